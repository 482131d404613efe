//! Features that leave the range in which they mean something.
//!
//! A number that has nothing to do with the others makes a linear fit of the feature useless wherever
//! it falls into the window. Pixels that see no surface have whatever depth and position the renderer
//! likes: Cycles stores a depth of 1e10, LuxCore infinity, Mitsuba 0. What is beyond reason is moved to
//! the end of the reasonable range: a miss lies just behind the farthest surface. Albedos above 1 (lamps
//! in Cycles, metals in Mitsuba, up to 56 in a fixture of ours) are no reflectance and are cut to 1.
//! Zeros are bounded and stay, and NaN is left for the denoiser to repair and count.

use crate::frame::{Feature, FeatureKind};
use crate::image::Plane;

/// Brings values that a feature of its kind cannot have into range, as [`Picture`](super::Picture) does with
/// what it reads; for frames that come from elsewhere. Returns what was done, where anything was.
pub fn bound_feature(feature: &mut Feature) -> Option<String> {
    type Bound = fn(&mut Plane, Option<&mut Plane>) -> usize;
    let (bound, what): (Bound, _) = match feature.kind {
        FeatureKind::Depth | FeatureKind::Position => {
            (bound_misses, "values beyond any surface (misses) were moved to the end of the range")
        }
        FeatureKind::Albedo => (cut_albedo, "values above 1 are no reflectance and were cut to 1"),
        _ => return None,
    };
    let mut count = 0;
    for (c, plane) in feature.planes.iter_mut().enumerate() {
        count += bound(plane, feature.var_of_mean.as_mut().map(|variance| &mut variance[c]));
    }
    for plane in feature.halves.iter_mut().flatten().flatten() {
        bound(plane, None);
    }
    (count > 0).then(|| format!("{}: {count} {what}", feature.name))
}

/// Beyond this no surface lies: in millimetres it is a thousand kilometres.
const NO_SURFACE: f32 = 1e9;

/// Bounds the misses of a depth or position plane and returns how many there were. Means of hits and
/// misses, as at silhouettes in Cycles, are beyond reason as well. Where a miss was, `variance` says
/// nothing about the new value and becomes 0.
fn bound_misses(plane: &mut Plane, variance: Option<&mut Plane>) -> usize {
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

/// The largest variance of anything between 0 and 1.
const MOST_VARIANCE: f32 = 0.25;

/// Cuts an albedo to 1 and returns how many values were above.
fn cut_albedo(plane: &mut Plane, mut variance: Option<&mut Plane>) -> usize {
    let mut cut = 0;
    for (i, value) in plane.data_mut().iter_mut().enumerate().filter(|(_, value)| **value > 1.0) {
        *value = 1.0;
        cut += 1;
        if let Some(variance) = variance.as_mut().map(|plane| &mut plane.data_mut()[i]) {
            *variance = variance.min(MOST_VARIANCE);
        }
    }
    cut
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misses_go_to_the_end_of_the_range_and_nan_stays() {
        let values = vec![4.0, 1e10, f32::INFINITY, -2.0, f32::NEG_INFINITY, f32::NAN, 0.0];
        let mut plane = Plane::from_vec(7, 1, values).unwrap();
        let mut variance = Plane::filled(7, 1, 9.0);
        assert_eq!(bound_misses(&mut plane, Some(&mut variance)), 3);
        assert_eq!(variance.data(), &[9.0, 0.0, 0.0, 9.0, 0.0, 9.0, 9.0]);
        assert_eq!(&plane.data()[..5], &[4.0, 4.0, 4.0, -2.0, -2.0]);
        assert!(plane.data()[5].is_nan());
        let mut empty_sky = Plane::filled(3, 2, 1e10);
        assert_eq!(bound_misses(&mut empty_sky, None), 6);
        assert_eq!(empty_sky, Plane::filled(3, 2, 0.0));
    }

    #[test]
    fn albedos_are_cut_to_one_with_their_variance() {
        let mut albedo = Plane::from_vec(3, 1, vec![0.5, 56.0, f32::NAN]).unwrap();
        let mut variance = Plane::from_vec(3, 1, vec![7.0, 9.0, 8.0]).unwrap();
        assert_eq!(cut_albedo(&mut albedo, Some(&mut variance)), 1);
        assert_eq!(albedo.data()[..2], [0.5, 1.0]);
        assert_eq!(variance.data(), [7.0, 0.25, 8.0]);
    }
}
