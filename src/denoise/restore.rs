//! What the residual shows to be more than noise comes back.
//!
//! Around a pixel the residual y − ŷ should hold no more energy than the noise, N = Σ σ². Where it holds
//! more, S = Σ (y − ŷ)² > N, the reconstruction has lost something, and the positive-part James–Stein
//! estimate ŷ + max(0, 1 − N/S)(y − ŷ) has less risk than y itself if ŷ is independent of y. It is not quite: it
//! was fitted to y, and has taken some of the noise out of the residual, so that S is too small rather than too large.
//! So the result converges to the truth as samples are added, and detail that no feature knows survives.
//! `[choice]` N is taken for larger than it is by a margin, so that chance alone gives nothing back.
//!
//! A small highlight is not seen by that where few samples have found it: its pixels are dark by chance or noisy. But all
//! of them together are brighter than chance has it. So where the sum of the residuals is above m of its standard
//! deviations, R = Σ (y − ŷ) > m √N, the share max(0, 1 − m² N/R²) of every residual comes back, if that is more. Light
//! alone: what is darker than its fit all around has often been missed by the few samples that find it. `[choice]` with
//! both: relMSE ×0.981 on five scenes and ×0.999 on thirteen others, but ×1.06 behind a door ajar and ×1.11 on glossy
//! things at 16 spp. Not where the noise is estimated from the picture, which does not know its rare samples: ×1.05 on
//! the thirteen at 16 spp.
//!
//! | `[choice]` of m and the sums' radius, without [`LIGHT_SHARE`] | five scenes: relMSE, MSE, light lost | thirteen others |
//! |---|--:|--:|
//! | no sums | 1, 1, 1.19 % | 1, 1, 1.76 % |
//! | 1.8, 2 | ×0.995, ×0.953, 0.99 % | ×1.008, ×0.960, 1.65 % |
//! | 2, 1 | ×0.995, ×0.963, 1.09 % | ×0.993, ×0.978, 1.72 % |
//! | 2, 2 | ×0.994, ×0.955, 1.05 % | ×0.997, ×0.966, 1.68 % |
//! | 2, 3 | ×0.999, ×0.957, 1.02 % | ×1.007, ×0.962, 1.66 % |
//! | 2.3, 2 | ×0.995, ×0.958, 1.10 % | ×0.995, ×0.977, 1.72 % |

use super::reconstruction::Reconstruction;
use super::signal::Signal;
use super::variance::{around as places, smooth};
use crate::image::{Plane, Rgb, mean_of_channels, squared_difference, sum_of_channels};
use rayon::prelude::*;

/// Radius of the neighbourhood over which S and N are summed.
const RADIUS: usize = 2;

/// Factor on N under which a residual passes for noise. The relative deviation of S over 25 pixels of
/// Gaussian noise is √(2/25) = 0.28; two of them, and heavier tails, are let pass. `[choice]` 1.5 against 2: relMSE ×0.996
/// on five scenes and ×1.000 on thirteen others (16 to 256 spp), but ×1.08 and ×1.12 without their variances.
const MARGIN: f32 = 2.0;

/// That margin is at least 1 + this / √n, n the effective number (Σ σ²)²/Σ σ⁴ of pixels that the noise comes from:
/// where one of them has nearly all of it, its own deviation of √2 is let pass, which would show as a speck. `[choice]`
/// of 0, 2 and 3: relMSE ×1, ×1.000 and ×1.003 on five and thirteen scenes; at 2 specks in fog are gone, at 3 small
/// highlights on glass go too.
const LONE_MARGIN: f32 = 2.0;

/// Radius over which noise is averaged of which [`LEAST_NOISE`] counts.
const NOISE_RADIUS: usize = 7;

/// N is at least this share of the noise of all pixels within [`NOISE_RADIUS`]: those that a rare light has missed
/// do not know of it, and came back as dark specks where their neighbours' light had been spread. `[choice]` of 0, 0.1
/// and 0.5: relMSE ×1, ×1.004 and ×1.005 (five scenes), ×1, ×1.000 and ×1.000 (thirteen others); within 4 pixels ×1.002
/// and ×1.000, but half of the specks stay.
const LEAST_NOISE: f32 = 0.1;

/// Radius over which the shares are averaged.
const SHARE_RADIUS: usize = 1;

/// m, the deviations under which a sum of residuals passes for chance.
const LIGHT_MARGIN: f32 = 2.0;

/// Radius of those sums, and of the mean of the shares that come of them.
const LIGHT_RADIUS: usize = 2;

/// This share of the light that is there counts as a sum's noise, too: on walls two deviations are often exceeded by
/// chance, and show as specks. `[choice]` of 0, 0.1, 0.25 and 0.5: relMSE ×0.994, ×0.997, ×0.998 and ×0.999,
/// MSE ×0.955, ×0.961, ×0.976 and ×0.984 of the result without light (five scenes); at 0.1 the specks on floors are gone, and most of those on walls.
const LIGHT_SHARE: f32 = 0.1;

/// How far around a pixel the shares look: the widest of the means, and theirs.
pub const REACH: usize = NOISE_RADIUS + SHARE_RADIUS;

/// Brings back the detail and the light that the residual shows to be lost, in every target alike; where it does, the
/// noise comes back too. Light where the variance was `measured`, not estimated from the picture.
pub fn apply(result: &mut Reconstruction, signal: &Signal, measured: bool) {
    let (noisy, color) = (signal.color(), result.color());
    let mut shares = shares(noisy, &color, &signal.variance, &signal.smoothed);
    if measured {
        shares.combine(&shares_of_light(noisy, &color, &signal.variance), f32::max);
    }
    for (plane, noisy) in result.targets.iter_mut().zip(&signal.targets) {
        blend(plane, noisy, &shares);
    }
    blend(&mut result.mse, &mean_of_channels(&signal.variance), &shares);
}

/// The share of the residual to give back at every pixel, 0 to 1; the noise is that of the `smoothed` variance.
fn shares(noisy: [&Plane; 3], reconstruction: &Rgb, variance: &Rgb, smoothed: &Rgb) -> Plane {
    let (width, height) = noisy[0].size();
    let residual = squared_difference(noisy, reconstruction);
    let noise = sum_of_channels(smoothed);
    let own = sum_of_channels(variance);
    let around = |plane: &Plane| smooth(plane, RADIUS);
    let squares = around(&Plane::par_from_fn(width, height, |x, y| own.get(x, y).powi(2).min(f32::MAX)));
    let widely = smooth(&own, NOISE_RADIUS);
    let (residual, noise, own) = (around(&residual), around(&noise), around(&own));
    let shares = Plane::par_from_fn(width, height, |x, y| {
        let (s, own) = (residual.get(x, y), own.get(x, y));
        let n = noise.get(x, y).max(LEAST_NOISE * widely.get(x, y));
        let pixels = pixels_within(RADIUS, [x, y], (width, height));
        let lone = if own > 0.0 { (squares.get(x, y) / pixels).sqrt() / own } else { 0.0 };
        let margin = MARGIN.max(1.0 + LONE_MARGIN * lone);
        if s > 0.0 { (1.0 - margin * n / s).max(0.0) } else { 0.0 }
    });
    smooth(&shares, SHARE_RADIUS)
}

/// The same for light. The channels' noise is of the same paths, so their deviations are added, not their variances.
fn shares_of_light(noisy: [&Plane; 3], reconstruction: &Rgb, variance: &Rgb) -> Plane {
    let (width, height) = noisy[0].size();
    let residual = Plane::par_from_fn(width, height, |x, y| {
        let pairs = noisy.iter().zip(reconstruction);
        pairs.map(|(a, b)| a.get(x, y) - b.get(x, y)).sum::<f32>().clamp(f32::MIN, f32::MAX)
    });
    let noise = Plane::par_from_fn(width, height, |x, y| {
        variance.iter().map(|v| v.get(x, y).sqrt()).sum::<f32>().powi(2).min(f32::MAX)
    });
    let light = sum_of_channels(reconstruction);
    let [residual, noise, light] = [residual, noise, light].map(|plane| smooth(&plane, LIGHT_RADIUS));
    let shares = Plane::par_from_fn(width, height, |x, y| {
        let r = residual.get(x, y);
        let n = noise.get(x, y) / pixels_within(LIGHT_RADIUS, [x, y], (width, height)); // of the mean of so many
        let n = n + (LIGHT_SHARE * light.get(x, y)).powi(2);
        if r > 0.0 { (1.0 - LIGHT_MARGIN.powi(2) * (n / r) / r).max(0.0) } else { 0.0 }
    });
    smooth(&shares, LIGHT_RADIUS)
}

/// How many pixels a mean over `radius` is of at column `x` and row `y`.
fn pixels_within(radius: usize, [x, y]: [usize; 2], (width, height): (usize, usize)) -> f32 {
    (places(x, radius, width).len() * places(y, radius, height).len()) as f32
}

/// plane ← plane + share · (noisy − plane).
fn blend(plane: &mut Plane, noisy: &Plane, shares: &Plane) {
    plane.rows_mut().enumerate().for_each(|(y, row)| {
        for ((value, noisy), share) in row.iter_mut().zip(noisy.row(y)).zip(shares.row(y)) {
            *value += share * (noisy - *value);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(f: impl Fn(usize, usize) -> f32) -> Rgb {
        std::array::from_fn(|_| Plane::from_fn(16, 12, &f))
    }

    #[test]
    fn lost_detail_comes_back_and_noise_does_not() {
        let noisy = grey(|x, y| if x < 8 { 1.0 + 0.1 * (((x * 7 + y * 3) % 5) as f32 - 2.0) } else { 5.0 });
        let flat = grey(|_, _| 1.0);
        let variance = grey(|_, _| 0.02);
        let shares = shares(noisy.each_ref(), &flat, &variance, &variance);
        assert_eq!(shares.get(1, 6), 0.0);
        assert!(shares.get(14, 6) > 0.99);
        let mut restored = flat[0].clone();
        blend(&mut restored, &noisy[0], &shares);
        assert!((restored.get(14, 6) - 5.0).abs() < 0.05);
    }

    #[test]
    fn a_highlight_comes_back_that_no_pixel_shows_alone() {
        // Every pixel of it is brighter than its fit by its own deviation: of 25 that is five of their sum's.
        let share = |deviations: f32, scale: f32| {
            let noisy = grey(|x, y| {
                scale * if (6..11).contains(&x) && (3..8).contains(&y) { 1.0 + deviations } else { 1.0 }
            });
            let (fit, variance) = (grey(|_, _| scale), grey(|_, _| scale * scale));
            assert_eq!(shares(noisy.each_ref(), &fit, &variance, &variance).get(8, 5), 0.0);
            let shares = shares_of_light(noisy.each_ref(), &fit, &variance);
            assert_eq!(shares.get(1, 10), 0.0);
            shares.get(8, 5)
        };
        for scale in [1.0, 1e-12, 1e12] {
            assert!(share(1.0, scale) > 0.3, "{}", share(1.0, scale));
            assert_eq!(share(0.4, scale), 0.0);
            assert_eq!(share(-1.0, scale), 0.0, "it may have been missed by chance");
        }
    }

    #[test]
    fn pixels_that_a_rare_light_has_missed_do_not_come_back() {
        let noisy = grey(|_, _| 0.9);
        let share = |bright: f32| {
            let variance = grey(|x, y| if (x, y) == (12, 6) { bright } else { 1e-6 });
            shares(noisy.each_ref(), &grey(|_, _| 1.0), &variance, &variance).get(6, 6)
        };
        assert!(share(1e-6) > 0.99 && share(20.0) == 0.0);
    }

    #[test]
    fn a_lone_pixel_must_stand_out_of_its_noise_by_more_than_many() {
        let share = |spot: (usize, usize), deviations: f32| {
            let noisy = grey(|x, y| if (x, y) == spot { 1.0 + deviations } else { 1.0 });
            let variance = grey(|x, y| if (x, y) == spot { 1.0 } else { 1e-4 });
            shares(noisy.each_ref(), &grey(|_, _| 1.0), &variance, &variance).get(spot.0, spot.1)
        };
        // Of one pixel the margin is 3, of many 2, and also in a corner, where there are fewer around.
        for spot in [(8, 6), (0, 0), (15, 0)] {
            assert_eq!(share(spot, 1.7), 0.0, "{spot:?}");
            let far = share(spot, 6.0);
            assert!((far - (1.0 - 3.0 / 36.0)).abs() < 0.01, "{spot:?}: {far}");
        }
    }
}
