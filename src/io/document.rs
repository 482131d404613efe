//! An open EXR file: its headers, and its blocks on demand.
//!
//! What the denoiser needs is decoded into planes by [`super::decode`], and everything else goes from the input to the
//! output block by block in [`super::rewrite`]. Blocks may be [kept](super::kept) decoded from one look to the next.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use exr::block::chunk::{Chunk, CompressedBlock, TileCoordinates};
use exr::block::{BlockIndex, UncompressedBlock};
use exr::io::PeekRead;
use exr::meta::attribute::{IntegerBounds, LineOrder};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, Headers, MetaData, OffsetTables};
use exr::prelude::Vec2;
use rayon::prelude::*;

use super::kept::{Kept, no_block};
use super::ordered::make_in_order;
use super::zip::Zip;
use super::{attributes, limits};
use crate::error::{Error, ErrorKind, Result};

/// Bytes of a block beyond which the system is asked whether it has the memory.
const LARGE_BLOCK: usize = 64 << 20;

/// How often the decoder holds a block while it decodes it: as it comes out of the codec, and sorted.
const DECODING: u64 = 3;

/// An EXR file whose headers have been read and checked.
#[derive(Debug)]
pub(super) struct Document {
    path: PathBuf,
    meta: MetaData,
    /// Where each block of each part starts, by index in increasing rows.
    offsets: OffsetTables,
    kept: Mutex<Kept>,
    /// A number that stands for each block that was read, as it is in the file, by its part and index.
    seen: Mutex<BTreeMap<(usize, usize), u64>>,
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
        let mut meta = read_meta(&mut reader)?;
        limits::check(&meta.headers, length)?;
        MetaData::validate(&meta.headers, false).map_err(|error| exr_error(&error))?;
        let offsets = MetaData::read_offset_tables(&mut PeekRead::new(&mut reader), &meta.headers)
            .map_err(|error| exr_error(&error))?;
        attributes::keep(&mut meta.headers, &mut reader).map_err(|error| exr_error(&error))?;
        Ok(Self { path: path.to_owned(), meta, offsets, kept: Mutex::default(), seen: Mutex::default() })
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

    /// Bytes of a part's pixels as they are decoded.
    pub(super) fn part_bytes(&self, part: usize) -> usize {
        let header = &self.meta.headers[part];
        header.layer_size.area().saturating_mul(header.channels.bytes_per_pixel)
    }

    /// Keeps from now on up to `room` bytes of blocks as they are decoded, those of `only` one part where it is given;
    /// none where the system has not the memory for them and as many bytes of planes. Returns what is left of `room`.
    pub(super) fn keep(&self, only: Option<usize>, room: usize) -> usize {
        let parts = only.map_or(0..self.meta.headers.len(), |part| part..part + 1);
        let all = parts.map(|part| self.part_bytes(part)).fold(0, usize::saturating_add);
        let kept = room.min(all);
        let there = limits::check_memory(2 * kept as u64, "blocks").is_ok();
        whole(&self.kept).keep(only, if there { kept } else { 0 });
        room - kept
    }

    /// The blocks of a part that have pixels under `window`, by their indices in increasing rows: those beside
    /// each other together, from the top.
    pub(super) fn rows_of_blocks(&self, part: usize, window: IntegerBounds) -> Vec<Range<usize>> {
        let header = &self.meta.headers[part];
        let (all, columns) = (self.offsets[part].len(), columns_of_blocks(header));
        let wanted = |index: &usize| overlap(block_bounds(header, *index), window);
        let rows = (0..all.div_ceil(columns)).map(|row| row * columns..((row + 1) * columns).min(all));
        let rows = rows.filter_map(|mut row| {
            let first = row.find(wanted)?;
            Some(first..row.take_while(wanted).last().map_or(first, |last| last) + 1)
        });
        rows.collect()
    }

    /// Hands every block of these [rows](Self::rows_of_blocks) of a part to `take`, with what is `beside` its row.
    ///
    /// # Errors
    /// `Unreadable` when a block is missing or damaged.
    pub(super) fn for_each_block<T: Send>(
        &self,
        part: usize,
        rows: &[Range<usize>],
        beside: &mut [T],
        take: impl Fn(&mut T, &UncompressedBlock) + Sync,
    ) -> Result<()> {
        self.check_block(part)?;
        let workers = Spare::default();
        let read = rows.par_iter().zip(beside).map(|(row, beside)| {
            workers.lend(|worker: &mut Worker| {
                row.clone()
                    .try_for_each(|index| worker.look(self, part, index, |_, block| take(beside, block)))
            })
        });
        read.collect::<Vec<Result<()>>>().into_iter().collect()
    }

    /// Hands what `make` makes of the blocks of a part to `take`, in its line order, on a thread of its own while more
    /// of it is made. `make` gets every block with its index in increasing rows.
    ///
    /// # Errors
    /// `Unreadable` when a block is missing or damaged; and what `make` or `take` fails with.
    pub(super) fn make_of_blocks<T: Send>(
        &self,
        part: usize,
        make: impl Fn(&mut Zip, usize, &UncompressedBlock) -> Result<T> + Sync,
        take: impl FnMut(T) -> Result<()> + Send,
    ) -> Result<()> {
        self.check_block(part)?;
        let header = &self.meta.headers[part];
        let order = in_line_order(header, (0..self.offsets[part].len()).collect());
        let make = |worker: &mut Worker, n: usize| {
            worker.look(self, part, order[n], |zip, block| make(zip, order[n], block))?
        };
        make_in_order(order.len(), make, take)
    }

    /// Checks that a block of a part finds room.
    ///
    /// # Errors
    /// `Unreadable` when the system has not the memory for one.
    fn check_block(&self, part: usize) -> Result<()> {
        let bytes = self.meta.headers[part].max_block_byte_size();
        if bytes > LARGE_BLOCK {
            let taken = (bytes as u64).saturating_mul(DECODING);
            limits::check_memory(taken, "a block").map_err(|error| self.place(part, error))?;
        }
        Ok(())
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
        let mut reader = Reader::default();
        for index in in_line_order(&self.meta.headers[part], indices) {
            let chunk = reader.chunk(self, part, index)?;
            take(index, chunk)?;
        }
        Ok(())
    }

    /// A number that stands for the file's content: other content, another number, but for rare chance. What was
    /// read before is not read again.
    ///
    /// # Errors
    /// `Unreadable` when the file cannot be read.
    pub(super) fn fingerprint(&self) -> Result<u64> {
        let (head, _) = self.head().map_err(|error| io_error(&error).in_file(&self.path))?;
        let mut reader = Reader::default();
        for (part, offsets) in self.offsets.iter().enumerate() {
            for index in 0..offsets.len() {
                let seen = whole(&self.seen).contains_key(&(part, index));
                if !seen {
                    reader.chunk(self, part, index)?;
                }
            }
        }
        Ok(whole(&self.seen).values().copied().fold(fold(&head), mixed))
    }

    /// The same without reading much: of the headers, the table of blocks, which tells how far each shrank, and
    /// samples. Another render has another number; few pixels that change may be missed where blocks are not
    /// compressed.
    ///
    /// # Errors
    /// As [`Self::fingerprint`].
    pub(super) fn outline(&self) -> Result<u64> {
        self.outlined().map_err(|error| io_error(&error).in_file(&self.path))
    }

    fn outlined(&self) -> std::io::Result<u64> {
        /// `[choice]` a sequence of a thousand frames is looked at in the time of reading one.
        const SAMPLES: u64 = 64;
        const SAMPLE_BYTES: usize = 4096;
        /// Multiples of the golden ratio spread evenly, and fall in step with no row or channel.
        const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;
        let (head, mut file) = self.head()?;
        let (first, length) = (head.len() as u64, file.metadata()?.len());
        let mut sample = Vec::with_capacity(SAMPLE_BYTES);
        let mut hash = mixed(fold(&head), length);
        for n in 0..SAMPLES {
            let share = u128::from(n.wrapping_mul(GOLDEN)) * u128::from(length.saturating_sub(first));
            file.seek(SeekFrom::Start(first + (share >> u64::BITS) as u64))?;
            sample.clear();
            file.by_ref().take(SAMPLE_BYTES as u64).read_to_end(&mut sample)?;
            hash = mixed(hash, fold(&sample));
        }
        Ok(hash)
    }

    /// What stands before the first block, and the file.
    fn head(&self) -> std::io::Result<(Vec<u8>, File)> {
        let first = self.offsets.iter().flatten().min().copied().unwrap_or(0);
        let mut head = Vec::new();
        let mut file = File::open(&self.path)?;
        file.by_ref().take(first).read_to_end(&mut head)?;
        Ok((head, file))
    }

    /// Whether the file holds all its blocks, as far as their table and the last of them tell.
    pub(super) fn is_whole(&self) -> bool {
        let part = |(part, offsets): (usize, &Vec<u64>)| {
            let blocks = offsets.iter().enumerate();
            blocks.map(|(index, offset)| (*offset, part, index)).collect::<Vec<_>>()
        };
        let blocks: Vec<_> = self.offsets.iter().enumerate().flat_map(part).collect();
        let last = blocks.iter().max();
        blocks.iter().all(|(offset, ..)| *offset > 0)
            && last.is_some_and(|&(_, part, index)| Reader::default().chunk(self, part, index).is_ok())
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
        if packed_bytes(&chunk.compressed_block).is_some_and(<[u8]>::is_empty) {
            return Err(damaged(format!("block {index} is empty")));
        }
        let seen = whole(&self.seen).contains_key(&(part, index));
        if !seen {
            let number = packed_bytes(&chunk.compressed_block).map_or(0, fold);
            whole(&self.seen).insert((part, index), number);
        }
        Ok(chunk)
    }

    /// Decodes `chunk` into `block`, whose memory is used again where it can be.
    fn decompress(&self, chunk: Chunk, block: &mut UncompressedBlock, zip: &mut Zip) -> Result<()> {
        let header = &self.meta.headers[chunk.layer_index];
        let place = header.get_block_data_indices(&chunk.compressed_block).map_err(|e| exr_error(&e))?;
        let bounds = header.get_absolute_block_pixel_coordinates(place).map_err(|e| exr_error(&e))?;
        let bytes = bounds.size.area() * header.channels.bytes_per_pixel;
        // What does not shrink is stored as it is.
        let packed = packed_bytes(&chunk.compressed_block);
        let shrunk = packed.filter(|packed| packed.len() != bytes);
        if let Some(packed) = packed.filter(|_| Zip::is_for(header)) {
            block.data.resize(bytes, 0);
            let whole = match shrunk {
                None => {
                    block.data.copy_from_slice(packed);
                    Some(())
                }
                Some(packed) => zip.decompress(packed, &mut block.data),
            };
            if whole.is_some() {
                block.index = BlockIndex {
                    layer: chunk.layer_index,
                    pixel_position: bounds.position.to_usize("block").map_err(|error| exr_error(&error))?,
                    pixel_size: bounds.size,
                    level: place.level_index,
                };
                return Ok(());
            }
        }
        if let Some(packed) = shrunk {
            limits::check_dwa(header, packed)?;
        }
        *block = UncompressedBlock::decompress_chunk(chunk, &self.meta, false).map_err(|e| exr_error(&e))?;
        Ok(())
    }
}

/// The headers of the file at `path`, which may be cut off behind them.
///
/// # Errors
/// `Unreadable` when it is missing or has none.
pub(super) fn headers_of(path: &Path) -> Result<Headers> {
    let headers = || {
        let file = File::open(path).map_err(|error| io_error(&error))?;
        let headers = read_meta(&mut BufReader::new(file))?.headers;
        if headers.is_empty() { Err(damaged("it has no part".into())) } else { Ok(headers) }
    };
    guarded(headers).map_err(|error| error.in_file(path))
}

/// Whether the EXR file at `path` ends before its headers do: not one pixel is in it.
pub(super) fn ends_in_headers(path: &Path) -> bool {
    const MISSING: &str = "reference to missing bytes"; // what the decoder makes of a file's end
    let Ok(file) = File::open(path) else { return false };
    let read = catch_unwind(AssertUnwindSafe(|| MetaData::read_from_buffered(BufReader::new(file), false)));
    matches!(read, Ok(Err(exr::error::Error::Invalid(what))) if what == MISSING)
}

fn read_meta(reader: &mut BufReader<File>) -> Result<MetaData> {
    match MetaData::read_from_buffered(&mut *reader, true) {
        Ok(meta) => Ok(meta),
        Err(strict) => {
            reader.rewind().map_err(|error| io_error(&error))?;
            MetaData::read_from_buffered(reader, false).map_err(|_| exr_error(&strict))
        }
    }
}

/// The bytes of a block as they are compressed; none of deep ones, which are refused before.
pub(super) fn packed_bytes(block: &CompressedBlock) -> Option<&[u8]> {
    match block {
        CompressedBlock::ScanLine(block) => Some(&block.compressed_pixels_le),
        CompressedBlock::Tile(block) => Some(&block.compressed_pixels_le),
        CompressedBlock::DeepScanLine(_) | CompressedBlock::DeepTile(_) => None,
    }
}

/// A file that is opened when its first block is read.
#[derive(Default)]
pub(super) struct Reader(Option<BufReader<File>>);

/// What a thread needs to decode blocks.
struct Worker {
    reader: Reader,
    zip: Zip,
    block: UncompressedBlock,
}

impl Default for Worker {
    fn default() -> Self {
        Self { reader: Reader::default(), zip: Zip::default(), block: no_block() }
    }
}

impl Worker {
    /// Shows a block of a part to `look`: as it is kept, or decoded, which may be kept then.
    fn look<R>(
        &mut self,
        document: &Document,
        part: usize,
        index: usize,
        look: impl FnOnce(&mut Zip, &UncompressedBlock) -> R,
    ) -> Result<R> {
        let kept = whole(&document.kept).get((part, index));
        if let Some(block) = kept {
            return Ok(look(&mut self.zip, &block));
        }
        let chunk = self.reader.chunk(document, part, index)?;
        guarded(|| document.decompress(chunk, &mut self.block, &mut self.zip))
            .map_err(|error| document.place(part, error))?;
        let seen = look(&mut self.zip, &self.block);
        whole(&document.kept).offer((part, index), &mut self.block);
        Ok(seen)
    }
}

impl Reader {
    /// Reads a block of a part of its document, compressed as it is.
    ///
    /// # Errors
    /// As [`Document::for_each_block`].
    pub(super) fn chunk(&mut self, document: &Document, part: usize, index: usize) -> Result<Chunk> {
        let file = match &mut self.0 {
            Some(file) => file,
            closed => {
                let file = File::open(&document.path);
                let file = file.map_err(|error| document.place(part, io_error(&error)))?;
                closed.insert(BufReader::new(file))
            }
        };
        guarded(|| document.chunk(file, part, index)).map_err(|error| document.place(part, error))
    }
}

/// What threads work with and leave to each other, so that its memory is had once.
#[derive(Default)]
struct Spare<T>(Mutex<Vec<T>>);

impl<T: Default> Spare<T> {
    fn lend<R>(&self, work: impl FnOnce(&mut T) -> R) -> R {
        let spare = whole(&self.0).pop();
        let mut tools = spare.unwrap_or_default();
        let done = work(&mut tools);
        whole(&self.0).push(tools);
        done
    }
}

/// What threads share and is whole at any time, also where one has panicked.
fn whole<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A number that stands for some bytes.
fn fold(bytes: &[u8]) -> u64 {
    let (words, rest) = bytes.as_chunks();
    let rest = rest.iter().map(|byte| u64::from(*byte));
    words.iter().map(|word| u64::from_le_bytes(*word)).chain(rest).fold(bytes.len() as u64, mixed)
}

/// The hash of what went before and one more word, after FxHash of rustc: a word at a time takes a small share of
/// what decoding takes.
fn mixed(hash: u64, word: u64) -> u64 {
    (hash.rotate_left(5) ^ word).wrapping_mul(0x517c_c1b7_2722_0a95)
}

/// Where a part's `index`th block in increasing rows lies, in the file's pixel coordinates.
pub(super) fn block_bounds(header: &Header, index: usize) -> IntegerBounds {
    let place = header.get_block_data_window_pixel_coordinates(block_coordinates(header, index));
    place.expect("the index is one of the part's")
}

/// Blocks, or strips of them, that come from the top, in the part's line order.
pub(super) fn in_line_order<T>(header: &Header, mut blocks: Vec<T>) -> Vec<T> {
    if header.line_order == LineOrder::Decreasing {
        blocks.reverse();
    }
    blocks
}

/// Whether two rectangles have pixels in common.
fn overlap(a: IntegerBounds, b: IntegerBounds) -> bool {
    let along = |a: i32, a_size: usize, b: i32, b_size: usize| {
        i64::from(a) < i64::from(b) + b_size as i64 && i64::from(b) < i64::from(a) + a_size as i64
    };
    along(a.position.x(), a.size.width(), b.position.x(), b.size.width())
        && along(a.position.y(), a.size.height(), b.position.y(), b.size.height())
}

/// How many blocks of a part lie beside each other.
pub(super) fn columns_of_blocks(header: &Header) -> usize {
    match header.blocks {
        BlockDescription::ScanLines => 1,
        BlockDescription::Tiles(tiles) => header.layer_size.width().div_ceil(tiles.tile_size.width()),
    }
}

/// The coordinates of a part's `index`th block in increasing rows.
fn block_coordinates(header: &Header, index: usize) -> TileCoordinates {
    let columns = columns_of_blocks(header);
    TileCoordinates { tile_index: Vec2(index % columns, index / columns), level_index: Vec2(0, 0) }
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
        .of_system(error)
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
