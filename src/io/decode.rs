//! Channels of a file as planes of `f32`.

use exr::block::UncompressedBlock;
use exr::block::lines::LineIndex;
use exr::meta::attribute::{ChannelList, IntegerBounds, SampleType};
use half::f16;
use rayon::prelude::*;

use super::document::Document;
use super::limits;
use crate::error::Result;
use crate::image::Plane;

/// A channel's place in its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct ChannelAt {
    /// Which part.
    pub(super) part: usize,
    /// Which channel of the part.
    pub(super) channel: usize,
}

/// Reads the `wanted` channels under `window` (in the file's pixel coordinates), in their order.
/// Where a part does not reach the window its planes are 0. Only blocks with such pixels are decoded.
///
/// # Errors
/// `Unreadable` when the file is damaged.
pub(super) fn read_planes(
    document: &Document,
    wanted: &[ChannelAt],
    window: IntegerBounds,
) -> Result<Vec<Plane>> {
    let black = || {
        let plane = |_| Plane::filled(window.size.width(), window.size.height(), 0.0);
        wanted.iter().map(plane).collect::<Vec<_>>()
    };
    limits::check_planes(wanted.len(), (window.size.width(), window.size.height()))
        .map_err(|error| error.in_file(document.path()))?;
    let mut planes = None; // not before a first block proves that the file holds more than promises
    for (part, header) in document.headers().iter().enumerate() {
        let fills: Vec<Option<usize>> =
            wanted.iter().map(|at| (at.part == part).then_some(at.channel)).collect();
        if fills.iter().all(Option::is_none) {
            continue;
        }
        let from = header.own_attributes.layer_position;
        let shift = [(from.x(), window.position.x()), (from.y(), window.position.y())];
        let shift = shift.map(|(part, window)| i64::from(part) - i64::from(window));
        document.for_each_block(part, Some(window), |blocks| {
            let planes = planes.get_or_insert_with(black);
            planes.par_iter_mut().zip(&fills).for_each(|(plane, channel)| {
                let Some(channel) = *channel else { return };
                let placement = Placement { channels: &header.channels, channel, shift };
                blocks.iter().for_each(|(_, block)| placement.copy(block, plane));
            });
            Ok(())
        })?;
    }
    Ok(planes.unwrap_or_else(black))
}

/// What of a part goes to a plane, and where.
struct Placement<'a> {
    channels: &'a ChannelList,
    /// The one whose samples fill the plane.
    channel: usize,
    /// What must be added to a column and a row of the part to get those of the planes.
    shift: [i64; 2],
}

impl Placement<'_> {
    fn copy(&self, block: &UncompressedBlock, plane: &mut Plane) {
        let (width, height) = plane.size();
        let kind = self.channels.list[self.channel].sample_type;
        let lines = LineIndex::lines_in_block(block.index, self.channels);
        for (bytes, line) in lines.filter(|(_, line)| line.channel == self.channel) {
            let x = line.position.x() as i64 + self.shift[0];
            let y = line.position.y() as i64 + self.shift[1];
            let samples = Samples { bytes: &block.data[bytes], kind };
            if let Some(y) = usize::try_from(y).ok().filter(|y| *y < height) {
                samples.copy_to(&mut plane.data_mut()[y * width..][..width], x);
            }
        }
    }
}

/// A line of samples as stored.
struct Samples<'a> {
    bytes: &'a [u8],
    kind: SampleType,
}

impl Samples<'_> {
    /// Copies the samples into `row`, the first one to column `x`; what falls outside is dropped.
    fn copy_to(&self, row: &mut [f32], x: i64) {
        let skip = usize::try_from(-x).unwrap_or(0);
        let row = row.get_mut(usize::try_from(x).unwrap_or(0)..).unwrap_or_default();
        match self.kind {
            SampleType::F16 => {
                fill(row, self.bytes.as_chunks().0, skip, |b| f16::from_ne_bytes(b).to_f32());
            }
            SampleType::F32 => fill(row, self.bytes.as_chunks().0, skip, f32::from_ne_bytes),
            SampleType::U32 => fill(row, self.bytes.as_chunks().0, skip, |b| u32::from_ne_bytes(b) as f32),
        }
    }
}

fn fill<const N: usize>(row: &mut [f32], samples: &[[u8; N]], skip: usize, read: impl Fn([u8; N]) -> f32) {
    for (target, sample) in row.iter_mut().zip(samples.iter().skip(skip)) {
        *target = read(*sample);
    }
}
