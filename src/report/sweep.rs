//! What a sweep over variants of the denoiser measured, and what follows from it.

use serde::Serialize;

use crate::metrics::{Calibration, Scores};

/// Variants on one or more renders of one scene, against one reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sweep {
    /// The reference's file.
    pub reference: String,
    /// The relMSE that the reference's own noise adds to every figure, where its halves tell.
    pub reference_noise: Option<f64>,
    /// The renders, as they were given.
    pub inputs: Vec<Input>,
    /// What one more sample of every pixel takes the renderer, in seconds, where it was told.
    pub sample_seconds: Option<f64>,
}

/// One noisy render and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Input {
    /// Its file.
    pub name: String,
    /// Samples per pixel, where known.
    pub spp: Option<f64>,
    /// The render itself against the reference.
    pub noisy: Scores,
    /// One run for each variant and each rival, in that order.
    pub runs: Vec<Run>,
    /// Pictures to look at; not in the JSON.
    #[serde(skip)]
    pub layers: Vec<Layer>,
}

/// One variant, or one rival, on one input.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Run {
    /// The variant's name.
    pub name: String,
    /// Wall-clock seconds of the denoising alone, without reading and writing, where known.
    pub seconds: Option<f64>,
    /// Processor seconds of the same, those of all threads together, where known: what other programs on the
    /// machine hardly touch.
    pub processor_seconds: Option<f64>,
    /// The result against the reference.
    pub scores: Scores,
    /// How true its estimated error is; rivals have none.
    pub calibration: Option<Calibration>,
}

/// A picture of the page.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// The name in the page's lists, and (with `-` for what file names do not bear) its file's.
    pub name: String,
    /// PNG.
    pub png: Vec<u8>,
}

/// What the seconds of a run would have bought as plain samples. All of it rests on one law: the
/// squared error of the render falls as one over the number of samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EqualTime {
    /// Samples per pixel at which the render alone would be as good.
    pub equivalent_spp: f64,
    /// Denoising pays where one more sample of every pixel takes longer than this, in seconds.
    /// Infinite (`null` in JSON) when the result is no better than the render.
    pub break_even_sample_seconds: f64,
    /// With the sample's seconds known: samples per pixel that the run's seconds buy, and the
    /// render's relMSE with them.
    pub bought: Option<(f64, f64)>,
}

impl Input {
    /// Which runs no other run beats in both seconds and relMSE; runs without seconds are not.
    pub fn pareto_front(&self) -> Vec<bool> {
        let beaten = |run: &Run, seconds: f64| {
            self.runs.iter().any(|other| {
                other.seconds.is_some_and(|s| {
                    let (faster, better) = (s <= seconds, other.scores.rel_mse <= run.scores.rel_mse);
                    faster && better && (s < seconds || other.scores.rel_mse < run.scores.rel_mse)
                })
            })
        };
        self.runs.iter().map(|run| run.seconds.is_some_and(|seconds| !beaten(run, seconds))).collect()
    }
}

impl Sweep {
    /// relMSE against the truth: what was measured less the reference's own noise.
    pub fn error(&self, scores: &Scores) -> f64 {
        scores.rel_mse - self.reference_noise.unwrap_or(0.0)
    }

    /// How many pictures, renders and results, have an [error](Self::error) that the reference's noise hides.
    pub fn drowned(&self) -> usize {
        let scores = |input: &Input| {
            let all = input.runs.iter().map(|run| &run.scores).chain([&input.noisy]);
            all.filter(|scores| self.error(scores) <= 0.0).count()
        };
        self.inputs.iter().map(scores).sum()
    }

    /// What the seconds of `run` on `input` would have bought; `None` when its seconds or the samples
    /// per pixel are not known, or its error drowns in the reference's noise.
    pub fn equal_time(&self, input: &Input, run: &Run) -> Option<EqualTime> {
        let (seconds, spp) = (run.seconds?, input.spp?);
        let (noisy, error) = (self.error(&input.noisy), self.error(&run.scores));
        if error <= 0.0 {
            return None;
        }
        let equivalent_spp = spp * noisy / error;
        let gained = equivalent_spp - spp;
        Some(EqualTime {
            equivalent_spp,
            break_even_sample_seconds: if gained > 0.0 { seconds / gained } else { f64::INFINITY },
            bought: self.sample_seconds.map(|each| {
                let extra = seconds / each;
                (extra, noisy * spp / (spp + extra))
            }),
        })
    }

    /// (samples per pixel, [error](Self::error)) of the run named `name` on every input whose samples are known, by
    /// rising samples; the renders themselves for `None`.
    pub fn against_spp(&self, name: Option<&str>) -> Vec<(f64, f64)> {
        let error = |input: &Input| match name {
            None => Some(self.error(&input.noisy)),
            Some(name) => input.runs.iter().find(|run| run.name == name).map(|run| self.error(&run.scores)),
        };
        let mut points: Vec<(f64, f64)> =
            self.inputs.iter().filter_map(|input| Some((input.spp?, error(input)?))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    }
}

/// Slope of the straight line through the logarithms of `points`, by least squares; `None` for fewer
/// than two different abscissae or values that are not positive.
pub fn log_slope(points: &[(f64, f64)]) -> Option<f64> {
    if points.iter().any(|&(x, y)| x <= 0.0 || y <= 0.0) {
        return None;
    }
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let (mean_x, mean_y) =
        (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    let spread: f64 = logs.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    let along: f64 = logs.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
    (spread > 0.0).then(|| along / spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scores(rel_mse: f64) -> Scores {
        Scores { rmse: 0.0, rel_mse, trimmed_rel_mse: 0.0, smape: 0.0, ssim: 0.0, energy: 0.0 }
    }

    fn input(spp: f64, runs: &[(f64, f64)]) -> Input {
        let run = |(i, &(seconds, error)): (usize, &(f64, f64))| Run {
            name: i.to_string(),
            seconds: Some(seconds),
            processor_seconds: None,
            scores: scores(error),
            calibration: None,
        };
        Input {
            name: "in".into(),
            spp: Some(spp),
            noisy: scores(0.16),
            runs: runs.iter().enumerate().map(run).collect(),
            layers: vec![],
        }
    }

    #[test]
    fn the_front_keeps_what_nothing_beats_and_both_of_two_equals() {
        let input = input(4.0, &[(1.0, 0.5), (2.0, 0.4), (2.0, 0.45), (3.0, 0.4), (1.0, 0.5)]);
        assert_eq!(input.pareto_front(), [true, true, false, false, true]);
    }

    #[test]
    fn seconds_are_weighed_against_samples_less_the_references_noise() {
        let mut sweep = Sweep {
            reference: "ref".into(),
            reference_noise: Some(0.01),
            inputs: vec![input(4.0, &[(10.0, 0.02), (10.0, 0.32), (10.0, 0.01)])],
            sample_seconds: Some(2.0),
        };
        sweep.inputs[0].noisy = scores(0.17);
        let of = |sweep: &Sweep, i: usize| sweep.equal_time(&sweep.inputs[0], &sweep.inputs[0].runs[i]);
        let good = of(&sweep, 0).unwrap();
        assert!((good.equivalent_spp - 64.0).abs() < 1e-9);
        assert!((good.break_even_sample_seconds - 10.0 / 60.0).abs() < 1e-12);
        let (extra, error) = good.bought.unwrap();
        assert_eq!(extra, 5.0);
        assert!((error - 0.16 * 4.0 / 9.0).abs() < 1e-12);
        sweep.sample_seconds = None;
        let bad = of(&sweep, 1).unwrap();
        assert_eq!((bad.break_even_sample_seconds, bad.bought), (f64::INFINITY, None));
        assert_eq!((of(&sweep, 2), sweep.drowned()), (None, 1));
    }

    #[test]
    fn the_slope_of_a_power_law_is_its_exponent() {
        let points: Vec<(f64, f64)> = [1.0, 7.0, 30.0].map(|x: f64| (x, 5.0 * x.powf(-0.75))).to_vec();
        assert!((log_slope(&points).unwrap() + 0.75).abs() < 1e-12);
        assert_eq!(log_slope(&[(1.0, 2.0)]), None);
        assert_eq!(log_slope(&[(1.0, 2.0), (2.0, 0.0)]), None);
    }

    #[test]
    fn inputs_are_ordered_by_their_samples() {
        let sweep = Sweep {
            reference: "ref".into(),
            reference_noise: None,
            inputs: vec![input(64.0, &[(1.0, 0.1)]), input(16.0, &[(1.0, 0.3)])],
            sample_seconds: None,
        };
        assert_eq!(sweep.against_spp(Some("0")), [(16.0, 0.3), (64.0, 0.1)]);
        assert_eq!(sweep.against_spp(None), [(16.0, 0.16), (64.0, 0.16)]);
        assert!(sweep.against_spp(Some("unknown")).is_empty());
    }
}
