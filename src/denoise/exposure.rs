//! The picture's exposure: a power of two that brings its typical radiance near 1.
//!
//! Every absolute constant of the method (what counts as dark, the floor of a risk) is meant in these
//! units, so that a picture scaled by 2^n gives the same result scaled by 2^n, bit for bit.

use super::condition::power_of_two_near_inverse;
use crate::image::Plane;

/// Exposed values are no larger than this (2^90), so that sums over a window, weighted by risks and taken
/// through an albedo, stay in `f32`.
const LARGEST_EXPOSED: f32 = (1u128 << 90) as f32;

/// What a picture's exposure is made of. Summed row by row, so that it does not depend on how many rows
/// are added at once.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Light {
    /// Σ log₂ of the positive luminances.
    log2: f64,
    /// How many those are.
    pixels: usize,
    /// The largest magnitude of any value.
    largest: f32,
}

impl Light {
    /// Adds the next row's luminances.
    pub fn add_row(&mut self, luminances: impl Iterator<Item = f64>) {
        let mut row = 0.0;
        for luminance in luminances.filter(|luminance| *luminance > 0.0) {
            row += luminance.log2();
            self.pixels += 1;
        }
        self.log2 += row;
    }

    /// Adds a value that must stay within `f32` when exposed.
    pub fn add_value(&mut self, value: f32) {
        self.largest = self.largest.max(value.abs());
    }

    /// The factor to multiply radiance by: 2^−round(log₂ L), L the geometric mean of the positive
    /// luminances; 1 for a picture without light; less where the largest value would grow beyond
    /// [`LARGEST_EXPOSED`].
    pub fn scale(&self) -> f32 {
        let most = power_of_two_near_inverse(self.largest) * LARGEST_EXPOSED;
        let typical = (self.log2 / self.pixels.max(1) as f64).round().clamp(-100.0, 100.0);
        ((-typical).exp2() as f32).min(most)
    }
}

/// Multiplies a plane by `factor`; what would leave the finite numbers keeps to their end.
pub fn expose(plane: &mut Plane, factor: f32) {
    plane.change(|v| (v * factor).clamp(f32::MIN, f32::MAX));
}

/// Multiplies a plane of variances by `factor`²; no larger than [`LARGEST_EXPOSED`] either.
pub fn expose_variance(plane: &mut Plane, factor: f32) {
    plane.change(|v| limited_variance(v * factor * factor));
}

/// A variance of what is exposed, no larger than [`LARGEST_EXPOSED`] either.
pub fn limited_variance(variance: f32) -> f32 {
    variance.min(LARGEST_EXPOSED)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grey_of_an_eighth_needs_eight_and_black_needs_nothing() {
        let scale = |grey: f32, largest: f32| {
            let mut light = Light::default();
            (0..2).for_each(|_| light.add_row([f64::from(grey); 3].into_iter()));
            light.add_value(-largest);
            light.scale()
        };
        assert_eq!(scale(0.125, 0.125), 8.0);
        assert_eq!(scale(0.13, 0.13), 8.0);
        assert_eq!(scale(0.0, 0.0), 1.0);
        let limited = scale(1.0, 1e32);
        assert!(limited * 1e32 <= 2.0 * LARGEST_EXPOSED && limited * 1e32 > 0.5 * LARGEST_EXPOSED);
    }
}
