//! A file, with those beside it, understood: which channels play which role, and their pixels on demand.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use exr::meta::attribute::IntegerBounds;
use exr::meta::header::Header;
use exr::prelude::Vec2;
use rayon::prelude::*;

use super::assemble::{Given, Planes, Remarks, assemble};
use super::bounds;
use super::channels::{Renderer, Role, Statistic, UNSURE, VarianceKind};
use super::components::{Asked, Sum};
use super::decode::{ChannelAt, read_planes};
use super::document::Document;
use super::evidence::Tally;
use super::layers::{Channel, Layer, buffer_prefix, stem};
use super::layout::{FileLayout, Layout, RoleLayout};
use super::mapping::{Mapping, Target, find, target};
use super::named::Named;
use super::picture::ReadOptions;
use super::places::is_same_file;
use super::recognize::{layers, samples_in};
use super::region::{numbers, told};
use super::roles::{Candidate, Choice, has_variance, settle};
use super::siblings::{buffers_beside, is_buffer};
use super::statistics::Statistics;
use super::sums::{Deviation, Differences};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{FeatureKind, Frame};
use crate::image::{Plane, Rect};

/// Bytes of planes that are looked through at one time.
const BAND_BYTES: usize = 64 << 20;

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

/// Planes by their channel.
pub(super) type Held = BTreeMap<Channel, Plane>;

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

/// The pixels of a picture, held or read again at every look.
struct Pixels<'a> {
    documents: &'a [Document],
    window: IntegerBounds,
    /// Rows of a block.
    lines: usize,
    held: Option<Held>,
}

impl<'a> Pixels<'a> {
    /// Of the picture in this part of the first file, of which the channels `held` are held.
    fn new(documents: &'a [Document], part: usize, held: Option<&BTreeSet<Channel>>) -> Result<Self> {
        let header = &documents[0].headers()[part];
        let window = header.data_window();
        let held = held.map(|channels| read(documents, channels, window)).transpose()?;
        Ok(Self { documents, window, lines: lines_of_block(header), held })
    }

    /// Shows all rows of `channels` to `look`, in order, in one portion or several.
    fn look(&self, channels: &BTreeSet<Channel>, mut look: impl FnMut(&Held)) -> Result<()> {
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
    fn seen(
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
    fn deviation(&self, total: [Channel; 3], addends: &[[Channel; 3]]) -> Result<Deviation> {
        let mut differences = Differences::default();
        self.look(&addends.iter().flatten().copied().chain(total).collect(), |planes| {
            let of = |channels: &[Channel; 3]| channels.map(|channel| &planes[&channel]);
            differences.add(of(&total), &addends.iter().map(of).collect::<Vec<_>>());
        })?;
        Ok(differences.deviation())
    }
}

/// Keeps up to `room` bytes of the decoded blocks of `documents`, the first ones first. Returns what is left of it.
fn keep(documents: &[Document], room: usize) -> usize {
    documents.iter().fold(room, |room, document| document.keep(None, room))
}

/// Rows of a block of a part, but no more than the largest block of scan lines has: tiles may be of any height.
pub(super) fn lines_of_block(header: &Header) -> usize {
    const LINES: usize = 256;
    header.max_block_pixel_size().height().min(LINES)
}

/// Bytes of a row of so many planes.
fn bytes_of_row(window: IntegerBounds, planes: usize) -> usize {
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

fn read(documents: &[Document], wanted: &BTreeSet<Channel>, window: IntegerBounds) -> Result<Held> {
    let mut planes = BTreeMap::new();
    for (file, document) in documents.iter().enumerate() {
        let here: Vec<Channel> = wanted.iter().copied().filter(|channel| channel.file == file).collect();
        let places: Vec<ChannelAt> = here.iter().map(|channel| channel.at).collect();
        planes.extend(here.into_iter().zip(read_planes(document, &places, window)?));
    }
    Ok(planes)
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

/// The layers of these files, of a renderer that may be given.
pub(super) fn layers_of(documents: &[Document], profile: Option<Renderer>) -> Vec<Layer> {
    layers(documents, profile.filter(|renderer| renderer.writes_one_file_per_buffer()))
}

pub(super) fn mapped_choices(
    options: &ReadOptions,
    documents: &[Document],
    layers: &[Layer],
) -> Result<Vec<Choice>> {
    let further: Vec<String> = options.features.iter().map(|feature| feature.name.clone()).collect();
    let mappings = options.map.iter().chain(&options.features);
    let mut choices: Vec<Choice> = Vec::new();
    for mapping in mappings {
        let target = target(&mapping.name, &further)?;
        if choices.iter().any(|choice| choice.target.excludes(&target)) {
            return Err(Error::new(ErrorKind::Usage, format!("'{}' is mapped twice", mapping.name))
                .remedy("give every role once"));
        }
        choices.push(mapped_choice(mapping, target, documents, layers)?);
    }
    Ok(choices)
}

/// What `mapping` gives the role that it means by its name.
pub(super) fn mapped_choice(
    mapping: &Mapping,
    target: Target,
    documents: &[Document],
    layers: &[Layer],
) -> Result<Choice> {
    let names = |channel| full_names(documents, channel);
    let part = |channel: Channel| documents[channel.file].part_name(channel.at.part);
    let channels = find(mapping, layers, names, part)?;
    check_color(mapping, &target, channels.len())?;
    let is_color = target.role == Role::Color && target.statistic == Statistic::Mean;
    let elsewhere = |channel: &Channel| channel.file != 0 || channel.at.part != channels[0].at.part;
    if is_color && channels.iter().any(elsewhere) {
        return Err(Error::new(ErrorKind::Usage, "the colour must lie in one part of the first file")
            .remedy("name the file that is to be written again first"));
    }
    Ok(Choice { target, channels })
}

/// Refuses colours of two channels, and of more than three.
fn check_color(mapping: &Mapping, target: &Target, count: usize) -> Result<()> {
    let is_color = matches!(target.role, Role::Color | Role::Feature(FeatureKind::Albedo));
    if !is_color || matches!(count, 0 | 1 | 3) {
        return Ok(());
    }
    let what = format!("'{}' is mapped to {count} channels where 3 (or 1) were expected", mapping.name);
    Err(Error::new(ErrorKind::Lacking, what).remedy(format!("name them by --map {}=R,G,B", mapping.name)))
}

/// The names by which a channel may be called: its own, and with its part's in front.
fn full_names(documents: &[Document], channel: Channel) -> Vec<String> {
    let document = &documents[channel.file];
    let own = document.headers()[channel.at.part].channels.list[channel.at.channel].name.to_string();
    let with_part = document.part_name(channel.at.part).map(|part| format!("{part}.{own}"));
    std::iter::once(own).chain(with_part).collect()
}

/// The name that tells a channel from all others of its file: where it has several parts, with its part's.
pub(super) fn told_name(documents: &[Document], channel: Channel) -> String {
    let parts = documents[channel.file].headers().len();
    let mut names = full_names(documents, channel);
    let part = documents[channel.file].part_name(channel.at.part).unwrap_or_default();
    let has_it = names[0].strip_prefix(part.as_str()).is_some_and(|rest| rest.starts_with('.'));
    if parts > 1 && !has_it { names.pop().unwrap_or_default() } else { names.swap_remove(0) }
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

fn note_bounds(choices: &[Choice], statistics: &BTreeMap<Channel, Statistics>, remarks: &mut Remarks) {
    for choice in choices.iter().filter(|choice| choice.target.statistic == Statistic::Mean) {
        let Role::Feature(kind) = choice.target.role else { continue };
        let statistics: Vec<Statistics> = choice.channels.iter().map(|channel| statistics[channel]).collect();
        remarks.notes.extend(bounds::told(&choice.target.feature, kind, &statistics));
    }
}

/// Names the channels that say nothing. Infinite depths and positions are misses and say something.
fn warn_of_broken(
    choices: &[Choice],
    documents: &[Document],
    statistics: &BTreeMap<Channel, Statistics>,
    remarks: &mut Remarks,
) {
    let misses = |choice: &Choice| {
        matches!(choice.target.role, Role::Feature(FeatureKind::Depth | FeatureKind::Position))
            && matches!(choice.target.statistic, Statistic::Mean | Statistic::HalfA | Statistic::HalfB)
    };
    let mut broken = BTreeSet::new();
    for choice in choices {
        let says_nothing = |channel: &&Channel| {
            let statistics = &statistics[channel];
            statistics.range().is_none() && !(misses(choice) && statistics.misses > 0)
        };
        broken.extend(choice.channels.iter().filter(says_nothing));
    }
    if broken.is_empty() {
        return;
    }
    let names: Vec<String> = broken.iter().map(|channel| told_name(documents, *channel)).collect();
    remarks.warnings.push(format!(
        "{}: NaN or infinite at every pixel; a channel of the colour or a component becomes black, all else is \
         done without",
        names.join(", ")
    ));
}

/// A wrong layer that is taken for the colour looks like this; so does a black frame.
fn warn_of_darkness(
    choices: &[Choice],
    documents: &[Document],
    statistics: &BTreeMap<Channel, Statistics>,
    remarks: &mut Remarks,
) {
    let color = color_of(choices);
    let ranges: Option<Vec<_>> = color.iter().map(|channel| statistics[channel].range()).collect();
    if ranges.is_none_or(|ranges| ranges.iter().any(|(_, most)| *most > 0.0)) {
        return;
    }
    let names: Vec<String> = color.iter().map(|channel| told_name(documents, *channel)).collect();
    remarks.warnings.push(format!(
        "{}: nowhere above 0, and taken for the colour: if the picture is not black, name its channels by --map color=…",
        names.join(", ")
    ));
}

/// The channels of the colour's mean, which every picture has.
fn color_of(choices: &[Choice]) -> &[Channel] {
    let is_mean = |c: &&Choice| c.target.role == Role::Color && c.target.statistic == Statistic::Mean;
    choices.iter().find(is_mean).map_or(&[], |choice| &choice.channels)
}

/// The files that have channels of these `choices`.
fn files_of<'c>(choices: impl Iterator<Item = &'c Choice>) -> BTreeSet<usize> {
    choices.flat_map(|choice| &choice.channels).map(|channel| channel.file).collect()
}

/// Names the further files of which nothing is used; `documents` are those and the first.
fn warn_of_useless(documents: &[Document], useful: &BTreeSet<usize>, remarks: &mut Remarks) {
    for (_, document) in documents.iter().enumerate().skip(1).filter(|(file, _)| !useful.contains(file)) {
        remarks.warnings.push(format!(
            "{}: none of its layers plays a role; give it one by --map, or leave the file out of --with",
            document.path().display()
        ));
    }
}

/// Refuses a further file that leaves pixels of the colour without a value: 0 would pass for one.
fn check_windows(documents: &[Document], choices: &[Choice], window: IntegerBounds) -> Result<()> {
    let channels = choices.iter().flat_map(|choice| &choice.channels).filter(|channel| channel.file > 0);
    for channel in channels {
        let other = documents[channel.file].headers()[channel.at.part].data_window();
        if !covers(other, window) {
            let [other, window] = [other, window].map(told);
            let what = format!("its data window {other} does not cover that of the picture, {window}");
            return Err(Error::new(ErrorKind::Lacking, what)
                .remedy("give a file of the same frame and region")
                .in_channel(full_names(documents, *channel).swap_remove(0))
                .in_file(documents[channel.file].path()));
        }
    }
    Ok(())
}

/// Whether `outer` has all pixels of `inner`.
fn covers(outer: IntegerBounds, inner: IntegerBounds) -> bool {
    let ([x, y, width, height], [ix, iy, inner_width, inner_height]) = (numbers(outer), numbers(inner));
    x <= ix && y <= iy && x + width >= ix + inner_width && y + height >= iy + inner_height
}

/// Does without variances that say nothing, and names them: those of which no value can be one, and the colour's
/// where it is 0 at every pixel though the picture is not the same everywhere. That a renderer writes who was not
/// asked for one; believed, it would keep all noise.
fn leave_out_variances(
    choices: &mut Vec<Choice>,
    documents: &[Document],
    statistics: &BTreeMap<Channel, Statistics>,
    remarks: &mut Remarks,
) {
    let range = |channel: &Channel| statistics[channel].range();
    let varies = color_of(choices).iter().filter_map(range).any(|(least, most)| least < most);
    let says_nothing = |choice: &Choice| {
        let most = || choice.channels.iter().filter_map(range).map(|(_, most)| most);
        let is_variance = matches!(choice.target.statistic, Statistic::Variance(_));
        let all_zero = choice.target.role == Role::Color && varies && most().all(|most| most <= 0.0);
        is_variance && (most().any(|most| most < 0.0) || (all_zero && most().next().is_some()))
    };
    let (left_out, kept): (Vec<_>, _) = std::mem::take(choices).into_iter().partition(says_nothing);
    *choices = kept;
    for choice in left_out {
        let negative = choice.channels.iter().filter_map(range).any(|(_, most)| most < 0.0);
        let mut names: Vec<String> =
            choice.channels.iter().map(|channel| told_name(documents, *channel)).collect();
        names.dedup();
        let why =
            if negative { "below 0 at every pixel" } else { "0 at every pixel though the colour varies" };
        let names = names.join(", ");
        remarks.warnings.push(format!("{names}: {why}: no variance, it is done without"));
    }
}

/// Tells which roles come from a part whose pixels are not the colour's.
fn note_windows(documents: &[Document], choices: &[Choice], window: IntegerBounds, remarks: &mut Remarks) {
    for choice in choices {
        let other =
            |channel: &&Channel| documents[channel.file].headers()[channel.at.part].data_window() != window;
        if let Some(channel) = choice.channels.iter().find(other) {
            remarks.notes.push(format!(
                "{}: its data window is not the colour's; 0 stands where it does not reach",
                told_name(documents, *channel)
            ));
        }
    }
}

/// Tells of what the user says about variances where there is none to say it of.
fn warn_of_needless(options: &ReadOptions, choices: &[Choice], remarks: &mut Remarks) {
    let has = |is: fn(&Statistic) -> bool| choices.iter().any(|choice| is(&choice.target.statistic));
    let variances = has(|statistic| matches!(statistic, Statistic::Variance(_)));
    let needless = match options.variance_kind {
        None => false,
        Some(VarianceKind::Halves) => {
            !has(|it| matches!(it, Statistic::HalfA | Statistic::HalfB)) && options.half.is_none()
        }
        Some(_) => !variances,
    };
    if needless {
        remarks.warnings.push(
            "--variance-kind is of no use: nothing that it could be said of was found; name it by --map variance=… or \
             --map halfA=…"
                .to_owned(),
        );
    }
    if options.spp.is_some() && !variances {
        remarks
            .notes
            .push("--spp changes no variance: none was found; name it by --map variance=…".to_owned());
    }
}

fn note_components(found: &[String], remarks: &mut Remarks) {
    if !found.is_empty() {
        let mut told = BTreeSet::new(); // one may be of several sums
        let names: Vec<&str> = found.iter().map(String::as_str).filter(|name| told.insert(*name)).collect();
        remarks.notes.push(format!(
            "passing through as they are: '{}'; --aov auto denoises them with the beauty, so that what sums to it still does",
            names.join("', '")
        ));
    }
}

fn note_other_colors(others: &[String], remarks: &mut Remarks) {
    if !others.is_empty() {
        remarks.notes.push(format!(
            "'{}' could be the colour as well and passes through; choose it by --map color=…",
            others.join("', '")
        ));
    }
}

/// A renderer that writes one file per buffer leaves no mark, but its other files may lie there.
fn note_buffers_beside(path: &Path, remarks: &mut Remarks) {
    let (name, _) = stem(path);
    for (profile, renderer) in Renderer::NAMES.iter().filter(|(_, r)| r.writes_one_file_per_buffer()) {
        let prefix = buffer_prefix(&name, *renderer);
        let is_color = name.len() > prefix.len() && is_buffer(&name[prefix.len()..], *renderer);
        if is_color && !buffers_beside(path, *renderer).is_empty() {
            remarks
                .notes
                .push(format!("further buffers lie beside the file: --profile {profile} reads them"));
        }
    }
}
