//! What happened in a run, for `--report` and for the last line.

use apr::baseline::Denoiser;
use apr::denoise::Stage;
use apr::image::{Plane, Rect, Rgb};
use apr::io::{Layout, RoleLayout, SumCheck};
use apr::metrics::REL_MSE_EPSILON;
use apr::{Denoised, Frame, Options, Summary};
use rayon::prelude::*;
use serde::Serialize;

use crate::clock::Cost;
use crate::inspect::{sum_line, wanting};
use crate::parts::{Output, Used};
use crate::plan::Job;
use crate::sampling::Sampling;
use crate::sequence_report::Outcome;

/// The report's JSON.
#[derive(Serialize)]
pub struct Report<'a> {
    program: &'static str,
    version: &'static str,
    /// Its number in a sequence.
    frame: Option<i32>,
    output: String,
    layout: Layout,
    method: &'static str,
    options: &'a Denoiser,
    /// Of all stages, wall clock.
    seconds: f64,
    /// Bands that the picture was denoised in; the stages are then those of each.
    bands: usize,
    /// Stages that were run, in order.
    stages: Vec<Cost>,
    /// Stages that were not, in no band.
    skipped: Vec<Skipped>,
    summary: &'a Summary,
    estimated_error: EstimatedError,
    /// Whether the components sum to the beauty.
    sums: Vec<SumCheck>,
    /// What the next pass is told, where that was asked for.
    sampling: Option<&'a Sampling>,
    /// What the writing had to tell.
    notes: Vec<String>,
}

#[derive(Serialize)]
struct Skipped {
    stage: String,
    reason: &'static str,
}

/// Mean squared error over the picture's pixels and channels, as far as it can be estimated.
#[derive(Clone, Serialize)]
pub struct EstimatedError {
    /// The input's, from its variance or its half buffers; none where it has neither.
    mse_before: Option<f64>,
    /// The result's; none where the method has no estimate.
    mse_after: Option<f64>,
    /// The same, each pixel's divided by its squared brightness plus 0.01.
    relative_before: Option<f64>,
    /// The result's.
    relative_after: Option<f64>,
}

impl<'a> Report<'a> {
    /// Everything that is known after a run.
    pub fn new(
        used: &'a Used,
        denoiser: &'a Denoiser,
        output: &'a Output,
        stages: Vec<Cost>,
        notes: Vec<String>,
        job: &Job,
        sampling: Option<&'a Sampling>,
    ) -> Self {
        let (layout, denoised) = (used.layout(), &output.denoised);
        let skipped =
            denoiser.pipeline().map_or_else(Vec::new, |options| skipped(layout, options, &denoised.summary));
        let ran = |cost: &Cost| skipped.iter().all(|skipped| skipped.stage != cost.stage);
        Self {
            program: env!("CARGO_PKG_NAME"),
            version: env!("CARGO_PKG_VERSION"),
            frame: job.frame,
            output: job.output.display().to_string(),
            layout: wanting(layout, denoiser),
            method: denoiser.method().name(),
            options: denoiser,
            seconds: stages.iter().map(|stage| stage.seconds).sum(),
            bands: output.parts,
            stages: stages.into_iter().filter(ran).collect(),
            skipped,
            summary: &denoised.summary,
            estimated_error: output.error.mean(),
            sums: used.sums(denoised),
            sampling,
            notes,
        }
    }

    /// What the report of a whole sequence keeps of it.
    pub fn outcome(&self) -> Outcome {
        Outcome::Done {
            seconds: self.seconds,
            estimated_error: self.estimated_error.clone(),
            outliers: self.summary.outliers,
            warnings: self.layout.warnings.clone(),
        }
    }

    /// What the user should know of how it was written, and of what was repaired.
    pub fn notes(&self) -> Vec<String> {
        self.notes.iter().cloned().chain(repaired(&self.layout, self.summary)).collect()
    }

    /// In one line for people, after one for each set of components.
    pub fn line(&self) -> String {
        let seconds = self.seconds;
        let error = &self.estimated_error;
        let told = |error: Option<f64>| error.map_or("unknown".to_owned(), |error| format!("{error:.2e}"));
        let (before, after) = (told(error.relative_before), told(error.relative_after));
        let sums: String = self.sums.iter().map(|sum| sum_line(sum) + "\n").collect();
        format!("{sums}{}: {seconds:.2} s, estimated relMSE {before} -> {after}", self.output)
    }
}

/// In one line, the pixels that were no numbers, where there were any.
fn repaired(layout: &Layout, summary: &Summary) -> Option<String> {
    let counts = [
        (summary.repaired_color, "colour"),
        (summary.repaired_variance, "variances"),
        (summary.repaired_features, "features"),
        (summary.repaired_halves, "half buffers"),
        (summary.repaired_aovs, "components"),
    ];
    let told = counts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} of the {what}"));
    let told: Vec<String> = told.collect();
    if told.is_empty() {
        return None;
    }
    let (nan, infinite) = layout
        .roles
        .iter()
        .fold((0, 0), |(nan, infinite), role| (nan + role.nan, infinite + role.non_finite - role.nan));
    let negative = match summary.negative_color {
        0 => String::new(),
        1 => "; 1 pixel of the colour is negative and stays so".to_owned(),
        n => format!("; {n} pixels of the colour are negative and stay so"),
    };
    Some(format!(
        "broken pixels were repaired from their neighbours: {} (in the file {nan} samples are NaN and {infinite} \
         infinite){negative}",
        told.join(", ")
    ))
}

/// The stages that had nothing to do, and why.
fn skipped(layout: &Layout, options: &Options, summary: &Summary) -> Vec<Skipped> {
    let noisy = |role: &RoleLayout| role.is_feature() && role.statistic != "mean";
    let reason = |stage: Stage| match stage {
        Stage::Outliers if !options.outliers.enabled => Some("switched off by the options"),
        Stage::Prefilter if !options.prefilter.enabled => Some("switched off by the options"),
        Stage::Prefilter if !layout.roles.iter().any(noisy) && layout.half.is_none() => {
            Some("no feature has a variance or halves")
        }
        Stage::Coarse if !options.coarse => Some("switched off by the options"),
        _ if summary.centres == 0 && stage != Stage::Sanitize => Some("there is no noise to take out"),
        Stage::Energy if summary.outliers == 0 && !options.restore => Some("there are no outliers"),
        _ => None,
    };
    let fits = (1..=options.stages.len()).map(Stage::Fit);
    let before = [Stage::Sanitize, Stage::Outliers, Stage::Prefilter, Stage::Coarse];
    let stages = before.into_iter().chain(fits).chain([Stage::Energy]);
    stages.filter_map(|stage| Some(Skipped { stage: stage.to_string(), reason: reason(stage)? })).collect()
}

/// The estimated errors of the pixels so far, as they are and relative.
#[derive(Debug, Clone, Default)]
pub struct ErrorSums {
    before: [Mean; 2],
    after: [Mean; 2],
}

/// A mean of what is finite.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: f64,
    count: usize,
}

impl Mean {
    fn add(&mut self, value: f64) {
        if value.is_finite() {
            self.sum += value;
            self.count += 1;
        }
    }

    fn join(&mut self, other: Self) {
        self.sum += other.sum;
        self.count += other.count;
    }

    fn value(self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }
}

impl ErrorSums {
    /// Adds the pixels `within` a frame, which `denoised` holds; `input` is the frame's [`input_error`].
    pub fn add(&mut self, input: Option<&Rgb>, within: Rect, denoised: &Denoised) {
        let rows = (0..within.height).into_par_iter().map(|y| {
            let input =
                input.map(|channels| channels.each_ref().map(|plane| &plane.row(within.y + y)[within.x..]));
            Self::of_row(input, denoised, y)
        });
        // One by one, so that the threads do not matter.
        for row in rows.collect::<Vec<_>>() {
            self.before.iter_mut().zip(row.before).for_each(|(mean, row)| mean.join(row));
            self.after.iter_mut().zip(row.after).for_each(|(mean, row)| mean.join(row));
        }
    }

    /// Of row `y` of `denoised`, where `input` is the input's error. That is known of every channel, the result's as
    /// their mean (as in [`apr::sampling::relative_error`]).
    fn of_row(input: Option<[&[f32]; 3]>, denoised: &Denoised, y: usize) -> Self {
        let mut sums = Self::default();
        let mean = |of: [f64; 3]| of.iter().sum::<f64>() / 3.0;
        let add = |means: &mut [Mean; 2], errors: [f64; 2]| {
            means.iter_mut().zip(errors).for_each(|(mean, error)| mean.add(error));
        };
        for x in 0..denoised.color[0].width() {
            let light =
                denoised.color.each_ref().map(|plane| f64::from(plane.get(x, y)).powi(2) + REL_MSE_EPSILON);
            if let Some(mse) = &denoised.mse {
                let after = f64::from(mse.get(x, y));
                add(&mut sums.after, [after, after / mean(light)]);
            }
            if let Some(input) = input {
                let errors = input.map(|row| f64::from(row[x]));
                let relative = std::array::from_fn(|c| errors[c] / light[c]);
                add(&mut sums.before, [errors, relative].map(mean));
            }
        }
        sums
    }

    /// The means.
    pub fn mean(&self) -> EstimatedError {
        let [mse_before, relative_before] = self.before.map(Mean::value);
        let [mse_after, relative_after] = self.after.map(Mean::value);
        EstimatedError { mse_before, mse_after, relative_before, relative_after }
    }
}

/// The squared error of the channels of a frame's pixels: their variance, or that of the mean of two halves, `(A−B)²/4`. NaN
/// where that is no variance, which the denoiser repairs from the pixels around.
pub fn input_error(frame: &Frame) -> Option<Rgb> {
    if let Some(variance) = frame.color_var_of_mean() {
        let mut error = variance.clone();
        error.iter_mut().for_each(|plane| plane.change(|v| if v < 0.0 { f32::NAN } else { v }));
        return Some(error);
    }
    let [a, b] = frame.halves()?;
    let quarter = |c: usize| move |x, y| (a[c].get(x, y) - b[c].get(x, y)).powi(2) / 4.0;
    Some(std::array::from_fn(|c| Plane::par_from_fn(frame.width(), frame.height(), quarter(c))))
}
