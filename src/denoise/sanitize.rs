//! Stage 1: NaN, infinities and values beyond all measure are repaired from their neighbours, counted.
//!
//! A pixel whose colour is bad is repaired in its AOVs and half buffers too, by the mean of its good
//! neighbours, so that what sums before sums after. An AOV or half that is bad where the colour is good is
//! repaired alone and costs the colour nothing. Blocks are filled from their rim inwards.
//! Negative colour is counted and kept: pixel filters with negative lobes make it, and it belongs to
//! the mean.

use crate::frame::{Feature, Frame, Summary};
use crate::image::{Plane, Rect, Rgb};

/// Pixels up to this far from a good one are repaired from what is good.
pub const REACH: usize = 16;

/// Radiance beyond this is a defect: its square would leave `f32` whatever the exposure.
const LARGEST_RADIANCE: f32 = 1e32;

/// Variance beyond this is a defect.
const LARGEST_VARIANCE: f32 = 1e37;

/// Feature values are limited to this, so that their squares stay finite: what is farther is "far".
const LARGEST_FEATURE: f32 = 1e15;

/// A frame without NaN and infinity.
#[derive(Debug, Clone)]
pub struct Clean {
    /// Noisy colour.
    pub color: Rgb,
    /// Variance of the colour's mean, ≥ 0.
    pub variance: Option<Rgb>,
    /// Half buffers.
    pub halves: Option<[Rgb; 2]>,
    /// Pictures that go through the beauty's operator.
    pub aovs: Vec<Rgb>,
    /// Features, their variances ≥ 0.
    pub features: Vec<Feature>,
}

/// Whether a radiance is a number that the method can take.
pub fn good_radiance(value: f32) -> bool {
    value.abs() <= LARGEST_RADIANCE // false for NaN
}

/// Whether a variance of the colour's mean is one.
pub fn good_variance(value: f32) -> bool {
    (0.0..=LARGEST_VARIANCE).contains(&value)
}

/// A feature's value in the range that the method can take; NaN stays.
pub fn limited_feature(value: f32) -> f32 {
    value.clamp(-LARGEST_FEATURE, LARGEST_FEATURE)
}

/// Repairs `frame`, a picture or a part of it, and counts in `summary` what was repaired in `counted`. The
/// variance is left out unless it is a number somewhere in the whole picture (`variance_is_known`).
pub fn apply(frame: &Frame, variance_is_known: bool, counted: Rect, summary: &mut Summary) -> Clean {
    let mut clean = Clean {
        color: frame.color().clone(),
        variance: frame.color_var_of_mean().cloned(),
        halves: frame.halves().cloned(),
        aovs: frame.aovs().iter().map(|aov| aov.color.clone()).collect(),
        features: frame.features().to_vec(),
    };
    let bad_color = bad_pixels(frame.color(), good_radiance);
    summary.repaired_color = repair(clean.color.iter_mut(), &bad_color, counted);
    for (aov, planes) in frame.aovs().iter().zip(&mut clean.aovs) {
        let bad = either(bad_pixels(&*planes, good_radiance), &bad_color);
        let alone = repair(planes.iter_mut(), &bad, counted) - summary.repaired_color;
        if alone > 0 {
            let name = &aov.name;
            summary
                .notes
                .push(format!("{name}: {alone} pixels repaired that are no numbers, the colour's are"));
        }
    }
    if let Some(halves) = &mut clean.halves {
        let bad = either(bad_pixels(halves.iter().flatten(), good_radiance), &bad_color);
        repair(halves.iter_mut().flatten(), &bad, counted);
    }
    summary.negative_color =
        counted.pixels().filter(|&(x, y)| clean.color.iter().any(|plane| plane.get(x, y) < 0.0)).count();
    if let Some(variance) = &mut clean.variance {
        let bad = bad_pixels(&*variance, good_variance);
        summary.repaired_variance = repair(variance.iter_mut(), &bad, counted);
        if !variance_is_known {
            // Black would say that there is no noise.
            summary.notes.push("variance: left out, it is a number at no pixel".into());
            clean.variance = None;
        }
    }
    for feature in &mut clean.features {
        // Limited first: what is far to both sides has no mean.
        feature.planes.iter_mut().for_each(|plane| change(plane, limited_feature));
        let bad = bad_pixels(&feature.planes, |v| !v.is_nan());
        summary.repaired_features += repair(feature.planes.iter_mut(), &bad, counted);
        for plane in feature.halves.iter_mut().flatten().flatten() {
            change(plane, limited_feature);
            let bad = bad_pixels([&*plane], |v| !v.is_nan());
            repair([plane], &bad, counted);
        }
        if let Some(variance) = &mut feature.var_of_mean {
            let limited = |v: f32| v.clamp(f32::MIN, LARGEST_FEATURE * LARGEST_FEATURE);
            variance.iter_mut().for_each(|plane| change(plane, limited));
            let bad = bad_pixels(&*variance, |v| v >= 0.0);
            summary.repaired_variance += repair(variance.iter_mut(), &bad, counted);
        }
    }
    clean
}

fn change(plane: &mut Plane, f: impl Fn(f32) -> f32) {
    plane.data_mut().iter_mut().for_each(|v| *v = f(*v));
}

/// The pixels at which any of `planes` is not `good`.
fn bad_pixels<'a>(planes: impl IntoIterator<Item = &'a Plane>, good: impl Fn(f32) -> bool) -> Vec<bool> {
    let mut planes = planes.into_iter();
    let mut bad: Vec<bool> = planes.next().into_iter().flat_map(Plane::data).map(|&v| !good(v)).collect();
    for plane in planes {
        bad.iter_mut().zip(plane.data()).for_each(|(bad, &v)| *bad |= !good(v));
    }
    bad
}

fn either(mut a: Vec<bool>, b: &[bool]) -> Vec<bool> {
    a.iter_mut().zip(b).for_each(|(a, b)| *a |= b);
    a
}

/// Replaces the `bad` pixels of `planes` by the mean of their good neighbours, layer by layer from the rim;
/// by 0 where no good pixel is within [`REACH`]. Returns how many of `counted` were bad.
fn repair<'a>(planes: impl IntoIterator<Item = &'a mut Plane>, bad: &[bool], counted: Rect) -> usize {
    let mut planes: Vec<&mut Plane> = planes.into_iter().collect();
    let Some((width, height)) = planes.first().map(|plane| plane.size()) else { return 0 };
    if !bad.contains(&true) {
        return 0;
    }
    let mut bad = bad.to_vec();
    let count = counted.pixels().filter(|&(x, y)| bad[y * width + x]).count();
    let neighbours = |i: usize| {
        let (x, y) = (i % width, i / width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.flat_map(move |ny| (x.saturating_sub(1)..(x + 2).min(width)).map(move |nx| ny * width + nx))
    };
    let mut frontier: Vec<usize> =
        (0..bad.len()).filter(|&i| bad[i] && neighbours(i).any(|n| !bad[n])).collect();
    for _ in 0..REACH {
        for plane in planes.iter_mut() {
            let values: Vec<f32> = frontier
                .iter()
                .map(|&i| {
                    let (mut sum, mut n) = (0.0f64, 0.0);
                    for neighbour in neighbours(i).filter(|&n| !bad[n]) {
                        sum += f64::from(plane.data()[neighbour]);
                        n += 1.0;
                    }
                    (sum / n) as f32
                })
                .collect();
            for (&i, value) in frontier.iter().zip(values) {
                plane.data_mut()[i] = value;
            }
        }
        frontier.iter().for_each(|&i| bad[i] = false);
        let mut next: Vec<usize> = frontier.iter().flat_map(|&i| neighbours(i)).filter(|&n| bad[n]).collect();
        next.sort_unstable();
        next.dedup();
        frontier = next;
    }
    for plane in planes {
        plane.data_mut().iter_mut().zip(&bad).filter(|(_, bad)| **bad).for_each(|(v, _)| *v = 0.0);
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    fn repair_one(plane: &mut Plane, counted: Rect) -> usize {
        let bad = bad_pixels([&*plane], f32::is_finite);
        repair([plane], &bad, counted)
    }

    #[test]
    fn what_is_bad_beside_a_good_colour_costs_the_colour_nothing() {
        let picture = || -> Rgb { std::array::from_fn(|c| Plane::filled(3, 2, 1.0 + c as f32)) };
        let with = |bad: &[usize]| {
            let mut rgb = picture();
            bad.iter().for_each(|&i| rgb[1].data_mut()[i] = f32::NAN);
            rgb
        };
        let aov = |name: &str, color| crate::frame::Aov { name: name.into(), color };
        let frame = Frame::new(with(&[0]))
            .and_then(|frame| frame.with_halves([with(&[1]), picture()]))
            .and_then(|frame| frame.with_aov(aov("spotted", with(&[2]))))
            .and_then(|frame| frame.with_aov(aov("broken", with(&[0, 1, 2, 3, 4, 5]))))
            .unwrap();
        let mut summary = Summary::default();
        let clean = apply(&frame, false, Rect::whole((3, 2)), &mut summary);
        assert_eq!((clean.color, clean.halves), (picture(), Some([picture(), picture()])));
        assert_eq!(clean.aovs[0], picture());
        assert!(clean.aovs[1].iter().flat_map(Plane::data).all(|&v| v == 0.0));
        assert_eq!((summary.repaired_color, summary.notes.len()), (1, 2));
    }

    #[test]
    fn a_block_of_nan_is_filled_from_its_rim_and_counted() {
        let mut plane = Plane::from_fn(9, 7, |_, _| 2.0);
        for (x, y) in [(3, 3), (4, 3), (5, 3), (3, 4), (4, 4), (5, 4), (3, 5), (4, 5), (5, 5), (0, 0)] {
            plane.data_mut()[y * 9 + x] = f32::NAN;
        }
        plane.data_mut()[1] = f32::INFINITY;
        assert_eq!(repair_one(&mut plane, Rect::whole((9, 7))), 11);
        assert!(plane.data().iter().all(|&v| v == 2.0));
    }

    #[test]
    fn a_block_is_repaired_as_far_as_its_rim_reaches() {
        let (width, height) = (2 * REACH + 4, 3);
        let mut plane =
            Plane::from_fn(width, height, |x, _| if x > 0 && x < width - 1 { f32::NAN } else { 5.0 });
        let half = Rect { x: 0, y: 0, width: width / 2, height };
        assert_eq!(repair_one(&mut plane, half), 3 * (REACH + 1));
        let expected = |x: usize| if x.min(width - 1 - x) > REACH { 0.0 } else { 5.0 };
        assert_eq!(plane, Plane::from_fn(width, height, |x, _| expected(x)));
    }

    #[test]
    fn a_channel_without_a_good_pixel_becomes_black() {
        let mut plane = Plane::filled(3, 2, f32::NAN);
        assert_eq!(repair_one(&mut plane, Rect::whole((3, 2))), 6);
        assert_eq!(plane.data(), &[0.0; 6]);
    }

    #[test]
    fn a_variance_without_a_good_pixel_is_none() {
        let grey = || -> Rgb { std::array::from_fn(|_| Plane::filled(3, 2, 1.0)) };
        let mut variance = grey();
        variance[1].data_mut().fill(f32::NAN);
        let frame = Frame::new(grey()).and_then(|frame| frame.with_variance_of_mean(variance)).unwrap();
        let mut summary = Summary::default();
        assert_eq!(apply(&frame, false, Rect::whole((3, 2)), &mut summary).variance, None);
        assert_eq!((summary.repaired_variance, summary.notes.len()), (6, 1));
    }

    #[test]
    fn nan_between_infinities_of_both_signs_becomes_a_number() {
        let grey = || std::array::from_fn(|_| Plane::filled(3, 1, 1.0));
        let plane = Plane::from_vec(3, 1, vec![f32::INFINITY, f32::NAN, f32::NEG_INFINITY]).unwrap();
        let depth = Feature::new("depth", crate::FeatureKind::Depth, vec![plane]);
        let frame = Frame::new(grey()).and_then(|frame| frame.with_feature(depth)).unwrap();
        let clean = apply(&frame, false, Rect::whole((3, 1)), &mut Summary::default());
        assert_eq!(clean.features[0].planes[0].data(), &[LARGEST_FEATURE, 0.0, -LARGEST_FEATURE]);
    }

    #[test]
    fn a_bad_pixel_of_one_channel_is_repaired_in_all() {
        let mut red = Plane::from_fn(3, 1, |x, _| x as f32);
        let mut green = Plane::from_fn(3, 1, |x, _| 10.0 * x as f32);
        green.data_mut()[1] = f32::NEG_INFINITY;
        let bad = bad_pixels([&red, &green], f32::is_finite);
        assert_eq!(repair([&mut red, &mut green], &bad, Rect::whole((3, 1))), 1);
        assert_eq!((red.data()[1], green.data()[1]), (1.0, 10.0));
    }
}
