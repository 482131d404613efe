//! Maps of sample counts, which a tracer takes: one whole number for each pixel.

use std::path::Path;

use super::decode::{ChannelAt, read_planes};
use super::document::Document;
use crate::error::{Error, ErrorKind, Result};

/// The channel that this project's own files keep their counts in.
const OWN: &str = "sampleCount.Y";

/// Where a picture of three equal channels has them.
const RED: &str = "R";

/// Most samples of one pixel: whole numbers up to it have no gaps in single precision.
const MOST: f32 = 16_777_216.0;

/// The samples of each pixel, row by row, from the map at `path` for a picture of `size`: its channel
/// `sampleCount.Y`, or its only channel, or `R`. Fractions are rounded.
///
/// # Errors
/// `Unreadable` when the file is missing or damaged; `Lacking` when it has none of these channels, is of
/// another size, holds what is no number from 0 to 2²⁴, or is 0 everywhere.
pub fn read_counts(path: impl AsRef<Path>, size: (usize, usize)) -> Result<Vec<u32>> {
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
        let plane = &read_planes(&document, &[at], window)?[0];
        let count = |(pixel, &value): (usize, &f32)| {
            if (0.0..=MOST).contains(&value) {
                return Ok(value.round() as u32);
            }
            let (x, y) = (pixel % size.0, pixel / size.0);
            let what = format!("{value} samples in column {x} of row {y}, both counted from 0");
            let error = Error::new(ErrorKind::Lacking, what).in_channel(&name);
            Err(error.remedy("give every pixel a number from 0 to 16777216"))
        };
        let counts = plane.data().iter().enumerate().map(count).collect::<Result<Vec<u32>>>()?;
        if counts.iter().all(|&n| n == 0) {
            let error = Error::new(ErrorKind::Lacking, "the map gives no pixel a sample").in_channel(&name);
            return Err(error.remedy("give samples to some pixel"));
        }
        Ok(counts)
    };
    read().map_err(|error: Error| error.in_file(path))
}

/// The channel that holds the counts, and its name.
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
    named(OWN).or(only).or_else(|| named(RED)).cloned().ok_or_else(|| {
        /// Enough to recognise the file, few enough for a message.
        const NAMED: usize = 12;
        let names: Vec<&str> = all.iter().take(NAMED).map(|(_, name)| name.as_str()).collect();
        let what = format!("which channel holds the samples of each pixel? It has {}", names.join(", "));
        Error::new(ErrorKind::Lacking, what).remedy(format!("name that one {OWN}, or give it alone"))
    })
}
