//! Rendering in rounds with the bundled tracer: a uniform first one, then rounds whose samples go
//! where the denoised picture's estimated error falls fastest (Moon et al. 2016, last part).
//!
//! Samples that are chosen after seeing earlier ones of the same pixel would bias its mean. [`crossed_error`]
//! judges every pixel by others alone.

mod crossed;

pub use crossed::crossed_error;

use crate::error::{Error, ErrorKind, Result};
use crate::sampling::{SamplingOptions, allocate, mean_error};
use crate::trace::{Renderer, Samples};

/// Options of a render in rounds.
#[derive(Debug, Clone, PartialEq)]
pub struct AdaptiveOptions {
    /// Samples per pixel on the average, over all rounds; 3 or more.
    pub spp: u32,
    /// Rounds, the uniform first one included; 2 to `spp` − 1.
    pub rounds: u32,
    /// Stop when the estimated mean relative squared error is at most this; pixels at or under it get no
    /// further samples.
    pub target_error: Option<f32>,
    /// How samples are allocated.
    pub sampling: SamplingOptions,
}

impl Default for AdaptiveOptions {
    fn default() -> Self {
        Self { spp: 32, rounds: 4, target_error: None, sampling: SamplingOptions::default() }
    }
}

/// The least samples of the first round: a variance takes two.
const LEAST_FIRST: u32 = 2;

/// What a round did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Round {
    /// Samples drawn.
    pub samples: u64,
    /// Estimated mean relative squared error of the picture, denoised, after the round; none after the
    /// last one unless there is a target.
    pub estimated_error: Option<f64>,
}

/// What has just been done, for whoever measures the time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// A round's samples have been drawn, so many.
    Traced(u64),
    /// The error after it has been estimated.
    Estimated(f64),
}

/// What a render in rounds did.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The rounds.
    pub rounds: Vec<Round>,
    /// Whether the target was met; none without a target.
    pub met: Option<bool>,
}

/// Draws `options.spp` samples per pixel of a fresh `renderer` in rounds, exactly so many over all pixels
/// unless the target is met before; tells `observer` every step.
///
/// # Errors
/// When an option is out of range or the renderer has drawn samples already.
pub fn render(
    renderer: &mut Renderer,
    options: &AdaptiveOptions,
    observer: &mut dyn FnMut(Step),
) -> Result<Outcome> {
    check(renderer, options)?;
    let pixels = renderer.film().counts().len() as u64;
    let total = pixels * u64::from(options.spp);
    let first = (options.spp / options.rounds).max(LEAST_FIRST);
    renderer.pass(Samples::Uniform(first))?;
    let mut left = total - pixels * u64::from(first);
    let mut samples = total - left;
    let mut rounds = vec![];
    let mut met = None;
    for to_come in (0..u64::from(options.rounds)).rev() {
        observer(Step::Traced(samples));
        let mut round = Round { samples, estimated_error: None };
        let wanted = left > 0 || options.target_error.is_some();
        let error = wanted.then(|| crossed_error(&renderer.film().to_plain_frame()?)).transpose()?;
        if let Some(error) = &error {
            let mean = mean_error(error);
            observer(Step::Estimated(mean));
            round.estimated_error = Some(mean);
            met = options.target_error.map(|target| mean <= f64::from(target));
        }
        rounds.push(round);
        let Some(error) = error.filter(|_| left > 0 && met != Some(true)) else { break };
        let budget = left / to_come.max(1);
        let counts: Vec<u32> = renderer.film().counts().iter().map(|count| count.drawn).collect();
        let map = allocate(&error, &counts, budget, options.target_error, &options.sampling)?;
        renderer.pass(Samples::Map(&map))?;
        samples = budget;
        left -= budget;
    }
    Ok(Outcome { rounds, met })
}

fn check(renderer: &Renderer, options: &AdaptiveOptions) -> Result<()> {
    let usage = |what: String, remedy: &str| Err(Error::new(ErrorKind::Usage, what).remedy(remedy));
    if options.rounds < 2 {
        return usage("fewer than 2 rounds leave nothing to adapt".to_owned(), "give 2 rounds or more");
    }
    let least = u64::from(options.rounds) + u64::from(LEAST_FIRST) - 1;
    if u64::from(options.spp) < least {
        let what = format!(
            "an spp of {} is too little for {} rounds, the first of {LEAST_FIRST} samples",
            options.spp, options.rounds
        );
        return usage(what, &format!("give an spp of {least} or more, or fewer rounds"));
    }
    if let Some(target) = options.target_error
        && !(target.is_finite() && target > 0.0)
    {
        return usage(format!("a target error of {target}"), "give a number above 0, such as 0.001");
    }
    if renderer.film().drawn() > 0 {
        return usage("the render has begun already".into(), "begin anew, without a checkpoint");
    }
    Ok(())
}
