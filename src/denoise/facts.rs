//! What must be known of a whole picture before any part of it can be denoised alone.
//!
//! All else that the stages do looks a bounded distance around a pixel (see [`super::part`]). These few
//! questions are asked of every pixel once, so that they can be answered row by row while a file is read.
//! Only good values are asked: what the first stage repairs is a mean of those, or black. What depends on the
//! answers, the energy of the outliers, is had by going through the rows a second time.

use super::energy::Energy;
use super::exposure::Light;
use super::gains::Gains;
use super::observer::Log;
use super::part::Part;
use super::prepare::without_outliers;
use super::sanitize::{good_feature, good_feature_variance, good_radiance, good_variance, limited_feature};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{Feature, FeatureKind, Frame, Outline};
use crate::image::Plane;
use crate::options::Options;
use std::borrow::Cow;

/// What must be known of a whole picture before a part of it can be denoised alone.
///
/// Call [`Facts::add`] for all rows from top to bottom, then [`Facts::add_outliers`] for all rows, then
/// [`denoise_part`](super::denoise_part) for any part; with the same options throughout.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Facts {
    /// Of the rows that were added; none before the first.
    kinds: Option<Kinds>,
    /// Some rows had other kinds than the first.
    mixed: bool,
    /// So many rows were added.
    rows: usize,
    light: Light,
    color: [Range; 3],
    statistics: Statistics,
    /// For each AOV and channel whether it is a number anywhere.
    aovs: Vec<[bool; 3]>,
    features: Vec<FeatureFacts>,
    pub(super) energy: Energy,
    /// What gives it back, worked out once all its rows were added.
    pub(super) gains: Option<Gains>,
}

/// What all portions of a picture's rows have in common.
#[derive(Debug, Clone, PartialEq)]
struct Kinds {
    width: usize,
    /// The features' names, what they describe, and how many planes each has.
    features: Vec<(String, FeatureKind, usize)>,
    /// The AOVs' names.
    aovs: Vec<String>,
    /// Whether there are variances and halves: of the colour, then of every feature.
    statistics: Vec<[bool; 2]>,
}

impl Kinds {
    fn of(frame: &Frame) -> Self {
        let Outline { size: (width, _), features, aovs, .. } = frame.outline();
        let of_color = [frame.color_var_of_mean().is_some(), frame.halves().is_some()];
        let of_features = frame.features().iter().map(|f| [f.var_of_mean.is_some(), f.halves.is_some()]);
        let statistics = std::iter::once(of_color).chain(of_features).collect();
        Self { width, features, aovs, statistics }
    }
}

/// What is known of a feature.
#[derive(Debug, Clone, PartialEq)]
struct FeatureFacts {
    planes: Vec<Range>,
    statistics: Statistics,
}

/// What the statistics of some planes say of the noise, where there are any.
#[derive(Debug, Clone, PartialEq, Default)]
struct Statistics {
    variance: Option<Vec<Noise>>,
    halves: Option<Vec<Noise>>,
}

/// What of a picture is a number at any pixel; the rest says nothing and is left out.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Known {
    /// For each channel.
    pub color: [bool; 3],
    /// Of the colour.
    pub statistics: Usable,
    /// For each AOV and channel.
    pub aovs: Vec<[bool; 3]>,
    /// For each feature.
    pub features: Vec<KnownFeature>,
}

/// What of a feature is a number at any pixel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct KnownFeature {
    /// For each plane.
    pub planes: Vec<bool>,
    /// Of these planes.
    pub statistics: Usable,
}

/// Which statistics of some planes can be used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Usable {
    /// Every plane that is known has a good variance at some pixel, and the halves do not deny it.
    pub variance: bool,
    /// Every plane that is known has good halves at some pixel.
    pub halves: bool,
    /// The variance is 0 wherever it is a number though the halves differ: a layer that was never filled.
    pub denied: bool,
}

/// Whether a plane has two different values, and how far they spread.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Range {
    first: Option<f32>,
    varies: bool,
    values: f64,
    /// Of the differences to the first value.
    sum: f64,
    squares: f64,
}

impl Range {
    fn add(&mut self, value: f32) {
        let first = *self.first.get_or_insert(value);
        self.varies |= first != value;
        let apart = f64::from(value) - f64::from(first);
        self.values += 1.0;
        self.sum += apart;
        self.squares += apart * apart;
    }

    /// The values' variance over the picture, 0 without any.
    fn spread(&self) -> f32 {
        let n = self.values.max(1.0);
        (self.squares / n - (self.sum / n).powi(2)).max(0.0) as f32
    }

    fn is_known(&self) -> bool {
        self.first.is_some()
    }
}

/// What a plane of variances, or a plane of each half, says of the noise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Noise {
    /// It is a number at some pixel.
    known: bool,
    /// It shows noise at some pixel.
    noisy: bool,
}

impl Noise {
    /// Adds the variances, or the distances of the halves, of some pixels: until one is noisy, which has no more to say.
    fn add_all(&mut self, pixels: impl IntoIterator<Item = f32>) {
        for noise in pixels {
            if self.noisy {
                return;
            }
            (self.known, self.noisy) = (true, noise > 0.0);
        }
    }
}

impl Statistics {
    /// Those of planes that are `known` which can be used.
    fn usable(&self, known: &[bool]) -> Usable {
        let all_known = |statistic: &Option<Vec<Noise>>| {
            let mut noise = statistic.iter().flatten().zip(known);
            statistic.is_some() && noise.all(|(noise, known)| noise.known || !known)
        };
        let [variance, halves] = [&self.variance, &self.halves].map(all_known);
        let denied =
            variance && halves && !any_noisy(&self.variance, known) && any_noisy(&self.halves, known);
        Usable { variance: variance && !denied, halves, denied }
    }

    /// Whether planes that are `known` are noisy; none where nothing tells.
    fn noisy(&self, known: &[bool]) -> Option<bool> {
        match self.usable(known) {
            Usable { variance: true, .. } => Some(any_noisy(&self.variance, known)),
            Usable { halves: true, .. } => Some(any_noisy(&self.halves, known)),
            _ => None,
        }
    }
}

fn any_noisy(statistic: &Option<Vec<Noise>>, known: &[bool]) -> bool {
    statistic.iter().flatten().zip(known).any(|(noise, known)| noise.noisy && *known)
}

impl Facts {
    /// Of a whole picture; its outliers are not looked for.
    pub fn of(frame: &Frame) -> Self {
        let mut facts = Self::default();
        facts.add(frame);
        facts
    }

    /// Adds the next rows, in their full width. Every call has the same kinds of planes: where one has not,
    /// [`denoise_part`](super::denoise_part) refuses these facts.
    pub fn add(&mut self, rows: &Frame) {
        let kinds = Kinds::of(rows);
        self.rows += rows.height();
        self.mixed |= *self.kinds.get_or_insert_with(|| kinds.clone()) != kinds;
        self.aovs.resize(rows.aovs().len(), [false; 3]);
        if self.features.is_empty() {
            self.features.extend(rows.features().iter().map(FeatureFacts::new));
        }
        let Self { light, color, statistics: Statistics { variance, halves }, aovs, features, .. } = self;
        // Every sum is of one task, which adds in order: so the bits are those of a loop.
        rayon::scope(|tasks| {
            tasks.spawn(move |_| add_light(light, rows));
            for (range, plane) in color.iter_mut().zip(rows.color()) {
                tasks.spawn(move |_| {
                    plane.data().iter().filter(|v| good_radiance(**v)).for_each(|v| range.add(*v))
                });
            }
            if let Some(planes) = rows.color_var_of_mean() {
                let noise = variance.get_or_insert_with(|| vec![Noise::default(); 3]);
                tasks.spawn(move |_| add_variance(noise, planes, good_variance));
            }
            if let Some(planes) = rows.halves() {
                let noise = halves.get_or_insert_with(|| vec![Noise::default(); 3]);
                let planes = planes.each_ref().map(|half| &half[..]);
                tasks.spawn(move |_| add_halves(noise, planes, good_radiance, |v| v));
            }
            for (known, aov) in aovs.iter_mut().zip(rows.aovs()) {
                tasks.spawn(move |_| {
                    for (known, plane) in known.iter_mut().zip(&aov.color) {
                        *known = *known || plane.data().iter().any(|v| good_radiance(*v));
                    }
                });
            }
            for (facts, feature) in features.iter_mut().zip(rows.features()) {
                tasks.spawn(move |_| facts.add(feature));
            }
        });
    }

    /// Adds the energy of the outliers of the next rows, `part.wanted` in their full width, of a picture all of
    /// whose rows were [added](Self::add) before; `frame` holds what [`Part::of_outliers`] has read.
    ///
    /// # Errors
    /// When an option is out of its range, the frame is not of the part's size, or these are not the facts of its
    /// picture.
    pub fn add_outliers<'a>(
        &mut self,
        frame: impl Into<Cow<'a, Frame>>,
        part: &Part,
        options: &Options,
    ) -> Result<()> {
        let frame = frame.into();
        options.check()?;
        part.check(&frame)?;
        self.check(&frame, part)?;
        let (known, log) = (self.known(), &mut Log::silent(options));
        let (clean, removed) = without_outliers(frame, &known, self.exposure(), part, options, log)?;
        self.energy.add(clean.color.each_ref(), &removed, part.within(), part.wanted.y);
        let all = self.energy.pixels() == part.picture.0 * part.picture.1;
        self.gains = all.then(|| Gains::of(&self.energy, options.outliers.witnesses));
        Ok(())
    }

    /// Refuses a frame of another picture than the one whose rows were added, each once.
    pub(super) fn check(&self, frame: &Frame, part: &Part) -> Result<()> {
        let foreign = |what: String| {
            let remedy = "give every row of the picture that the frame is a part of to Facts::add, once";
            Err(Error::new(ErrorKind::Usage, what).remedy(remedy))
        };
        let known = (self.kinds.as_ref().map_or(0, |kinds| kinds.width), self.rows);
        if known != part.picture {
            let ((width, height), (columns, rows)) = (part.picture, known);
            return foreign(format!(
                "the facts are of {columns}×{rows} pixels where the picture is {width}×{height}"
            ));
        }
        if self.mixed
            || self.kinds.as_ref().is_some_and(|kinds| Kinds { width: known.0, ..Kinds::of(frame) } != *kinds)
        {
            return foreign(
                "the facts are of other features, AOVs or statistics than the frame has".to_owned(),
            );
        }
        Ok(())
    }

    /// What is a number at any pixel.
    pub(crate) fn known(&self) -> Known {
        let color = self.color.each_ref().map(Range::is_known);
        Known {
            color,
            statistics: self.statistics.usable(&color),
            aovs: self.aovs.clone(),
            features: self.features.iter().map(FeatureFacts::known).collect(),
        }
    }

    /// The factor that brings the picture to the exposure in which the method's constants are meant.
    pub fn exposure(&self) -> f32 {
        self.light.scale()
    }

    /// Whether there is anything to take out: some variance above 0, halves that differ, or, where neither
    /// is known, a colour that is not the same everywhere.
    pub fn has_noise(&self) -> bool {
        self.noisy().unwrap_or_else(|| self.color.iter().any(|range| range.varies))
    }

    /// Whether neither a variance nor halves tell the noise, so that it is estimated from the picture.
    pub fn noise_is_estimated(&self) -> bool {
        self.noisy().is_none()
    }

    fn noisy(&self) -> Option<bool> {
        self.statistics.noisy(&self.color.each_ref().map(Range::is_known))
    }

    /// Whether the variance or the halves of the frame's `feature`th feature show noise.
    pub fn feature_is_noisy(&self, feature: usize) -> bool {
        self.features[feature].is_noisy()
    }

    /// The variance of a plane of a feature over the picture.
    pub fn feature_spread(&self, feature: usize, plane: usize) -> f32 {
        self.features[feature].planes[plane].spread()
    }

    /// Whether a plane of a feature is the same everywhere.
    pub fn feature_is_constant(&self, feature: usize, plane: usize) -> bool {
        !self.features[feature].planes[plane].varies
    }
}

impl FeatureFacts {
    fn new(feature: &Feature) -> Self {
        let planes = feature.planes.len();
        let noise = |there: bool| there.then(|| vec![Noise::default(); planes]);
        let [variance, halves] = [feature.var_of_mean.is_some(), feature.halves.is_some()].map(noise);
        Self { planes: vec![Range::default(); planes], statistics: Statistics { variance, halves } }
    }

    fn add(&mut self, feature: &Feature) {
        for (range, plane) in self.planes.iter_mut().zip(&feature.planes) {
            let good = plane.data().iter().filter(|v| good_feature(feature.kind, **v));
            good.for_each(|v| range.add(limited_feature(*v)));
        }
        if let (Some(noise), Some(variance)) = (&mut self.statistics.variance, &feature.var_of_mean) {
            add_variance(noise, variance, good_feature_variance);
        }
        if let (Some(noise), Some([a, b])) = (&mut self.statistics.halves, &feature.halves) {
            add_halves(noise, [a, b], |v| good_feature(feature.kind, v), limited_feature);
        }
    }

    fn known_planes(&self) -> Vec<bool> {
        self.planes.iter().map(Range::is_known).collect()
    }

    fn known(&self) -> KnownFeature {
        let planes = self.known_planes();
        KnownFeature { statistics: self.statistics.usable(&planes), planes }
    }

    fn is_noisy(&self) -> bool {
        self.statistics.noisy(&self.known_planes()).unwrap_or(false)
    }
}

/// Adds the luminance of the pixels, of the channels that are good there.
fn add_light(light: &mut Light, rows: &Frame) {
    for y in 0..rows.height() {
        let color = rows.color().each_ref().map(|plane| plane.row(y));
        light.add_row((0..rows.width()).filter_map(|x| {
            let good = color.iter().map(|row| row[x]).filter(|v| good_radiance(*v));
            let (sum, n) = good.fold((0.0, 0.0), |(sum, n), v| (sum + f64::from(v), n + 1.0));
            (n > 0.0).then(|| sum / n)
        }));
    }
}

/// Adds the variances of some planes.
fn add_variance(noise: &mut [Noise], variance: &[Plane], good: impl Fn(f32) -> bool) {
    for (noise, plane) in noise.iter_mut().zip(variance) {
        noise.add_all(plane.data().iter().copied().filter(|v| good(*v)));
    }
}

/// Adds both halves of some planes, where both are good, `limited`.
fn add_halves(
    noise: &mut [Noise],
    [a, b]: [&[Plane]; 2],
    good: impl Fn(f32) -> bool,
    limited: impl Fn(f32) -> f32,
) {
    for (noise, (a, b)) in noise.iter_mut().zip(a.iter().zip(b)) {
        let pairs = a.data().iter().zip(b.data()).filter(|(a, b)| good(**a) && good(**b));
        // Not by the square of the difference, which may be no number that there is.
        noise.add_all(pairs.map(|(a, b)| (limited(*a) - limited(*b)).abs()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::denoise::{Silent, denoise_part};
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
        assert!(!Facts::of(&unknown).known().statistics.variance);
        let half = |bad: f32| rgb(move |x, _| if x == 4 { bad } else { 1.0 });
        let halves = |bad: f32| flat().with_halves([half(bad), half(1.0)]).unwrap();
        assert!(!Facts::of(&halves(f32::INFINITY)).has_noise());
        assert!(Facts::of(&halves(2.0)).has_noise());
    }

    #[test]
    fn a_variance_of_0_does_not_overrule_halves_that_differ() {
        let [a, b] =
            [0.2, -0.2].map(|by: f32| rgb(move |x, y| 1.0 + if (x + y) % 2 == 0 { by } else { -by }));
        let depth = |planes: &Rgb| planes[..1].to_vec();
        let feature = Feature::new("depth", FeatureKind::Depth, depth(&rgb(|_, _| 1.0)))
            .with_halves([depth(&a), depth(&b)]);
        let frame = |variance: f32| {
            let feature = feature.clone().with_variance_of_mean(depth(&rgb(|_, _| variance)));
            let frame = Frame::new(rgb(|_, _| 1.0)).and_then(|f| f.with_halves([a.clone(), b.clone()]));
            frame
                .and_then(|f| f.with_variance_of_mean(rgb(|_, _| variance)))
                .and_then(|f| f.with_feature(feature))
                .unwrap()
        };
        for variance in [0.0, 0.04] {
            let facts = Facts::of(&frame(variance));
            assert!(facts.has_noise() && facts.feature_is_noisy(0) && !facts.noise_is_estimated());
            let known = facts.known();
            for usable in [known.statistics, known.features[0].statistics] {
                assert_eq!([usable.variance, usable.denied], [variance > 0.0, variance == 0.0]);
            }
            let result = crate::denoise::denoise(frame(variance), &Options::default()).unwrap();
            let notes = result.summary.notes.join("\n");
            assert_eq!(notes.contains("variance is 0 at every pixel"), variance == 0.0, "{notes}");
            assert_eq!(notes.contains("variance of depth is 0 at every pixel"), variance == 0.0, "{notes}");
        }
    }

    #[test]
    fn facts_of_another_picture_are_refused() {
        let depth = |name: &str| Feature::new(name, FeatureKind::Depth, rgb(|x, _| x as f32)[..1].to_vec());
        let frame =
            |f: &str| Frame::new(rgb(|x, y| (x * y) as f32)).and_then(|frame| frame.with_feature(depth(f)));
        let (picture, options) = (frame("depth").unwrap(), Options::default());
        let (right, mut twice, mut mixed) = (Facts::of(&picture), Facts::of(&picture), Facts::default());
        twice.add(&picture);
        let height = SIZE.1 - 2;
        let upper = Frame::new(rows(picture.color(), 0, height).try_into().unwrap()).unwrap();
        let lower = Frame::new(rows(picture.color(), height, 2).try_into().unwrap());
        let narrow =
            Feature::new("depth", FeatureKind::Depth, rows(&picture.features()[0].planes, height, 2));
        [upper.clone(), lower.and_then(|lower| lower.with_feature(narrow)).unwrap()]
            .iter()
            .for_each(|f| mixed.add(f));
        let part = Part::whole(SIZE);
        let facts = [Facts::default(), twice, mixed, Facts::of(&upper), Facts::of(&frame("z").unwrap())];
        for mut facts in facts {
            let error = denoise_part(&picture, &part, &facts, &options, &Silent).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Usage);
            assert!(error.to_string().starts_with("the facts are of "), "{error}");
            assert!(facts.add_outliers(&picture, &part, &options).is_err());
        }
        let mut outliers_twice = right.clone();
        outliers_twice.add_outliers(&picture, &part, &options).unwrap();
        assert!(denoise_part(&picture, &part, &outliers_twice, &options, &Silent).is_ok());
        outliers_twice.add_outliers(&picture, &part, &options).unwrap();
        let error = denoise_part(&picture, &part, &outliers_twice, &options, &Silent).unwrap_err();
        assert!(error.to_string().contains("Facts::add_outliers"), "{error}");
    }
}
