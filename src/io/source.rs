//! A file, with those beside it, understood: which channels play which role, and their pixels on demand.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use exr::meta::attribute::IntegerBounds;

use super::assemble::{Given, Planes, Remarks, assemble};
use super::by_name::{Named, layers_of};
use super::channels::{Renderer, Role, UNSURE};
use super::components::{Asked, Sum};
use super::decode::ChannelAt;
use super::document::Document;
use super::doubts::{
    check_windows, leave_out_variances, note_bounds, note_buffers_beside, note_components, note_other_colors,
    note_windows, warn_of_broken, warn_of_darkness, warn_of_needless, warn_of_useless,
};
use super::layers::{Channel, Layer};
use super::layout::{FileLayout, Layout, RoleLayout};
use super::mapping::mapped_choices;
use super::names::told_name;
use super::picture::ReadOptions;
use super::pixels::{Held, Pixels, bands, bytes_of_row, keep, lines_of_block, part_of, read};
use super::places::is_same_file;
use super::recognize::samples_in;
use super::roles::{Candidate, Choice, color_of, has_variance, settle};
use super::siblings::buffers_beside;
use super::statistics::Statistics;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::Frame;
use crate::image::{Plane, Rect};

/// The most bytes of decoded blocks that are kept beside all planes until the result is written: a picture of 1920×1080
/// with 32 float channels. `[choice]` decoding them twice takes a twentieth of the fastest preset's time.
const KEPT_BYTES: usize = 256 << 20;

/// What is held of a picture from one look at it to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Hold {
    /// All planes.
    Planes,
    /// Up to so many bytes of blocks as they were decoded; what is not is read again.
    Blocks(usize),
}

/// A file and what is known of it as a whole.
#[derive(Debug)]
pub(super) struct Source {
    /// The first is the one that is written again.
    pub(super) documents: Vec<Document>,
    /// The channels that get the result.
    pub(super) beauty: Vec<ChannelAt>,
    /// The channels of each of the frame's AOVs.
    pub(super) aovs: Vec<Vec<ChannelAt>>,
    pub(super) sums: Vec<Sum>,
    /// The colour's data window.
    pub(super) window: IntegerBounds,
    pub(super) layout: Layout,
    choices: Vec<Choice>,
    statistics: BTreeMap<Channel, Statistics>,
    given: Given,
}

impl Source {
    /// Opens the file at `path` and looks at all its pixels. Returns the planes as well where `hold` says so.
    ///
    /// # Errors
    /// As [`Picture::read`](super::Picture::read).
    pub(super) fn open(path: &Path, options: &ReadOptions, hold: Hold) -> Result<(Self, Option<Held>)> {
        let documents = open_all(path, options)?;
        let layers = layers_of(&documents, options.profile);
        let mapped = mapped_choices(options, &documents, &layers)?;
        let named = Named::new(&documents, &layers, &mapped, options.profile)?;
        let Named { renderer, casting, color, beauty, .. } = &named;
        let renderer = *renderer;
        let part = beauty[0].at.part;
        match hold {
            Hold::Blocks(room) => {
                keep(&documents, room);
            }
            // Whoever wants motion vectors holds several pictures at once.
            Hold::Planes if !options.motion && documents[0].part_bytes(part) <= KEPT_BYTES => {
                documents[0].keep(Some(part), KEPT_BYTES);
            }
            Hold::Planes => {}
        }
        let mut candidates = casting.candidates(color);
        let is_motion = |found: &Candidate| matches!(found.mean.target.role, Role::Motion(_));
        let mut useful =
            files_of(candidates.iter().filter(|found| is_motion(found)).map(|found| &found.mean));
        candidates.retain(|found| options.motion || !is_motion(found));

        let color_part = color.mean.channels[0].at.part;
        let header = &documents[0].headers()[color_part];
        let window = header.data_window();
        let asked = named.components(&options.aovs)?;

        let wanted = wanted(color, &candidates, &asked);
        let pixels = Pixels::new(&documents, color_part, (hold == Hold::Planes).then_some(&wanted))?;
        let (seen, statistics) = pixels.seen(color, &candidates, &wanted)?;
        let mut cast = settle(color, &candidates, &seen);
        let sums = asked.settle(&mut cast, |total, addends| pixels.deviation(total, addends))?;
        let held = pixels.held;

        let mut remarks = Remarks { notes: cast.notes, ..Remarks::default() };
        check_windows(&documents, &cast.choices, window)?;
        useful.extend(files_of(cast.choices.iter()));
        warn_of_useless(&documents[..=options.with.len()], &useful, &mut remarks);
        warn_of_needless(options, &cast.choices, &mut remarks);
        leave_out_variances(&mut cast.choices, &documents, &statistics, &mut remarks);
        note_windows(&documents, &cast.choices, window, &mut remarks);
        note_bounds(&cast.choices, &statistics, &mut remarks);
        warn_of_broken(&cast.choices, &documents, &statistics, &mut remarks);
        warn_of_darkness(&cast.choices, &documents, &statistics, &mut remarks);
        if options.variance_kind.is_none() && has_variance(&cast.choices) {
            let unsure = UNSURE.iter().filter(|(wrote, _)| *wrote == renderer);
            remarks.warnings.extend(unsure.map(|(_, why)| (*why).to_owned()));
        }
        note_other_colors(&casting.other_colors(color), &mut remarks);
        remarks.notes.extend(Asked::note(&sums, &options.aovs));
        if options.aovs.is_empty() {
            let used: BTreeSet<Channel> =
                cast.choices.iter().flat_map(|choice| choice.channels.clone()).collect();
            note_components(&named.components(&["auto".to_owned()])?.automatic(&used), &mut remarks);
        }
        if renderer == Renderer::Plain {
            note_buffers_beside(path, &mut remarks);
        }
        let given = Given {
            kind: options.variance_kind,
            spp: options.spp.or_else(|| samples_in(header, color.around())),
        };
        let layout = Layout {
            files: documents.iter().map(FileLayout::of).collect(),
            renderer,
            forced: options.profile.is_some(),
            roles: cast.choices.iter().map(|choice| describe(choice, &documents, &statistics)).collect(),
            notes: remarks.notes,
            warnings: remarks.warnings,
            ..Layout::default()
        };
        let places = |channels: &[Channel]| channels.iter().map(|channel| channel.at).collect();
        let components = cast.choices.iter().filter(|choice| choice.target.role == Role::Aov);
        let aovs = components.map(|choice| places(&choice.channels)).collect();
        let (beauty, choices) = (places(beauty), cast.choices);
        let mut source = Self { documents, beauty, aovs, sums, window, layout, choices, statistics, given };
        source.note_variances()?;
        Ok((source, held))
    }

    /// Width and height.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.window.size.width(), self.window.size.height())
    }

    /// Where the colour's mean is, in the first file.
    pub(super) fn color(&self) -> impl Iterator<Item = ChannelAt> {
        color_of(&self.choices).iter().map(|channel| channel.at)
    }

    /// The picture in bands that are a small share of the memory.
    pub(super) fn bands(&self) -> impl Iterator<Item = Rect> {
        let planes = self.choices.iter().map(|choice| choice.channels.len()).sum();
        let header = &self.documents[0].headers()[self.beauty[0].part];
        bands(self.size(), bytes_of_row(self.window, planes), lines_of_block(header))
    }

    /// Bytes of the planes of the largest of these bands.
    pub(super) fn band_bytes(&self) -> usize {
        let planes: usize = self.choices.iter().map(|choice| choice.channels.len()).sum();
        let rows = self.bands().next().map_or(0, |band| band.height);
        rows * bytes_of_row(self.window, planes)
    }

    /// Keeps from now on up to `room` bytes of blocks as they are decoded. Returns what is left of `room`.
    pub(super) fn keep(&self, room: usize) -> usize {
        keep(&self.documents, room)
    }

    /// The planes of the channels that play a role under `rect`.
    ///
    /// # Errors
    /// `Unreadable` when a file is damaged.
    pub(super) fn planes(&self, rect: Rect) -> Result<Held> {
        let channels = self.choices.iter().flat_map(|choice| choice.channels.iter().copied()).collect();
        read(&self.documents, &channels, part_of(self.window, rect))
    }

    /// The frame of planes that [`Self::planes`] or [`Self::open`] gave, and the samples of each pixel.
    ///
    /// # Errors
    /// `Lacking` when the colour does not have one or three channels.
    pub(super) fn frame(&self, planes: Held) -> Result<(Frame, Option<Plane>)> {
        let mut remarks = Remarks::default(); // they were told when the file was opened
        let counts = self.choices.iter().find(|choice| choice.target.role == Role::SampleCount);
        let counts = counts.map(|choice| planes[&choice.channels[0]].clone());
        let planes = Planes::new(planes, &self.choices);
        let frame = assemble(&self.choices, planes, &self.statistics, self.given, &mut remarks)?;
        Ok((frame, counts))
    }

    /// Warns of variances that cannot be understood: one pixel tells.
    fn note_variances(&mut self) -> Result<()> {
        let channels = self.choices.iter().flat_map(|choice| &choice.channels);
        let planes = channels.map(|channel| (*channel, Plane::filled(1, 1, 0.0))).collect();
        let planes = Planes::new(planes, &self.choices);
        let mut remarks = Remarks::default();
        assemble(&self.choices, planes, &self.statistics, self.given, &mut remarks)?;
        let unsure = std::mem::take(&mut self.layout.warnings);
        self.layout.warnings = unsure.into_iter().chain(remarks.warnings).collect();
        Ok(())
    }
}

/// The channels that may be needed.
fn wanted(color: &Candidate, candidates: &[Candidate], components: &Asked) -> BTreeSet<Channel> {
    let all = candidates.iter().chain(std::iter::once(color));
    let choices = all.flat_map(|candidate| std::iter::once(&candidate.mean).chain(&candidate.companions));
    let channels = choices.flat_map(|choice| choice.channels.iter().copied());
    channels.chain(components.channels()).collect()
}

/// Opens the file, those given beside it, and those that lie beside it under the renderer's names.
pub(super) fn open_all(path: &Path, options: &ReadOptions) -> Result<Vec<Document>> {
    let mut documents = vec![Document::open(path)?];
    for further in &options.with {
        documents.push(Document::open(further)?);
    }
    if let Some(renderer) = options.profile.filter(|renderer| renderer.writes_one_file_per_buffer()) {
        let given = |file: &PathBuf| options.with.iter().any(|with| is_same_file(with, file));
        for sibling in buffers_beside(path, renderer).into_iter().filter(|file| !given(file)) {
            documents.push(Document::open(&sibling)?);
        }
    }
    Ok(documents)
}

/// `role` is what the user maps the colour by.
pub(super) fn no_color(layers: &[Layer], role: &str) -> Error {
    /// Enough to recognise the file, few enough for a message.
    const NAMED: usize = 12;
    let bare = layers.iter().filter(|layer| layer.name.is_empty()).flat_map(|layer| &layer.components);
    if bare.into_iter().any(|(component, _)| ["Y", "RY", "BY"].contains(&component.as_str())) {
        return Error::new(ErrorKind::Unreadable, "stores luminance (and chroma) where RGB was expected")
            .remedy(format!("convert it to RGB, or take the luminance alone by --map {role}=Y"));
    }
    let names: Vec<&str> = layers.iter().take(NAMED).map(|layer| layer.name.as_str()).collect();
    let more = if layers.len() > NAMED { ", …" } else { "" };
    Error::new(
        ErrorKind::Lacking,
        format!("no colour was found; the layers are '{}'{more}", names.join("', '")),
    )
    .remedy(format!("name it by --map {role}=LAYER"))
}

fn describe(
    choice: &Choice,
    documents: &[Document],
    statistics: &BTreeMap<Channel, Statistics>,
) -> RoleLayout {
    let names = choice.channels.iter().map(|&channel| {
        let name = told_name(documents, channel);
        match channel.file {
            0 => name,
            file => format!("{}:{name}", documents[file].path().display()),
        }
    });
    RoleLayout::new(choice, names.collect(), choice.channels.iter().map(|channel| &statistics[channel]))
}

/// The files that have channels of these `choices`.
fn files_of<'c>(choices: impl Iterator<Item = &'c Choice>) -> BTreeSet<usize> {
    choices.flat_map(|choice| &choice.channels).map(|channel| channel.file).collect()
}
