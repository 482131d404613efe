//! Frames under this project's own layer names.
//!
//! `R,G,B` is the colour, `variance.*` the variance of its mean and `halfA.*` the mean of one half
//! of the samples (the other half is `2·mean − halfA`). A feature is a layer of its own name, with
//! `<layer>Variance.*` and `<layer>HalfA.*` beside it; an AOV is a layer of three colours. The motion is
//! `motionPrevious.X,Y` and `motionNext.X,Y`.

use std::path::Path;

use exr::meta::BlockDescription;
use exr::meta::attribute::{AttributeValue, ChannelDescription, LineOrder, SampleType, Text};
use exr::meta::header::Header;
use exr::prelude::Compression;

use super::atomic::write_picture_atomically;
use super::encode::{block_from_lines, encode_error, write_blocks};
use super::rewrite::store;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{FeatureKind, Frame};
use crate::image::Plane;

/// What [`write_frame`] tells besides the frame itself.
#[derive(Debug, Clone, Copy, Default)]
pub struct FrameHeader<'a> {
    /// The seed of the render, as attribute `seed`.
    pub seed: Option<u64>,
    /// Further channels under their full names, such as a map of sample counts; of the frame's size.
    pub further: &'a [(&'a str, &'a Plane)],
}

/// Writes `frame` as 32-bit float scan lines with ZIP compression. The samples per pixel become the
/// attribute `samplesPerPixel`: an integer, or a float where the mean count is a fraction.
///
/// # Errors
/// When the file cannot be written (an old one is then unharmed), or two channels have one name, or
/// a further channel differs from the frame in size.
pub fn write_frame(path: impl AsRef<Path>, frame: &Frame, header: &FrameHeader) -> Result<()> {
    let path = path.as_ref();
    let channels = channels(frame, header).map_err(|error| error.in_file(path))?;
    write_channels(path, exr_header(frame, header, &channels), &channels)
}

/// Writes one plane as the one channel `name`, in the same way: a map for a renderer.
///
/// # Errors
/// When the file cannot be written (an old one is then unharmed).
pub fn write_plane(path: impl AsRef<Path>, name: &str, plane: &Plane) -> Result<()> {
    let channels = checked(vec![(name.to_owned(), plane)])?;
    write_channels(path.as_ref(), plain_header(plane.size(), &channels), &channels)
}

fn write_channels(path: &Path, header: Header, channels: &[(Text, &Plane)]) -> Result<()> {
    write_picture_atomically(path, |file| {
        exr::block::write(file, std::iter::once(header).collect(), true, |meta, writer| {
            let blocks: Vec<_> = meta.enumerate_ordered_header_block_indices().collect();
            write_blocks(writer, &meta.headers, blocks.len(), |n| {
                let (index, block) = blocks[n];
                let line = |c: usize, x: usize, y: usize, bytes: &mut [u8]| {
                    store(&channels[c].1.row(y)[x..], SampleType::F32, bytes);
                };
                (index, block_from_lines(&meta.headers[0], block, line))
            })
        })
        .map_err(encode_error)
    })
}

/// Who wrote it, as files tell.
const SOFTWARE: &str = "apr-denoise";

/// The attribute that holds a render's seed.
const SEED: &str = "seed";

/// Whether a file whose first part has this header, as the decoder reads it, was
/// written by [`write_frame`] with a seed.
pub(super) fn is_seeded(header: &Header) -> bool {
    let attributes = &header.own_attributes;
    let is_own = attributes.software_name.as_ref().is_some_and(|name| name.as_slice() == SOFTWARE.as_bytes());
    is_own && attributes.other.contains_key(&Text::from(SEED))
}

fn plain_header(size: (usize, usize), channels: &[(Text, &Plane)]) -> Header {
    let list = channels.iter().map(|(name, _)| ChannelDescription::named(name.clone(), SampleType::F32));
    let mut header = Header::new(Text::from("apr"), size, list.collect()).with_encoding(
        Compression::ZIP16,
        BlockDescription::ScanLines,
        LineOrder::Increasing,
    );
    header.own_attributes.layer_name = None; // a file of one part needs no name
    header.own_attributes.software_name = Some(Text::from(SOFTWARE));
    header
}

fn exr_header(frame: &Frame, tell: &FrameHeader, channels: &[(Text, &Plane)]) -> Header {
    let mut header = plain_header((frame.width(), frame.height()), channels);
    let other = &mut header.own_attributes.other;
    if let Some(spp) = frame.spp() {
        let whole = spp.fract() == 0.0;
        let value = if whole { AttributeValue::I32(spp as i32) } else { AttributeValue::F32(spp) };
        other.insert(Text::from("samplesPerPixel"), value);
    }
    if let Some(seed) = tell.seed {
        // EXR's integers have 32 bits; a larger one becomes text.
        let value = i32::try_from(seed).map_or_else(
            |_| AttributeValue::Text(Text::from(seed.to_string().as_str())),
            AttributeValue::I32,
        );
        other.insert(Text::from(SEED), value);
    }
    header
}

/// The names of a feature's components.
fn components(kind: FeatureKind, count: usize) -> Vec<String> {
    let names: &[&str] = match (kind, count) {
        (FeatureKind::Normal | FeatureKind::Position, 3) => &["X", "Y", "Z"],
        (FeatureKind::Depth, 1) => &["Z"],
        (_, 1) => &["Y"],
        (_, 2) => &["U", "V"],
        (_, 3) => &["R", "G", "B"],
        _ => return (0..count).map(|i| i.to_string()).collect(),
    };
    names.iter().map(|&name| name.to_owned()).collect()
}

/// Every channel with its name, in the alphabetical order that EXR wants.
fn channels<'a>(frame: &'a Frame, header: &FrameHeader<'a>) -> Result<Vec<(Text, &'a Plane)>> {
    let rgb = components(FeatureKind::Albedo, 3);
    let mut named: Vec<(String, &Plane)> = Vec::new();
    let mut layer = |layer: &str, components: &[String], planes: &'a [Plane]| {
        let dot = if layer.is_empty() { "" } else { "." };
        named.extend(components.iter().zip(planes).map(|(c, plane)| (format!("{layer}{dot}{c}"), plane)));
    };
    layer("", &rgb, frame.color());
    if let Some(variance) = frame.color_var_of_mean() {
        layer("variance", &rgb, variance);
    }
    if let Some([half, _]) = frame.halves() {
        layer("halfA", &rgb, half);
    }
    for feature in frame.features() {
        let names = components(feature.kind, feature.planes.len());
        layer(&feature.name, &names, &feature.planes);
        if let Some(variance) = &feature.var_of_mean {
            layer(&format!("{}Variance", feature.name), &names, variance);
        }
        if let Some([half, _]) = &feature.halves {
            layer(&format!("{}HalfA", feature.name), &names, half);
        }
    }
    let motion = frame.motion().map(|motion| (&motion.previous, &motion.next));
    for (name, planes) in motion.iter().flat_map(|(p, n)| [("motionPrevious", p), ("motionNext", n)]) {
        layer(name, &["X".to_owned(), "Y".to_owned()], planes.as_ref().map_or(&[], |planes| &planes[..]));
    }
    for aov in frame.aovs() {
        layer(&aov.name, &rgb, &aov.color);
    }
    for &(name, plane) in header.further {
        let ((w, h), (width, height)) = (plane.size(), frame.color()[0].size());
        if (w, h) != (width, height) {
            let what = format!("is {w}×{h} where the colour is {width}×{height}");
            return Err(Error::new(ErrorKind::Lacking, what)
                .in_channel(name)
                .remedy("give both the same size"));
        }
        named.push((name.to_owned(), plane));
    }
    checked(named)
}

fn checked(named: Vec<(String, &Plane)>) -> Result<Vec<(Text, &Plane)>> {
    let mut channels = Vec::with_capacity(named.len());
    for (name, plane) in named {
        let text = Text::new_or_none(&name).ok_or_else(|| {
            Error::new(ErrorKind::Usage, "is no name that EXR can hold: expected Latin-1")
                .in_channel(&name)
                .remedy("rename it")
        })?;
        channels.push((text, plane));
    }
    channels.sort_by(|a, b| a.0.as_slice().cmp(b.0.as_slice()));
    match channels.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        None => Ok(channels),
        Some(pair) => Err(Error::new(ErrorKind::Usage, "two channels have this name")
            .in_channel(pair[0].0.to_string())
            .remedy("rename the feature or AOV")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Feature;
    use crate::io::read_rgb;

    #[test]
    fn a_frame_is_read_back_and_a_second_name_is_refused() {
        let plane = |k: f32| Plane::from_fn(7, 21, move |x, y| k + x as f32 - 0.25 * y as f32);
        let normal = Feature::new("normal", FeatureKind::Normal, vec![plane(0.0), plane(1.0), plane(2.0)]);
        let color = [plane(1.0), plane(2.0), plane(3.0)];
        let frame = Frame::new(color.clone()).unwrap().with_feature(normal.clone()).unwrap().with_spp(16.0);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a b.exr");
        write_frame(&path, &frame, &FrameHeader { seed: Some(u64::MAX), ..FrameHeader::default() }).unwrap();
        assert_eq!(read_rgb(&path).unwrap(), color);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");

        let twice = frame.with_feature(normal).unwrap();
        let error = write_frame(&path, &twice, &FrameHeader::default()).unwrap_err();
        assert!(error.to_string().contains("normal.X"), "{error}");
        assert_eq!(read_rgb(&path).unwrap(), color, "the old file is unharmed");
    }
}
