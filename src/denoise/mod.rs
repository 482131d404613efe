//! The denoiser: the only place that knows the order of the stages.

mod amounts;
mod basis;
mod coarse;
pub(crate) mod condition;
mod confidence;
mod design;
mod distances;
mod energy;
pub(crate) mod exposure;
pub(crate) mod facts;
pub(crate) mod fit;
mod forgiveness;
mod gains;
pub(crate) mod gram;
mod guides;
mod nlm;
mod observer;
mod outlier;
pub(crate) mod part;
pub(crate) mod prefilter;
mod prepare;
mod pursuit;
mod reconstruct;
mod reconstruction;
mod restore;
mod risk;
mod samples;
pub(crate) mod sanitize;
mod signal;
mod solver;
mod sums;
mod surfaces;
mod temporal;
mod tiles;
pub(crate) mod variance;
pub(crate) mod vectors;
mod warp;
pub(crate) mod weights;
pub(crate) mod window;

use crate::error::Result;
use crate::frame::{Aov, Denoised, Frame, Outline};
use crate::image::{Rect, Rgb};
use crate::options::Options;
use observer::{AsStage, Log};
use prepare::{Prepared, prepare};
use reconstruction::Reconstruction;
use sanitize::Clean;
use signal::{Asked, Fits, Signal};
use std::borrow::Cow;
use temporal::Warped;
use tiles::Area;

pub use facts::Facts;
pub use observer::{Observer, Silent, Stage};
pub use part::{Part, halo};
pub use temporal::Neighbours;

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
/// When an option is out of its range, or the observer stops the run.
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
/// As [`denoise_observed`].
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
/// As [`denoise_observed`]; when the frame is not of the part's size, or the facts are of another picture.
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
    facts.check(&frame, part)?;
    let (log, outline) = (&mut Log::new(observer, options), frame.outline());
    if !facts.has_noise() {
        log.begin(Stage::Sanitize)?;
        let clean = sanitize::apply(frame, &facts.known(), facts.exposure(), part.within(), &mut log.summary);
        log.note("nothing to do: the picture has no noise");
        return Ok(unchanged(outline, clean, part, log));
    }
    let ready = prepare(frame, facts, facts, part, options, log)?;
    let gains = gains::find(facts, &ready, part, options, log)?;
    let beside = temporal::warped(&outline, &ready, neighbours, facts, options, log)?;
    let Prepared { signal, .. } = ready;

    let [areas, coarse_areas] = areas(part, options);
    let mut coarse = None;
    if options.coarse {
        log.begin(Stage::Coarse)?;
        let options = &coarse::options(options);
        let as_stage = AsStage(log);
        let log = &mut Log::new(&as_stage, options);
        coarse = Some(fits(&signal.halved(options), vec![], &coarse_areas, options, log)?);
    }
    let mut result = fits(&signal, beside, &areas, options, log)?;
    if let Some(coarse) = coarse {
        coarse::merge(&mut result, &coarse, options.dark_level);
    }

    log.begin(Stage::Energy)?;
    confidence::estimate(&mut result, signal.design.albedo_noise.as_ref(), options.dark_level);
    if options.restore {
        restore::apply(&mut result, &signal, !facts.noise_is_estimated());
    }
    if let Some(gains) = gains {
        gains.give_back(&mut result.targets, part.origin());
    }
    result.unexpose(facts.exposure());
    Ok(assemble(outline, result, part, log))
}

/// All stages of fits: at first the noisy colour stands for the true one, then what the stage before has found
/// (Moon et al. 2016).
fn fits(
    signal: &Signal,
    beside: Vec<Warped>,
    areas: &[Area],
    options: &Options,
    log: &mut Log<'_>,
) -> Result<Reconstruction> {
    let mut fits = Fits::new(signal, beside, options);
    let mut result: Option<Reconstruction> = None;
    for (n, (kernels, area)) in options.stages.iter().zip(areas).enumerate() {
        log.begin(Stage::Fit(n + 1))?;
        let last = n + 1 == options.stages.len();
        let asked = Asked {
            kernels,
            bandwidths: if last { &options.bandwidths } else { &[1.0] },
            coverage: options.min_coverage * if last { 1.0 } else { options.pilot_coverage },
            area: *area,
            targets: if last { signal.targets.len() } else { 3 }, // AOVs go through the last operator alone
            last,
        };
        result = Some(fits.stage(&asked, result.map(Reconstruction::into_pilot), log)?);
    }
    Ok(result.expect("the options' check wants at least one stage"))
}

/// Where every stage works so that the part is right, in the picture and in its blocks.
fn areas(part: &Part, options: &Options) -> [Vec<Area>; 2] {
    let size = part.read.size();
    let mut wanted = part.within();
    wanted = wanted.grown(if options.restore { restore::REACH } else { confidence::RADIUS }, size);
    if options.coarse {
        wanted = wanted.grown(coarse::REACH, size);
    }
    let blocks = part.read.blocks();
    let nowhere = Rect::whole((0, 0));
    let halved = Area { origin: (blocks.x, blocks.y), wanted: wanted.blocks(), counted: nowhere };
    let own = Area { origin: part.origin(), wanted, counted: part.within() };
    [own.of_stages(size, options), halved.of_stages(blocks.size(), options)]
}

/// A picture that is as it was.
fn unchanged(outline: Outline, clean: Clean<'_>, part: &Part, log: &mut Log<'_>) -> Denoised {
    assemble(outline, Reconstruction::exact(clean.into_targets()), part, log)
}

fn assemble(outline: Outline, result: Reconstruction, part: &Part, log: &mut Log<'_>) -> Denoised {
    let wanted = part.within();
    let mut planes = result.targets.into_iter().map(|plane| plane.into_part(wanted));
    let mut next =
        || -> Rgb { std::array::from_fn(|_| planes.next().expect("three planes for every picture")) };
    let color = next();
    let aovs = outline.aovs.into_iter().map(|name| Aov { name, color: next() }).collect();
    log.observer.progress(1.0);
    let [mse, order] = [result.mse, result.order].map(|plane| plane.into_part(wanted));
    let mse = Some(mse);
    Denoised { color, aovs, mse, order, sampling_priority: None, summary: std::mem::take(&mut log.summary) }
}
