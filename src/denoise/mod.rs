//! The denoiser: the only place that knows the order of the stages.

mod basis;
mod coarse;
pub(crate) mod condition;
mod distances;
mod energy;
pub(crate) mod exposure;
pub(crate) mod facts;
pub(crate) mod fit;
pub(crate) mod gram;
mod guides;
mod nlm;
mod outlier;
pub(crate) mod part;
pub(crate) mod prefilter;
mod reconstruct;
mod restore;
mod risk;
mod samples;
pub(crate) mod sanitize;
mod signal;
mod solver;
mod surfaces;
mod temporal;
pub(crate) mod variance;
pub(crate) mod vectors;
mod warp;
pub(crate) mod weights;
pub(crate) mod window;

use crate::error::{Error, ErrorKind, Result};
use crate::frame::{Aov, Denoised, Feature, FeatureKind, Frame, Outline, Summary};
use crate::image::{Plane, Rect, Rgb, mean_of_channels};
use crate::options::Options;
use energy::Energy;
use facts::Known;
use outlier::Outlier;
use reconstruct::Area;
use sanitize::Clean;
use signal::{AsOne, Signal};
use solver::Beside;
use std::borrow::Cow;
use surfaces::Spread;
use temporal::Warped;

pub use facts::Facts;
pub use part::{Part, halo};
pub use temporal::Neighbours;

/// Albedo beyond this is none: what is divided by it and multiplied by it again keeps its order.
const LARGEST_ALBEDO: f32 = 100.0;

/// The stages of a run, in order, for progress and timing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// NaN, infinities and negative values.
    Sanitize,
    /// Fireflies are taken out.
    Outliers,
    /// Noisy features are filtered.
    Prefilter,
    /// The variance is estimated, where nothing tells it.
    Noise,
    /// All fits of the picture at half its resolution.
    Coarse,
    /// Fits of stage `n`, counted from 1.
    Fit(usize),
    /// What the fit lost is restored and the outliers' energy is given back.
    Energy,
}

/// Hears how a run goes on. The library itself never prints and reads no clock.
pub trait Observer: Sync {
    /// A stage begins.
    fn stage(&self, _stage: Stage) {}
    /// The share of the current stage that is done, 0 to 1; may be called from any thread.
    fn progress(&self, _done: f32) {}
}

/// Hears nothing.
pub struct Silent;

impl Observer for Silent {}

/// Denoises `frame`.
///
/// # Errors
/// When an option is out of its range.
pub fn denoise<'a>(frame: impl Into<Cow<'a, Frame>>, options: &Options) -> Result<Denoised> {
    denoise_observed(frame, options, &Silent)
}

/// Denoises `frame` and tells `observer` how it goes on.
///
/// # Errors
/// When an option is out of its range.
pub fn denoise_observed<'a>(
    frame: impl Into<Cow<'a, Frame>>,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Denoised> {
    denoise_in_sequence(frame, &Neighbours::default(), options, observer)
}

/// Denoises `frame` with the samples of the frames beside it.
///
/// # Errors
/// When an option is out of its range.
pub fn denoise_in_sequence<'a>(
    frame: impl Into<Cow<'a, Frame>>,
    neighbours: &Neighbours<'_>,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Denoised> {
    let frame = frame.into();
    let part = Part::whole((frame.width(), frame.height()));
    let facts = Facts::of(&frame);
    run(frame, neighbours, &part, &facts, options, observer)
}

/// Denoises the pixels [`Part::wanted`] of a picture of which `facts` are known; `frame` holds the pixels
/// [`Part::read`]. They get the very bits that they have when the picture is denoised as a whole.
///
/// # Errors
/// When an option is out of its range, or the frame is not of the part's size.
pub fn denoise_part<'a>(
    frame: impl Into<Cow<'a, Frame>>,
    part: &Part,
    facts: &Facts,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Denoised> {
    run(frame.into(), &Neighbours::default(), part, facts, options, observer)
}

fn run(
    frame: Cow<'_, Frame>,
    neighbours: &Neighbours<'_>,
    part: &Part,
    facts: &Facts,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Denoised> {
    options.check()?;
    part.check(&frame)?;
    let (wanted, outline) = (part.within(), frame.outline());
    let mut summary = Summary { method: "apr", ..Summary::default() };

    if !facts.has_noise() {
        observer.stage(Stage::Sanitize);
        let clean = sanitize::apply(frame, &facts.known(), facts.exposure(), wanted, &mut summary);
        summary.notes.push("nothing to do: the picture has no noise".into());
        return Ok(unchanged(outline, clean, wanted, summary));
    }
    let exposure = facts.exposure();
    let ready = prepare(frame, facts, &facts.known(), options, wanted, observer, &mut summary);
    let counted = |(o, _): &(&Outlier, _)| wanted.contains(o.x, o.y);
    summary.outliers = ready.outliers.iter().zip(&ready.taken[0]).filter(counted).count();
    summary.energy_moved = std::array::from_fn(|c| {
        let energy = ready.outliers.iter().zip(&ready.taken[c]).filter(counted).map(|(_, &e)| f64::from(e));
        energy.sum::<f64>() / f64::from(exposure)
    });
    // A frame beside is brought to this one's exposure and columns.
    let warped = temporal::warped(
        &outline,
        &ready,
        neighbours,
        options,
        |other| {
            let known = Facts::of(other).known();
            prepare(other.into(), facts, &known, options, wanted, &Silent, &mut Summary::default())
        },
        &mut summary,
    );
    let gains = options.outliers.enabled.then(|| energy(facts, &ready, part)).transpose()?;
    let gains = gains.map(|energy| energy.gains(options.outliers.witnesses));
    if let Some(share) = gains.as_ref().map(|gains| gains.share).filter(|share| *share < 1.0) {
        let given = format!("{:.0} % of their energy is given back", 100.0 * share);
        summary.notes.push(format!("outliers: too few to tell how much light is missing; {given}"));
    }
    let Ready { clean, variance, smoothed, design, spreads, albedo, .. } = ready;
    let mut signal = Signal {
        targets: targets(&clean).map(Cow::Borrowed).collect(),
        variance,
        smoothed,
        features: design.into_iter().map(|column| column.plane).collect(),
        spreads,
        albedo,
    };
    if facts.noise_is_estimated() {
        observer.stage(Stage::Noise);
        let all = Rect::whole(part.read.size());
        let area = Area { origin: part.origin(), wanted: all, counted: Rect::whole((0, 0)) };
        signal.look_again(area, options, observer);
    }
    let [areas, coarse_areas] = areas(part, options);

    let coarse = options.coarse.then(|| {
        observer.stage(Stage::Coarse);
        let all = AsOne::new(observer, options.stages.len());
        let options = &coarse::options(options);
        signal.halved(options.variance_radius).reconstruct(
            &[],
            &coarse_areas,
            options,
            &all,
            &mut Summary::default(),
        )
    });
    let beside: Vec<Beside<'_>> = warped.iter().map(Warped::samples).collect();
    let mut result = signal.reconstruct(&beside, &areas, options, observer, &mut summary);
    if let Some(coarse) = coarse {
        coarse::merge(&mut result, &coarse, options.dark_level);
    }

    observer.stage(Stage::Energy);
    if options.restore {
        restore_lost(&mut result, &clean, &signal);
    }
    if let Some(gains) = gains {
        let beauty = result.color();
        for (t, plane) in result.targets.iter_mut().enumerate() {
            gains.give_back(plane, &beauty[t % 3], t, part.origin());
        }
    }
    result.targets.iter_mut().for_each(|plane| exposure::expose(plane, exposure.recip()));
    exposure::unexpose_error(&mut result.mse, exposure);
    Ok(assemble(outline, result, wanted, summary))
}

/// A frame with everything that is known of it before the fits, exposed.
struct Ready<'a> {
    clean: Clean<'a>,
    /// Of the colour's mean.
    variance: Rgb,
    /// The same, smoothed.
    smoothed: Rgb,
    outliers: Vec<Outlier>,
    /// What was taken out of each target.
    taken: Vec<Vec<f32>>,
    design: Vec<Design>,
    spreads: Vec<Spread>,
    /// The albedo, its floor added.
    albedo: Option<Rgb>,
}

/// A feature plane of the design, filtered.
struct Design {
    kind: FeatureKind,
    plane: Plane,
}

/// A frame without what is broken and without outliers, exposed.
struct Repaired<'a> {
    clean: Clean<'a>,
    variance: Rgb,
    outliers: Vec<Outlier>,
    taken: Vec<Vec<f32>>,
}

/// The stages that look at single pixels.
fn repair<'a>(
    frame: Cow<'a, Frame>,
    exposure: f32,
    known: &Known,
    options: &Options,
    wanted: Rect,
    observer: &dyn Observer,
    summary: &mut Summary,
) -> Repaired<'a> {
    // Repair, and bring the picture to an exposure in which the method's constants are meant.
    observer.stage(Stage::Sanitize);
    let mut clean = sanitize::apply(frame, known, exposure, wanted, summary);
    expose(&mut clean, exposure);
    let given = clean.variance.is_some();
    let mut variance = variance::of_mean(&mut clean, summary);

    // Outliers go, their energy is kept (Moon et al. 2016).
    observer.stage(Stage::Outliers);
    let outliers = if options.outliers.enabled {
        outlier::find(&clean.color, given.then_some(&variance), clean.halves.as_ref(), options)
    } else {
        vec![]
    };
    clean.halves = None; // they have told all that they know, and are six planes
    variance.iter_mut().for_each(|plane| drop(outlier::replace(plane, &outliers)));
    let taken = targets_mut(&mut clean).map(|plane| outlier::replace(plane, &outliers)).collect();
    Repaired { clean, variance, outliers, taken }
}

impl Facts {
    /// Adds the energy of the outliers of the next rows, [`Part::wanted`] in their full width, of a picture all of
    /// whose rows were [added](Self::add) before; `frame` holds what [`Part::of_outliers`] has read.
    ///
    /// # Errors
    /// When an option is out of its range, or the frame is not of the part's size.
    pub fn add_outliers(&mut self, frame: &Frame, part: &Part, options: &Options) -> Result<()> {
        options.check()?;
        part.check(frame)?;
        let (known, nothing) = (self.known(), &mut Summary::default());
        let Repaired { clean, outliers, taken, .. } =
            repair(frame.into(), self.exposure(), &known, options, part.within(), &Silent, nothing);
        let energy = self.energy.get_or_insert_default();
        energy.add(&clean.color, &outliers, &taken, part.within(), part.wanted.y);
        Ok(())
    }
}

/// The energy of the picture's outliers, of which a whole picture needs no facts.
fn energy<'a>(facts: &'a Facts, ready: &Ready<'_>, part: &Part) -> Result<Cow<'a, Energy>> {
    if let Some(energy) = &facts.energy {
        return Ok(Cow::Borrowed(energy));
    }
    if !part.is_whole() {
        let what = "the outliers of the picture around the part are not known";
        return Err(Error::new(ErrorKind::Usage, what).remedy("give all rows to Facts::add_outliers first"));
    }
    let mut energy = Energy::default();
    energy.add(&ready.clean.color, &ready.outliers, &ready.taken, part.within(), part.wanted.y);
    Ok(Cow::Owned(energy))
}

/// All stages before the fits.
fn prepare<'a>(
    frame: Cow<'a, Frame>,
    facts: &Facts,
    known: &Known,
    options: &Options,
    wanted: Rect,
    observer: &dyn Observer,
    summary: &mut Summary,
) -> Ready<'a> {
    let Repaired { mut clean, variance, outliers, taken } =
        repair(frame, facts.exposure(), known, options, wanted, observer, summary);
    observer.stage(Stage::Prefilter);
    let features = std::mem::take(&mut clean.features);
    let (design, spreads, albedo) = design_features(features, facts, known, options, summary);
    let smoothed = std::array::from_fn(|c| variance::smooth(&variance[c], options.variance_radius));
    Ready { clean, variance, smoothed, outliers, taken, design, spreads, albedo }
}

/// Where every stage works so that the part is right, in the picture and in its blocks.
fn areas(part: &Part, options: &Options) -> [Vec<Area>; 2] {
    let (size, radius, stages) = (part.read.size(), options.window_radius, options.stages.len());
    let mut wanted = part.within();
    if options.restore {
        wanted = wanted.grown(restore::REACH, size);
    }
    if options.coarse {
        wanted = wanted.grown(coarse::REACH, size);
    }
    let blocks = part.read.blocks();
    let nowhere = Rect::whole((0, 0));
    let halved = Area { origin: (blocks.x, blocks.y), wanted: wanted.blocks(), counted: nowhere };
    let own = Area { origin: part.origin(), wanted, counted: part.within() };
    [own.of_stages(stages, size, radius), halved.of_stages(stages, blocks.size(), radius)]
}

/// Brings back the detail that the residual shows to be lost, in every target alike.
fn restore_lost(result: &mut reconstruct::Stage, clean: &Clean<'_>, signal: &Signal<'_>) {
    let variance = &signal.smoothed;
    let shares = restore::shares(&clean.color, &result.color(), &signal.variance, variance);
    for (plane, noisy) in result.targets.iter_mut().zip(targets(clean)) {
        restore::blend(plane, noisy, &shares);
    }
    restore::blend(&mut result.mse, &mean_of_channels(variance), &shares);
}

/// The feature planes of the design, filtered, those that are constant left out; and the albedo, its
/// floor added, that demodulated kernels divide by. The spreads tell which planes are of one feature.
fn design_features(
    features: Vec<Cow<'_, Feature>>,
    facts: &Facts,
    known: &Known,
    options: &Options,
    summary: &mut Summary,
) -> (Vec<Design>, Vec<Spread>, Option<Rgb>) {
    let (mut design, mut spreads, mut albedo) = (vec![], vec![], None);
    let (asked, others): (Vec<_>, Vec<_>) =
        features.into_iter().enumerate().partition(|(_, feature)| options.features.contains(&feature.kind));
    drop(others);
    for (f, feature) in asked {
        let (name, kind) = (feature.name.clone(), feature.kind);
        let filtered = prefilter::apply(feature, facts.feature_is_noisy(f), &options.prefilter);
        if let (FeatureKind::Albedo, [r, g, b]) = (kind, &filtered[..]) {
            let floored = |plane: &Plane| {
                Plane::par_from_fn(plane.width(), plane.height(), |x, y| {
                    plane.get(x, y).clamp(0.0, LARGEST_ALBEDO) + options.albedo_floor
                })
            };
            albedo.get_or_insert_with(|| [floored(r), floored(g), floored(b)]);
        }
        let mut spread = Spread { planes: 0, variance: 0.0, is_distance: kind == FeatureKind::Depth };
        for (i, plane) in filtered.into_iter().enumerate() {
            let name = format!("{name}.{i}");
            if facts.feature_is_constant(f, i) {
                let why = if known.features[f].planes[i] { "constant" } else { "a number at no pixel" };
                summary.notes.push(format!("feature {name}: left out, it is {why}"));
            } else {
                summary.columns.push(name);
                design.push(Design { kind, plane });
                spread.planes += 1;
                spread.variance += facts.feature_spread(f, i);
            }
        }
        if spread.planes > 0 {
            spreads.push(spread);
        }
    }
    (design, spreads, albedo)
}

/// The planes to reconstruct: the colour's, then every AOV's.
pub(crate) fn targets<'a>(clean: &'a Clean<'_>) -> impl Iterator<Item = &'a Plane> {
    clean.color.iter().chain(clean.aovs.iter().flatten())
}

fn targets_mut<'a>(clean: &'a mut Clean<'_>) -> impl Iterator<Item = &'a mut Plane> {
    clean.color.iter_mut().chain(clean.aovs.iter_mut().flatten())
}

pub(crate) fn expose(clean: &mut Clean<'_>, factor: f32) {
    targets_mut(clean).for_each(|plane| exposure::expose(plane, factor));
    for plane in clean.halves.iter_mut().flatten().flatten() {
        exposure::expose(plane, factor);
    }
    for plane in clean.variance.iter_mut().flatten() {
        exposure::expose_variance(plane, factor);
    }
}

fn unchanged(outline: Outline, clean: Clean<'_>, wanted: Rect, summary: Summary) -> Denoised {
    let none = || Plane::filled(wanted.width, wanted.height, 0.0);
    let cut = |color: Rgb| color.map(|plane| plane.into_part(wanted));
    Denoised {
        color: cut(clean.color),
        aovs: outline
            .aovs
            .into_iter()
            .zip(clean.aovs)
            .map(|(name, color)| Aov { name, color: cut(color) })
            .collect(),
        mse: none(),
        order: none(),
        sampling_priority: None,
        summary,
    }
}

fn assemble(outline: Outline, result: reconstruct::Stage, wanted: Rect, summary: Summary) -> Denoised {
    let mut planes = result.targets.into_iter().map(|plane| plane.into_part(wanted));
    let mut next =
        || -> Rgb { std::array::from_fn(|_| planes.next().expect("three planes for every picture")) };
    let color = next();
    let aovs = outline.aovs.into_iter().map(|name| Aov { name, color: next() }).collect();
    let [mse, order] = [result.mse, result.order].map(|plane| plane.into_part(wanted));
    Denoised { color, aovs, mse, order, sampling_priority: None, summary }
}
