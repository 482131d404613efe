//! A file that holds a region of a picture, and all that is needed to put the picture together again.
//!
//! The parts with new channels hold the region's pixels; their data window is the region, inside the
//! picture's display window. They are compressed without loss whatever the picture will be. The other
//! parts hold the compressed blocks that have pixels of the region, as they are in the input: copied as
//! they are, they lose nothing, and their data window is that of the blocks. What lies beyond the picture's
//! border belongs to the regions at that border. Every part says in its attribute `apr.region` what it is a
//! region of.

use std::ops::Range;
use std::path::Path;

use exr::block::chunk::{Chunk, CompressedBlock};
use exr::block::writer::ChunksWriter;
use exr::meta::attribute::{AttributeValue, IntegerBounds, Text};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, Headers};
use exr::prelude::{Compression, Vec2};
use serde::{Deserialize, Serialize};

use super::atomic::write_picture_atomically;
use super::canvas::{Canvas, write_in_strips};
use super::document::Document;
use super::encode::{encode_error, through_encoder};
use super::pixels::lines_of_block;
use super::rewrite::{Addition, NewPart, Plan, Replacement, Source, store};
use crate::error::{Error, ErrorKind, Result};

/// The attribute that says what a part is a region of.
const REGION: &str = "apr.region";

/// Which region of which picture.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Place {
    /// The data window of the picture's colour.
    pub(super) picture: IntegerBounds,
    pub(super) region: IntegerBounds,
    /// Numbers that stand for the content of the files that were read.
    pub(super) inputs: Vec<String>,
}

/// What the attribute holds, as JSON; rectangles are x, y, width, height in the file's pixel coordinates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Mark {
    pub(super) picture: [i64; 4],
    pub(super) region: [i64; 4],
    pub(super) inputs: Vec<String>,
    /// The part's data window in the picture.
    pub(super) window: [i64; 4],
    /// Whether the part holds compressed blocks as they were.
    pub(super) copied: bool,
    /// How the part is compressed in the picture.
    pub(super) compression: (String, Option<f32>),
}

impl Mark {
    /// What the header says; none where it is no region.
    pub(super) fn of(header: &Header) -> Option<Self> {
        match header.own_attributes.other.get(&Text::from(REGION)) {
            Some(AttributeValue::Text(text)) => serde_json::from_str(&text.to_string()).ok(),
            _ => None,
        }
    }

    fn put(&self, header: &mut Header) {
        let text = serde_json::to_string(self).expect("numbers and names are JSON");
        let attributes = &mut header.own_attributes.other;
        attributes.insert(Text::from(REGION), AttributeValue::Text(Text::from(text.as_str())));
    }

    /// The part's header in the picture that `header`, which has this mark, is a region of.
    ///
    /// # Errors
    /// `Unreadable` when the mark makes no sense, or is not that of this header.
    pub(super) fn whole_header(&self, header: &Header) -> Result<Header> {
        let nonsense = || {
            Error::new(ErrorKind::Unreadable, format!("its attribute {REGION} makes no sense"))
                .remedy("denoise the region again")
        };
        let compression = named(&self.compression).ok_or_else(nonsense)?;
        let window = bounds(self.window).ok_or_else(nonsense)?;
        let (picture, region) = (bounds(self.picture), bounds(self.region));
        // A part with new channels has the pixels of the region, and those alone.
        let fits = self.copied || (picture == Some(window) && region == Some(header.data_window()));
        if picture.is_none() || region.is_none() || !fits {
            return Err(nonsense());
        }
        let mut whole = header.clone();
        whole.own_attributes.other.remove(&Text::from(REGION));
        Ok(with_window(whole, window, compression))
    }
}

/// Writes the pixels of `place.region`, whose new channels have its size.
///
/// # Errors
/// As [`rewrite`](super::rewrite::rewrite).
pub(super) fn write_region(
    document: &Document,
    target: &Path,
    replacements: &[Replacement],
    additions: &[Addition],
    signature: Option<&str>,
    place: &Place,
) -> Result<Vec<String>> {
    let Plan { new, headers: whole, notes } = Plan::new(document, replacements, additions, signature);
    let covers: Vec<Option<Cover>> = new
        .iter()
        .zip(&whole)
        .map(|(new, header)| new.is_none().then(|| Cover::new(header, place)))
        .collect();
    let mut headers = Headers::new();
    for (cover, header) in covers.iter().zip(&whole) {
        let (window, compression) = match cover {
            Some(cover) => (cover.window(header), header.compression),
            None => (place.region, lossless(header)),
        };
        let mut part = with_window(header.clone(), window, compression);
        let mark = Mark {
            picture: numbers(place.picture),
            region: numbers(place.region),
            inputs: place.inputs.clone(),
            window: numbers(header.data_window()),
            copied: cover.is_some(),
            compression: name(header.compression),
        };
        mark.put(&mut part);
        headers.push(part);
    }
    write_picture_atomically(target, |file| {
        exr::block::write(file, headers, false, |meta, writer| {
            for (part, (new, cover)) in new.iter().zip(&covers).enumerate() {
                if let Some(new) = new {
                    let lines = lines_of_block(&document.headers()[part]);
                    write_in_strips(writer, &meta.headers, part, lines, |strip| {
                        gather(strip, document, part, new, place.region)
                    })?;
                } else if let Some(cover) = cover {
                    let copied = document.for_each_chunk_of(part, cover.indices(), |index, chunk| {
                        let (index, chunk) = cover.cut_out(index, chunk);
                        writer.write_chunk(index, chunk).map_err(encode_error)
                    });
                    copied.map_err(through_encoder)?;
                }
            }
            Ok(())
        })
        .map_err(encode_error)
    })?;
    Ok(notes)
}

/// The pixels of a strip of a `region`: what passes through, then what is new.
fn gather(
    strip: &mut Canvas,
    document: &Document,
    part: usize,
    new: &NewPart,
    region: IntegerBounds,
) -> Result<()> {
    let output = |wanted: usize| {
        new.sources.iter().position(|source| matches!(source, Source::Input(channel) if *channel == wanted))
    };
    strip.take_all(document, part, output)?;
    let top = (strip.window.position.y() - region.position.y()) as usize;
    for (channel, source) in new.sources.iter().enumerate() {
        let Source::Plane(plane) = source else { continue };
        for y in 0..strip.window.size.height() {
            let kind = new.header.channels.list[channel].sample_type;
            store(plane.row(top + y), kind, strip.line_mut(channel, y));
        }
    }
    Ok(())
}

/// The blocks of a part that have pixels of a region: a rectangle of blocks, at least one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Cover {
    columns: Range<usize>,
    rows: Range<usize>,
    /// Columns of blocks in the whole part.
    stride: usize,
    /// Pixels of a block.
    block: (usize, usize),
}

impl Cover {
    fn new(header: &Header, place: &Place) -> Self {
        let (part, size) = (header.own_attributes.layer_position, header.layer_size);
        let block = block_size(header);
        let along = |part: i32, size: usize, step: usize, region: (i32, usize), picture: (i32, usize)| {
            let count = size.div_ceil(step);
            let end = |(from, length): (i32, usize)| i64::from(from) + length as i64;
            let first = if region.0 == picture.0 { 0 } else { i64::from(region.0) - i64::from(part) };
            let last = if end(region) == end(picture) { i64::MAX } else { end(region) - i64::from(part) };
            let first = (first.max(0) as usize / step).min(count - 1);
            first..(last.max(0) as usize).div_ceil(step).clamp(first + 1, count)
        };
        let (region, picture) = (place.region, place.picture);
        let x = |of: IntegerBounds| (of.position.x(), of.size.width());
        let y = |of: IntegerBounds| (of.position.y(), of.size.height());
        Self {
            columns: along(part.x(), size.width(), block.0, x(region), x(picture)),
            rows: along(part.y(), size.height(), block.1, y(region), y(picture)),
            stride: size.width().div_ceil(block.0),
            block,
        }
    }

    /// What a region's part with this data `window` covers of the part whose header in the picture is
    /// `whole`; none where it does not begin at a block.
    pub(super) fn of_part(whole: &Header, window: IntegerBounds) -> Option<Self> {
        let block = block_size(whole);
        let along = |window: i32, length: usize, part: i32, size: usize, step: usize| {
            let from = usize::try_from(i64::from(window) - i64::from(part)).ok()?;
            let inside = from.is_multiple_of(step) && from + length <= size;
            inside.then(|| from / step..(from + length).div_ceil(step))
        };
        let (part, size) = (whole.own_attributes.layer_position, whole.layer_size);
        Some(Self {
            columns: along(window.position.x(), window.size.width(), part.x(), size.width(), block.0)?,
            rows: along(window.position.y(), window.size.height(), part.y(), size.height(), block.1)?,
            stride: size.width().div_ceil(block.0),
            block,
        })
    }

    /// The data window of these blocks.
    fn window(&self, header: &Header) -> IntegerBounds {
        let (part, size) = (header.own_attributes.layer_position, header.layer_size);
        let along = |range: &Range<usize>, step: usize, size: usize| {
            (range.start * step, (range.end * step).min(size) - range.start * step)
        };
        let (x, width) = along(&self.columns, self.block.0, size.width());
        let (y, height) = along(&self.rows, self.block.1, size.height());
        IntegerBounds { position: part + Vec2(x as i32, y as i32), size: Vec2(width, height) }
    }

    /// The blocks by their index in the whole part, increasing.
    pub(super) fn indices(&self) -> Vec<usize> {
        let row = |row| self.columns.clone().map(move |column| row * self.stride + column);
        self.rows.clone().flat_map(row).collect()
    }

    /// A block of the whole part as one of the region's.
    fn cut_out(&self, index: usize, mut chunk: Chunk) -> (usize, Chunk) {
        let (column, row) = (index % self.stride - self.columns.start, index / self.stride - self.rows.start);
        if let CompressedBlock::Tile(tile) = &mut chunk.compressed_block {
            tile.coordinates.tile_index = Vec2(column, row);
        }
        (row * self.columns.len() + column, chunk)
    }

    /// The opposite of [`Self::cut_out`].
    pub(super) fn put_back(&self, index: usize, mut chunk: Chunk) -> (usize, Chunk) {
        let (column, row) = (index % self.columns.len(), index / self.columns.len());
        let (column, row) = (column + self.columns.start, row + self.rows.start);
        if let CompressedBlock::Tile(tile) = &mut chunk.compressed_block {
            tile.coordinates.tile_index = Vec2(column, row);
        }
        (row * self.stride + column, chunk)
    }

    /// The index in the region's part of a block of the whole part, if it is there.
    pub(super) fn index_within(&self, index: usize) -> Option<usize> {
        let (column, row) = (index % self.stride, index / self.stride);
        let there = self.columns.contains(&column) && self.rows.contains(&row);
        there.then(|| (row - self.rows.start) * self.columns.len() + column - self.columns.start)
    }
}

fn block_size(header: &Header) -> (usize, usize) {
    match header.blocks {
        BlockDescription::Tiles(tiles) => (tiles.tile_size.width(), tiles.tile_size.height()),
        BlockDescription::ScanLines => (header.layer_size.width(), header.compression.scan_lines_per_block()),
    }
}

fn with_window(mut header: Header, window: IntegerBounds, compression: Compression) -> Header {
    header.own_attributes.layer_position = window.position;
    header.layer_size = window.size;
    let (blocks, line_order) = (header.blocks, header.line_order);
    header.with_encoding(compression, blocks, line_order)
}

/// The header's compression, where it loses nothing of any channel.
fn lossless(header: &Header) -> Compression {
    let exact = |channel: &exr::meta::attribute::ChannelDescription| {
        header.compression.is_lossless_for(channel.sample_type)
    };
    if header.channels.list.iter().all(exact) { header.compression } else { Compression::ZIP16 }
}

/// x, y, width and height.
pub(super) fn numbers(bounds: IntegerBounds) -> [i64; 4] {
    let IntegerBounds { position, size } = bounds;
    [position.x().into(), position.y().into(), size.width() as i64, size.height() as i64]
}

/// For messages, as `--region` has it.
pub(super) fn told(bounds: IntegerBounds) -> String {
    text(numbers(bounds))
}

/// The same of a window's numbers.
pub(super) fn text(window: [i64; 4]) -> String {
    window.map(|number| number.to_string()).join(",")
}

/// The opposite of [`numbers`], as far as there are such pixels.
pub(super) fn bounds([x, y, width, height]: [i64; 4]) -> Option<IntegerBounds> {
    let position = Vec2(i32::try_from(x).ok()?, i32::try_from(y).ok()?);
    let size = Vec2(usize::try_from(width).ok()?, usize::try_from(height).ok()?);
    let last = |from: i64, length: i64| i32::try_from(from.checked_add(length)?).ok();
    (width > 0 && height > 0).then_some(())?;
    last(x, width).and(last(y, height)).map(|_| IntegerBounds { position, size })
}

/// Compressions by name; those of a level have it beside the name.
const COMPRESSIONS: [(&str, Compression); 8] = [
    ("none", Compression::Uncompressed),
    ("rle", Compression::RLE),
    ("zips", Compression::ZIP1),
    ("zip", Compression::ZIP16),
    ("piz", Compression::PIZ),
    ("pxr24", Compression::PXR24),
    ("b44", Compression::B44),
    ("b44a", Compression::B44A),
];

fn name(compression: Compression) -> (String, Option<f32>) {
    match compression {
        Compression::DWAA(level) => ("dwaa".to_owned(), level),
        Compression::DWAB(level) => ("dwab".to_owned(), level),
        plain => {
            let known = COMPRESSIONS.iter().find(|(_, other)| *other == plain);
            (known.map_or("", |(name, _)| name).to_owned(), None)
        }
    }
}

fn named((name, level): &(String, Option<f32>)) -> Option<Compression> {
    match name.as_str() {
        "dwaa" => Some(Compression::DWAA(*level)),
        "dwab" => Some(Compression::DWAB(*level)),
        plain => COMPRESSIONS.iter().find(|(name, _)| *name == plain).map(|(_, compression)| *compression),
    }
}
