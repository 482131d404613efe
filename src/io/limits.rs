//! What a header may claim before anything is allocated for it.
//!
//! A damaged or hostile file of a few bytes can announce a picture of terabytes. Every claim is
//! held against the length of the file, and against the fixed limits below. Then reading takes no more than
//!
//! - 4 bytes a pixel for every channel that plays a role, [`MAX_PLANE_BYTES`] in all,
//! - decoded blocks of 64 MiB at a time, or one of up to [`MAX_BLOCK_BYTES`], and what they are decoded from,
//! - the headers and tables of blocks, a few times their length in the file.
//!
//! Channels without a role are never held, and no more than 64 MiB of planes are made before a first block was decoded.
//! What a codec may make of the file is limited too: a block that decodes to more than it announces is an error
//! when the announced size is reached. Before planes are made, or a block of more than those 64 MiB is decoded,
//! the system is asked whether it has so much to give, so that a bomb within these limits is an error too.

use exr::meta::BlockDescription;
use exr::meta::attribute::{AttributeValue, LevelMode};
use exr::meta::header::Header;
use exr::prelude::{Compression, Vec2};

use crate::error::{Error, ErrorKind, Result};
use crate::image::can_be_had;

/// The most pixels a part may have: 16384 × 16384. One plane of them takes 1 GiB.
pub const MAX_PIXELS: u64 = 1 << 28;

/// The most channels a file may have, over all its parts.
pub const MAX_CHANNELS: usize = 1 << 14;

/// The most parts a file may have.
pub const MAX_PARTS: usize = 1 << 12;

/// The most bytes that one block (a tile, or some scan lines of all channels) may decode to.
pub const MAX_BLOCK_BYTES: u64 = 1 << 30;

/// The most bytes that the planes of all channels with a role may take: an 8K frame may have 129 of them.
pub const MAX_PLANE_BYTES: u64 = 1 << 34;

/// The most bytes of planes that are made before a first block was decoded.
pub(super) const MOST_UNPROVEN: usize = 1 << 26;

/// Bytes that the table of blocks and the head of a block take in the file, at least.
const LEAST_BYTES_PER_CHUNK: u64 = 16;

/// Refuses what this program cannot handle, and what the file cannot hold.
///
/// # Errors
/// `Unreadable`, with the part and the remedy.
pub(super) fn check(headers: &[Header], file_bytes: u64) -> Result<()> {
    let channels: usize = headers.iter().map(|header| header.channels.list.len()).sum();
    if headers.is_empty() || headers.len() > MAX_PARTS || channels > MAX_CHANNELS {
        return Err(unreadable(format!(
            "announces {} parts and {channels} channels where 1 to {MAX_PARTS} parts and at most \
             {MAX_CHANNELS} channels are handled",
            headers.len()
        ))
        .remedy("split the file"));
    }
    let mut least_bytes = 0u64;
    for header in headers {
        let part = || header.own_attributes.layer_name.as_ref().map_or_else(String::new, ToString::to_string);
        let checked =
            supported(header).and_then(|()| typed(header)).and_then(|()| plausible(header, file_bytes));
        let bytes = checked.map_err(|error| if headers.len() > 1 { error.in_part(part()) } else { error })?;
        least_bytes = least_bytes.saturating_add(bytes);
    }
    if least_bytes > file_bytes {
        return Err(unreadable(format!(
            "announces {} parts, which {file_bytes} bytes of file cannot hold",
            headers.len()
        ))
        .remedy("it is damaged or incomplete: write it again"));
    }
    Ok(())
}

/// Refuses to read more planes than [`MAX_PLANE_BYTES`] allow.
///
/// # Errors
/// `Unreadable`, with what it would take and the remedy.
pub(super) fn check_planes(planes: usize, (width, height): (usize, usize)) -> Result<()> {
    let bytes = [planes, width, height].iter().fold(4u64, |bytes, &n| bytes.saturating_mul(n as u64));
    if bytes <= MAX_PLANE_BYTES {
        return check_memory(bytes, "its planes");
    }
    Err(unreadable(format!(
        "has {planes} channels of {width}×{height} pixels that play a role, {bytes} bytes where \
         {MAX_PLANE_BYTES} are the limit"
    ))
    .remedy("split the picture, or write fewer layers"))
}

/// Asks the system for as many bytes as the next step takes, and gives them back.
///
/// # Errors
/// `Unreadable`, with the remedy, where it has not so many: below a limit of the process, or at all.
pub(super) fn check_memory(bytes: u64, what: &str) -> Result<()> {
    if can_be_had(bytes) {
        return Ok(());
    }
    Err(unreadable(format!("takes {bytes} bytes for {what}, more than this process can have"))
        .remedy("give it more memory, or check whether the file is damaged"))
}

fn unreadable(what: impl Into<String>) -> Error {
    Error::new(ErrorKind::Unreadable, what)
}

fn supported(header: &Header) -> Result<()> {
    if header.deep {
        return Err(unreadable("holds deep data where flat pixels were expected")
            .remedy("flatten it, for example with `oiiotool --flatten`"));
    }
    if let Some(channel) = header.channels.list.iter().find(|channel| channel.sampling != Vec2(1, 1)) {
        return Err(unreadable(format!(
            "is subsampled {}×{} (luminance/chroma) where full resolution was expected",
            channel.sampling.x(),
            channel.sampling.y()
        ))
        .in_channel(channel.name.to_string())
        .remedy("convert it to RGB, for example with `exrmakergb` or a compositor"));
    }
    if let BlockDescription::Tiles(tiles) = header.blocks
        && tiles.level_mode != LevelMode::Singular
    {
        return Err(unreadable("holds several resolutions (a texture) where one picture was expected")
            .remedy("write a render without mip levels, for example with `exrmaketiled -o`"));
    }
    if matches!(header.compression, Compression::HTJ2K32 | Compression::HTJ2K256) {
        return Err(unreadable("is compressed with HTJ2K, which is not supported")
            .remedy("write it with ZIP compression"));
    }
    Ok(())
}

/// Refuses attributes whose type has no name. The decoder takes a zero for the first letter of one, and would
/// write what nobody can read.
fn typed(header: &Header) -> Result<()> {
    let attributes = header.own_attributes.other.iter().chain(&header.shared_attributes.other);
    for (name, value) in attributes {
        if matches!(value, AttributeValue::Custom { kind, .. } if kind.as_slice().contains(&0)) {
            return Err(unreadable(format!("is damaged: its attribute '{name}' has no type"))
                .remedy("write it again"));
        }
    }
    Ok(())
}

/// Returns the bytes that the part must take in the file at least.
fn plausible(header: &Header, file_bytes: u64) -> Result<u64> {
    let size = header.layer_size;
    let pixels = (size.width() as u64).saturating_mul(size.height() as u64);
    let bytes = pixels.saturating_mul(header.channels.bytes_per_pixel as u64);
    let (width, height) = (size.width(), size.height());
    if pixels > MAX_PIXELS {
        return Err(unreadable(format!(
            "announces {width}×{height} pixels where {MAX_PIXELS} are the limit"
        ))
        .remedy("render it in pieces, or check whether the file is damaged"));
    }
    let block = header.max_block_pixel_size();
    let block_pixels = (block.width() as u64).saturating_mul(block.height() as u64);
    if block_pixels.saturating_mul(header.channels.bytes_per_pixel as u64) > MAX_BLOCK_BYTES {
        return Err(unreadable(format!(
            "announces blocks of {}×{} pixels, more than the limit of {MAX_BLOCK_BYTES} bytes",
            block.width(),
            block.height()
        ))
        .remedy("write it with smaller tiles or as scan lines"));
    }
    let chunks = header.chunk_count as u64;
    let least_bytes = chunks
        .saturating_mul(LEAST_BYTES_PER_CHUNK)
        .saturating_add(bytes / most_expansion(header.compression));
    if pixels == 0 || least_bytes > file_bytes {
        return Err(unreadable(format!(
            "announces {width}×{height} pixels of {} channels in {chunks} blocks, which {file_bytes} bytes \
             of file cannot hold",
            header.channels.list.len()
        ))
        .remedy("it is damaged or incomplete: write it again"));
    }
    Ok(least_bytes)
}

/// Refuses a shrunk block of DWA whose counters announce more than any block of the part holds: the decoder asks for as
/// much memory as they say, and a process that is refused it ends.
///
/// # Errors
/// `Unreadable`, with the remedy.
pub(super) fn check_dwa(header: &Header, packed: &[u8]) -> Result<()> {
    /// Those of eleven that tell what the sections decode to: bytes that are stored as they are, those of runs
    /// before and after they are unrolled, coefficients of either kind.
    const DECODED: [usize; 5] = [1, 6, 7, 8, 9];
    /// Of a sample at most: runs take up to twice their content.
    const MOST_BYTES: u64 = 8;
    if !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Ok(());
    }
    let size = header.max_block_pixel_size();
    let samples = [size.width(), size.height()].map(|n| n.next_multiple_of(8) as u64).iter().product::<u64>()
        * header.channels.list.len() as u64;
    let (counters, _) = packed.as_chunks();
    let announced =
        DECODED.iter().filter_map(|&n| counters.get(n)).map(|counter| u64::from_le_bytes(*counter));
    match announced.max() {
        Some(most) if most > samples * MOST_BYTES => {
            Err(unreadable(format!("is damaged: a block announces {most} bytes where {samples} samples are"))
                .remedy("write it again"))
        }
        _ => Ok(()),
    }
}

/// By how much a codec can shrink its input at the very best.
fn most_expansion(compression: Compression) -> u64 {
    const DEFLATE: u64 = 1032; // its limit: 258 bytes by two bits
    const RUNS: u64 = 64; // two bytes stand for at most 128
    match compression {
        Compression::RLE => RUNS,
        Compression::ZIP1 | Compression::ZIP16 => DEFLATE,
        Compression::PXR24 => DEFLATE * 4 / 3, // three bytes out of four
        Compression::PIZ => 454,               // 255 samples of two bytes by nine bits
        Compression::B44 | Compression::B44A => 11, // three bytes stand for 32
        Compression::DWAA(_) | Compression::DWAB(_) => RUNS * DEFLATE, // both; a block of 8×8 takes more
        _ => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::meta::attribute::{ChannelDescription, LineOrder, SampleType, Text, TileDescription};
    use exr::prelude::attribute::LevelMode;

    fn header(width: usize, height: usize, compression: Compression) -> Header {
        let channels = ["B", "G", "R"].map(|name| ChannelDescription::named(name, SampleType::F16));
        Header::new(Text::from("beauty"), (width, height), channels.into_iter().collect()).with_encoding(
            compression,
            BlockDescription::ScanLines,
            LineOrder::Increasing,
        )
    }

    fn refusal(header: Header, file_bytes: u64) -> String {
        check(&[header], file_bytes).unwrap_err().to_string()
    }

    #[test]
    fn claims_are_held_against_the_limits_and_the_file() {
        assert!(check(&[header(640, 480, Compression::ZIP16)], 20_000).is_ok());
        assert!(refusal(header(1 << 20, 1 << 20, Compression::ZIP16), 1 << 40).contains("limit"));
        assert!(refusal(header(16000, 16000, Compression::ZIP16), 200_000).contains("cannot hold"));
        assert!(refusal(header(64, 1 << 20, Compression::PIZ), 1000).contains("cannot hold"));
        assert!(refusal(header(1 << 27, 2, Compression::DWAB(None)), 1 << 40).contains("blocks of"));
        // Two parts that the file can hold one at a time.
        let part = || header(1000, 1000, Compression::Uncompressed);
        assert!(check(&[part()], 7_000_000).is_ok());
        assert!(check(&[part(), part()], 7_000_000).unwrap_err().to_string().contains("2 parts"));
        assert!(check_planes(17, (1920, 1080)).is_ok());
        assert!(check_memory(1 << 60, "a test").unwrap_err().to_string().contains("more memory"));
        assert!(check_planes(17, (1 << 14, 1 << 14)).unwrap_err().to_string().contains("17 channels"));
        let mut many = header(64, 64, Compression::RLE);
        let names = (0..=MAX_CHANNELS)
            .map(|i| ChannelDescription::named(Text::from(format!("c{i}").as_str()), SampleType::U32));
        many.channels = exr::meta::attribute::ChannelList::new(names.collect());
        assert!(refusal(many, 1 << 40).contains("channels"));
    }

    #[test]
    fn what_is_not_supported_names_its_remedy() {
        let mut deep = header(8, 8, Compression::ZIP1);
        deep.deep = true;
        assert!(refusal(deep, 10_000).contains("flatten"));
        let mut chroma = header(8, 8, Compression::ZIP1);
        chroma.channels.list[1].sampling = Vec2(2, 2);
        let message = refusal(chroma, 10_000);
        assert!(message.contains("subsampled") && message.contains("'G'"), "{message}");
        assert!(refusal(header(8, 8, Compression::HTJ2K32), 10_000).contains("HTJ2K"));
        let levels = BlockDescription::Tiles(TileDescription {
            tile_size: Vec2(64, 64),
            level_mode: LevelMode::MipMap,
            rounding_mode: exr::math::RoundingMode::Down,
        });
        let mips =
            header(8, 8, Compression::ZIP1).with_encoding(Compression::ZIP1, levels, LineOrder::Increasing);
        assert!(refusal(mips, 10_000).contains("resolutions"));
    }
}
