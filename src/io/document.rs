//! An open EXR file: its headers, and its blocks on demand.
//!
//! Pixels are never held here. What the denoiser needs is decoded into planes by [`super::decode`],
//! and everything else goes from the input to the output block by block in [`super::rewrite`].

use std::fs::File;
use std::io::{BufRead, BufReader, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock, TileCoordinates};
use exr::io::PeekRead;
use exr::meta::attribute::{IntegerBounds, LineOrder};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData, OffsetTables};
use rayon::prelude::*;

use super::{attributes, limits};
use crate::error::{Error, ErrorKind, Result};

/// Bytes of decoded blocks that are in flight at one time: enough to keep the threads busy.
const BATCH_BYTES: usize = 64 << 20;

/// How often the decoder holds a block while it decodes it: as it comes out of the codec, and sorted.
const DECODING: u64 = 3;

/// An EXR file whose headers have been read and checked.
#[derive(Debug)]
pub(super) struct Document {
    path: PathBuf,
    meta: MetaData,
    /// Where each block of each part starts, by index in increasing rows.
    offsets: OffsetTables,
}

impl Document {
    /// Reads and checks the headers of the file at `path`.
    ///
    /// # Errors
    /// `Unreadable` when it is missing, no EXR file, damaged, beyond the limits, or uses a feature
    /// that is not supported.
    pub(super) fn open(path: &Path) -> Result<Self> {
        guarded(|| Self::open_unguarded(path)).map_err(|error| error.in_file(path))
    }

    fn open_unguarded(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|error| io_error(&error))?;
        let length = file.metadata().map_err(|error| io_error(&error))?.len();
        let mut reader = BufReader::new(file);
        let mut meta = match MetaData::read_from_buffered(&mut reader, true) {
            Ok(meta) => meta,
            Err(strict) => {
                reader.rewind().map_err(|error| io_error(&error))?;
                MetaData::read_from_buffered(&mut reader, false).map_err(|_| exr_error(&strict))?
            }
        };
        limits::check(&meta.headers, length)?;
        MetaData::validate(&meta.headers, false).map_err(|error| exr_error(&error))?;
        let offsets = MetaData::read_offset_tables(&mut PeekRead::new(&mut reader), &meta.headers)
            .map_err(|error| exr_error(&error))?;
        attributes::keep(&mut meta.headers, &mut reader).map_err(|error| exr_error(&error))?;
        Ok(Self { path: path.to_owned(), meta, offsets })
    }

    /// The file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// One header per part.
    pub(super) fn headers(&self) -> &[Header] {
        &self.meta.headers
    }

    /// The part's name, where it has one.
    pub(super) fn part_name(&self, part: usize) -> Option<String> {
        self.meta.headers[part].own_attributes.layer_name.as_ref().map(ToString::to_string)
    }

    /// Hands the blocks of a part that have pixels under `window` (all of them where there is none) to
    /// `take`, in its line order, each with its index in increasing rows.
    ///
    /// # Errors
    /// `Unreadable` when a block is missing or damaged; and what `take` fails with.
    pub(super) fn for_each_block(
        &self,
        part: usize,
        window: Option<IntegerBounds>,
        mut take: impl FnMut(Vec<(usize, UncompressedBlock)>) -> Result<()>,
    ) -> Result<()> {
        let block_bytes = self.meta.headers[part].max_block_byte_size().max(1);
        let header = &self.meta.headers[part];
        let wanted =
            |index: &usize| window.is_none_or(|window| overlap(block_bounds(header, *index), window));
        let indices = (0..self.offsets[part].len()).filter(wanted).collect();
        if block_bytes > BATCH_BYTES {
            let taken = (block_bytes as u64).saturating_mul(DECODING);
            limits::check_memory(taken, "a block").map_err(|error| self.place(part, error))?;
        }
        self.for_each_batch(part, indices, (BATCH_BYTES / block_bytes).max(1), |chunks| {
            let decompress = |(index, chunk)| Ok((index, self.decompress(chunk)?));
            let blocks: Result<Vec<_>> = chunks.into_par_iter().map(decompress).collect();
            take(blocks.map_err(|error| self.place(part, error))?)
        })
    }

    /// Hands all blocks of a part to `take`, compressed as they are, in its line order.
    ///
    /// # Errors
    /// As [`Self::for_each_block`].
    pub(super) fn for_each_chunk(
        &self,
        part: usize,
        mut take: impl FnMut(usize, Chunk) -> Result<()>,
    ) -> Result<()> {
        self.for_each_chunk_of(part, (0..self.offsets[part].len()).collect(), &mut take)
    }

    /// The same for the chunks of these indices, which increase.
    ///
    /// # Errors
    /// As [`Self::for_each_block`].
    pub(super) fn for_each_chunk_of(
        &self,
        part: usize,
        indices: Vec<usize>,
        mut take: impl FnMut(usize, Chunk) -> Result<()>,
    ) -> Result<()> {
        self.for_each_batch(part, indices, 1, |chunks| {
            chunks.into_iter().try_for_each(|(index, chunk)| take(index, chunk))
        })
    }

    /// A number that stands for the file's content: other content, another number, but for rare chance
    /// (FNV-1a, 64 bits).
    ///
    /// # Errors
    /// `Unreadable` when the file cannot be read.
    pub(super) fn fingerprint(&self) -> Result<u64> {
        const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
        const PRIME: u64 = 0x0100_0000_01b3;
        let unreadable = |error: std::io::Error| io_error(&error).in_file(&self.path);
        let mut reader = BufReader::with_capacity(1 << 20, File::open(&self.path).map_err(unreadable)?);
        let mut hash = OFFSET;
        loop {
            let bytes = reader.fill_buf().map_err(unreadable)?;
            if bytes.is_empty() {
                return Ok(hash);
            }
            hash = bytes.iter().fold(hash, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(PRIME));
            let read = bytes.len();
            reader.consume(read);
        }
    }

    fn for_each_batch(
        &self,
        part: usize,
        mut order: Vec<usize>,
        batch: usize,
        mut take: impl FnMut(Vec<(usize, Chunk)>) -> Result<()>,
    ) -> Result<()> {
        let file = File::open(&self.path).map_err(|error| self.place(part, io_error(&error)))?;
        let mut reader = BufReader::new(file);
        if self.meta.headers[part].line_order == LineOrder::Decreasing {
            order.reverse();
        }
        for indices in order.chunks(batch) {
            let read = |&index: &usize| Ok((index, guarded(|| self.chunk(&mut reader, part, index))?));
            let chunks: Result<Vec<_>> = indices.iter().map(read).collect();
            take(chunks.map_err(|error| self.place(part, error))?)?;
        }
        Ok(())
    }

    /// Names the file, and the part where there are several.
    fn place(&self, part: usize, error: Error) -> Error {
        match self.part_name(part) {
            Some(name) if self.meta.headers.len() > 1 => error.in_part(name).in_file(&self.path),
            _ => error.in_file(&self.path),
        }
    }

    /// Reads a block from where the table says it starts, and checks that it is the one.
    fn chunk(&self, reader: &mut BufReader<File>, part: usize, index: usize) -> Result<Chunk> {
        let offset = self.offsets[part][index];
        let position = reader.stream_position().map_err(|error| io_error(&error))?;
        if position != offset {
            reader.seek(SeekFrom::Start(offset)).map_err(|error| io_error(&error))?;
        }
        let chunk = Chunk::read(reader, &self.meta).map_err(|error| exr_error(&error))?;
        let header = &self.meta.headers[part];
        let found = header.get_block_data_indices(&chunk.compressed_block).map_err(|e| exr_error(&e))?;
        if chunk.layer_index != part || found != block_coordinates(header, index) {
            return Err(damaged(format!("block {index} is not where the table of blocks says")));
        }
        let is_empty = match &chunk.compressed_block {
            CompressedBlock::ScanLine(block) => block.compressed_pixels_le.is_empty(),
            CompressedBlock::Tile(block) => block.compressed_pixels_le.is_empty(),
            CompressedBlock::DeepScanLine(_) | CompressedBlock::DeepTile(_) => false, // refused before
        };
        if is_empty {
            return Err(damaged(format!("block {index} is empty")));
        }
        Ok(chunk)
    }

    fn decompress(&self, chunk: Chunk) -> Result<UncompressedBlock> {
        guarded(|| {
            UncompressedBlock::decompress_chunk(chunk, &self.meta, false).map_err(|error| exr_error(&error))
        })
    }
}

/// Where a part's `index`th block in increasing rows lies, in the file's pixel coordinates.
pub(super) fn block_bounds(header: &Header, index: usize) -> IntegerBounds {
    let place = header.get_block_data_window_pixel_coordinates(block_coordinates(header, index));
    place.expect("the index is one of the part's")
}

/// Whether two rectangles have pixels in common.
fn overlap(a: IntegerBounds, b: IntegerBounds) -> bool {
    let along = |a: i32, a_size: usize, b: i32, b_size: usize| {
        i64::from(a) < i64::from(b) + b_size as i64 && i64::from(b) < i64::from(a) + a_size as i64
    };
    along(a.position.x(), a.size.width(), b.position.x(), b.size.width())
        && along(a.position.y(), a.size.height(), b.position.y(), b.size.height())
}

/// The coordinates of a part's `index`th block in increasing rows.
fn block_coordinates(header: &Header, index: usize) -> TileCoordinates {
    let columns = match header.blocks {
        BlockDescription::ScanLines => 1,
        BlockDescription::Tiles(tiles) => header.layer_size.width().div_ceil(tiles.tile_size.width()),
    };
    TileCoordinates {
        tile_index: exr::math::Vec2(index % columns, index / columns),
        level_index: exr::math::Vec2(0, 0),
    }
}

/// The decoder is careful with damaged input but not proven: should it panic all the same, the file
/// is what is at fault, and the program says so.
fn guarded<T>(read: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(read))
        .unwrap_or_else(|_| Err(damaged("the decoder gave up on its content".into())))
}

fn damaged(what: String) -> Error {
    Error::new(ErrorKind::Unreadable, format!("is damaged: {what}")).remedy("write it again")
}

fn io_error(error: &std::io::Error) -> Error {
    Error::new(ErrorKind::Unreadable, format!("cannot be read: {error}"))
        .remedy("check the name and the permissions")
}

/// An error of the EXR decoder as ours.
fn exr_error(error: &exr::error::Error) -> Error {
    match error {
        exr::error::Error::Io(error) => io_error(error),
        exr::error::Error::NotSupported(what) => {
            Error::new(ErrorKind::Unreadable, format!("uses a feature that is not supported: {what}"))
                .remedy("write it as flat scan lines with ZIP compression")
        }
        exr::error::Error::Invalid(what) if what == "file identifier missing" => {
            Error::new(ErrorKind::Unreadable, "is no OpenEXR file").remedy("name an .exr file")
        }
        other => damaged(other.to_string()),
    }
}
