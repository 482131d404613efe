//! What the residual shows to be more than noise comes back.
//!
//! Around a pixel the residual y − ŷ should hold no more energy than the noise, N = Σ σ². Where it holds
//! more, S = Σ (y − ŷ)² > N, the reconstruction has lost something, and the positive-part James–Stein
//! estimate ŷ + max(0, 1 − N/S)(y − ŷ) has less risk than y itself wherever ŷ comes from. So the result
//! converges to the truth as samples are added, and detail that no feature knows survives.
//!
//! `[choice]` N is raised by a margin of its own chance deviation, since S is a sum over few pixels.

use super::variance::smooth;
use crate::image::{Plane, Rgb};

/// Radius of the neighbourhood over which S and N are summed.
const RADIUS: usize = 2;

/// Factor on N under which a residual passes for noise. The relative deviation of S over 25 pixels of
/// Gaussian noise is √(2/25) = 0.28; two of them, and heavier tails, are let pass.
const MARGIN: f32 = 2.0;

/// The share of the residual to give back at every pixel, 0 to 1.
pub fn shares(noisy: &Rgb, reconstruction: &Rgb, variance: &Rgb) -> Plane {
    let (width, height) = noisy[0].size();
    let residual = Plane::from_fn(width, height, |x, y| {
        noisy.iter().zip(reconstruction).map(|(a, b)| (a.get(x, y) - b.get(x, y)).powi(2)).sum()
    });
    let noise = Plane::from_fn(width, height, |x, y| variance.iter().map(|v| v.get(x, y)).sum());
    let (residual, noise) = (smooth(&residual, RADIUS), smooth(&noise, RADIUS));
    let shares = Plane::from_fn(width, height, |x, y| {
        let (s, n) = (residual.get(x, y), noise.get(x, y));
        if s > 0.0 { (1.0 - MARGIN * n / s).max(0.0) } else { 0.0 }
    });
    smooth(&shares, 1)
}

/// plane ← plane + share · (noisy − plane).
pub fn apply(plane: &mut Plane, noisy: &Plane, shares: &Plane) {
    for ((value, noisy), share) in plane.data_mut().iter_mut().zip(noisy.data()).zip(shares.data()) {
        *value += share * (noisy - *value);
    }
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
        let shares = shares(&noisy, &flat, &variance);
        assert_eq!(shares.get(1, 6), 0.0);
        assert!(shares.get(14, 6) > 0.99);
        let mut restored = flat[0].clone();
        apply(&mut restored, &noisy[0], &shares);
        assert!((restored.get(14, 6) - 5.0).abs() < 0.05);
    }
}
