//! `--sampling-map` and `--target-error`: what the renderer's next pass should do.

use apr::error::Result;
use apr::io::write_plane;
use apr::sampling::{SamplingOptions, density, mean_error, relative_error, samples_needed, shares_of_mean};
use apr::{Denoised, Frame};
use serde::Serialize;

use crate::parts::Input;
use crate::plan::Job;

/// The channel of the sampling map.
const CHANNEL: &str = "density.Y";

/// What is known about further samples.
#[derive(Debug, Serialize)]
pub struct Sampling {
    /// Estimated mean relative squared error (ε = 0.01) of the result.
    pub estimated_error: f64,
    /// The error that was asked for.
    pub target_error: Option<f32>,
    /// Whether the estimate is at most that.
    pub target_met: Option<bool>,
    /// Samples per pixel still needed, on the average over the picture, as a multiple of those there are.
    pub needed_share: Option<f64>,
    /// The same as a number of samples per pixel, where the file tells how many there are.
    pub needed_per_pixel: Option<f64>,
}

impl Sampling {
    /// Estimates and writes what was asked for; none where nothing was. It takes the whole
    /// picture.
    pub fn new(input: &Input, denoised: &Denoised, job: &Job, target: Option<f32>) -> Result<Option<Self>> {
        let map = job.sampling_map.as_ref();
        let Input::Whole(picture) = input else { return Ok(None) };
        if map.is_none() && target.is_none() {
            return Ok(None);
        }
        let options = SamplingOptions::default();
        let frame: &Frame = picture.frame();
        let error = relative_error(frame, denoised);
        if let Some(path) = map {
            write_plane(path, CHANNEL, &density(&error, picture.sample_counts(), target, &options)?)?;
        }
        let estimated_error = mean_error(&error);
        let pixels = error.data().len();
        let needed_share = target.map(|target| {
            let counts = shares_of_mean(picture.sample_counts(), pixels);
            samples_needed(&error, &counts, f64::from(target), &options).map(|n| n / pixels as f64)
        });
        let needed_share = needed_share.transpose()?;
        Ok(Some(Self {
            estimated_error,
            target_error: target,
            target_met: target.map(|target| estimated_error <= f64::from(target)),
            needed_share,
            needed_per_pixel: needed_share.zip(frame.spp()).map(|(share, spp)| share * f64::from(spp)),
        }))
    }

    /// In one line, for people; none without a target.
    pub fn line(&self) -> Option<String> {
        let (target, share) = (self.target_error?, self.needed_share?);
        let error = self.estimated_error;
        if self.target_met == Some(true) {
            return Some(format!("target error {target:.2e} is met: estimated {error:.2e}"));
        }
        let needed = match self.needed_per_pixel {
            Some(spp) => format!("about {:.0} more samples per pixel", spp.ceil()),
            None => format!("about {share:.2} times the samples there are, on top of them,"),
        };
        Some(format!("target error {target:.2e} is not met: estimated {error:.2e}, {needed} are needed"))
    }
}
