//! The picture's exposure: a power of two that brings its typical radiance near 1.
//!
//! Every absolute constant of the method (what counts as dark, the floor of a risk) is meant in these
//! units, so that a picture scaled by 2^n gives the same result scaled by 2^n, bit for bit.

use super::condition::power_of_two_near_inverse;
use crate::image::{Plane, Rgb};

/// Exposed values are no larger than this (2^90), so that sums over a window, weighted by risks and taken
/// through an albedo, stay in `f32`.
const LARGEST_EXPOSED: f32 = (1u128 << 90) as f32;

/// The factor to multiply radiance by: 2^−round(log₂ L), L the geometric mean of the positive
/// luminances of `color`; 1 for a picture without light; less where one of `planes` would grow beyond
/// [`LARGEST_EXPOSED`].
pub fn scale<'a>(color: &Rgb, planes: impl Iterator<Item = &'a Plane>) -> f32 {
    let (width, height) = color[0].size();
    let (mut sum, mut count) = (0.0f64, 0usize);
    for y in 0..height {
        for x in 0..width {
            let mean = color.iter().map(|plane| f64::from(plane.get(x, y))).sum::<f64>() / 3.0;
            if mean > 0.0 {
                sum += mean.log2();
                count += 1;
            }
        }
    }
    let largest = planes.flat_map(Plane::data).fold(0.0f32, |largest, v| largest.max(v.abs()));
    let most = power_of_two_near_inverse(largest) * LARGEST_EXPOSED;
    let typical = (sum / count.max(1) as f64).round().clamp(-100.0, 100.0);
    ((-typical).exp2() as f32).min(most)
}

/// Multiplies a plane by `factor`; what would leave the finite numbers keeps to their end.
pub fn expose(plane: &mut Plane, factor: f32) {
    plane.data_mut().iter_mut().for_each(|v| *v = (*v * factor).clamp(f32::MIN, f32::MAX));
}

/// Multiplies a plane of variances by `factor`²; no larger than [`LARGEST_EXPOSED`] either.
pub fn expose_variance(plane: &mut Plane, factor: f32) {
    plane.data_mut().iter_mut().for_each(|v| *v = (*v * factor * factor).min(LARGEST_EXPOSED));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grey_of_an_eighth_needs_eight_and_black_needs_nothing() {
        let grey = |v| -> Rgb { std::array::from_fn(|_| Plane::filled(3, 2, v)) };
        let scale = |color: Rgb| super::scale(&color, color.iter());
        assert_eq!(scale(grey(0.125)), 8.0);
        assert_eq!(scale(grey(0.13)), 8.0);
        assert_eq!(scale(grey(0.0)), 1.0);
        let bright = Plane::filled(3, 2, 1e32);
        let limited = super::scale(&grey(1.0), [&bright].into_iter());
        assert!(limited * 1e32 <= 2.0 * LARGEST_EXPOSED && limited * 1e32 > 0.5 * LARGEST_EXPOSED);
    }
}
