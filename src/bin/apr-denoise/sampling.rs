//! `--sampling-map` and `--target-error`: what the renderer's next pass should do.

use apr::adaptive::crossed_error;
use apr::baseline::Denoiser;
use apr::error::{Error, ErrorKind, Result};
use apr::image::Plane;
use apr::io::{DENSITY, Picture, write_plane};
use apr::sampling::{
    SamplingOptions, density, mean_error, proportional, relative_error, samples_needed, shares_of_mean,
};
use apr::{Denoised, Frame};
use serde::Serialize;

use crate::frames::counted;
use crate::plan::Job;

/// What is known about further samples.
#[derive(Debug, Serialize)]
pub struct Sampling {
    /// Estimated mean relative squared error (ε = 0.01) of the result, where the method has an estimate.
    pub estimated_error: Option<f64>,
    /// The error that was asked for.
    pub target_error: Option<f32>,
    /// Whether the estimate is at most that.
    pub target_met: Option<bool>,
    /// Samples per pixel still needed, on the average over the picture, as a multiple of those there are; placed where
    /// they take most from the error, as the sampling map does it.
    pub needed_share: Option<f64>,
    /// The same as a number of samples per pixel, where the file tells how many there are.
    pub needed_per_pixel: Option<f64>,
}

impl Sampling {
    /// Whether anything was asked for; it takes the picture as it was read.
    pub fn is_wanted(job: &Job, target: Option<f32>) -> bool {
        job.sampling_map.is_some() || target.is_some()
    }

    /// Estimates and writes what was asked for; none where nothing was.
    ///
    /// # Errors
    /// `Lacking` when there is a target and the method has no estimate; when the map cannot be written.
    pub fn new(
        picture: &Picture,
        denoiser: &Denoiser,
        denoised: &Denoised,
        job: &Job,
        target: Option<f32>,
    ) -> Result<Option<Self>> {
        if !Self::is_wanted(job, target) {
            return Ok(None);
        }
        let frame: &Frame = picture.frame();
        let error = relative_error(denoised);
        let mut told = Self {
            estimated_error: error.as_ref().map(mean_error),
            target_error: target,
            target_met: None,
            needed_share: None,
            needed_per_pixel: None,
        };
        if let Some(target) = target {
            let error = error.ok_or_else(|| without_estimate(denoiser))?;
            let (pixels, goal) = (error.data().len(), f64::from(target));
            let counts = shares_of_mean(picture.sample_counts(), pixels);
            let share = samples_needed(&error, &counts, goal, &SamplingOptions::default())? / pixels as f64;
            told.target_met = Some(mean_error(&error) <= goal);
            told.needed_share = Some(share);
            told.needed_per_pixel = frame.spp().map(|spp| share * f64::from(spp));
        }
        if let Some(path) = &job.sampling_map {
            let met = told.target_met == Some(true);
            write_plane(path, DENSITY, &next_density(picture, denoised, target, met)?)?;
        }
        Ok(Some(told))
    }

    /// In one line, for people; none without a target.
    pub fn line(&self) -> Option<String> {
        let (target, share, error) = (self.target_error?, self.needed_share?, self.estimated_error?);
        let by = format!("{error:.2e}, estimated");
        if self.target_met == Some(true) {
            return Some(format!("target error {target:.2e} is met: {by}"));
        }
        let needed = match self.needed_per_pixel {
            Some(spp) => {
                format!("about {} per pixel on the average", counted(spp.ceil() as usize, "more sample"))
            }
            None => format!("about {share:.2} times the samples there are, on top of them,"),
        };
        Some(format!(
            "target error {target:.2e} is not met: {by}; {needed} are needed where --sampling-map places them, and more \
             where they are spread evenly"
        ))
    }
}

/// The density of the next pass's samples: 0 where the target is met, else in proportion to what the method
/// itself asks for or, where it asks for nothing, by the error that others than the pixel itself tell.
fn next_density(picture: &Picture, denoised: &Denoised, target: Option<f32>, met: bool) -> Result<Plane> {
    let frame = picture.frame();
    if met {
        return Ok(Plane::filled(frame.width(), frame.height(), 0.0));
    }
    if let Some(priority) = &denoised.sampling_priority {
        return Ok(proportional(priority));
    }
    let error = crossed_error(frame)?;
    let map = |target| density(&error, picture.sample_counts(), target, &SamplingOptions::default());
    let wanted = map(target)?;
    // Should every pixel be under the target, while their mean by the other estimate is not, all go on.
    if wanted.data().iter().any(|&density| density > 0.0) { Ok(wanted) } else { map(None) }
}

fn without_estimate(denoiser: &Denoiser) -> Error {
    let method = denoiser.method().name();
    let what = format!("--target-error: the method {method} has no estimate of its error for this file");
    Error::new(ErrorKind::Lacking, what)
        .remedy("give half buffers (--half) if it is nlm or nfor, or use --method apr")
}
