//! Features that leave the range in which they mean something.
//!
//! A number that has nothing to do with the others makes a linear fit of the feature useless wherever
//! it falls into the window. Pixels that see no surface have whatever depth and position the renderer
//! likes: Cycles stores a depth of 1e10, LuxCore infinity, Mitsuba 0. What is beyond reason is moved to
//! the end of the reasonable range: a miss lies just behind the farthest surface. Albedos above 1 (lamps
//! in Cycles, metals in Mitsuba, up to 56 in a fixture of ours) are no reflectance and are cut to 1.
//! Zeros are bounded and stay. NaN, and infinities elsewhere than in depths and
//! positions, are left for the denoiser to repair and count.

use super::statistics::Statistics;
use crate::frame::{Feature, FeatureKind};
use crate::image::Plane;

/// Brings values that a feature of its kind cannot have into range, as [`Picture`](super::Picture) does with
/// what it reads; for frames that come from elsewhere. Returns what was done, where anything was.
pub fn bound_feature(feature: &mut Feature) -> Option<String> {
    let statistics: Vec<Statistics> = feature.planes.iter().map(Statistics::of).collect();
    bound(feature, &statistics);
    told(&feature.name, feature.kind, &statistics)
}

/// Brings a feature into range, a part of a picture whose planes have these `statistics`.
pub(super) fn bound(feature: &mut Feature, statistics: &[Statistics]) {
    for (c, statistics) in statistics.iter().enumerate() {
        let variance = feature.var_of_mean.as_mut().map(|variance| &mut variance[c]);
        let halves = feature.halves.iter_mut().flatten().map(|half| &mut half[c]);
        match feature.kind {
            FeatureKind::Depth | FeatureKind::Position => {
                bound_misses(&mut feature.planes[c], variance, statistics);
                halves.for_each(|half| bound_misses(half, None, statistics));
            }
            FeatureKind::Albedo => {
                cut_albedo(&mut feature.planes[c], variance);
                halves.for_each(|half| cut_albedo(half, None));
            }
            _ => {}
        }
    }
}

/// What bounding a feature of these statistics does to it, where anything.
pub(super) fn told(name: &str, kind: FeatureKind, statistics: &[Statistics]) -> Option<String> {
    type Count = fn(&Statistics) -> usize;
    let (count, what): (Count, _) = match kind {
        FeatureKind::Depth | FeatureKind::Position => {
            (|of| of.misses, "values beyond any surface (misses) were moved to the end of the range")
        }
        FeatureKind::Albedo => (|of| of.above_one, "values above 1 are no reflectance and were cut to 1"),
        _ => return None,
    };
    let count: usize = statistics.iter().map(count).sum();
    (count > 0).then(|| format!("{name}: {count} {what}"))
}

/// Beyond this no surface lies: in millimetres it is a thousand kilometres.
pub(super) const NO_SURFACE: f32 = 1e9;

/// Bounds the misses of a depth or position plane to the range of what was seen. Means of hits and misses,
/// as at silhouettes in Cycles, are beyond reason as well. Where a miss was, `variance` says nothing about
/// the new value and becomes 0.
fn bound_misses(plane: &mut Plane, variance: Option<&mut Plane>, statistics: &Statistics) {
    let is_miss = |v: f32| v.abs() >= NO_SURFACE;
    let (low, high) = statistics.seen().unwrap_or((0.0, 0.0));
    if let Some(variance) = variance {
        let at_misses = variance.data_mut().iter_mut().zip(plane.data()).filter(|(_, v)| is_miss(**v));
        at_misses.for_each(|(variance, _)| *variance = 0.0);
    }
    for value in plane.data_mut().iter_mut().filter(|value| is_miss(**value)) {
        *value = if *value < 0.0 { low } else { high };
    }
}

/// The largest variance of anything between 0 and 1.
const MOST_VARIANCE: f32 = 0.25;

/// Whether a value is one, but no reflectance.
pub(super) fn is_above_one(value: f32) -> bool {
    value > 1.0 && value.is_finite()
}

/// Cuts an albedo to 1.
fn cut_albedo(plane: &mut Plane, mut variance: Option<&mut Plane>) {
    for (i, value) in plane.data_mut().iter_mut().enumerate().filter(|(_, value)| is_above_one(**value)) {
        *value = 1.0;
        if let Some(variance) = variance.as_mut().map(|plane| &mut plane.data_mut()[i]) {
            *variance = variance.min(MOST_VARIANCE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn feature(kind: FeatureKind, plane: Plane, variance: Plane) -> Feature {
        let mut feature = Feature::new("f", kind, vec![plane]);
        feature.var_of_mean = Some(vec![variance]);
        feature
    }

    fn planes(feature: Feature) -> [Plane; 2] {
        [feature.planes[0].clone(), feature.var_of_mean.unwrap().remove(0)]
    }

    #[test]
    fn misses_go_to_the_end_of_the_range_and_nan_stays() {
        let values = vec![4.0, 1e10, f32::INFINITY, -2.0, f32::NEG_INFINITY, f32::NAN, 0.0];
        let plane = Plane::from_vec(7, 1, values).unwrap();
        let mut depth = feature(FeatureKind::Depth, plane, Plane::filled(7, 1, 9.0));
        let told = bound_feature(&mut depth).unwrap();
        assert!(told.starts_with("f: 3 values beyond any surface"), "{told}");
        let [plane, variance] = &planes(depth);
        assert_eq!(variance.data(), &[9.0, 0.0, 0.0, 9.0, 0.0, 9.0, 9.0]);
        assert_eq!(&plane.data()[..5], &[4.0, 4.0, 4.0, -2.0, -2.0]);
        assert!(plane.data()[5].is_nan());
        let sky = || Plane::filled(3, 2, 1e10);
        let mut empty_sky = feature(FeatureKind::Depth, sky(), sky());
        assert!(bound_feature(&mut empty_sky).unwrap().starts_with("f: 6 "));
        assert_eq!(planes(empty_sky)[0], Plane::filled(3, 2, 0.0));
    }

    #[test]
    fn albedos_are_cut_to_one_with_their_variance() {
        let albedo = Plane::from_vec(3, 1, vec![0.5, 56.0, f32::INFINITY]).unwrap();
        let variance = Plane::from_vec(3, 1, vec![7.0, 9.0, 8.0]).unwrap();
        let mut albedo = feature(FeatureKind::Albedo, albedo, variance);
        assert!(bound_feature(&mut albedo).unwrap().starts_with("f: 1 values above 1"));
        let [albedo, variance] = &planes(albedo);
        assert_eq!(albedo.data(), [0.5, 1.0, f32::INFINITY]);
        assert_eq!(variance.data(), [7.0, 0.25, 8.0]);
    }
}
