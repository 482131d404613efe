//! Channels of a file as planes of `f32`.

use exr::block::lines::LineIndex;
use exr::meta::attribute::{IntegerBounds, SampleType};
use half::f16;

use super::document::Document;
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
/// Where a part does not reach the window its planes are 0.
///
/// # Errors
/// `Unreadable` when the file is damaged.
pub(super) fn read_planes(
    document: &Document,
    wanted: &[ChannelAt],
    window: IntegerBounds,
) -> Result<Vec<Plane>> {
    let (width, height) = (window.size.width(), window.size.height());
    let mut planes: Vec<_> = wanted.iter().map(|_| Plane::filled(width, height, 0.0)).collect();
    for (part, header) in document.headers().iter().enumerate() {
        // targets[c] lists the planes that channel c of this part fills
        let mut targets = vec![Vec::new(); header.channels.list.len()];
        for (plane, at) in wanted.iter().enumerate().filter(|(_, at)| at.part == part) {
            targets[at.channel].push(plane);
        }
        if targets.iter().all(Vec::is_empty) {
            continue;
        }
        let shift_x = i64::from(header.own_attributes.layer_position.x()) - i64::from(window.position.x());
        let shift_y = i64::from(header.own_attributes.layer_position.y()) - i64::from(window.position.y());
        document.for_each_block(part, |blocks| {
            for (_, block) in blocks {
                for (bytes, line) in LineIndex::lines_in_block(block.index, &header.channels) {
                    let y = line.position.y() as i64 + shift_y;
                    if targets[line.channel].is_empty() || !(0..height as i64).contains(&y) {
                        continue;
                    }
                    let samples = Samples {
                        bytes: &block.data[bytes],
                        kind: header.channels.list[line.channel].sample_type,
                    };
                    for &plane in &targets[line.channel] {
                        let row = &mut planes[plane].data_mut()[y as usize * width..][..width];
                        samples.copy_to(row, line.position.x() as i64 + shift_x);
                    }
                }
            }
            Ok(())
        })?;
    }
    Ok(planes)
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
