//! What the residual shows to be more than noise comes back: detail, then light.
//!
//! Around a pixel the residual y − ŷ should hold no more energy than the noise, N = Σ σ². Where it holds
//! more, S = Σ (y − ŷ)² > N, the reconstruction has lost something, and the positive-part James–Stein
//! estimate ŷ + max(0, 1 − N/S)(y − ŷ) has less risk than y itself wherever ŷ comes from. So the result
//! converges to the truth as samples are added, and detail that no feature knows survives.
//!
//! Weights that distrust bright and noisy samples lose light on the average. Over some more pixels the
//! mean residual shows that too: where it stands out of its own noise, ŷ is multiplied by what is missing.
//!
//! `[choice]` both are shrunk by a margin, so that chance alone gives nothing back. Light: 16 spp, four
//! dark scenes with heavy tails: relMSE ×0.96, energy of bright defocused discs from −36 % to −18 %; no
//! change elsewhere. Radius 15 returns more light but to the wrong pixels (discs: relMSE ×1.7).

use super::variance::smooth;
use crate::image::{Plane, Rgb, sum_of_channels};
use rayon::prelude::*;

/// Radius of the neighbourhood over which S and N are summed for detail.
const DETAIL_RADIUS: usize = 2;

/// Factor on N under which a residual passes for noise. The relative deviation of S over 25 pixels of
/// Gaussian noise is √(2/25) = 0.28; two of them, and heavier tails, are let pass.
const DETAIL_MARGIN: f32 = 2.0;

/// That margin is at least 1 + this / √n, n the effective number (Σ σ²)²/Σ σ⁴ of pixels that the noise comes from:
/// where one of them has nearly all of it, its own deviation of √2 is let pass, which would show as a speck. `[choice]`
/// of 0, 2 and 3: relMSE ×1, ×1.000 and ×1.003 on five and thirteen scenes; at 2 specks in fog are gone, at 3 small
/// highlights on glass go too.
const LONE_MARGIN: f32 = 2.0;

/// Pixels of that neighbourhood.
const DETAIL_PIXELS: f32 = ((2 * DETAIL_RADIUS + 1) * (2 * DETAIL_RADIUS + 1)) as f32;

/// Radius over which the shares are averaged.
const SHARE_RADIUS: usize = 1;

/// Radius of the neighbourhood over which the residual's mean is taken for light.
const LIGHT_RADIUS: usize = 4;

/// Squared number of deviations that a mean residual must stand out of its noise.
const LIGHT_MARGIN: f32 = 9.0;

/// How far around a pixel both look: the means of detail, of its shares, and of light.
pub const REACH: usize = DETAIL_RADIUS + SHARE_RADIUS + LIGHT_RADIUS;

/// Light is at most doubled and at most halved.
const LIGHT_RANGE: (f32, f32) = (0.5, 2.0);

/// The share of the residual to give back at every pixel, 0 to 1; the noise is that of the `smoothed` variance.
pub fn detail_shares(noisy: &Rgb, reconstruction: &Rgb, variance: &Rgb, smoothed: &Rgb) -> Plane {
    let (width, height) = noisy[0].size();
    let residual = Plane::par_from_fn(width, height, |x, y| {
        noisy
            .iter()
            .zip(reconstruction)
            .map(|(a, b)| (a.get(x, y) - b.get(x, y)).powi(2))
            .sum::<f32>()
            .min(f32::MAX)
    });
    let noise = sum_of_channels(smoothed);
    let own = sum_of_channels(variance);
    let around = |plane: &Plane| smooth(plane, DETAIL_RADIUS);
    let squares = around(&Plane::par_from_fn(width, height, |x, y| own.get(x, y).powi(2).min(f32::MAX)));
    let (residual, noise, own) = (around(&residual), around(&noise), around(&own));
    let shares = Plane::par_from_fn(width, height, |x, y| {
        let (s, n, own) = (residual.get(x, y), noise.get(x, y), own.get(x, y));
        let lone = if own > 0.0 { (squares.get(x, y) / DETAIL_PIXELS).sqrt() / own } else { 0.0 };
        let margin = DETAIL_MARGIN.max(1.0 + LONE_MARGIN * lone);
        if s > 0.0 { (1.0 - margin * n / s).max(0.0) } else { 0.0 }
    });
    smooth(&shares, SHARE_RADIUS)
}

/// plane ← plane + share · (noisy − plane).
pub fn blend(plane: &mut Plane, noisy: &Plane, shares: &Plane) {
    plane.rows_mut().enumerate().for_each(|(y, row)| {
        for ((value, noisy), share) in row.iter_mut().zip(noisy.row(y)).zip(shares.row(y)) {
            *value += share * (noisy - *value);
        }
    });
}

/// The factor by which every pixel of one channel is to be multiplied: 1 where the mean residual around
/// it is within its noise.
pub fn light_factors(noisy: &Plane, reconstruction: &Plane, variance: &Plane) -> Plane {
    let (width, height) = noisy.size();
    let missing = Plane::par_from_fn(width, height, |x, y| noisy.get(x, y) - reconstruction.get(x, y));
    let missing = smooth(&missing, LIGHT_RADIUS);
    let light = smooth(reconstruction, LIGHT_RADIUS);
    let noise = smooth(variance, LIGHT_RADIUS);
    let pixels = (2 * LIGHT_RADIUS + 1).pow(2) as f32;
    Plane::par_from_fn(width, height, |x, y| {
        let (missing, light) = (missing.get(x, y), light.get(x, y));
        let chance = LIGHT_MARGIN * noise.get(x, y) / pixels;
        let signal = missing * missing;
        if light > 0.0 && signal > chance {
            (1.0 + missing / light * (1.0 - chance / signal)).clamp(LIGHT_RANGE.0, LIGHT_RANGE.1)
        } else {
            1.0
        }
    })
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
        let shares = detail_shares(&noisy, &flat, &variance, &variance);
        assert_eq!(shares.get(1, 6), 0.0);
        assert!(shares.get(14, 6) > 0.99);
        let mut restored = flat[0].clone();
        blend(&mut restored, &noisy[0], &shares);
        assert!((restored.get(14, 6) - 5.0).abs() < 0.05);
    }

    #[test]
    fn light_comes_back_where_it_is_missing_beyond_chance() {
        let noisy = Plane::from_fn(40, 12, |x, y| {
            let noise = 0.1 * (((x * 7 + y * 3) % 5) as f32 - 2.0);
            if x < 20 { 1.0 + noise } else { 1.5 + noise }
        });
        let factors = light_factors(&noisy, &Plane::filled(40, 12, 1.0), &Plane::filled(40, 12, 0.02));
        assert_eq!(factors.get(5, 6), 1.0);
        assert!((1.45..1.5).contains(&factors.get(34, 6)), "{}", factors.get(34, 6));
    }
}
