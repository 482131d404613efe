//! Blocks of samples into compressed chunks.

use std::io::{Seek, Write};

use exr::block::chunk::{
    Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock, TileCoordinates,
};
use exr::block::writer::{ChunkWriter, ChunksWriter};
use exr::block::{BlockIndex, UncompressedBlock};
use exr::meta::BlockDescription;
use exr::meta::header::Header;
use exr::prelude::Vec2;

use super::ordered::make_in_order;
use super::zip::Zip;
use crate::error::{Error, ErrorKind};

/// Writes `count` blocks in their order: what `block` makes of their numbers, each with its index in its header.
/// They are made and compressed on all threads, which changes nothing of the file.
///
/// # Errors
/// When a block does not fit its header or the disk is full.
pub(super) fn write_blocks<W: Write + Seek + Send>(
    writer: &mut ChunkWriter<W>,
    headers: &[Header],
    count: usize,
    block: impl Fn(usize) -> (usize, UncompressedBlock) + Sync,
) -> exr::error::UnitResult {
    let make = |zip: &mut Zip, n: usize| {
        let (index, block) = block(n);
        compress(block, headers, zip).map(|chunk| (index, chunk)).map_err(encode_error)
    };
    let write = |(index, chunk)| writer.write_chunk(index, chunk).map_err(encode_error);
    make_in_order(count, make, write).map_err(through_encoder)
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
