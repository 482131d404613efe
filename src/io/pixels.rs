//! The pixels of a picture: planes by their channel, held or read band by band at every look.

use std::collections::{BTreeMap, BTreeSet};

use exr::meta::attribute::IntegerBounds;
use exr::meta::header::Header;
use exr::prelude::Vec2;
use rayon::prelude::*;

use super::decode::{ChannelAt, read_planes};
use super::document::Document;
use super::evidence::Tally;
use super::layers::Channel;
use super::roles::{Candidate, Choice};
use super::statistics::Statistics;
use super::sums::{Deviation, Differences};
use crate::error::Result;
use crate::image::{Plane, Rect};

/// Bytes of planes that are looked through at one time.
const BAND_BYTES: usize = 64 << 20;

/// Planes by their channel.
pub(super) type Held = BTreeMap<Channel, Plane>;

/// The pixels of a picture, held or read again at every look.
pub(super) struct Pixels<'a> {
    documents: &'a [Document],
    window: IntegerBounds,
    /// Rows of a block.
    lines: usize,
    pub(super) held: Option<Held>,
}

impl<'a> Pixels<'a> {
    /// Of the picture in this part of the first file, of which the channels `held` are held.
    pub(super) fn new(
        documents: &'a [Document],
        part: usize,
        held: Option<&BTreeSet<Channel>>,
    ) -> Result<Self> {
        let header = &documents[0].headers()[part];
        let window = header.data_window();
        let held = held.map(|channels| read(documents, channels, window)).transpose()?;
        Ok(Self { documents, window, lines: lines_of_block(header), held })
    }

    /// Shows all rows of `channels` to `look`, in order, in one portion or several.
    pub(super) fn look(&self, channels: &BTreeSet<Channel>, mut look: impl FnMut(&Held)) -> Result<()> {
        if let Some(held) = &self.held {
            look(held);
            return Ok(());
        }
        let size = (self.window.size.width(), self.window.size.height());
        for band in bands(size, bytes_of_row(self.window, channels.len()), self.lines) {
            look(&read(self.documents, channels, part_of(self.window, band))?);
        }
        Ok(())
    }

    /// What the candidates look like, and what the channels `wanted` come to.
    pub(super) fn seen(
        &self,
        color: &Candidate,
        candidates: &[Candidate],
        wanted: &BTreeSet<Channel>,
    ) -> Result<(Vec<Tally>, BTreeMap<Channel, Statistics>)> {
        let mut seen = vec![Tally::default(); candidates.len()];
        let mut statistics: BTreeMap<Channel, Statistics> =
            wanted.iter().map(|channel| (*channel, Statistics::default())).collect();
        self.look(wanted, |planes| {
            let of = |choice: &Choice| choice.channels.iter().map(|c| &planes[c]).collect::<Vec<_>>();
            for (seen, candidate) in seen.iter_mut().zip(candidates) {
                seen.add(candidate.evidence, &of(&candidate.mean), &of(&color.mean));
            }
            statistics.par_iter_mut().for_each(|(channel, statistics)| statistics.add(&planes[channel]));
        })?;
        Ok((seen, statistics))
    }

    /// How far the sum of `addends` is from `total`.
    pub(super) fn deviation(&self, total: [Channel; 3], addends: &[[Channel; 3]]) -> Result<Deviation> {
        let mut differences = Differences::default();
        self.look(&addends.iter().flatten().copied().chain(total).collect(), |planes| {
            let of = |channels: &[Channel; 3]| channels.map(|channel| &planes[&channel]);
            differences.add(of(&total), &addends.iter().map(of).collect::<Vec<_>>());
        })?;
        Ok(differences.deviation())
    }
}

/// Keeps up to `room` bytes of the decoded blocks of `documents`, the first ones first. Returns what is left of it.
pub(super) fn keep(documents: &[Document], room: usize) -> usize {
    documents.iter().fold(room, |room, document| document.keep(None, room))
}

/// Rows of a block of a part, but no more than the largest block of scan lines has: tiles may be of any height.
pub(super) fn lines_of_block(header: &Header) -> usize {
    const LINES: usize = 256;
    header.max_block_pixel_size().height().min(LINES)
}

/// Bytes of a row of so many planes.
pub(super) fn bytes_of_row(window: IntegerBounds, planes: usize) -> usize {
    window.size.width() * planes * size_of::<f32>()
}

/// A picture of `size` cut into bands of about [`BAND_BYTES`], a row of which takes `row` bytes: of whole rows of blocks
/// `lines` high, so that none is read for two bands.
pub(super) fn bands((width, height): (usize, usize), row: usize, lines: usize) -> impl Iterator<Item = Rect> {
    let rows = lines * (BAND_BYTES / (row * lines).max(1)).max(1);
    let band = move |y| Rect { x: 0, y, width, height: rows.min(height - y) };
    (0..height).step_by(rows).map(band)
}

/// The pixels `rect` of a picture with this data window, in the file's coordinates.
pub(super) fn part_of(window: IntegerBounds, rect: Rect) -> IntegerBounds {
    let along = |from: i32, offset: usize| (i64::from(from) + offset as i64) as i32; // inside the window
    let position = Vec2(along(window.position.x(), rect.x), along(window.position.y(), rect.y));
    IntegerBounds { position, size: Vec2(rect.width, rect.height) }
}

/// The planes of the channels that are `wanted`, under this `window`.
pub(super) fn read(
    documents: &[Document],
    wanted: &BTreeSet<Channel>,
    window: IntegerBounds,
) -> Result<Held> {
    let mut planes = BTreeMap::new();
    for (file, document) in documents.iter().enumerate() {
        let here: Vec<Channel> = wanted.iter().copied().filter(|channel| channel.file == file).collect();
        let places: Vec<ChannelAt> = here.iter().map(|channel| channel.at).collect();
        planes.extend(here.into_iter().zip(read_planes(document, &places, window)?));
    }
    Ok(planes)
}
