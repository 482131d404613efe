//! Where further samples are worth most: from a denoised picture's estimated error to a number of
//! samples for every pixel (Moon et al. 2016, last part).
//!
//! A pixel's error E, which n samples have left, is taken to fall as n^−α. One more sample then
//! takes αE/n from it: its priority. A round's samples go where the priority is highest until all that
//! got any have the same, which is n_i = (E_i n_i^α)^{1/(1+α)}·λ with the one λ that spends the budget.
//!
//! E is the denoiser's own estimate of its error. The paper ranks by the fits' risk ξ/(ŷ² + ε), which is too sure of itself
//! where the fits are wrong (see `denoise/confidence.rs`).

use crate::error::{Error, ErrorKind, Result};
use crate::frame::Denoised;
use crate::image::Plane;
use crate::metrics::relative_mean;

/// Options of the allocation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SamplingOptions {
    /// The power α at which a denoised pixel's error falls with its samples, above 0 to 4. `[choice]` 1:
    /// 0.7 and 1.5 change the error by under 1 %.
    pub decay: f64,
    /// The most samples that a round gives a pixel, as a multiple of its mean over those that get any;
    /// 1 or more. `[choice]` 8: 2 leaves relMSE ×1.15, 4 ×1.03.
    pub limit: f64,
    /// The share of a round that is spread evenly over the pixels that get any, 0 to 1: the error map is a noisy
    /// estimate and must not starve a pixel. `[choice]` 0.5: the least at which no shipped scene ends worse than
    /// by uniform samples; geometric mean and worst (door ajar) against those with 0.25, 0.4, 0.5, 0.7:
    /// 0.751 and 1.05, 0.752 and 1.01, 0.755 and 0.99, 0.782 and 1.04 (frosted glass).
    pub even_share: f64,
}

impl Default for SamplingOptions {
    fn default() -> Self {
        Self { decay: 1.0, limit: 8.0, even_share: 0.5 }
    }
}

/// The estimated relative squared error (as in relMSE) of every pixel, ≥ 0, where the method has an estimate.
/// The estimate is the mean over the channels, and is held against that of their light: a saturated colour's error
/// is its bright channel's.
pub fn relative_error(denoised: &Denoised) -> Option<Plane> {
    denoised.mse.as_ref().map(|mse| relative_mean(mse, &denoised.color))
}

/// The mean of an error plane, which is what a target is compared with.
pub fn mean_error(error: &Plane) -> f64 {
    error.data().iter().map(|&e| f64::from(e)).sum::<f64>() / error.data().len() as f64
}

/// How many of `budget` further samples each pixel gets, row by row: their sum is `budget`. `counts` are
/// the samples that left `error`. With a `target`, pixels whose error is at or under it get none; where
/// that is all of them, the sum is 0. Where there is no error at all and no target they all get as many.
///
/// # Errors
/// When `counts` is not of `error`'s size, an option is out of range, or a pixel's samples exceed 32 bits.
pub fn allocate(
    error: &Plane,
    counts: &[u32],
    budget: u64,
    target: Option<f32>,
    options: &SamplingOptions,
) -> Result<Vec<u32>> {
    let counts: Vec<f64> = counts.iter().map(|&n| f64::from(n)).collect();
    let pool = Pool::new(error, &counts, target, options)?;
    let Some(shares) = pool.spend(budget as f64, options) else { return Ok(vec![0; counts.len()]) };
    whole(&shares, error.width(), budget)
}

/// The density of the next pass's samples, 1 on the average: multiply it by the pass's samples per
/// pixel. It is meant for as many samples as there are already; `counts` are those, or `None` where all
/// pixels have as many. With a `target`, pixels at or under it get 0; where that is all of them, all do.
///
/// # Errors
/// As [`allocate`].
pub fn density(
    error: &Plane,
    counts: Option<&Plane>,
    target: Option<f32>,
    options: &SamplingOptions,
) -> Result<Plane> {
    let (width, height) = error.size();
    let pixels = (width * height) as f64;
    let counts = shares_of_mean(counts, width * height);
    let pool = Pool::new(error, &counts, target, options)?;
    let shares = pool.spend(pixels, options).unwrap_or(vec![0.0; counts.len()]);
    Plane::from_vec(width, height, shares.into_iter().map(|share| share as f32).collect())
}

/// The samples of each pixel, row by row, of a pass of `spp` samples per pixel by `density`: their product, in whole
/// numbers of the same sum.
///
/// # Errors
/// When a pixel's samples exceed 32 bits.
pub fn counts(density: &Plane, spp: u32) -> Result<Vec<u32>> {
    let shares: Vec<f64> = density.data().iter().map(|&share| f64::from(share)).collect();
    let budget = (shares.iter().sum::<f64>() * f64::from(spp)).round() as u64;
    whole(&shares, density.width(), budget)
}

/// The density of the next pass's samples in proportion to a method's own `priority`, 1 on the average;
/// flat where there is none.
pub fn proportional(priority: &Plane) -> Plane {
    let shares = shares_of_mean(Some(priority), priority.data().len());
    let (width, height) = priority.size();
    Plane::par_from_fn(width, height, |x, y| shares[y * width + x] as f32)
}

/// Samples per pixel as multiples of their mean over `pixels` pixels; 1 where nothing is known.
pub fn shares_of_mean(counts: Option<&Plane>, pixels: usize) -> Vec<f64> {
    let finite = |n: &f32| if n.is_finite() { f64::from(n.max(0.0)) } else { 0.0 };
    let sum: f64 = counts.map_or(0.0, |plane| plane.data().iter().map(finite).sum());
    match counts {
        Some(plane) if sum > 0.0 => plane.data().iter().map(|n| finite(n) * pixels as f64 / sum).collect(),
        _ => vec![1.0; pixels],
    }
}

/// The fewest further samples after which the mean of `error` should be at most `target`, given to
/// the pixels as [`allocate`] would without its limit; 0 where it is already. `counts` are the samples
/// of each pixel that left `error`, in any unit, and the result is in the same. An estimate, as good as the power law.
///
/// # Errors
/// As [`allocate`], or when `target` is not above 0.
pub fn samples_needed(error: &Plane, counts: &[f64], target: f64, options: &SamplingOptions) -> Result<f64> {
    if !(target.is_finite() && target > 0.0) {
        let what = format!("a target error of {target} where a number above 0 was expected");
        return Err(Error::new(ErrorKind::Usage, what).remedy("give 0.001, say"));
    }
    let pool = Pool::new(error, counts, None, options)?;
    let (mut low, mut high) = pool.levels();
    // Samples per pixel before and after, at a level; they are no fewer than before.
    let after = |level: f64, i: usize| (pool.wish[i] * level).max(pool.counts[i]);
    let remaining = |level: f64| {
        let of = |i: usize| pool.error[i] * (pool.counts[i] / after(level, i)).powf(options.decay);
        (0..pool.error.len()).map(of).sum::<f64>() / pool.error.len() as f64
    };
    if remaining(low) <= target {
        return Ok(0.0);
    }
    while remaining(high) > target {
        high *= 2.0;
    }
    for _ in 0..BISECTIONS {
        let level = (low * high).sqrt();
        if remaining(level) > target { low = level } else { high = level }
    }
    Ok((0..pool.error.len()).map(|i| after(high, i) - pool.counts[i]).sum())
}

/// Halvings of the level's logarithm: below f64's resolution.
const BISECTIONS: usize = 64;

/// The pixels that compete for samples; others have no wish.
struct Pool {
    error: Vec<f64>,
    counts: Vec<f64>,
    /// Samples that a pixel wishes at the level λ = 1; 0 where it wants none.
    wish: Vec<f64>,
}

impl Pool {
    fn new(error: &Plane, counts: &[f64], target: Option<f32>, options: &SamplingOptions) -> Result<Self> {
        let usage = |what: String, remedy: &str| Err(Error::new(ErrorKind::Usage, what).remedy(remedy));
        if counts.len() != error.data().len() {
            let (w, h) = error.size();
            let what = format!("{} sample counts for an error map of {w}×{h}", counts.len());
            return usage(what, "give one for each pixel");
        }
        if !(options.decay > 0.0 && options.decay <= 4.0) {
            return usage(format!("the decay is {}", options.decay), "give more than 0 and at most 4");
        }
        if !(options.limit >= 1.0 && options.limit.is_finite()) {
            return usage(format!("the limit is {}", options.limit), "give 1 or more");
        }
        if !(0.0..=1.0).contains(&options.even_share) {
            return usage(format!("the even share is {}", options.even_share), "give 0 to 1");
        }
        let error: Vec<f64> =
            error.data().iter().map(|e| if e.is_finite() { f64::from(e.max(0.0)) } else { 0.0 }).collect();
        let met = |e: f64| target.is_some_and(|target| e <= f64::from(target));
        // A pixel without samples counts as one with a few of the others' share; where there are none, as one.
        let sum: f64 = counts.iter().sum();
        let least = if sum > 0.0 { UNSAMPLED * sum / counts.len() as f64 } else { 1.0 };
        let counts: Vec<f64> = counts.iter().map(|n| n.max(least)).collect();
        let converged = error.iter().all(|e| *e == 0.0) && target.is_none();
        let wish = error.iter().zip(&counts).map(|(&e, n)| {
            let e = if converged { 1.0 } else { e };
            if met(e) { 0.0 } else { (e * n.powf(options.decay)).powf(1.0 / (1.0 + options.decay)) }
        });
        Ok(Self { wish: wish.collect(), error, counts })
    }

    /// A level at which nobody gets more than the least and one at which everybody who wishes has some more.
    fn levels(&self) -> (f64, f64) {
        let ratios = || self.wish.iter().zip(&self.counts).filter(|(w, _)| **w > 0.0).map(|(w, n)| n / w);
        (ratios().fold(f64::INFINITY, f64::min), 2.0 * ratios().fold(0.0, f64::max))
    }

    /// Every pixel's share of `budget`, not yet whole; `None` where no pixel wants any.
    fn spend(&self, budget: f64, options: &SamplingOptions) -> Option<Vec<f64>> {
        let wishing = self.wish.iter().filter(|w| **w > 0.0).count();
        if wishing == 0 {
            return None;
        }
        let mean = budget / wishing as f64;
        let (least, most) = (options.even_share * mean, options.limit * mean);
        let share = |level: f64, i: usize| {
            let wish = self.wish[i];
            if wish > 0.0 { (wish * level - self.counts[i]).clamp(least, most) } else { 0.0 }
        };
        let spent = |level: f64| (0..self.wish.len()).map(|i| share(level, i)).sum::<f64>();
        let (mut low, mut high) = self.levels();
        // All of them at the limit may miss the budget by a rounding.
        while spent(high) < budget * (1.0 - 1e-9) {
            high *= 2.0;
        }
        for _ in 0..BISECTIONS {
            let level = (low * high).sqrt();
            if spent(level) < budget { low = level } else { high = level }
        }
        Some((0..self.wish.len()).map(|i| share(high, i)).collect())
    }
}

/// The share of the mean count that pixels without samples are taken to have.
const UNSAMPLED: f64 = 0.1;

/// What a running sum may miss a half by, for its rounding error.
const TIE: f64 = 1e-6;

/// `budget` samples in proportion to `shares`, in numbers that a tracer takes.
fn whole(shares: &[f64], width: usize, budget: u64) -> Result<Vec<u32>> {
    let samples = round(shares, width, budget).into_iter().map(u32::try_from);
    samples.collect::<std::result::Result<_, _>>().map_err(|_| {
        Error::new(ErrorKind::Usage, format!("{budget} samples are too many for the pixels that need any"))
            .remedy("ask for fewer samples per pixel")
    })
}

/// Whole numbers with the sum `budget`: running sums are rounded, along rows that turn at their ends so that
/// a fraction's leftovers do not line up.
fn round(shares: &[f64], width: usize, budget: u64) -> Vec<u64> {
    let total: f64 = shares.iter().sum();
    let scale = if total > 0.0 { budget as f64 / total } else { 0.0 };
    let mut samples = vec![0; shares.len()];
    let (mut sum, mut given) = (0.0, 0u64);
    let mut last = 0;
    for step in 0..shares.len() {
        let (y, x) = (step / width, step % width);
        let i = if y % 2 == 0 { step } else { y * width + width - 1 - x };
        if shares[i] > 0.0 {
            sum += shares[i];
            let due = ((sum * scale + 0.5 + TIE) as u64).clamp(given, budget);
            samples[i] = due - given;
            given = due;
            last = i;
        }
    }
    samples[last] += budget - given;
    samples
}

#[cfg(test)]
mod tests;
