//! What must be known of a whole picture before any part of it can be denoised alone.
//!
//! All else that the stages do looks a bounded distance around a pixel (see [`super::part`]). These few
//! questions are asked of every pixel once, so that they can be answered row by row while a file is read.
//! Only good values are asked: what the first stage repairs is a mean of those, or black.

use super::exposure::Light;
use super::sanitize::{good_radiance, good_variance, limited_feature};
use super::variance::half_difference_squared;
use crate::frame::{Feature, Frame};
use crate::image::Plane;

/// The answers, of the rows that were added so far.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Facts {
    light: Light,
    /// The variance of the colour is a number at some pixel.
    variance_known: bool,
    /// It is above 0 at some pixel.
    variance_noisy: bool,
    /// Whether the halves differ at some pixel, where there are halves.
    halves_differ: Option<bool>,
    color: [Range; 3],
    features: Vec<FeatureFacts>,
}

/// What is known of a feature.
#[derive(Debug, Clone, PartialEq)]
struct FeatureFacts {
    /// Its variance or its halves show noise.
    noisy: bool,
    planes: Vec<Range>,
}

/// Whether a plane has two different values.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Range {
    first: Option<f32>,
    varies: bool,
}

impl Range {
    fn add(&mut self, value: f32) {
        self.varies |= *self.first.get_or_insert(value) != value;
    }
}

impl Facts {
    /// Of a whole picture.
    pub fn of(frame: &Frame) -> Self {
        let mut facts = Self::default();
        facts.add(frame);
        facts
    }

    /// Adds the next rows, in their full width. Every call has the same kinds of planes.
    pub fn add(&mut self, rows: &Frame) {
        if self.features.is_empty() {
            self.features.extend(rows.features().iter().map(FeatureFacts::new));
        }
        for y in 0..rows.height() {
            self.add_radiance(rows, y);
            if let Some(variance) = rows.color_var_of_mean() {
                for_each_good(variance, y, good_variance, |values| {
                    self.variance_known = true;
                    self.variance_noisy |= values.iter().any(|v| *v > 0.0);
                });
            }
            self.features.iter_mut().zip(rows.features()).for_each(|(facts, feature)| facts.add(feature, y));
        }
    }

    fn add_radiance(&mut self, rows: &Frame, y: usize) {
        let mut luminances = Vec::with_capacity(rows.width());
        for_each_good(rows.color(), y, good_radiance, |values| {
            luminances.push(values.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0);
            values.iter().for_each(|v| self.light.add_value(*v));
            self.color.iter_mut().zip(values).for_each(|(range, v)| range.add(*v));
        });
        self.light.add_row(luminances.into_iter());
        for aov in rows.aovs() {
            for_each_good(&aov.color, y, good_radiance, |values| {
                values.iter().for_each(|v| self.light.add_value(*v));
            });
        }
        if let Some(halves) = rows.halves() {
            let mut differ = false;
            for_each_good(halves.iter().flatten(), y, good_radiance, |values| {
                values.iter().for_each(|v| self.light.add_value(*v));
                differ |= (0..3).any(|c| half_difference_squared(values[c], values[c + 3]) > 0.0);
            });
            *self.halves_differ.get_or_insert_default() |= differ;
        }
    }

    /// These facts, for a frame whose variance is known as `other`'s is.
    pub(super) fn with_variance_of(&self, other: &Self) -> Self {
        Self { variance_known: other.variance_known, ..self.clone() }
    }

    /// The factor that brings the picture to the exposure in which the method's constants are meant.
    pub fn exposure(&self) -> f32 {
        self.light.scale()
    }

    /// Whether the variance of the colour is a number at any pixel.
    pub(crate) fn variance_is_known(&self) -> bool {
        self.variance_known
    }

    /// Whether there is anything to take out: some variance above 0, halves that differ, or, where neither
    /// is known, a colour that is not the same everywhere.
    pub fn has_noise(&self) -> bool {
        match (self.variance_known, self.halves_differ) {
            (true, _) => self.variance_noisy,
            (false, Some(differ)) => differ,
            (false, None) => self.color.iter().any(|range| range.varies),
        }
    }

    /// Whether the variance or the halves of the frame's `feature`th feature show noise.
    pub fn feature_is_noisy(&self, feature: usize) -> bool {
        self.features[feature].noisy
    }

    /// Whether a plane of a feature is the same everywhere.
    pub fn feature_is_constant(&self, feature: usize, plane: usize) -> bool {
        !self.features[feature].planes[plane].varies
    }
}

impl FeatureFacts {
    fn new(feature: &Feature) -> Self {
        Self { noisy: false, planes: vec![Range::default(); feature.planes.len()] }
    }

    fn add(&mut self, feature: &Feature, y: usize) {
        let limited = |values: &[f32]| values.iter().map(|v| limited_feature(*v)).collect::<Vec<_>>();
        for_each_good(
            &feature.planes,
            y,
            |v| !v.is_nan(),
            |values| {
                self.planes.iter_mut().zip(limited(values)).for_each(|(range, v)| range.add(v));
            },
        );
        match (&feature.var_of_mean, &feature.halves) {
            (Some(variance), _) => for_each_good(
                variance,
                y,
                |v| v >= 0.0,
                |values| {
                    self.noisy |= values.iter().any(|v| *v > 0.0);
                },
            ),
            (None, Some([a, b])) => {
                for pair in a.iter().zip(b) {
                    for_each_good(
                        <[&Plane; 2]>::from(pair),
                        y,
                        |v| !v.is_nan(),
                        |values| {
                            let limited = limited(values);
                            self.noisy |= half_difference_squared(limited[0], limited[1]) > 0.0;
                        },
                    );
                }
            }
            (None, None) => {}
        }
    }
}

/// Hands the values of `planes` at each pixel of row `y` to `take`, where all of them are `good`.
fn for_each_good<'p>(
    planes: impl IntoIterator<Item = &'p Plane>,
    y: usize,
    good: impl Fn(f32) -> bool,
    mut take: impl FnMut(&[f32]),
) {
    let rows: Vec<&[f32]> = planes.into_iter().map(|plane| plane.row(y)).collect();
    let mut values = vec![0.0; rows.len()];
    for x in 0..rows[0].len() {
        values.iter_mut().zip(&rows).for_each(|(value, row)| *value = row[x]);
        if values.iter().all(|v| good(*v)) {
            take(&values);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::FeatureKind;
    use crate::image::{Rect, Rgb};

    const SIZE: (usize, usize) = (9, 7);

    fn rgb(f: impl Fn(usize, usize) -> f32) -> Rgb {
        std::array::from_fn(|_| Plane::from_fn(SIZE.0, SIZE.1, &f))
    }

    fn rows(planes: &[Plane], y: usize, height: usize) -> Vec<Plane> {
        planes.iter().map(|plane| plane.crop(Rect { x: 0, y, width: SIZE.0, height })).collect()
    }

    #[test]
    fn rows_added_in_any_portions_tell_the_same() {
        let color = rgb(|x, y| if (x, y) == (3, 3) { f32::NAN } else { 0.3 + 0.77 * (x * y) as f32 });
        let variance = rgb(|x, y| if x == y { 0.5 } else { 0.0 });
        let depth = Plane::from_fn(SIZE.0, SIZE.1, |_, y| if y == 6 { 2.0 } else { 1.0 });
        let part = |y: usize, height: usize| {
            let rgb = |planes: &Rgb| rows(planes, y, height).try_into().unwrap();
            let mut depth =
                Feature::new("depth", FeatureKind::Depth, rows(std::slice::from_ref(&depth), y, height));
            depth.var_of_mean = Some(vec![Plane::filled(SIZE.0, height, 0.0)]);
            let frame = Frame::new(rgb(&color)).and_then(|f| f.with_variance_of_mean(rgb(&variance)));
            frame.and_then(|f| f.with_feature(depth)).unwrap()
        };
        let whole = Facts::of(&part(0, 7));
        for heights in [[1, 1, 5], [3, 3, 1], [2, 4, 1]] {
            let mut facts = Facts::default();
            let mut y = 0;
            for height in heights {
                facts.add(&part(y, height));
                y += height;
            }
            assert_eq!(facts, whole);
        }
        assert!(whole.has_noise() && !whole.feature_is_noisy(0) && !whole.feature_is_constant(0, 0));
        assert!(Facts::of(&part(0, 6)).feature_is_constant(0, 0));
    }

    #[test]
    fn bad_values_are_no_noise_and_no_variance() {
        let flat = || Frame::new(rgb(|_, _| 1.0)).unwrap();
        assert!(!Facts::of(&flat()).has_noise());
        let unknown = flat().with_variance_of_mean(rgb(|_, _| f32::NAN)).unwrap();
        assert!(!Facts::of(&unknown).variance_is_known());
        let half = |bad: f32| rgb(move |x, _| if x == 4 { bad } else { 1.0 });
        let halves = |bad: f32| flat().with_halves([half(bad), half(1.0)]).unwrap();
        assert!(!Facts::of(&halves(f32::INFINITY)).has_noise());
        assert!(Facts::of(&halves(2.0)).has_noise());
    }
}
