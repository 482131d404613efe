//! The pixels of a part as they are stored, gathered from blocks of any place and written in blocks of any
//! other, strip by strip: what is held is never the part.

use std::io::{Seek, Write};
use std::sync::{Mutex, PoisonError};

use exr::block::lines::LineIndex;
use exr::block::writer::ChunkWriter;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::meta::attribute::IntegerBounds;
use exr::meta::header::Header;
use exr::prelude::Vec2;

use super::document::{Document, block_bounds, columns_of_blocks, in_line_order};
use super::encode::{block_from_lines, through_encoder, write_blocks};
use super::limits::check_memory;
use super::pixels::{bands, part_of};
use crate::error::Result;

/// Writes all blocks of `headers[part]`, in its line order, strip by strip, whose pixels `gather` brings. A strip has at
/// least the `lines` of the blocks that these come from, or each of those would be decoded for many.
///
/// # Errors
/// What `gather` fails with, and when the disk is full.
pub(super) fn write_in_strips<W: Write + Seek + Send>(
    writer: &mut ChunkWriter<W>,
    headers: &[Header],
    part: usize,
    lines: usize,
    gather: impl Fn(&mut Canvas) -> Result<()>,
) -> exr::error::UnitResult {
    let header = &headers[part];
    let (size, columns) = (header.layer_size, columns_of_blocks(header));
    let height = header.max_block_pixel_size().height();
    let row = size.width() * header.channels.bytes_per_pixel;
    let strips = bands((size.width(), size.height()), row, lines.next_multiple_of(height));
    for strip in in_line_order(header, strips.collect()) {
        let window = part_of(header.data_window(), strip);
        let mut canvas = Canvas::new(header, window).map_err(through_encoder)?;
        gather(&mut canvas).map_err(through_encoder)?;
        let rows = strip.y / height..(strip.y + strip.height).div_ceil(height);
        let blocks = in_line_order(header, (rows.start * columns..rows.end * columns).collect());
        write_blocks(writer, headers, blocks.len(), |n| (blocks[n], canvas.block(header, part, blocks[n])))?;
    }
    Ok(())
}

/// Rows of a part with all its channels, each in its own sample type: a line of every channel, row after row.
pub(super) struct Canvas {
    /// Where they lie, in the file's pixel coordinates.
    pub(super) window: IntegerBounds,
    /// Bytes of a sample of each channel, and where its line begins in a row.
    channels: Vec<(usize, usize)>,
    row: usize,
    data: Vec<u8>,
}

impl Canvas {
    /// An empty one of the pixels in `window`.
    ///
    /// # Errors
    /// `Unreadable` when it takes more memory than there is.
    fn new(header: &Header, window: IntegerBounds) -> Result<Self> {
        let (mut channels, mut row) = (Vec::new(), 0);
        for channel in &header.channels.list {
            let sample = channel.sample_type.bytes_per_sample();
            channels.push((sample, row));
            row += sample * window.size.width();
        }
        let bytes = row.saturating_mul(window.size.height());
        check_memory(bytes as u64, "rows of a part")?;
        Ok(Self { window, channels, row, data: vec![0; bytes] })
    }

    /// The samples of a channel in row `y` of the window.
    pub(super) fn line_mut(&mut self, channel: usize, y: usize) -> &mut [u8] {
        let (sample, start) = self.channels[channel];
        &mut self.data[y * self.row + start..][..sample * self.window.size.width()]
    }

    /// Takes the pixels of a document's part that lie in the window. `channel` tells which of this canvas's
    /// channels one of the part's is, if any.
    ///
    /// # Errors
    /// `Unreadable` when a block is missing or damaged.
    pub(super) fn take_all(
        &mut self,
        document: &Document,
        part: usize,
        channel: impl Fn(usize) -> Option<usize> + Sync,
    ) -> Result<()> {
        let rows = document.rows_of_blocks(part, self.window);
        let (from, canvas) = (&document.headers()[part], Mutex::new(self));
        document.for_each_block(part, &rows, &mut vec![(); rows.len()], |(), block| {
            canvas.lock().unwrap_or_else(PoisonError::into_inner).take(from, block, &channel);
        })
    }

    fn take(&mut self, from: &Header, block: &UncompressedBlock, channel: impl Fn(usize) -> Option<usize>) {
        let shift = |a: i32, b: i32| i64::from(a) - i64::from(b);
        let (part, own) = (from.own_attributes.layer_position, self.window.position);
        let (shift_x, shift_y) = (shift(part.x(), own.x()), shift(part.y(), own.y()));
        let (width, height) = (self.window.size.width(), self.window.size.height());
        for (bytes, line) in LineIndex::lines_in_block(block.index, &from.channels) {
            let Some(channel) = channel(line.channel) else { continue };
            let (x, y) = (line.position.x() as i64 + shift_x, line.position.y() as i64 + shift_y);
            let Some(y) = usize::try_from(y).ok().filter(|y| *y < height) else { continue };
            let skip = usize::try_from(-x).unwrap_or(0).min(line.sample_count);
            let start = usize::try_from(x).unwrap_or(0).min(width);
            let count = (line.sample_count - skip).min(width - start);
            let sample = self.channels[channel].0;
            let samples = &block.data[bytes][skip * sample..][..count * sample];
            self.line_mut(channel, y)[start * sample..][..samples.len()].copy_from_slice(samples);
        }
    }

    fn block(&self, header: &Header, part: usize, index: usize) -> UncompressedBlock {
        let IntegerBounds { position, size } = block_bounds(header, index);
        let within = |a: i32, b: i32| (i64::from(a) - i64::from(b)) as usize;
        let origin = header.own_attributes.layer_position;
        let top = within(self.window.position.y(), origin.y());
        let place = BlockIndex {
            layer: part,
            pixel_position: Vec2(within(position.x(), origin.x()), within(position.y(), origin.y())),
            pixel_size: size,
            level: Vec2(0, 0),
        };
        block_from_lines(header, place, |channel, x, y, bytes| {
            let (sample, start) = self.channels[channel];
            bytes.copy_from_slice(&self.data[(y - top) * self.row + start + x * sample..][..bytes.len()]);
        })
    }
}
