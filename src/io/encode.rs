//! Blocks of samples into compressed chunks, a batch at a time on all threads.

use std::io::{Seek, Write};

use exr::block::chunk::{
    Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock, TileCoordinates,
};
use exr::block::writer::{ChunkWriter, ChunksWriter};
use exr::block::{BlockIndex, UncompressedBlock};
use exr::meta::BlockDescription;
use exr::meta::header::Header;
use exr::prelude::Vec2;
use rayon::prelude::*;

use super::zip::Zip;
use crate::error::{Error, ErrorKind};

/// Blocks that are compressed together: enough to keep the threads busy, few enough to be a small
/// share of the memory.
pub(super) const BATCH: usize = 64;

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
        .map_init(Zip::default, |zip, (index, block)| {
            compress(block, headers, zip).map(|chunk| (index, chunk))
        })
        .collect();
    for chunk in chunks {
        let (index, chunk) = chunk?;
        writer.write_chunk(index, chunk)?;
    }
    Ok(())
}

/// The chunk of a block.
///
/// # Errors
/// When the block does not fit its header.
pub(super) fn compress(
    block: UncompressedBlock,
    headers: &[Header],
    zip: &mut Zip,
) -> exr::error::Result<Chunk> {
    let header = &headers[block.index.layer];
    if !Zip::is_for(header) {
        return block.compress_to_chunk(headers);
    }
    let packed = zip.compress(&block.data)?;
    let compressed_pixels_le = if packed.len() < block.data.len() { packed } else { block.data };
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
