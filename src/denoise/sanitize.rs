//! Stage 1: NaN, infinities and values beyond all measure are repaired from their neighbours, counted.
//!
//! A pixel whose colour is bad is repaired in its AOVs and half buffers too, by the mean of its good
//! neighbours, so that what sums before sums after; and in its variance, which is of what was bad: so is a feature's.
//! An AOV, half or variance that is bad where the colour is good is repaired alone and costs the colour nothing. Blocks
//! are filled from their rim inwards. A plane that is a number nowhere is left out, and costs the others nothing.
//! Negative colour is counted and kept: pixel filters with negative lobes make it, and it belongs to
//! the mean.

use super::exposure::{self, LARGEST_EXPOSED};
use super::facts::{Known, KnownFeature, Usable};
use crate::frame::{Aov, Feature, FeatureKind, Frame, Motion, Summary};
use crate::image::{Plane, Rect, Rgb};
use rayon::prelude::*;
use std::borrow::Cow;

/// Pixels up to this far from a good one are repaired from what is good.
pub const REACH: usize = 16;

/// Pixels that one task looks at, at least.
const TASK: usize = 1 << 13;

/// Radiance beyond this is a defect: its square would leave `f32` whatever the exposure.
const LARGEST_RADIANCE: f32 = 1e32;

/// Variance beyond this is a defect.
const LARGEST_VARIANCE: f32 = 1e37;

/// Feature values are limited to this, so that their squares stay finite: what is farther is "far".
const LARGEST_FEATURE: f32 = 1e15;

/// A frame without NaN and infinity.
#[derive(Debug, Clone)]
pub struct Clean<'a> {
    /// Noisy colour.
    pub color: Rgb,
    /// Variance of the colour's mean, ≥ 0.
    pub variance: Option<Rgb>,
    /// Half buffers.
    pub halves: Option<[Rgb; 2]>,
    /// Pictures that go through the beauty's operator.
    pub aovs: Vec<Rgb>,
    /// Features, their variances ≥ 0; the frame's own where there was nothing to repair.
    pub features: Vec<Cow<'a, Feature>>,
    /// Motion vectors, as they are.
    pub motion: Option<Cow<'a, Motion>>,
}

impl<'a> Clean<'a> {
    /// The planes of a frame as they are, copied only where it is not given away.
    fn of(frame: Cow<'a, Frame>) -> Self {
        match frame {
            Cow::Borrowed(frame) => Self {
                color: frame.color.clone(),
                variance: frame.color_var_of_mean.clone(),
                halves: frame.halves.clone(),
                aovs: frame.aovs.iter().map(|aov| aov.color.clone()).collect(),
                features: frame.features.iter().map(Cow::Borrowed).collect(),
                motion: frame.motion.as_ref().map(Cow::Borrowed),
            },
            Cow::Owned(Frame {
                color, color_var_of_mean: variance, halves, aovs, features, motion, ..
            }) => Self {
                color,
                variance,
                halves,
                aovs: aovs.into_iter().map(|Aov { color, .. }| color).collect(),
                features: features.into_iter().map(Cow::Owned).collect(),
                motion: motion.map(Cow::Owned),
            },
        }
    }
}

/// The planes that the fits reconstruct: the colour's, then every AOV's.
impl Clean<'_> {
    /// All of them.
    pub fn targets(&self) -> impl Iterator<Item = &Plane> {
        self.color.iter().chain(self.aovs.iter().flatten())
    }

    /// The same, to be changed.
    pub fn targets_mut(&mut self) -> impl Iterator<Item = &mut Plane> {
        self.color.iter_mut().chain(self.aovs.iter_mut().flatten())
    }

    /// The same, the rest given up.
    pub fn into_targets(self) -> Vec<Plane> {
        self.color.into_iter().chain(self.aovs.into_iter().flatten()).collect()
    }

    /// Multiplies all radiance by `factor`.
    pub fn expose(&mut self, factor: f32) {
        self.targets_mut().for_each(|plane| exposure::expose(plane, factor));
        for plane in self.halves.iter_mut().flatten().flatten() {
            exposure::expose(plane, factor);
        }
        for plane in self.variance.iter_mut().flatten() {
            exposure::expose_variance(plane, factor);
        }
    }
}

/// Whether a radiance is a number that the method can take.
pub fn good_radiance(value: f32) -> bool {
    value.abs() <= LARGEST_RADIANCE // false for NaN
}

/// Whether a variance of the colour's mean is usable: 0 to 1e37.
pub fn good_variance(value: f32) -> bool {
    (0.0..=LARGEST_VARIANCE).contains(&value)
}

/// Whether a feature's value says something. An infinite depth or position does: nothing was hit.
pub fn good_feature(kind: FeatureKind, value: f32) -> bool {
    value.is_finite() || (value.is_infinite() && matches!(kind, FeatureKind::Depth | FeatureKind::Position))
}

/// Such a value in the range that the method can take.
pub fn limited_feature(value: f32) -> f32 {
    value.clamp(-LARGEST_FEATURE, LARGEST_FEATURE)
}

/// Whether a feature's variance is usable: 0 or more, finite.
pub fn good_feature_variance(value: f32) -> bool {
    value >= 0.0 && value.is_finite()
}

/// Repairs `frame`, a picture or a part of it, and counts in `summary` what was repaired in `counted`. Radiance that
/// `exposure` would bring beyond all measure is repaired too: one such pixel must not decide how all are seen. Planes
/// that are a number nowhere in the whole picture, as it is `known`, are left out: of the colour and the AOVs
/// such a channel is black, of the features such a plane is 0, statistics that cannot be used are done without.
pub(crate) fn apply<'a>(
    frame: Cow<'a, Frame>,
    known: &Known,
    exposure: f32,
    counted: Rect,
    summary: &mut Summary,
) -> Clean<'a> {
    let good = |value: f32| good_radiance(value) && (value * exposure).abs() <= LARGEST_EXPOSED;
    let left_out = left_out(&frame, known);
    let mut clean = Clean::of(frame);
    clean.variance.take_if(|_| !known.statistics.variance);
    clean.halves.take_if(|_| !known.statistics.halves);
    blacken(&mut clean.color, &known.color);
    let bad_color = bad_pixels(&clean.color, good);
    summary.repaired_color = repair(clean.color.iter_mut(), &bad_color, counted);
    for (aov, known) in clean.aovs.iter_mut().zip(&known.aovs) {
        blacken(aov, known);
        let bad = either(bad_pixels(&*aov, good), &bad_color);
        summary.repaired_aovs += repair(aov.iter_mut(), &bad, counted) - summary.repaired_color;
    }
    if let Some(halves) = &mut clean.halves {
        halves.iter_mut().for_each(|half| blacken(half, &known.color));
        let bad = either(bad_pixels(halves.iter().flatten(), good), &bad_color);
        summary.repaired_halves = repair(halves.iter_mut().flatten(), &bad, counted) - summary.repaired_color;
    }
    summary.negative_color = negative(&clean.color, counted);
    if let Some(variance) = &mut clean.variance {
        blacken(variance, &known.color);
        let bad = either(bad_pixels(&*variance, good_variance), &bad_color);
        summary.repaired_variance = repair(variance.iter_mut(), &bad, counted) - summary.repaired_color;
    }
    let features = std::mem::take(&mut clean.features).into_par_iter().zip(&known.features);
    let repaired: Vec<_> = features.map(|(feature, known)| repair_feature(feature, known, counted)).collect();
    for (feature, [planes, halves, variances]) in repaired {
        clean.features.push(feature);
        summary.repaired_features += planes;
        summary.repaired_halves += halves;
        summary.repaired_variance += variances;
    }
    summary.notes.extend(left_out);
    clean
}

/// How many of the `counted` pixels have a negative channel.
fn negative(color: &Rgb, counted: Rect) -> usize {
    let rows = (counted.y..counted.y + counted.height).into_par_iter();
    let columns = counted.x..counted.x + counted.width;
    rows.map(|y| {
        let [r, g, b] = color.each_ref().map(|plane| &plane.row(y)[columns.clone()]);
        r.iter().zip(g).zip(b).filter(|((r, g), b)| r.min(**g).min(**b) < 0.0).count()
    })
    .sum()
}

/// The feature repaired, and how many of the counted pixels were bad in its planes, halves and variances.
fn repair_feature<'a>(
    feature: Cow<'a, Feature>,
    known: &KnownFeature,
    counted: Rect,
) -> (Cow<'a, Feature>, [usize; 3]) {
    if is_fine(&feature, known) {
        return (feature, [0; 3]);
    }
    let mut feature = feature.into_owned();
    let kind = feature.kind;
    let good = |v: f32| good_feature(kind, v);
    blacken(&mut feature.planes, &known.planes);
    let bad = bad_pixels(&feature.planes, good);
    // Limited first: what is far to both sides has no mean.
    feature.planes.iter_mut().for_each(|plane| plane.change(limited_feature));
    let in_planes = repair(feature.planes.iter_mut(), &bad, counted);
    feature.halves = feature.halves.take().filter(|_| known.statistics.halves);
    let mut in_halves = 0;
    for half in feature.halves.iter_mut().flatten() {
        blacken(half, &known.planes);
        for plane in half {
            let bad = bad_pixels([&*plane], good);
            plane.change(limited_feature);
            in_halves += repair([plane], &bad, counted);
        }
    }
    feature.var_of_mean = feature.var_of_mean.take().filter(|_| known.statistics.variance);
    let mut in_variances = 0;
    if let Some(variance) = &mut feature.var_of_mean {
        blacken(variance, &known.planes);
        let bad = either(bad_pixels(&*variance, good_feature_variance), &bad);
        variance.iter_mut().for_each(|plane| plane.change(|v| v.min(LARGEST_FEATURE * LARGEST_FEATURE)));
        in_variances = repair(variance.iter_mut(), &bad, counted) - in_planes;
    }
    (Cow::Owned(feature), [in_planes, in_halves, in_variances])
}

/// Whether repair would change nothing in `feature`.
fn is_fine(feature: &Feature, known: &KnownFeature) -> bool {
    let all =
        |planes: &[Plane], fine: fn(f32) -> bool| planes.iter().all(|p| p.data().iter().all(|&v| fine(v)));
    let values = |planes: &[Plane]| all(planes, |v| v.abs() <= LARGEST_FEATURE);
    let variances =
        |planes: &[Plane]| all(planes, |v| (0.0..=LARGEST_FEATURE * LARGEST_FEATURE).contains(&v));
    known.planes.iter().all(|known| *known)
        && values(&feature.planes)
        && feature
            .halves
            .as_ref()
            .is_none_or(|halves| known.statistics.halves && halves.iter().all(|half| values(half)))
        && feature
            .var_of_mean
            .as_ref()
            .is_none_or(|variance| known.statistics.variance && variances(variance))
}

/// Sets the planes to 0 that are not `known`.
fn blacken(planes: &mut [Plane], known: &[bool]) {
    for (plane, _) in planes.iter_mut().zip(known).filter(|(_, known)| !**known) {
        plane.data_mut().fill(0.0);
    }
}

/// What is left out of `frame` because it says nothing, in words.
fn left_out(frame: &Frame, known: &Known) -> Vec<String> {
    const WHY: &str = "is a number at no pixel";
    let mut notes = vec![];
    let colors = frame.aovs().iter().map(|aov| aov.name.as_str()).zip(&known.aovs);
    for (name, known) in std::iter::once(("color", &known.color)).chain(colors) {
        let channels = ["R", "G", "B"].iter().zip(known).filter(|(_, known)| !**known);
        notes.extend(
            channels.map(|(channel, _)| format!("{name}.{channel} {WHY}: it is black in the result")),
        );
    }
    let mut statistics = |of: &str, [variance, halves]: [bool; 2], usable: Usable| {
        if usable.denied {
            let why = "is 0 at every pixel though the half buffers differ";
            notes.push(format!("the variance{of} {why}: it is left out"));
        } else if variance && !usable.variance {
            notes.push(format!("the variance{of} {WHY} of some channel: it is left out"));
        }
        if halves && !usable.halves {
            notes.push(format!("the half buffers{of} {WHY} of some channel: they are left out"));
        }
    };
    statistics("", [frame.color_var_of_mean().is_some(), frame.halves().is_some()], known.statistics);
    for (feature, known) in frame.features().iter().zip(&known.features) {
        let given = [feature.var_of_mean.is_some(), feature.halves.is_some()];
        statistics(&format!(" of {}", feature.name), given, known.statistics);
    }
    notes
}

/// The pixels at which any of `planes` is not `good`.
fn bad_pixels<'a>(
    planes: impl IntoIterator<Item = &'a Plane>,
    good: impl Fn(f32) -> bool + Sync,
) -> Vec<bool> {
    let planes: Vec<&Plane> = planes.into_iter().collect();
    let bad = |i: usize| planes.iter().any(|plane| !good(plane.data()[i]));
    let pixels = planes.first().map_or(0, |plane| plane.data().len());
    (0..pixels).into_par_iter().with_min_len(TASK).map(bad).collect()
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
    use crate::denoise::Facts;

    fn applied<'a>(frame: &'a Frame, summary: &mut Summary) -> Clean<'a> {
        let all = Rect::whole((frame.width(), frame.height()));
        let facts = Facts::of(frame);
        apply(frame.into(), &facts.known(), facts.exposure(), all, summary)
    }

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
        let clean = applied(&frame, &mut summary);
        assert_eq!((clean.color, clean.halves), (picture(), Some([picture(), picture()])));
        assert_eq!(clean.aovs[0], picture());
        assert_eq!((summary.repaired_color, summary.repaired_halves, summary.repaired_aovs), (1, 1, 1));
        let [red, green, blue] = picture();
        assert_eq!(clean.aovs[1], [red, Plane::filled(3, 2, 0.0), blue], "{green:?} was no number");
        assert!(summary.notes[0].starts_with("broken.G is a number at no pixel"), "{:?}", summary.notes);
    }

    #[test]
    fn what_is_repaired_has_the_variance_of_its_neighbours() {
        let with = |value: f32, bad: f32| -> Rgb {
            std::array::from_fn(|_| Plane::from_fn(5, 5, |x, y| if (x, y) == (2, 2) { bad } else { value }))
        };
        let depth = |value, variance| {
            let [plane, ..] = with(3.0, value);
            let [variance, ..] = with(0.5, variance);
            Feature::new("depth", FeatureKind::Depth, vec![plane]).with_variance_of_mean(vec![variance])
        };
        let frame = |color: f32, variance: f32, feature: Feature| {
            let frame =
                Frame::new(with(1.0, color)).and_then(|f| f.with_variance_of_mean(with(0.25, variance)));
            frame.and_then(|f| f.with_feature(feature)).unwrap()
        };
        let mut summary = Summary::default();
        let broken = frame(f32::INFINITY, 1e10, depth(f32::NAN, 1e10));
        let (got, whole) = (applied(&broken, &mut summary), frame(1.0, 0.25, depth(3.0, 0.5)));
        let expected = applied(&whole, &mut Summary::default());
        assert_eq!(
            (got.color, got.variance, got.features),
            (expected.color, expected.variance, expected.features)
        );
        let counts = (summary.repaired_color, summary.repaired_features, summary.repaired_variance);
        assert_eq!(counts, (1, 1, 0), "what is repaired with the colour is counted with it");
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
        assert_eq!(applied(&frame, &mut summary).variance, None);
        assert_eq!((summary.repaired_variance, summary.notes.len()), (0, 1));
    }

    #[test]
    fn nan_between_infinities_of_both_signs_becomes_a_number() {
        let grey = || std::array::from_fn(|_| Plane::filled(3, 1, 1.0));
        let plane = Plane::from_vec(3, 1, vec![f32::INFINITY, f32::NAN, f32::NEG_INFINITY]).unwrap();
        let depth = Feature::new("depth", crate::FeatureKind::Depth, vec![plane]);
        let frame = Frame::new(grey()).and_then(|frame| frame.with_feature(depth)).unwrap();
        let clean = applied(&frame, &mut Summary::default());
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
