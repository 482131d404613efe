//! `--adaptive`: a render in rounds, timed.

use std::time::Instant;

use apr::Result;
use apr::adaptive::{AdaptiveOptions, Step, render};
use apr::trace::Renderer;
use serde::Serialize;

use crate::answer::print;

/// What the report says about the rounds.
#[derive(Debug, Serialize)]
pub struct Rounds {
    rounds: Vec<Timed>,
    /// The estimated error that was asked for.
    target_error: Option<f32>,
    /// Whether the last estimate is at most that.
    pub target_met: Option<bool>,
    /// Seconds that the estimates took, over the seconds that the samples took.
    overhead: f64,
}

#[derive(Debug, Serialize)]
struct Timed {
    /// Samples drawn in this round.
    samples: u64,
    /// Of the picture after this round, denoised: estimated mean relative squared error.
    estimated_error: Option<f64>,
    /// Spent on the samples and on the choice of their pixels.
    trace_seconds: f64,
    /// Spent on the estimate after them.
    estimate_seconds: f64,
}

/// Renders in rounds; tells each unless `quiet`.
pub fn run(renderer: &mut Renderer, options: &AdaptiveOptions, quiet: bool) -> Result<Rounds> {
    let mut rounds: Vec<Timed> = Vec::new();
    let mut since = Instant::now();
    let outcome = render(renderer, options, &mut |step| {
        let seconds = since.elapsed().as_secs_f64();
        since = Instant::now();
        match (step, rounds.last_mut()) {
            (Step::Estimated(error), Some(round)) => {
                (round.estimated_error, round.estimate_seconds) = (Some(error), seconds);
                if !quiet {
                    let samples = round.samples;
                    // Nobody has to listen while the picture is not done.
                    let _ = print(&format!("after {samples} samples more: estimated relMSE {error:.2e}"));
                }
            }
            (Step::Traced(samples), _) => {
                let (trace_seconds, estimate_seconds) = (seconds, 0.0);
                rounds.push(Timed { samples, estimated_error: None, trace_seconds, estimate_seconds });
            }
            (Step::Estimated(_), None) => {}
        }
    })?;
    if outcome.met == Some(false) && !quiet {
        let _ = print("the target error is not met: more --spp are needed");
    }
    let sum = |of: fn(&Timed) -> f64| rounds.iter().map(of).sum::<f64>();
    let overhead = sum(|round| round.estimate_seconds) / sum(|round| round.trace_seconds);
    Ok(Rounds { rounds, target_error: options.target_error, target_met: outcome.met, overhead })
}
