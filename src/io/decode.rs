//! Channels of a file as planes of `f32`.

use std::ops::Range;

use exr::block::UncompressedBlock;
use exr::block::lines::LineIndex;
use exr::meta::attribute::{ChannelList, IntegerBounds, SampleType};
use half::f16;

use super::document::{Document, block_bounds};
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
    let bytes = wanted.len() * window.size.area() * size_of::<f32>();
    let mut planes = None;
    for (part, header) in document.headers().iter().enumerate() {
        let fills: Vec<Option<usize>> =
            wanted.iter().map(|at| (at.part == part).then_some(at.channel)).collect();
        let rows = document.rows_of_blocks(part, window);
        if fills.iter().all(Option::is_none) || rows.is_empty() {
            continue;
        }
        if planes.is_none() && bytes > limits::MOST_UNPROVEN {
            // No memory for them before a first block proves that the file holds more than promises.
            let first = rows[0].start..rows[0].start + 1;
            document.for_each_block(part, std::slice::from_ref(&first), &mut [()], |(), _| ())?;
        }
        let planes = planes.get_or_insert_with(black);
        let from = header.own_attributes.layer_position;
        let shift = [(from.x(), window.position.x()), (from.y(), window.position.y())];
        let shift = shift.map(|(part, window)| i64::from(part) - i64::from(window));
        let placement = Placement { channels: &header.channels, shift };
        let mut bands = bands(document, part, &rows, window, planes, &fills);
        document.for_each_block(part, &rows, &mut bands, |band, block| placement.copy(block, band))?;
    }
    Ok(planes.unwrap_or_else(black))
}

/// The rows of the planes that a row of blocks fills.
struct Band<'a> {
    /// The first of them.
    top: usize,
    /// Those of every channel of the part, where it fills planes.
    channels: Vec<Vec<&'a mut [f32]>>,
    width: usize,
}

/// The planes cut into bands for these rows of blocks; `fills` tells which channel of the part fills a plane.
fn bands<'a>(
    document: &Document,
    part: usize,
    rows: &[Range<usize>],
    window: IntegerBounds,
    planes: &'a mut [Plane],
    fills: &[Option<usize>],
) -> Vec<Band<'a>> {
    let header = &document.headers()[part];
    let (width, height) = (window.size.width(), window.size.height() as i64);
    // The window's rows under each row of blocks, which follow on each other.
    let spans = rows.iter().map(|row| {
        let IntegerBounds { position, size } = block_bounds(header, row.start);
        let top = i64::from(position.y()) - i64::from(window.position.y());
        [top, top + size.height() as i64].map(|y| y.clamp(0, height) as usize)
    });
    let spans: Vec<[usize; 2]> = spans.collect();
    let mut bands: Vec<Band> = spans
        .iter()
        .map(|&[top, _]| {
            let channels = header.channels.list.iter().map(|_| vec![]).collect();
            Band { top, channels, width }
        })
        .collect();
    for (plane, channel) in planes.iter_mut().zip(fills) {
        let Some(channel) = *channel else { continue };
        let mut rest = &mut plane.data_mut()[spans[0][0] * width..];
        for (band, [top, end]) in bands.iter_mut().zip(&spans) {
            let (rows, below) = rest.split_at_mut((end - top) * width);
            band.channels[channel].push(rows);
            rest = below;
        }
    }
    bands
}

/// What of a part goes to its planes, and where.
struct Placement<'a> {
    channels: &'a ChannelList,
    /// What must be added to a column and a row of the part to get those of the planes.
    shift: [i64; 2],
}

impl Placement<'_> {
    fn copy(&self, block: &UncompressedBlock, band: &mut Band) {
        for (bytes, line) in LineIndex::lines_in_block(block.index, self.channels) {
            let planes = &mut band.channels[line.channel];
            let x = line.position.x() as i64 + self.shift[0];
            let y = line.position.y() as i64 + self.shift[1] - band.top as i64;
            let Ok(y) = usize::try_from(y) else { continue };
            let kind = self.channels.list[line.channel].sample_type;
            let samples = Samples { bytes: &block.data[bytes], kind };
            for rows in planes {
                if let Some(row) = rows.chunks_exact_mut(band.width).nth(y) {
                    samples.copy_to(row, x);
                }
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
