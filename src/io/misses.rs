//! Pixels that see no surface: their depth and position are whatever the renderer likes.
//!
//! Cycles stores a depth of 1e10, LuxCore infinity, Mitsuba 0. A number that has nothing to do with
//! the others makes a linear fit of the feature useless wherever it falls into the window, so what is
//! beyond reason is moved to the end of the reasonable range: a miss lies just behind the farthest
//! surface. Zeros are bounded and stay, and NaN is left for the denoiser to repair and count.

use crate::image::Plane;

/// Beyond this no surface lies: in millimetres it is a thousand kilometres.
const NO_SURFACE: f32 = 1e9;

/// Bounds the misses of a depth or position plane and returns how many there were. Means of hits and
/// misses, as at silhouettes in Cycles, are beyond reason as well. Where a miss was, `variance` says
/// nothing about the new value and becomes 0.
pub(super) fn bound(plane: &mut Plane, variance: Option<&mut Plane>) -> usize {
    let is_miss = |v: f32| v.abs() >= NO_SURFACE;
    let seen = plane.data().iter().filter(|v| v.abs() < NO_SURFACE);
    let (low, high) = seen.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
    let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
    if let Some(variance) = variance {
        let at_misses = variance.data_mut().iter_mut().zip(plane.data()).filter(|(_, v)| is_miss(**v));
        at_misses.for_each(|(variance, _)| *variance = 0.0);
    }
    let mut misses = 0;
    for value in plane.data_mut().iter_mut().filter(|value| is_miss(**value)) {
        *value = if *value < 0.0 { low } else { high };
        misses += 1;
    }
    misses
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misses_go_to_the_end_of_the_range_and_nan_stays() {
        let values = vec![4.0, 1e10, f32::INFINITY, -2.0, f32::NEG_INFINITY, f32::NAN, 0.0];
        let mut plane = Plane::from_vec(7, 1, values).unwrap();
        let mut variance = Plane::filled(7, 1, 9.0);
        assert_eq!(bound(&mut plane, Some(&mut variance)), 3);
        assert_eq!(variance.data(), &[9.0, 0.0, 0.0, 9.0, 0.0, 9.0, 9.0]);
        assert_eq!(&plane.data()[..5], &[4.0, 4.0, 4.0, -2.0, -2.0]);
        assert!(plane.data()[5].is_nan());
        let mut empty_sky = Plane::filled(3, 2, 1e10);
        assert_eq!(bound(&mut empty_sky, None), 6);
        assert_eq!(empty_sky, Plane::filled(3, 2, 0.0));
    }
}
