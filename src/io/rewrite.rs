//! The input with a new beauty (and components): everything else goes through bit for bit.
//!
//! Parts without a new channel are copied block by block without being decoded. The others are
//! decoded, their channels replaced, and encoded again; that loses nothing as long as their compression
//! is lossless for what passes through, and otherwise they are written with ZIP instead.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;

use exr::block::lines::LineIndex;
use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::meta::attribute::{AttributeValue, ChannelDescription, ChannelList, LineOrder, SampleType, Text};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, Headers};
use exr::prelude::{Compression, Vec2};
use half::f16;

use super::atomic::write_picture_atomically;
use super::decode::ChannelAt;
use super::document::{Document, packed_bytes};
use super::encode::{block_from_lines, compress, encode_error, through_encoder};
use super::zip::Zip;
use crate::error::Result;
use crate::image::Plane;

/// A plane that replaces a channel, or becomes a new one.
pub(super) struct Replacement<'a> {
    pub(super) at: ChannelAt,
    pub(super) plane: &'a Plane,
}

/// A channel to add to the beauty's part (that of the first replacement), as 32-bit floats; one of the same name is replaced.
pub(super) struct Addition<'a> {
    pub(super) name: &'a str,
    pub(super) plane: &'a Plane,
}

/// Where the samples of a channel of the output come from.
#[derive(Clone, Copy)]
pub(super) enum Source<'a> {
    /// The input's channel of this index.
    Input(usize),
    Plane(&'a Plane),
}

/// What is written for a part with new channels.
pub(super) struct NewPart<'a> {
    pub(super) header: Header,
    /// For each channel of `header`.
    pub(super) sources: Vec<Source<'a>>,
}

/// The attribute that says what a result was made by.
const SIGNATURE: &str = "apr.settings";

/// The attribute that names the channels of a part that hold results, of this run or of earlier ones: a JSON list. The
/// file may have noise besides, of the other eye, or where the renderer keeps it beside its own result.
pub(super) const DENOISED: &str = "apr.denoised";

/// Bytes that are written before the disk is asked to take them.
const SYNC_BYTES: usize = 16 << 20;

/// What becomes of every part of a file.
pub(super) struct Plan<'a> {
    /// The parts with new channels; the others are copied.
    pub(super) new: Vec<Option<NewPart<'a>>>,
    /// Of the file with the new channels.
    pub(super) headers: Headers,
    /// What the user should know.
    pub(super) notes: Vec<String>,
}

impl<'a> Plan<'a> {
    /// For `document` with the `replacements`, which are marked where there is a signature; the `additions` and that
    /// go to the first replacement's part.
    pub(super) fn new(
        document: &Document,
        replacements: &[Replacement<'a>],
        additions: &[Addition<'a>],
        signature: Option<&str>,
    ) -> Self {
        let beauty = replacements.first().map_or(0, |replacement| replacement.at.part);
        let mut notes = Vec::new();
        let mut new: Vec<Option<NewPart>> = Vec::new();
        for (part, header) in document.headers().iter().enumerate() {
            let here: Vec<&Replacement> = replacements.iter().filter(|new| new.at.part == part).collect();
            let additions = if part == beauty { additions } else { &[] };
            let changes = !here.is_empty() || !additions.is_empty();
            new.push(changes.then(|| NewPart::plan(header, &here, additions, &mut notes)));
        }
        let kept = document.headers().iter().zip(&new);
        let mut headers: Headers =
            kept.map(|(header, new)| new.as_ref().map_or(header, |new| &new.header).clone()).collect();
        if let Some(signature) = signature.and_then(Text::new_or_none) {
            let attributes = &mut headers[beauty].own_attributes.other;
            attributes.insert(Text::from(SIGNATURE), AttributeValue::Text(signature));
            for ChannelAt { part, channel } in replacements.iter().map(|replacement| replacement.at) {
                let name = document.headers()[part].channels.list[channel].name.to_string();
                mark_denoised(&mut headers[part], name);
            }
        }
        Self { new, headers, notes }
    }
}

/// Writes `document` to `target` with the `replacements`, whose planes have their parts' size, and the
/// `additions` and the signature to the first replacement's part. Returns what the user should know.
///
/// # Errors
/// When the input turns out to be damaged, or the output cannot be written: an old file at `target`
/// is then unharmed.
pub(super) fn rewrite(
    document: &Document,
    target: &Path,
    replacements: &[Replacement],
    additions: &[Addition],
    signature: Option<&str>,
) -> Result<Vec<String>> {
    let Plan { new, headers, notes } = Plan::new(document, replacements, additions, signature);
    write_picture_atomically(target, |file| {
        let disk = *file.get_ref();
        exr::block::write(file, headers, false, |meta, writer| {
            for (part, new) in new.iter().enumerate() {
                let written = if let Some(new) = new {
                    let input = &document.headers()[part];
                    let make = |zip: &mut Zip, index: usize, block: &UncompressedBlock| {
                        let blocks = new.blocks(input, index, block).into_iter();
                        let chunks = blocks.map(|(index, block)| {
                            compress(block, &meta.headers, zip).map(|chunk| (index, chunk))
                        });
                        chunks.collect::<std::result::Result<Vec<_>, _>>().map_err(encode_error)
                    };
                    let mut unsynced = 0;
                    document.make_of_blocks(part, make, |chunks| {
                        for (index, chunk) in chunks {
                            unsynced += packed_bytes(&chunk.compressed_block).map_or(0, <[u8]>::len);
                            writer.write_chunk(index, chunk).map_err(encode_error)?;
                        }
                        // The disk works while the next blocks are made, and has little to do at the end.
                        if unsynced < SYNC_BYTES {
                            return Ok(());
                        }
                        unsynced = 0;
                        disk.sync_data().map_err(|error| encode_error(error.into()))
                    })
                } else {
                    document.for_each_chunk(part, |index, chunk| {
                        writer.write_chunk(index, chunk).map_err(encode_error)
                    })
                };
                written.map_err(through_encoder)?;
            }
            Ok(())
        })
        .map_err(encode_error)
    })?;
    Ok(notes)
}

/// What the result that has these `headers` was made by; none where it is no result.
pub(super) fn signature_in(headers: &[Header]) -> Option<String> {
    headers.iter().find_map(|header| match header.own_attributes.other.get(&Text::from(SIGNATURE)) {
        Some(AttributeValue::Text(text)) => Some(text.to_string()),
        _ => None,
    })
}

/// Whether the channel at this place holds a result of this program.
pub(super) fn is_denoised(headers: &[Header], ChannelAt { part, channel }: ChannelAt) -> bool {
    denoised(&headers[part]).contains(&headers[part].channels.list[channel].name.to_string())
}

/// Whether the file tells which of its channels hold results.
pub(super) fn names_results(headers: &[Header]) -> bool {
    headers.iter().any(|header| header.own_attributes.other.contains_key(&Text::from(DENOISED)))
}

fn denoised(header: &Header) -> BTreeSet<String> {
    match header.own_attributes.other.get(&Text::from(DENOISED)) {
        Some(AttributeValue::Text(text)) => serde_json::from_str(&text.to_string()).unwrap_or_default(),
        _ => BTreeSet::new(),
    }
}

fn mark_denoised(header: &mut Header, name: String) {
    let mut names = denoised(header);
    names.insert(name);
    let text = serde_json::to_string(&names).expect("names are JSON");
    let value = AttributeValue::Text(Text::from(text.as_str()));
    header.own_attributes.other.insert(Text::from(DENOISED), value);
}

impl<'a> NewPart<'a> {
    fn plan(
        input: &Header,
        replacements: &[&Replacement<'a>],
        additions: &[Addition<'a>],
        notes: &mut Vec<String>,
    ) -> Self {
        let mut channels: Vec<(ChannelDescription, Source)> = Vec::new();
        for (index, description) in input.channels.list.iter().enumerate() {
            let new = replacements.iter().find(|replacement| replacement.at.channel == index);
            let source = new.map_or(Source::Input(index), |replacement| Source::Plane(replacement.plane));
            channels.push((description.clone(), source));
        }
        for addition in additions {
            let description = ChannelDescription::named(Text::from(addition.name), SampleType::F32);
            channels.retain(|(channel, _)| channel.name != description.name);
            channels.push((description, Source::Plane(addition.plane)));
        }
        channels.sort_by(|(a, _), (b, _)| a.name.as_slice().cmp(b.name.as_slice()));
        let compression = compression(input.compression, &channels);
        if compression != input.compression {
            notes.push(format!(
                "written with ZIP, because {} would alter the channels that pass through",
                input.compression
            ));
        }
        let (descriptions, sources) = channels.into_iter().unzip::<_, _, Vec<_>, Vec<_>>();
        let mut header = input.clone().with_encoding(compression, input.blocks, input.line_order);
        header.channels = ChannelList::new(descriptions.into());
        Self { header, sources }
    }

    /// The blocks of the output for one of the input: the one at the same place, or several lower ones
    /// where the new compression takes fewer lines together.
    fn blocks(
        &self,
        input: &Header,
        index: usize,
        block: &UncompressedBlock,
    ) -> Vec<(usize, UncompressedBlock)> {
        let step = match input.blocks {
            BlockDescription::Tiles(_) => input.max_block_pixel_size().height(),
            BlockDescription::ScanLines => self.header.compression.scan_lines_per_block(),
        };
        let split = input.max_block_pixel_size().height() / step; // ZIP's 16 lines divide all others
        let BlockIndex { pixel_position: at, pixel_size: size, .. } = block.index;
        // The input's lines, row by row and channel by channel.
        let lines: Vec<Range<usize>> =
            LineIndex::lines_in_block(block.index, &input.channels).map(|(bytes, _)| bytes).collect();
        let channels = input.channels.list.len();
        let mut blocks: Vec<_> = (0..size.height().div_ceil(step))
            .map(|k| {
                let position = Vec2(at.x(), at.y() + k * step);
                let size = Vec2(size.width(), step.min(size.height() - k * step));
                let place = BlockIndex { pixel_position: position, pixel_size: size, ..block.index };
                let line = |channel: usize, x: usize, y: usize, target: &mut [u8]| match self.sources[channel]
                {
                    Source::Input(source) => {
                        let bytes = lines[(y - at.y()) * channels + source].clone();
                        target.copy_from_slice(&block.data[bytes]);
                    }
                    Source::Plane(plane) => {
                        let samples = &plane.row(y)[x..x + size.width()];
                        store(samples, self.header.channels.list[channel].sample_type, target);
                    }
                };
                (index * split + k, block_from_lines(&self.header, place, line))
            })
            .collect();
        if input.line_order == LineOrder::Decreasing {
            blocks.reverse();
        }
        blocks
    }
}

/// The input's compression, unless it would alter what passes through. (PXR24 cuts floats to 24
/// bits, but those that come from a PXR24 file have no more.)
fn compression(input: Compression, channels: &[(ChannelDescription, Source)]) -> Compression {
    let passes = |(description, source): &(ChannelDescription, Source)| match source {
        Source::Input(_) => input.is_lossless_for(description.sample_type),
        Source::Plane(_) => true,
    };
    if input == Compression::PXR24 || channels.iter().all(passes) { input } else { Compression::ZIP16 }
}

/// Stores samples as the channel's type: the nearest finite half, or the nearest whole number.
pub(super) fn store(samples: &[f32], kind: SampleType, target: &mut [u8]) {
    match kind {
        SampleType::F16 => {
            let (low, high) = (f16::MIN.to_f32(), f16::MAX.to_f32());
            fill(samples, target.as_chunks_mut().0, |v| f16::from_f32(v.clamp(low, high)).to_ne_bytes());
        }
        SampleType::F32 => fill(samples, target.as_chunks_mut().0, f32::to_ne_bytes),
        SampleType::U32 => fill(samples, target.as_chunks_mut().0, |v| (v.round() as u32).to_ne_bytes()),
    }
}

fn fill<const N: usize>(samples: &[f32], target: &mut [[u8; N]], write: impl Fn(f32) -> [u8; N]) {
    for (bytes, sample) in target.iter_mut().zip(samples) {
        *bytes = write(*sample);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_stored_as_the_nearest_of_their_type() {
        let mut halves = [0; 6];
        store(&[1.5, 1e9, -1e9], SampleType::F16, &mut halves);
        let read: Vec<f32> = halves.as_chunks().0.iter().map(|b| f16::from_ne_bytes(*b).to_f32()).collect();
        assert_eq!(read, [1.5, 65504.0, -65504.0]);
        let mut whole = [0; 12];
        store(&[2.6, -3.0, 1e20], SampleType::U32, &mut whole);
        let read: Vec<u32> = whole.as_chunks().0.iter().map(|b| u32::from_ne_bytes(*b)).collect();
        assert_eq!(read, [3, 0, u32::MAX]);
    }

    #[test]
    fn a_lossy_codec_stays_only_where_nothing_is_lost() {
        let plane = Plane::filled(1, 1, 0.0);
        let of = |kind, source| (ChannelDescription::named("x", kind), source);
        let passed = of(SampleType::F16, Source::Input(0));
        let float = of(SampleType::F32, Source::Input(0));
        let new = of(SampleType::F16, Source::Plane(&plane));
        assert_eq!(compression(Compression::B44, &[new.clone(), float.clone()]), Compression::B44);
        assert_eq!(compression(Compression::B44, &[new.clone(), passed.clone()]), Compression::ZIP16);
        let only = std::slice::from_ref(&new);
        assert_eq!(compression(Compression::DWAA(Some(45.0)), only), Compression::DWAA(Some(45.0)));
        assert_eq!(compression(Compression::DWAA(None), &[new.clone(), float.clone()]), Compression::ZIP16);
        assert_eq!(compression(Compression::PXR24, &[new, float]), Compression::PXR24);
        assert_eq!(compression(Compression::PIZ, &[passed]), Compression::PIZ);
    }
}
