//! The picture's exposure: a power of two that brings its typical radiance near 1.
//!
//! Every absolute constant of the method (what counts as dark, the floor of a risk) is meant in these
//! units, so that a picture scaled by 2^n gives the same result scaled by 2^n, bit for bit.

use crate::image::{Plane, Rgb};

/// The factor to multiply radiance by: 2^−round(log₂ L), L the geometric mean of the positive
/// luminances; 1 for a picture without light.
pub fn scale(color: &Rgb) -> f32 {
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
    if count == 0 { 1.0 } else { (-(sum / count as f64).round().clamp(-100.0, 100.0)).exp2() as f32 }
}

/// Multiplies a plane by `factor`.
pub fn expose(plane: &mut Plane, factor: f32) {
    plane.data_mut().iter_mut().for_each(|v| *v *= factor);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grey_of_an_eighth_needs_eight_and_black_needs_nothing() {
        let grey = |v| std::array::from_fn(|_| Plane::filled(3, 2, v));
        assert_eq!(scale(&grey(0.125)), 8.0);
        assert_eq!(scale(&grey(0.13)), 8.0);
        assert_eq!(scale(&grey(0.0)), 1.0);
    }
}
