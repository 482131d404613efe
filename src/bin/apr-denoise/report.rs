//! What happened in a run, for `--report` and for the last line.

use std::path::Path;

use apr::denoise::Stage;
use apr::error::{Error, ErrorKind, Result};
use apr::io::{Layout, Picture};
use apr::{Denoised, Frame, Options, Summary};
use serde::Serialize;

use crate::clock::{Cost, name};

/// The report's JSON.
#[derive(Serialize)]
pub struct Report<'a> {
    program: &'static str,
    version: &'static str,
    output: String,
    layout: &'a Layout,
    options: &'a Options,
    /// Stages that were run, in order.
    stages: Vec<Cost>,
    /// Stages that were not.
    skipped: Vec<Skipped>,
    summary: &'a Summary,
    estimated_error: EstimatedError,
    /// What the writing had to tell.
    notes: Vec<String>,
}

#[derive(Serialize)]
struct Skipped {
    stage: String,
    reason: &'static str,
}

/// Mean squared error over the picture's pixels and channels, as far as it can be estimated.
#[derive(Serialize)]
struct EstimatedError {
    /// The input's, from its variance or its half buffers; none where it has neither.
    mse_before: Option<f64>,
    /// The result's.
    mse_after: f64,
    /// The same, each pixel's divided by its squared brightness plus 0.01.
    relative_before: Option<f64>,
    /// The result's.
    relative_after: f64,
}

impl<'a> Report<'a> {
    /// Everything that is known after a run.
    pub fn new(
        picture: &'a Picture,
        options: &'a Options,
        denoised: &'a Denoised,
        stages: Vec<Cost>,
        notes: Vec<String>,
        output: &Path,
    ) -> Self {
        Self {
            program: env!("CARGO_PKG_NAME"),
            version: env!("CARGO_PKG_VERSION"),
            output: output.display().to_string(),
            layout: picture.layout(),
            options,
            skipped: skipped(picture.frame(), &denoised.summary, &stages),
            stages,
            summary: &denoised.summary,
            estimated_error: EstimatedError::new(picture.frame(), denoised),
            notes,
        }
    }

    /// As text of a JSON file.
    pub fn json(&self) -> Result<String> {
        serde_json::to_string_pretty(self).map_err(|error| Error::new(ErrorKind::Internal, error.to_string()))
    }

    /// In one line, for people.
    pub fn line(&self) -> String {
        let seconds: f64 = self.stages.iter().map(|stage| stage.seconds).sum();
        let error = &self.estimated_error;
        let before = error.relative_before.map_or("unknown".to_owned(), |before| format!("{before:.2e}"));
        format!(
            "{}: {seconds:.2} s, estimated relative error {before} -> {:.2e}",
            self.output, error.relative_after
        )
    }
}

fn skipped(frame: &Frame, summary: &Summary, run: &[Cost]) -> Vec<Skipped> {
    let switched_off = "switched off by the options";
    let none_found = if summary.outliers == 0 { "there are no outliers" } else { switched_off };
    let no_features = if frame.features().is_empty() { "there are no features" } else { switched_off };
    let stages = [
        (Stage::Sanitize, switched_off),
        (Stage::Outliers, switched_off),
        (Stage::Prefilter, no_features),
        (Stage::Fit(1), switched_off),
        (Stage::Energy, none_found),
    ];
    let missed = stages.into_iter().map(|(stage, reason)| Skipped { stage: name(stage), reason });
    missed.filter(|skipped| run.iter().all(|cost| cost.stage != skipped.stage)).collect()
}

impl EstimatedError {
    fn new(frame: &Frame, denoised: &Denoised) -> Self {
        /// The same as in relMSE: keeps black pixels from deciding everything.
        const EPSILON: f64 = 0.01;
        let color = &denoised.color;
        let brightness = |i: usize| color.iter().map(|plane| f64::from(plane.data()[i])).sum::<f64>() / 3.0;
        let mean = |error: &dyn Fn(usize) -> f64, relative: bool| {
            let count = color[0].data().len();
            let of = |i: usize| error(i) / if relative { brightness(i).powi(2) + EPSILON } else { 1.0 };
            (0..count).map(of).filter(|e| e.is_finite()).sum::<f64>() / count as f64
        };
        let input = input_error(frame);
        let before = |relative| input.as_ref().map(|at| mean(at, relative));
        let after = |i: usize| f64::from(denoised.mse.data()[i]);
        Self {
            mse_before: before(false),
            mse_after: mean(&after, false),
            relative_before: before(true),
            relative_after: mean(&after, true),
        }
    }
}

/// The input's squared error at a pixel: its variance, or that of the mean of two halves, `(A−B)²/4`.
fn input_error(frame: &Frame) -> Option<Box<dyn Fn(usize) -> f64 + '_>> {
    let mean = |of: &dyn Fn(usize) -> f32| (0..3).map(|c| f64::from(of(c))).sum::<f64>() / 3.0;
    match (frame.color_var_of_mean(), frame.halves()) {
        (Some(variance), _) => Some(Box::new(move |i| mean(&|c| variance[c].data()[i]))),
        (None, Some([a, b])) => {
            Some(Box::new(move |i| mean(&|c| (a[c].data()[i] - b[c].data()[i]).powi(2) / 4.0)))
        }
        (None, None) => None,
    }
}
