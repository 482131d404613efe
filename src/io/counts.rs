//! Maps of samples, which a tracer takes: a whole number for each pixel, or the density of a pass that is to come.

use std::path::Path;

use super::decode::{ChannelAt, read_planes};
use super::document::Document;
use crate::error::{Error, ErrorKind, Result};
use crate::image::Plane;

/// The channel of a density of samples: 1 on the average, to be multiplied by the samples per pixel of the pass.
pub const DENSITY: &str = "density.Y";

/// The channel that this project's own files keep their counts in.
const OWN: &str = "sampleCount.Y";

/// Where a picture of three equal channels has them.
const RED: &str = "R";

/// Most samples of one pixel: whole numbers up to it have no gaps in single precision.
const MOST: f32 = 16_777_216.0;

/// What a map asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum SampleMap {
    /// So many samples of each pixel, row by row.
    Counts(Vec<u32>),
    /// So many times the samples per pixel of the pass.
    Density(Plane),
}

/// The map of samples at `path` for a picture of `size`: the channel `sampleCount.Y`, or `density.Y`, or its only one,
/// or `R`. Only the second holds a density. Fractions of counts are rounded.
///
/// # Errors
/// `Unreadable` when the file is missing or damaged; `Lacking` when it has none of these channels, is of
/// another size, holds what is no number from 0 to 2²⁴, or is 0 everywhere.
pub fn read_sample_map(path: impl AsRef<Path>, size: (usize, usize)) -> Result<SampleMap> {
    let path = path.as_ref();
    let read = || {
        let document = Document::open(path)?;
        let (at, name) = channel(&document)?;
        let window = document.headers()[at.part].data_window();
        let found = (window.size.width(), window.size.height());
        if found != size {
            let ((w, h), (width, height)) = (found, size);
            let what = format!("the map is {w}×{h} where the picture is {width}×{height}");
            return Err(Error::new(ErrorKind::Lacking, what).remedy("make it of the picture's size"));
        }
        let plane = read_planes(&document, &[at], window)?.swap_remove(0);
        let lacking = |what: String| Error::new(ErrorKind::Lacking, what).in_channel(&name);
        let values = plane.data();
        if let Some(pixel) = values.iter().position(|value| !(0.0..=MOST).contains(value)) {
            let (x, y, value) = (pixel % size.0, pixel / size.0, values[pixel]);
            let what = format!("{value} samples in column {x} of row {y}, both counted from 0");
            return Err(lacking(what).remedy("give every pixel a number from 0 to 16777216"));
        }
        let (map, asks, remedy) = if name == DENSITY {
            let asks = values.iter().any(|&density| density > 0.0);
            let met = "no pass is needed where apr-denoise wrote it: the target is met";
            (SampleMap::Density(plane), asks, met)
        } else {
            let counts: Vec<u32> = values.iter().map(|value| value.round() as u32).collect();
            let asks = counts.iter().any(|&n| n > 0);
            (SampleMap::Counts(counts), asks, "give samples to some pixel")
        };
        if asks { Ok(map) } else { Err(lacking("the map gives no pixel a sample".to_owned()).remedy(remedy)) }
    };
    read().map_err(|error: Error| error.in_file(path))
}

/// The channel that holds the map, and its name.
fn channel(document: &Document) -> Result<(ChannelAt, String)> {
    let parts = document.headers().iter().enumerate();
    let all: Vec<(ChannelAt, String)> = parts
        .flat_map(|(part, header)| {
            let named = header.channels.list.iter().enumerate();
            named.map(move |(channel, told)| (ChannelAt { part, channel }, told.name.to_string()))
        })
        .collect();
    let named = |wanted: &str| all.iter().find(|(_, name)| name == wanted);
    let only = all.first().filter(|_| all.len() == 1);
    named(OWN).or_else(|| named(DENSITY)).or(only).or_else(|| named(RED)).cloned().ok_or_else(|| {
        /// Enough to recognise the file, few enough for a message.
        const NAMED: usize = 12;
        let names: Vec<&str> = all.iter().take(NAMED).map(|(_, name)| name.as_str()).collect();
        let what = format!("which channel holds the samples of each pixel? It has {}", names.join(", "));
        Error::new(ErrorKind::Lacking, what).remedy(format!("name that one {OWN}, or give it alone"))
    })
}
