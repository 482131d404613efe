//! All that comes before the fits: a frame becomes a signal.

use super::design::Design;
use super::facts::{Facts, Known};
use super::observer::{AsStage, Log, Stage};
use super::outlier::Removed;
use super::part::Part;
use super::sanitize::{self, Clean};
use super::signal::{Asked, Fits, Signal};
use super::tiles::Area;
use super::{outlier, variance};
use crate::error::Result;
use crate::frame::{Frame, Motion};
use crate::image::Rect;
use crate::options::Options;
use std::borrow::Cow;

/// A frame with everything that is known of it before the fits.
pub struct Prepared<'a> {
    /// What the fits read.
    pub signal: Signal,
    /// The outliers that are not in it.
    pub removed: Removed,
    /// The frame's motion vectors, as they are.
    pub motion: Option<Cow<'a, Motion>>,
}

/// Prepares a frame of which `own` facts are known. A frame beside the one that is denoised is brought to that one's
/// exposure and columns: those of `facts`.
///
/// # Errors
/// When the run is to stop.
pub fn prepare<'a>(
    frame: Cow<'a, Frame>,
    own: &Facts,
    facts: &Facts,
    part: &Part,
    options: &Options,
    log: &mut Log<'_>,
) -> Result<Prepared<'a>> {
    let known = own.known();
    let (mut clean, removed) = without_outliers(frame, &known, facts.exposure(), part, options, log)?;
    let variance = variance::of_mean(&mut clean, &mut log.summary);
    clean.halves = None; // they have told all that they know, and are six planes
    log.begin(Stage::Prefilter)?;
    let design = Design::of(std::mem::take(&mut clean.features), facts, &known, options, log)?;
    let motion = clean.motion.take();
    let mut signal = Signal::new(clean.into_targets(), variance, design, options);
    if own.noise_is_estimated() {
        log.begin(Stage::Noise)?;
        look_again(&mut signal, part, options, log)?;
    }
    Ok(Prepared { signal, removed, motion })
}

/// The stages that look at single pixels: repair, an exposure in which the method's constants are meant, and outliers,
/// whose energy is kept (Moon et al. 2016).
///
/// # Errors
/// When the run is to stop.
pub fn without_outliers<'a>(
    frame: Cow<'a, Frame>,
    known: &Known,
    exposure: f32,
    part: &Part,
    options: &Options,
    log: &mut Log<'_>,
) -> Result<(Clean<'a>, Removed)> {
    log.begin(Stage::Sanitize)?;
    let mut clean = sanitize::apply(frame, known, exposure, part.within(), &mut log.summary);
    clean.expose(exposure);
    log.begin(Stage::Outliers)?;
    let removed = outlier::remove(&mut clean, options);
    Ok((clean, removed))
}

/// Estimates the variance again, from what a fit by the first estimate leaves.
fn look_again(signal: &mut Signal, part: &Part, options: &Options, log: &Log<'_>) -> Result<()> {
    let wanted = Rect::whole(part.read.size());
    let asked = Asked {
        kernels: &options.stages[0],
        bandwidths: &[1.0],
        coverage: options.min_coverage * options.pilot_coverage,
        area: Area { origin: part.origin(), wanted, counted: Rect::whole((0, 0)) },
        targets: 3,
        last: true,
    };
    let as_stage = AsStage(log);
    let fit = Fits::new(signal, vec![], options).stage(&asked, None, &mut Log::new(&as_stage, options))?;
    let again = |c: usize| variance::from_residual(&signal.targets[c], &fit.targets[c], &signal.variance[c]);
    signal.set_variance(std::array::from_fn(again), options);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Plane, Rgb};

    fn noise(frame: Frame) -> Plane {
        let (facts, part) = (Facts::of(&frame), Part::whole((frame.width(), frame.height())));
        let options = Options::default();
        let ready =
            prepare(frame.into(), &facts, &facts, &part, &options, &mut Log::silent(&options)).unwrap();
        let [red, ..] = ready.signal.variance;
        red
    }

    /// Its neighbours would be held for as noisy, and all edges around blurred.
    #[test]
    fn a_firefly_in_one_half_is_not_the_noise_of_the_pixels_around() {
        let grain = |x: usize, y: usize, seed: usize| ((x * 7919 + y * 104_729 + seed) % 13) as f32 / 130.0;
        let half = |seed: usize, firefly: f32| -> Rgb {
            std::array::from_fn(|_| {
                let value = |x, y| if (x, y) == (20, 16) { firefly } else { 0.5 + grain(x, y, seed) };
                Plane::from_fn(40, 32, value)
            })
        };
        let variance = |firefly: f32| {
            let halves = [half(3, firefly), half(8, 0.5)];
            let mean = |c: usize| {
                Plane::from_fn(40, 32, |x, y| 0.5 * (halves[0][c].get(x, y) + halves[1][c].get(x, y)))
            };
            noise(Frame::new(std::array::from_fn(mean)).and_then(|frame| frame.with_halves(halves)).unwrap())
        };
        let (with, without) = (variance(600.0), variance(0.55));
        let most = |plane: &Plane| plane.data().iter().fold(0.0f32, |most, v| most.max(*v));
        assert!(most(&with) < 1.5 * most(&without), "{} instead of {}", most(&with), most(&without));
    }
}
