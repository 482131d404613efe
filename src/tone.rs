//! The one tone map, for pictures people look at and for the metric that judges as they do.
//!
//! Linear values are cut to 0…1 and put through the sRGB transfer curve, exposure 1: what a viewer
//! without settings shows. It is fixed, so that two pictures never differ by their tone map.

use crate::image::Rgb;

/// The sRGB transfer curve of `linear` cut to 0…1; NaN gives 0.
pub fn srgb(linear: f32) -> f32 {
    let value = if linear.is_nan() { 0.0 } else { linear.clamp(0.0, 1.0) };
    if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 }
}

/// Luminance of pixel `i` (Rec. 709 weights), linear.
pub fn luminance(color: &Rgb, i: usize) -> f32 {
    0.2126 * color[0].data()[i] + 0.7152 * color[1].data()[i] + 0.0722 * color[2].data()[i]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curve_meets_its_ends_its_joint_and_cuts_the_rest() {
        assert_eq!([srgb(-1.0), srgb(0.0), srgb(f32::NAN)], [0.0; 3]);
        assert!((srgb(1.0) - 1.0).abs() < 1e-6 && srgb(f32::INFINITY) == srgb(1.0));
        assert!((srgb(0.003_130_8) - srgb(0.003_131)).abs() < 1e-5);
        assert!((srgb(0.214_041) - 0.5).abs() < 1e-5);
    }
}
