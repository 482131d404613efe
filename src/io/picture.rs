//! A render on disk: read into a frame, and written again with a new beauty.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use exr::meta::attribute::IntegerBounds;

use super::assemble::{Given, Planes, Remarks, assemble};
use super::channels::{Renderer, Role, Statistic, UNSURE, VarianceKind};
use super::components::{Asked, Sum};
use super::decode::{ChannelAt, read_planes};
use super::document::Document;
use super::halves::merge_halves;
use super::layers::{Channel, Layer, buffer_prefix};
use super::layout::{FileLayout, Layout, RoleLayout};
use super::mapping::{Mapping, find, target};
use super::recognize::{detect, layers, samples_in};
use super::rewrite::{Addition, Replacement, rewrite, signature_in};
use super::roles::{Candidate, Casting, Choice, has_variance, settle};
use super::siblings::{buffers_beside, is_buffer};
use super::sums::{Deviation, SumCheck};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{Denoised, Frame};
use crate::image::{Plane, Rgb};

/// How to understand a file.
#[derive(Debug, Clone, Default)]
pub struct ReadOptions {
    /// The renderer, where it is not to be guessed.
    pub profile: Option<Renderer>,
    /// Roles that the user assigns; they win over the channel map.
    pub map: Vec<Mapping>,
    /// Further features.
    pub features: Vec<Mapping>,
    /// What variance buffers hold, where the channel map does not know.
    pub variance_kind: Option<VarianceKind>,
    /// Samples per pixel, where the header lacks it.
    pub spp: Option<f32>,
    /// The same frame rendered with another seed.
    pub half: Option<PathBuf>,
    /// Files with further layers, whose bare channels form a layer of the file's name.
    pub with: Vec<PathBuf>,
    /// Components of the beauty that are to go through its operator: layers by name, with or without what
    /// is around them, `*` at the end for any end; `auto` for all sets of layers that are known to sum to
    /// the beauty.
    pub aovs: Vec<String>,
    /// Whether motion vectors are wanted: only sequences have a use for them.
    pub motion: bool,
}

/// A file as the denoiser sees it.
#[derive(Debug)]
pub struct Picture {
    /// The first is the one that is written again.
    documents: Vec<Document>,
    beauty: Vec<ChannelAt>,
    /// The channels of each of the frame's AOVs.
    aovs: Vec<Vec<ChannelAt>>,
    sums: Vec<Sum>,
    frame: Frame,
    /// Samples of each pixel, or shares of them.
    counts: Option<Plane>,
    layout: Layout,
    signature: Option<String>,
}

impl Picture {
    /// Reads the file at `path`.
    ///
    /// # Errors
    /// `Unreadable` when a file is missing, damaged, beyond the limits, or uses a feature that is not
    /// supported; `Lacking` when there is no colour or a mapped channel is not there; `Usage` when a
    /// mapping names no role.
    pub fn read(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        let mut picture = Self::read_one(path, options).map_err(|error| error.in_file(path))?;
        if let Some(half) = &options.half {
            let other = Self::read_one(half, options).map_err(|error| error.in_file(half))?;
            picture.frame =
                merge_halves(&picture.frame, &other.frame).map_err(|error| error.in_file(half))?;
            picture.counts = None; // they were those of one of the two
            picture.layout.half = Some(half.display().to_string());
        }
        picture.layout.complete(&picture.frame);
        picture.check_sums();
        Ok(picture)
    }

    /// What the denoiser gets.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// The samples of each pixel, where the file tells; in any unit (Cycles writes shares).
    pub fn sample_counts(&self) -> Option<&Plane> {
        self.counts.as_ref()
    }

    /// What was found.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Whether the components that ought to sum to the beauty do so, before and after.
    pub fn sums(&self, denoised: &Denoised) -> Vec<SumCheck> {
        let after = |sum: &Sum| {
            let addends: Vec<&Rgb> = sum.addends.iter().map(|&i| &denoised.aovs[i].color).collect();
            Deviation::of(&denoised.color, &addends)
        };
        let checks = self.layout.sums.iter().zip(&self.sums);
        checks.map(|(before, sum)| SumCheck { after: Some(after(sum)), ..before.clone() }).collect()
    }

    /// Has [`Self::write`] add the attribute `apr.settings` that says what the result was made by;
    /// [`signature`] reads it back. Keep to ASCII: what other letters become is not promised.
    pub fn sign(&mut self, signature: impl Into<String>) {
        self.signature = Some(signature.into());
    }

    /// Writes the file again with the denoised beauty and its components; with `aux` also the estimated error
    /// (`apr.mse.Y`) and the order chosen (`apr.order.Y`). Everything else passes through bit for
    /// bit. Returns what the user should know.
    ///
    /// # Errors
    /// `Unwritable` when the folder or the disk does not take it; `target` is then as it was.
    pub fn write(&self, target: impl AsRef<Path>, denoised: &Denoised, aux: bool) -> Result<Vec<String>> {
        if denoised.aovs.len() != self.aovs.len() {
            let what = format!(
                "the result has {} AOVs where the picture has {}",
                denoised.aovs.len(),
                self.aovs.len()
            );
            return Err(Error::new(ErrorKind::Usage, what).remedy("denoise the frame of this very picture"));
        }
        let components = self.aovs.iter().zip(&denoised.aovs).map(|(places, aov)| (places, &aov.color));
        let replacements: Vec<Replacement> = std::iter::once((&self.beauty, &denoised.color))
            .chain(components)
            .flat_map(|(places, rgb)| places.iter().zip(rgb).map(|(&at, plane)| Replacement { at, plane }))
            .collect();
        let mut additions = Vec::new();
        if aux {
            additions.push(Addition { name: "apr.mse.Y", plane: &denoised.mse });
            additions.push(Addition { name: "apr.order.Y", plane: &denoised.order });
        }
        rewrite(&self.documents[0], target.as_ref(), &replacements, &additions, self.signature.as_deref())
    }

    fn read_one(path: &Path, options: &ReadOptions) -> Result<Self> {
        let documents = open_all(path, options)?;
        let one_file_per_buffer = options.profile.filter(|renderer| renderer.writes_one_file_per_buffer());
        let layers = layers(&documents, one_file_per_buffer);
        let renderer = options.profile.unwrap_or_else(|| detect(&documents[0], &layers));
        let mapped = mapped_choices(options, &documents, &layers)?;
        let casting = Casting::new(&layers, renderer, &mapped);
        let color = casting.color().ok_or_else(|| no_color(&layers))?;
        let beauty = casting.beauty(&color);
        let mut candidates = casting.candidates(&color);
        candidates.retain(|found| options.motion || !matches!(found.mean.target.role, Role::Motion(_)));

        let window = documents[0].headers()[color.mean.channels[0].at.part].data_window();
        let writable = |channel: &Channel| documents[0].headers()[channel.at.part].data_window() == window;
        let components = |names: &[String]| Asked::find(names, &casting, renderer, &color, &beauty, writable);
        let asked = components(&options.aovs)?;
        let planes = read_all(&documents, &color, &candidates, &asked, window)?;
        let mut cast = settle(&color, &candidates, |channel| &planes[&channel]);
        let sums = asked.settle(&mut cast, |channel| &planes[&channel]);
        let roles = cast.choices.iter().map(|choice| describe(choice, &documents, &planes)).collect();
        let mut remarks = Remarks { notes: cast.notes, ..Remarks::default() };
        note_windows(&documents, &cast.choices, window, &mut remarks);
        if options.variance_kind.is_none() && has_variance(&cast.choices) {
            let unsure = UNSURE.iter().filter(|(wrote, _)| *wrote == renderer);
            remarks.warnings.extend(unsure.map(|(_, why)| (*why).to_owned()));
        }
        note_other_colors(&casting.other_colors(&color), &mut remarks);
        if options.aovs.is_empty() {
            note_components(&components(&["auto".to_owned()])?.automatic(), &mut remarks);
        }
        if renderer == Renderer::Plain {
            note_buffers_beside(path, &mut remarks);
        }
        let header = &documents[0].headers()[color.mean.channels[0].at.part];
        let given = Given { kind: options.variance_kind, spp: options.spp.or_else(|| samples_in(header)) };
        let counts = cast.choices.iter().find(|choice| choice.target.role == Role::SampleCount);
        let counts = counts.map(|choice| planes[&choice.channels[0]].clone());
        let frame = assemble(&cast.choices, Planes::new(planes, &cast.choices), given, &mut remarks)?;
        let layout = Layout {
            files: documents.iter().map(FileLayout::of).collect(),
            renderer,
            forced: options.profile.is_some(),
            roles,
            notes: remarks.notes,
            warnings: remarks.warnings,
            ..Layout::default()
        };
        let places = |channels: &[Channel]| channels.iter().map(|channel| channel.at).collect();
        let components = cast.choices.iter().filter(|choice| choice.target.role == Role::Aov);
        let aovs = components.map(|choice| places(&choice.channels)).collect();
        Ok(Self { beauty: places(&beauty), documents, aovs, sums, frame, counts, layout, signature: None })
    }

    /// How well the noisy components sum, for the layout.
    fn check_sums(&mut self) {
        for sum in &self.sums {
            let aovs = || sum.addends.iter().map(|&i| &self.frame.aovs()[i]);
            let addends: Vec<&Rgb> = aovs().map(|aov| &aov.color).collect();
            let before = Deviation::of(self.frame.color(), &addends);
            let layers: Vec<String> = aovs().map(|aov| aov.name.clone()).collect();
            if sum.by_itself && !before.is_small() {
                self.layout.warnings.push(format!(
                    "{}: '{}' do not sum to the beauty: the noisy ones already differ from it by {:.2} % (relative \
                     RMS); something that the beauty shows is in none of them (emission, background, lights \
                     without a group?) or in several",
                    sum.name,
                    layers.join("' + '"),
                    100.0 * before.relative_rms
                ));
            }
            self.layout.sums.push(SumCheck { set: sum.name.to_owned(), layers, before, after: None });
        }
    }
}

/// Opens the file, those given beside it, and those that lie beside it under the renderer's names.
fn open_all(path: &Path, options: &ReadOptions) -> Result<Vec<Document>> {
    let mut documents = vec![Document::open(path)?];
    for further in &options.with {
        documents.push(Document::open(further)?);
    }
    if let Some(renderer) = options.profile.filter(|renderer| renderer.writes_one_file_per_buffer()) {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let prefix = buffer_prefix(&name, renderer);
        for sibling in buffers_beside(path, &prefix, renderer) {
            documents.push(Document::open(&sibling)?);
        }
    }
    Ok(documents)
}

fn mapped_choices(options: &ReadOptions, documents: &[Document], layers: &[Layer]) -> Result<Vec<Choice>> {
    let further: Vec<String> = options.features.iter().map(|feature| feature.name.clone()).collect();
    let names = |channel| full_names(documents, channel);
    let mappings = options.map.iter().chain(&options.features);
    let choices = mappings.map(|mapping| {
        Ok(Choice { target: target(&mapping.name, &further)?, channels: find(mapping, layers, names)? })
    });
    let choices: Vec<Choice> = choices.collect::<Result<_>>()?;
    match choices.iter().find(|choice| {
        choice.target.role == Role::Color
            && choice.target.statistic == Statistic::Mean
            && choice
                .channels
                .iter()
                .any(|channel| channel.file != 0 || channel.at.part != choice.channels[0].at.part)
    }) {
        None => Ok(choices),
        Some(_) => Err(Error::new(ErrorKind::Usage, "the colour must lie in one part of the first file")
            .remedy("name the file that is to be written again first")),
    }
}

/// The names by which a channel may be called: its own, and with its part's in front.
fn full_names(documents: &[Document], channel: Channel) -> Vec<String> {
    let document = &documents[channel.file];
    let own = document.headers()[channel.at.part].channels.list[channel.at.channel].name.to_string();
    let with_part = document.part_name(channel.at.part).map(|part| format!("{part}.{own}"));
    std::iter::once(own).chain(with_part).collect()
}

fn no_color(layers: &[Layer]) -> Error {
    /// Enough to recognise the file, few enough for a message.
    const NAMED: usize = 12;
    let bare = layers.iter().filter(|layer| layer.name.is_empty()).flat_map(|layer| &layer.components);
    if bare.into_iter().any(|(component, _)| ["Y", "RY", "BY"].contains(&component.as_str())) {
        return Error::new(ErrorKind::Unreadable, "stores luminance (and chroma) where RGB was expected")
            .remedy("convert it to RGB, or denoise the luminance alone by --map color=Y");
    }
    let names: Vec<&str> = layers.iter().take(NAMED).map(|layer| layer.name.as_str()).collect();
    let more = if layers.len() > NAMED { ", …" } else { "" };
    Error::new(
        ErrorKind::Lacking,
        format!("no colour was found; the layers are '{}'{more}", names.join("', '")),
    )
    .remedy("name it by --map color=LAYER")
}

fn read_all(
    documents: &[Document],
    color: &Candidate,
    candidates: &[Candidate],
    components: &Asked,
    window: IntegerBounds,
) -> Result<BTreeMap<Channel, Plane>> {
    let choices = candidates
        .iter()
        .chain(std::iter::once(color))
        .flat_map(|candidate| std::iter::once(&candidate.mean).chain(&candidate.companions));
    let channels = choices.flat_map(|choice| choice.channels.iter().copied());
    let wanted: BTreeSet<Channel> = channels.chain(components.channels()).collect();
    let mut planes = BTreeMap::new();
    for (file, document) in documents.iter().enumerate() {
        let here: Vec<Channel> = wanted.iter().copied().filter(|channel| channel.file == file).collect();
        let places: Vec<ChannelAt> = here.iter().map(|channel| channel.at).collect();
        planes.extend(here.into_iter().zip(read_planes(document, &places, window)?));
    }
    Ok(planes)
}

fn describe(choice: &Choice, documents: &[Document], planes: &BTreeMap<Channel, Plane>) -> RoleLayout {
    let names = choice.channels.iter().map(|&channel| {
        let name = full_names(documents, channel).swap_remove(0);
        match channel.file {
            0 => name,
            file => format!("{}:{name}", documents[file].path().display()),
        }
    });
    RoleLayout::new(choice, names.collect(), choice.channels.iter().map(|channel| &planes[channel]))
}

/// Tells which roles come from a part whose pixels are not the colour's.
fn note_windows(documents: &[Document], choices: &[Choice], window: IntegerBounds, remarks: &mut Remarks) {
    for choice in choices {
        let other =
            |channel: &&Channel| documents[channel.file].headers()[channel.at.part].data_window() != window;
        if let Some(channel) = choice.channels.iter().find(other) {
            remarks.notes.push(format!(
                "{}: its data window is not the colour's; 0 stands where it does not reach",
                full_names(documents, *channel)[0]
            ));
        }
    }
}

fn note_components(found: &[String], remarks: &mut Remarks) {
    if !found.is_empty() {
        remarks.notes.push(format!(
            "'{}' pass through as they are; --aov auto denoises them with the beauty, so that they sum to it",
            found.join("', '")
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
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    for (profile, renderer) in Renderer::NAMES.iter().filter(|(_, r)| r.writes_one_file_per_buffer()) {
        let prefix = buffer_prefix(&name, *renderer);
        let is_color = name.len() > prefix.len() && is_buffer(&name[prefix.len()..], *renderer);
        if is_color && !buffers_beside(path, &prefix, *renderer).is_empty() {
            remarks
                .notes
                .push(format!("further buffers lie beside the file: --profile {profile} reads them"));
        }
    }
}

/// What the result at `path` was made by, if it was signed: see [`Picture::sign`]. Reads no pixels.
///
/// # Errors
/// `Unreadable` when it is missing or no EXR file.
pub fn signature(path: impl AsRef<Path>) -> Result<Option<String>> {
    let document = Document::open(path.as_ref())?;
    Ok(document.headers().iter().find_map(signature_in))
}

/// The colour of the file at `path`, for comparisons and references.
///
/// # Errors
/// As [`Picture::read`].
pub fn read_rgb(path: impl AsRef<Path>) -> Result<Rgb> {
    let path = path.as_ref();
    let read = || {
        let documents = [Document::open(path)?];
        let layers = layers(&documents, None);
        let renderer = detect(&documents[0], &layers);
        let casting = Casting::new(&layers, renderer, &[]);
        let color = casting.color().ok_or_else(|| no_color(&layers))?;
        let beauty = casting.beauty(&color);
        let window = documents[0].headers()[beauty[0].at.part].data_window();
        let places: Vec<ChannelAt> = beauty.iter().map(|channel| channel.at).collect();
        let planes = read_planes(&documents[0], &places, window)?;
        planes.try_into().map_err(|_| no_color(&layers))
    };
    read().map_err(|error: Error| error.in_file(path))
}
