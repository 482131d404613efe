//! The picture's exposure: a power of two that brings its typical radiance near 1.
//!
//! Every absolute constant of the method (what counts as dark, the floor of a risk) is meant in these
//! units, so that a picture scaled by 2^n gives the same result scaled by 2^n, bit for bit.

use crate::image::Plane;

/// Of [`LARGEST_EXPOSED`].
const EXPONENT: u32 = 90;

/// Exposed values are no larger than this, so that sums over a window, weighted by risks and taken
/// through an albedo, stay in `f32`. Radiance beyond it is a defect.
pub const LARGEST_EXPOSED: f32 = (1u128 << EXPONENT) as f32;

/// By how much luminances stay below that, in log₂: a channel may be three times as bright, and exposures are rounded.
const HEADROOM: f64 = 3.0;

/// What lies more deviations than this above the mean log₂ luminance is lone, and may leave the range. A share p of
/// all pixels lies at most √(1/p − 1) of them off: it is less than a thousandth.
const DEVIATIONS: f64 = 32.0;

/// What a picture's exposure is made of. Summed row by row, so that it does not depend on how many rows
/// are added at once.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Light {
    /// Σ log₂ of the positive luminances.
    log2: f64,
    /// Σ of its squares.
    squares: f64,
    /// How many those are.
    pixels: usize,
    /// The largest luminance.
    largest: f64,
}

impl Light {
    /// Adds the next row's luminances.
    #[expect(clippy::disallowed_methods, reason = "only the rounded mean of the logarithms is of use")]
    pub fn add_row(&mut self, luminances: impl Iterator<Item = f64>) {
        let (mut row, mut squares) = (0.0, 0.0);
        for luminance in luminances.filter(|luminance| *luminance > 0.0) {
            let log2 = luminance.log2();
            row += log2;
            squares += log2 * log2;
            self.pixels += 1;
            self.largest = self.largest.max(luminance);
        }
        self.log2 += row;
        self.squares += squares;
    }

    /// The factor to multiply radiance by: 2^−round(log₂ L), L the geometric mean of the positive
    /// luminances; 1 for a picture without light. It is less where more than lone pixels would grow beyond
    /// [`LARGEST_EXPOSED`], as a picture on a background of 1e-38 would.
    #[expect(clippy::disallowed_methods, reason = "the logarithm is rounded, and a power of two is exact")]
    pub fn scale(&self) -> f32 {
        let pixels = self.pixels.max(1) as f64;
        let mean = self.log2 / pixels;
        let deviation = (self.squares / pixels - mean * mean).max(0.0).sqrt();
        let highest = self.largest.log2().min(mean + DEVIATIONS * deviation); // −∞ without light
        let typical = mean.max(highest - (f64::from(EXPONENT) - HEADROOM));
        (-typical.round().clamp(-100.0, 100.0)).exp2() as f32
    }
}

/// Multiplies a plane by `factor`; saturates at ±`f32::MAX`.
pub fn expose(plane: &mut Plane, factor: f32) {
    plane.change(|v| (v * factor).clamp(f32::MIN, f32::MAX));
}

/// Multiplies a plane of variances by `factor`²; no larger than [`LARGEST_EXPOSED`] either.
pub fn expose_variance(plane: &mut Plane, factor: f32) {
    plane.change(|v| limited_variance(v * factor * factor));
}

/// Takes a plane of squared errors back to where `exposure` came from: a number from 0 to `f32::MAX`.
#[expect(clippy::manual_clamp, reason = "NaN is to become 0")]
pub fn unexpose_error(plane: &mut Plane, exposure: f32) {
    let back = exposure.recip(); // its square may be out of range
    plane.change(|v| (v * back * back).max(0.0).min(f32::MAX));
}

/// A variance of what is exposed, no larger than [`LARGEST_EXPOSED`] either.
pub fn limited_variance(variance: f32) -> f32 {
    variance.min(LARGEST_EXPOSED)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of so many pixels of each grey.
    fn scale<const N: usize>(greys: [(f64, usize); N]) -> f32 {
        let mut light = Light::default();
        greys.iter().for_each(|(grey, pixels)| light.add_row(std::iter::repeat_n(*grey, *pixels)));
        light.scale()
    }

    #[test]
    fn a_grey_of_an_eighth_needs_eight_and_black_needs_nothing() {
        assert_eq!([0.125, 0.13, 0.0].map(|grey| scale([(grey, 6)])), [8.0, 8.0, 1.0]);
    }

    #[test]
    fn what_is_lone_does_not_darken_the_picture_and_what_is_rare_stays_in_range() {
        assert_eq!(scale([(1.0, 1999), (1e32, 1)]), 1.0);
        for share in [2, 10, 500] {
            let scale = scale([(1e-30, 1000 - 1000 / share), (1.0, 1000 / share)]);
            assert!(3.0 * scale <= LARGEST_EXPOSED && scale >= 2f32.powi(50), "1 of {share}: {scale}");
        }
    }

    #[test]
    fn errors_of_the_brightest_picture_are_taken_back() {
        let mut error = Plane::from_vec(3, 1, vec![2f32.powi(-100), 0.0, f32::NAN]).unwrap();
        unexpose_error(&mut error, 2f32.powi(-100));
        assert_eq!(error.data(), [2f32.powi(100), 0.0, 0.0]);
    }
}
