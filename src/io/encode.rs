//! Blocks of samples into compressed chunks, a batch at a time on all threads.

use std::io::{Seek, Write};

use exr::block::chunk::{
    Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock, TileCoordinates,
};
use exr::block::writer::{ChunkWriter, ChunksWriter};
use exr::block::{BlockIndex, UncompressedBlock};
use exr::meta::BlockDescription;
use exr::meta::header::Header;
use exr::prelude::{Compression, Vec2};
use libdeflater::{CompressionLvl, Compressor};
use rayon::prelude::*;

use crate::error::{Error, ErrorKind};

/// Blocks that are compressed together: enough to keep the threads busy, few enough to be a small
/// share of the memory.
pub(super) const BATCH: usize = 64;

/// `[choice]` of libdeflate's levels 1, 4 and 6 on a noisy picture of 31 channels: 0.99, 1.60 and 1.35 s of the processor for
/// 1.002, 1.001 and 1 of the bytes.
const ZIP_LEVEL: i32 = 1;

/// Writes `blocks`, each with its index in its header, in their order. They are made and compressed on rayon's
/// current threads; the order in the file does not depend on them.
///
/// # Errors
/// When a block does not fit its header or the disk is full.
pub(super) fn write_blocks<W: Write + Seek>(
    writer: &mut ChunkWriter<W>,
    headers: &[Header],
    blocks: impl ParallelIterator<Item = (usize, UncompressedBlock)>,
) -> exr::error::UnitResult {
    let chunks: Vec<_> = blocks
        .map_init(compressor, |compressor, (index, block)| {
            compress(block, headers, compressor).map(|chunk| (index, chunk))
        })
        .collect();
    for chunk in chunks {
        let (index, chunk) = chunk?;
        writer.write_chunk(index, chunk)?;
    }
    Ok(())
}

fn compressor() -> Compressor {
    Compressor::new(CompressionLvl::new(ZIP_LEVEL).expect("it is one of libdeflate's levels"))
}

/// The chunk of a block. `[choice]` ZIP is compressed here and not by `exr`, whose compressor takes 3.4 times as
/// long for as many bytes and was more than a fifth of what the fastest preset takes.
fn compress(
    block: UncompressedBlock,
    headers: &[Header],
    compressor: &mut Compressor,
) -> exr::error::Result<Chunk> {
    let header = &headers[block.index.layer];
    let is_zip = matches!(header.compression, Compression::ZIP1 | Compression::ZIP16);
    if !is_zip || cfg!(target_endian = "big") {
        return block.compress_to_chunk(headers);
    }
    let zipped = zip(&block.data, compressor)?;
    let compressed_pixels_le = if zipped.len() < block.data.len() { zipped } else { block.data };
    let Vec2(x, y) = block.index.pixel_position;
    let compressed_block = match header.blocks {
        BlockDescription::ScanLines => CompressedBlock::ScanLine(CompressedScanLineBlock {
            compressed_pixels_le,
            y_coordinate: header.own_attributes.layer_position.y() + y as i32,
        }),
        BlockDescription::Tiles(tiles) => CompressedBlock::Tile(CompressedTileBlock {
            compressed_pixels_le,
            coordinates: TileCoordinates {
                tile_index: Vec2(x / tiles.tile_size.x(), y / tiles.tile_size.y()),
                level_index: block.index.level,
            },
        }),
    };
    Ok(Chunk { layer_index: block.index.layer, compressed_block })
}

/// Bytes as ZIP blocks hold them: first those at even places and then those at odd ones, each as its difference
/// to the one before it plus 128, deflated.
fn zip(data: &[u8], compressor: &mut Compressor) -> std::io::Result<Vec<u8>> {
    let (pairs, last) = data.as_chunks::<2>();
    let mut sorted = vec![0; data.len()];
    let (even, odd) = sorted.split_at_mut(pairs.len() + last.len());
    even[pairs.len()..].copy_from_slice(last);
    for ((even, odd), pair) in even.iter_mut().zip(odd).zip(pairs) {
        [*even, *odd] = *pair;
    }
    let mut filtered = sorted.clone();
    for (difference, pair) in filtered.iter_mut().skip(1).zip(sorted.array_windows::<2>()) {
        *difference = pair[1].wrapping_sub(pair[0]).wrapping_add(128);
    }
    let mut zipped = vec![0; compressor.zlib_compress_bound(filtered.len())];
    let length = compressor.zlib_compress(&filtered, &mut zipped).map_err(std::io::Error::other)?;
    zipped.truncate(length);
    Ok(zipped)
}

/// The block at `index` whose line of channel `c` at row `y` is filled by `line(c, x, y, bytes)`,
/// with samples in the machine's own byte order.
pub(super) fn block_from_lines(
    header: &Header,
    index: BlockIndex,
    mut line: impl FnMut(usize, usize, usize, &mut [u8]),
) -> UncompressedBlock {
    UncompressedBlock::from_lines(&header.channels, index, |target| {
        let at = target.location;
        line(at.channel, at.position.x(), at.position.y(), target.value);
    })
}

/// One of our errors on its way through the EXR encoder.
pub(super) fn through_encoder(error: Error) -> exr::error::Error {
    exr::error::Error::Io(std::io::Error::other(error))
}

/// What comes out of the EXR encoder: our own error, or one of the encoder or the disk.
pub(super) fn encode_error(error: exr::error::Error) -> Error {
    let cannot = |why: String| {
        Error::new(ErrorKind::Unwritable, format!("cannot be written: {why}"))
            .remedy("check that the disk has room")
    };
    match error {
        exr::error::Error::Io(error) => match error.downcast::<Error>() {
            Ok(ours) => ours,
            Err(error) => cannot(error.to_string()),
        },
        other => cannot(other.to_string()),
    }
}
