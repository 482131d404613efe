//! Non-local means (Rousselle, Knaus, Zwicker: Adaptive Rendering with Non-Local Means Filtering, SIGGRAPH
//! Asia 2012).
//!
//! Patches are compared by their variance-normalised distance. With half buffers the weights of one half
//! filter the other, so that no weight knows the noise that it is applied to; the result is the mean of
//! both, and half their difference is what noise is left, from which the sampling map follows.
//!
//! `[choice]` the squared half difference has one degree of freedom a pixel: it is averaged over 7×7
//! pixels. Without half buffers the picture's own weights filter it, and neither error nor map is to be had.
//! `[choice]` AOVs have no halves: the mean of both halves' weights filters them, so that their sum differs
//! from the beauty by what the two halves' weights make of the halves' difference.

use super::input::{Input, Output, mean, relative_error};
use super::patches::{Channels, Patches, filter};
use crate::denoise::variance::smooth;
use crate::error::Result;
use crate::frame::{Denoised, Frame};
use crate::image::{Plane, Rgb};
use crate::options::within;
use serde::{Deserialize, Serialize};

/// Radius over which the half buffers' squared difference is averaged.
const ERROR_RADIUS: usize = 3;

/// Constants of the method; the defaults are the publication's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Radius r of the search window, 1 to 15.
    pub window_radius: usize,
    /// Radius f of the patches, 0 to 7.
    pub patch_radius: usize,
    /// Bandwidth k.
    pub bandwidth: f32,
    /// Weights under this count as 0; at most 1.
    pub threshold: f32,
}

impl Default for Options {
    fn default() -> Self {
        Self { window_radius: 10, patch_radius: 3, bandwidth: 0.45, threshold: 0.05 }
    }
}

impl Options {
    /// Checks every range.
    ///
    /// # Errors
    /// [`crate::ErrorKind::Usage`] names the option and what it may be.
    pub fn check(&self) -> Result<()> {
        within("window_radius", self.window_radius, 1..=15)?;
        within("patch_radius", self.patch_radius, 0..=7)?;
        within("bandwidth", self.bandwidth, 1e-3..=1e3)?;
        within("threshold", self.threshold, 0.0..=1.0)
    }
}

/// Filters `frame`.
///
/// # Errors
/// When an option is out of its range.
pub fn denoise(frame: &Frame, options: &Options) -> Result<Denoised> {
    options.check()?;
    let input = Input::new(frame, "nlm");
    let output = match &input.clean.halves {
        Some(halves) => dual(&input, halves, options),
        None => {
            let patches = patches(&input.clean.color, &input.variance, options);
            let targets = filter(&patches, &input.targets(), options.bandwidth, options.threshold);
            Output { targets, mse: None, order: 0.0, sampling_priority: None }
        }
    };
    Ok(input.finish(output))
}

fn patches(guide: &Rgb, variance: &Rgb, options: &Options) -> Patches {
    Patches::new(guide, variance, [options.window_radius, options.patch_radius], Channels::Mean)
}

/// The cross filtering of two halves.
fn dual(input: &Input<'_>, halves: &[Rgb; 2], options: &Options) -> Output {
    let variance = input.variance_of_half();
    let [b, a] = [0, 1].map(|guide| {
        // The weights of this half for the other.
        let planes: Vec<&Plane> = halves[1 - guide].iter().chain(input.aovs()).collect();
        let patches = patches(&halves[guide], &variance, options);
        filter(&patches, &planes, options.bandwidth, options.threshold)
    });
    let targets: Vec<Plane> = a.iter().zip(&b).map(|(a, b)| mean(a, b)).collect();
    let (width, height) = input.size();
    let squared = Plane::from_fn(width, height, |x, y| {
        let of = |(a, b): (&Plane, &Plane)| (0.5 * (a.get(x, y) - b.get(x, y))).powi(2);
        a.iter().zip(&b).take(3).map(of).sum::<f32>() / 3.0
    });
    let map = smooth(&relative_error(&squared, &targets), ERROR_RADIUS);
    Output { targets, mse: Some(smooth(&squared, ERROR_RADIUS)), order: 0.0, sampling_priority: Some(map) }
}
