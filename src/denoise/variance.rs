//! The variance of the colour's mean: given, from half buffers, or from the picture itself.

use super::exposure::limited_variance;
use super::sanitize::Clean;
use super::vectors;
use crate::frame::Summary;
use crate::image::{Plane, Rgb};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

/// Radius over which single-pixel estimates (one degree of freedom each) are averaged.
const ESTIMATE_RADIUS: usize = 3;

/// Radius over which a high-pass of the picture is averaged. `[choice]` 2 against 1: relMSE ×1.03 (18 scenes
/// without their variances).
const HIGH_PASS_RADIUS: usize = 1;

/// How far around a pixel the first estimate looks: means over half buffers look farther than the high-pass.
pub const REACH: usize = ESTIMATE_RADIUS;

/// Radius over which squared residuals are averaged. `[choice]` against 2: 1 ×1.35, 3 ×1.2.
pub const RESIDUAL_RADIUS: usize = 2;

/// A fit takes some of the noise with it: what it leaves is multiplied by this. `[choice]` of 1, 1.25 and 1.5:
/// relMSE ×1.02, ×1 and ×0.99, with the last one fine detail came out worse than it went in.
const RESIDUAL_GAIN: f32 = 1.25;

/// The variance of the mean of `clean`'s colour, which gives up its own, with a note in `summary` on how it was had.
pub fn of_mean(clean: &mut Clean<'_>, summary: &mut Summary) -> Rgb {
    if let Some(variance) = clean.variance.take() {
        return variance;
    }
    if let Some([a, b]) = &clean.halves {
        summary.notes.push("variance: from the half buffers, averaged over 7×7 pixels".into());
        return std::array::from_fn(|c| {
            let mut squares = from_halves(&a[c], &b[c]);
            squares.change(limited_variance);
            smooth(&squares, ESTIMATE_RADIUS)
        });
    }
    summary.notes.push(
        "variance: estimated from the picture itself, which takes detail that no feature shows for noise"
            .into(),
    );
    std::array::from_fn(|c| from_picture(&clean.color[c]))
}

/// ((A − B)/2)²: unbiased for the variance of (A + B)/2, with one degree of freedom.
pub fn from_halves(a: &Plane, b: &Plane) -> Plane {
    Plane::par_from_fn(a.width(), a.height(), |x, y| half_difference_squared(a.get(x, y), b.get(x, y)))
}

/// ((a − b)/2)²; may be infinite.
pub fn half_difference_squared(a: f32, b: f32) -> f32 {
    let half = 0.5 * (a - b);
    half * half
}

/// Noise from a high-pass: the stencil [1 −2 1; −2 4 −2; 1 −2 1]/6 leaves white noise its variance and
/// cancels planes and parabolas (Immerkær 1996). `[choice]` the mean of its squares: that of its magnitudes, which
/// edges disturb less, makes little of the rare bright samples that most of the noise is: relMSE ×2.4 at 16 spp,
/// ×1.5 at 64, ×1.15 at 256 (18 scenes without their variances).
fn from_picture(color: &Plane) -> Plane {
    let (w, h) = color.size();
    let at = |x: isize, y: isize| {
        color.get(x.clamp(0, w as isize - 1) as usize, y.clamp(0, h as isize - 1) as usize)
    };
    let stencil = [1.0f32, -2.0, 1.0];
    let high_pass = Plane::par_from_fn(w, h, |x, y| {
        let mut sum = 0.0;
        for (j, v) in stencil.iter().enumerate() {
            for (i, u) in stencil.iter().enumerate() {
                sum += u * v * at(x as isize + i as isize - 1, y as isize + j as isize - 1);
            }
        }
        limited_variance((sum / 6.0).powi(2))
    });
    smooth(&high_pass, HIGH_PASS_RADIUS)
}

/// The second estimate of the variance of `noisy`: min(`before`, 1.25 · mean of (noisy − `fit`)² over 5×5 pixels).
/// The high-pass takes texture for noise; a fit explains what features show of it. `[choice]` relMSE against none ×1.04 at
/// 16 spp, ×0.92 at 64, ×0.77 at 256; without it fine detail came out four times as wrong as it went in (18 scenes
/// without their variances).
pub fn from_residual(noisy: &Plane, fit: &Plane, before: &Plane) -> Plane {
    let squares = Plane::par_from_fn(noisy.width(), noisy.height(), |x, y| {
        limited_variance((noisy.get(x, y) - fit.get(x, y)).powi(2))
    });
    let mut variance = smooth(&squares, RESIDUAL_RADIUS);
    variance.combine(before, |left, before| before.min(RESIDUAL_GAIN * left));
    variance
}

/// The share of its neighbourhood's variance that every pixel's is at least, for the weights. `[choice]`
/// relMSE against 0 on five scenes: ×0.996 at 16 spp, ×0.988 at 64; over 5×5 pixels ×1.001 and ×0.991, there
/// 0.02 is ×1.002 and ×1.001. Where one sample in a hundred is a firefly, ×0.05 at 16 samples.
const LEAST_SHARE: f32 = 0.005;

/// Radius of that neighbourhood.
pub const TRUSTED_RADIUS: usize = 4;

/// `variance`, at least 0.5 % of its mean over 9×9 pixels: what the weights may believe of it. A few samples that all missed the light say that there is no
/// noise at all: such pixels would resemble nothing but pixels of the very same colour, and what a firefly
/// among them brightened would resemble nothing.
pub fn trusted(variance: &Plane) -> Plane {
    let around = smooth(variance, TRUSTED_RADIUS);
    Plane::par_from_fn(variance.width(), variance.height(), |x, y| {
        variance.get(x, y).max(LEAST_SHARE * around.get(x, y))
    })
}

/// The mean over a square of `radius` around every pixel, clipped at the border.
pub fn smooth(plane: &Plane, radius: usize) -> Plane {
    if radius == 0 {
        return plane.clone();
    }
    let ((w, h), arch) = (plane.size(), vectors::widest());
    let mut across = Plane::filled(w, h, 0.0);
    across.rows_mut().enumerate().for_each_init(
        || vec![0.0f64; w],
        |sums, (y, means)| arch.dispatch(Across { row: plane.row(y), radius, sums, means }),
    );
    let mut smooth = Plane::filled(w, h, 0.0);
    smooth.rows_mut().enumerate().for_each_init(
        || vec![0.0f64; w],
        |sums, (y, means)| arch.dispatch(Down { plane: &across, rows: around(y, radius, h), sums, means }),
    );
    smooth
}

/// The places within `radius` of `at` among `n`.
pub fn around(at: usize, radius: usize, n: usize) -> Range<usize> {
    at.saturating_sub(radius)..(at + radius + 1).min(n)
}

/// Means along a row; `sums` is to work in.
struct Across<'a> {
    row: &'a [f32],
    radius: usize,
    sums: &'a mut [f64],
    means: &'a mut [f32],
}

impl WithSimd for Across<'_> {
    type Output = ();

    /// Shift by shift: all columns at once, each in the order of its window.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { row, radius, sums, means } = self;
        let w = row.len();
        sums.fill(0.0);
        for shift in 0..=2 * radius {
            let to = radius.saturating_sub(shift);
            let from = &row[shift.saturating_sub(radius).min(w)..];
            sums[to.min(w)..].iter_mut().zip(from).for_each(|(sum, v)| *sum += f64::from(*v));
        }
        for (x, (mean, sum)) in means.iter_mut().zip(&*sums).enumerate() {
            *mean = (sum / around(x, radius, w).len() as f64) as f32;
        }
    }
}

/// Means of `rows`, column by column; `sums` is to work in.
struct Down<'a> {
    plane: &'a Plane,
    rows: Range<usize>,
    sums: &'a mut [f64],
    means: &'a mut [f32],
}

impl WithSimd for Down<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { plane, rows, sums, means } = self;
        let n = rows.len() as f64;
        sums.fill(0.0);
        for row in rows {
            sums.iter_mut().zip(plane.row(row)).for_each(|(sum, v)| *sum += f64::from(*v));
        }
        means.iter_mut().zip(&*sums).for_each(|(mean, sum)| *mean = (sum / n) as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gaussian noise of unit variance, from sums of a small generator.
    fn noise(width: usize, height: usize) -> Plane {
        let mut seed = 7u32;
        Plane::from_fn(width, height, |_, _| {
            let mut sum = 0.0;
            for _ in 0..12 {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                sum += (seed >> 8) as f32 / (1 << 24) as f32;
            }
            sum - 6.0
        })
    }

    #[test]
    fn noise_on_a_parabola_is_measured_from_the_picture() {
        let noise = noise(80, 60);
        let picture = Plane::from_fn(80, 60, |x, y| {
            let (x, y) = (x as f32, y as f32);
            0.01 * x * x - 0.02 * x * y + 3.0 + 0.5 * noise.get(x as usize, y as usize)
        });
        let variance = from_picture(&picture);
        let mean = variance.data().iter().sum::<f32>() / 4800.0;
        assert!((mean - 0.25).abs() < 0.03, "{mean}");
    }

    #[test]
    fn halves_give_the_variance_of_their_mean() {
        let (a, b) = (noise(64, 64), Plane::filled(64, 64, 0.0));
        let mean = from_halves(&a, &b).data().iter().sum::<f32>() / 4096.0;
        assert!((mean - 0.25).abs() < 0.02, "{mean}");
    }

    #[test]
    fn a_pixel_without_noise_among_noisy_ones_is_believed_no_more_than_a_share() {
        let variance = Plane::from_fn(30, 9, |x, _| if x < 10 && x != 5 { 81.0 / 72.0 } else { 0.0 });
        let trusted = trusted(&variance);
        assert!((trusted.get(5, 4) - LEAST_SHARE).abs() < 1e-6);
        assert_eq!(trusted.get(4, 4), variance.get(4, 4));
        assert_eq!(trusted.get(29, 4), 0.0, "where nothing around is noisy there is no noise");
    }

    #[test]
    fn what_a_fit_explains_is_no_noise() {
        let noise = noise(64, 64);
        let detail = |x: usize, y: usize| if (x + y).is_multiple_of(2) { 3.0 } else { -3.0 };
        let noisy = Plane::from_fn(64, 64, |x, y| detail(x, y) + noise.get(x, y));
        let before = from_picture(&noisy);
        let mean = |plane: &Plane| plane.data().iter().sum::<f32>() / 4096.0;
        assert!(mean(&before) > 9.0, "a chequerboard is all high-pass");
        let after = from_residual(&noisy, &Plane::from_fn(64, 64, detail), &before);
        assert!((mean(&after) - RESIDUAL_GAIN).abs() < 0.1, "{}", mean(&after));
        let never_more = from_residual(&noisy, &Plane::filled(64, 64, 100.0), &before);
        assert_eq!(never_more, before);
    }

    #[test]
    fn smoothing_keeps_a_constant() {
        assert!(smooth(&Plane::filled(5, 3, 0.75), 2).data().iter().all(|&v| v == 0.75));
    }
}
