//! The contract between whoever has a noisy picture and the denoiser.
//!
//! Everything is per pixel, row major, top row first, all planes of one size. Colour is linear,
//! scene-referred RGB of any scale. **Variances are variances of the mean**: the expected squared
//! error of the stored pixel, not of one sample. Values may be NaN, infinite or negative: the first
//! stage repairs and counts them.

use crate::error::{Error, ErrorKind, Result};
use crate::image::{Plane, Rgb, black};
use std::borrow::Cow;

/// What a feature buffer describes; the name under which reports and maps list it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FeatureKind {
    /// Surface normal, 3 planes, any space.
    Normal,
    /// Texture: reflectance at the first (rough) hit, 3 planes; of another number colour is not divided by it.
    Albedo,
    /// Distance from the camera, 1 plane.
    Depth,
    /// Fraction of light samples that reach their light, 1 plane.
    Visibility,
    /// Hit point, 3 planes, any space.
    Position,
    /// Anything else that may explain the picture, 1 plane or more.
    Other,
}

/// A feature buffer: one or more planes that describe what the pixel sees.
#[derive(Debug, Clone, PartialEq)]
pub struct Feature {
    /// The name in reports and messages.
    pub name: String,
    /// What it describes.
    pub kind: FeatureKind,
    /// The mean over the pixel's samples, one plane per component.
    pub planes: Vec<Plane>,
    /// Variance of that mean, one plane per component.
    pub var_of_mean: Option<Vec<Plane>>,
    /// Means of the two independent halves of the samples.
    pub halves: Option<[Vec<Plane>; 2]>,
}

impl Feature {
    /// A feature without variance.
    pub fn new(name: impl Into<String>, kind: FeatureKind, planes: Vec<Plane>) -> Self {
        Self { name: name.into(), kind, planes, var_of_mean: None, halves: None }
    }

    /// Adds the variance of the mean, one plane per component.
    #[must_use]
    pub fn with_variance_of_mean(self, var_of_mean: Vec<Plane>) -> Self {
        Self { var_of_mean: Some(var_of_mean), ..self }
    }

    /// Adds the means of two independent halves of the samples; their average is the feature.
    #[must_use]
    pub fn with_halves(self, halves: [Vec<Plane>; 2]) -> Self {
        Self { halves: Some(halves), ..self }
    }
}

/// A further picture that belongs to the beauty (an AOV, a light group): it goes through the very
/// operator that the beauty chose, so that what sums before sums after.
#[derive(Debug, Clone, PartialEq)]
pub struct Aov {
    /// The name in reports and messages.
    pub name: String,
    /// Linear RGB, in the beauty's units.
    pub color: Rgb,
}

/// Where what each pixel shows is in the neighbouring frames of a sequence: columns to the right and rows
/// down from the pixel, in pixels, a mean over its samples. NaN where it is not known.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Motion {
    /// To its place in the frame before.
    pub previous: Option<[Plane; 2]>,
    /// To its place in the next frame.
    pub next: Option<[Plane; 2]>,
}

/// A noisy picture with everything known about it. Built from the colour by [`Frame::new`] and the
/// `with_…` methods, each of which checks sizes, so that the stages need not.
///
/// The denoiser takes a frame or a reference to one: of a frame that it is given it lets every plane go that it
/// has no more use for, which is a third of the memory of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    pub(crate) color: Rgb,
    pub(crate) color_var_of_mean: Option<Rgb>,
    pub(crate) halves: Option<[Rgb; 2]>,
    pub(crate) features: Vec<Feature>,
    pub(crate) aovs: Vec<Aov>,
    pub(crate) motion: Option<Motion>,
    origin: (i32, i32),
    spp: Option<f32>,
}

impl<'a> From<&'a Frame> for Cow<'a, Frame> {
    fn from(frame: &'a Frame) -> Self {
        Cow::Borrowed(frame)
    }
}

impl From<Frame> for Cow<'_, Frame> {
    fn from(frame: Frame) -> Self {
        Cow::Owned(frame)
    }
}

/// What kinds of planes a frame has, without the planes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Outline {
    /// Width and height.
    pub size: (usize, usize),
    /// Column and row of the first pixel.
    pub origin: (i32, i32),
    /// The features' names, what they describe, and how many planes each has.
    pub features: Vec<(String, FeatureKind, usize)>,
    /// The AOVs' names.
    pub aovs: Vec<String>,
}

impl Frame {
    /// A frame of colour alone.
    ///
    /// # Errors
    /// When the three planes differ in size or have no pixel.
    pub fn new(color: Rgb) -> Result<Self> {
        let frame = Self {
            color,
            color_var_of_mean: None,
            halves: None,
            features: vec![],
            aovs: vec![],
            motion: None,
            origin: (0, 0),
            spp: None,
        };
        if frame.width() == 0 || frame.height() == 0 {
            return Err(Error::new(ErrorKind::Lacking, "the picture has no pixel"));
        }
        frame.check("color", &frame.color)?;
        Ok(frame)
    }

    /// Adds the variance of the colour's mean.
    ///
    /// # Errors
    /// When a plane differs from the colour in size.
    pub fn with_variance_of_mean(mut self, var_of_mean: Rgb) -> Result<Self> {
        self.check("variance", &var_of_mean)?;
        self.color_var_of_mean = Some(var_of_mean);
        Ok(self)
    }

    /// Adds the means of two independent halves of the samples; their average is the colour.
    ///
    /// # Errors
    /// When a plane differs from the colour in size.
    pub fn with_halves(mut self, halves: [Rgb; 2]) -> Result<Self> {
        self.check("half buffer A", &halves[0])?;
        self.check("half buffer B", &halves[1])?;
        self.halves = Some(halves);
        Ok(self)
    }

    /// Adds a feature buffer.
    ///
    /// # Errors
    /// When it has no plane, or a plane differs from the colour in size, or its variance or halves
    /// have another number of planes.
    pub fn with_feature(mut self, feature: Feature) -> Result<Self> {
        let count = feature.planes.len();
        let wrong = |what: &str, got: usize| {
            Error::new(ErrorKind::Lacking, format!("{what} has {got} planes where {count} were expected"))
                .in_channel(&feature.name)
        };
        if count == 0 {
            return Err(Error::new(ErrorKind::Lacking, "the feature has no plane").in_channel(&feature.name));
        }
        self.check(&feature.name, &feature.planes)?;
        if let Some(variance) = &feature.var_of_mean {
            if variance.len() != count {
                return Err(wrong("the variance", variance.len()));
            }
            self.check(&feature.name, variance)?;
        }
        for half in feature.halves.iter().flatten() {
            if half.len() != count {
                return Err(wrong("a half buffer", half.len()));
            }
            self.check(&feature.name, half)?;
        }
        self.features.push(feature);
        Ok(self)
    }

    /// Adds a picture to be denoised by the beauty's operator.
    ///
    /// # Errors
    /// When a plane differs from the colour in size.
    pub fn with_aov(mut self, aov: Aov) -> Result<Self> {
        self.check(&aov.name, &aov.color)?;
        self.aovs.push(aov);
        Ok(self)
    }

    /// Adds the motion towards the frames beside this one.
    ///
    /// # Errors
    /// When a plane differs from the colour in size.
    pub fn with_motion(mut self, motion: Motion) -> Result<Self> {
        for planes in motion.previous.iter().chain(&motion.next) {
            self.check("motion", planes)?;
        }
        self.motion = Some(motion);
        Ok(self)
    }

    /// States the column and row of the first pixel in a picture that is larger, as a data window does: where the
    /// windows of a sequence follow something, the frames beside are found by it.
    #[must_use]
    pub fn with_origin(mut self, origin: (i32, i32)) -> Self {
        self.origin = origin;
        self
    }

    /// States the samples per pixel.
    #[must_use]
    pub fn with_spp(mut self, spp: f32) -> Self {
        self.spp = Some(spp);
        self
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.color[0].width()
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.color[0].height()
    }

    /// The noisy colour.
    pub fn color(&self) -> &Rgb {
        &self.color
    }

    /// The variance of the colour's mean, where known.
    pub fn color_var_of_mean(&self) -> Option<&Rgb> {
        self.color_var_of_mean.as_ref()
    }

    /// The means of the two independent halves of the samples, where known.
    pub fn halves(&self) -> Option<&[Rgb; 2]> {
        self.halves.as_ref()
    }

    /// The feature buffers, in the order they were added.
    pub fn features(&self) -> &[Feature] {
        &self.features
    }

    /// The pictures that go through the beauty's operator.
    pub fn aovs(&self) -> &[Aov] {
        &self.aovs
    }

    /// The motion towards the frames beside this one, where known.
    pub fn motion(&self) -> Option<&Motion> {
        self.motion.as_ref()
    }

    /// Column and row of the first pixel; 0, 0 where nothing else was said.
    pub fn origin(&self) -> (i32, i32) {
        self.origin
    }

    pub(crate) fn outline(&self) -> Outline {
        let feature = |feature: &Feature| (feature.name.clone(), feature.kind, feature.planes.len());
        Outline {
            size: (self.width(), self.height()),
            origin: self.origin,
            features: self.features.iter().map(feature).collect(),
            aovs: self.aovs.iter().map(|aov| aov.name.clone()).collect(),
        }
    }

    /// Samples per pixel, where known.
    pub fn spp(&self) -> Option<f32> {
        self.spp
    }

    fn check(&self, name: &str, planes: &[Plane]) -> Result<()> {
        let expected = self.color[0].size();
        match planes.iter().find(|plane| plane.size() != expected) {
            None => Ok(()),
            Some(plane) => Err(Error::new(
                ErrorKind::Lacking,
                format!(
                    "is {}×{} where the colour is {}×{}",
                    plane.width(),
                    plane.height(),
                    expected.0,
                    expected.1
                ),
            )
            .in_channel(name)),
        }
    }
}

/// A denoised picture with what is known about its error.
#[derive(Debug, Clone, PartialEq)]
pub struct Denoised {
    /// The reconstructed colour.
    pub color: Rgb,
    /// The frame's further pictures, through the same operator, in the same order.
    pub aovs: Vec<Aov>,
    /// Estimated mean squared error of `color`, averaged over its channels; never negative. The pipeline always has an
    /// estimate, some baselines do not.
    pub mse: Option<Plane>,
    /// Polynomial order that was chosen, averaged over the fits that cover the pixel: 0 to 3.
    pub order: Plane,
    /// Where the method would send the next samples, in any unit, ≥ 0, higher for more urgent; none where
    /// it has no opinion.
    pub sampling_priority: Option<Plane>,
    /// What happened on the way.
    pub summary: Summary,
}

impl Denoised {
    /// A result of `size` whose first pixels are those of this part; the others wait for [`Self::put`].
    #[must_use]
    pub fn begin(&self, (width, height): (usize, usize)) -> Self {
        let (none, dark) = (|| Plane::filled(width, height, 0.0), || black(width, height));
        let aovs = self.aovs.iter().map(|aov| Aov { name: aov.name.clone(), color: dark() }).collect();
        let summary = Summary { columns: self.summary.columns.clone(), ..Summary::default() };
        let mse = self.mse.as_ref().map(|_| none());
        let mut whole = Self { color: dark(), aovs, mse, order: none(), sampling_priority: None, summary };
        whole.put(self, (0, 0));
        whole
    }

    /// Puts the pixels of a part in place, the first of them `at` this column and row, and adds its counts.
    pub fn put(&mut self, part: &Self, at: (usize, usize)) {
        self.color.iter_mut().zip(&part.color).for_each(|(whole, part)| whole.put(part, at));
        for (whole, part) in self.aovs.iter_mut().zip(&part.aovs) {
            whole.color.iter_mut().zip(&part.color).for_each(|(whole, part)| whole.put(part, at));
        }
        if let (Some(whole), Some(part)) = (&mut self.mse, &part.mse) {
            whole.put(part, at);
        }
        self.order.put(&part.order, at);
        self.summary.add(&part.summary);
    }
}

/// A frame beside the one that was denoised.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Beside {
    /// Frames from this one to it, negative before.
    pub offset: i32,
    /// Mean over the pixels of how far its samples are trusted, 0 to 1.
    pub trusted: f32,
    /// Share of the pixels that could have been trusted but hold the same noise, 0 to 1: the frame was repeated, or
    /// rendered with the same seed.
    pub copied: f32,
}

/// Counts and decisions of one run, for the report.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Summary {
    /// The method's name, one of [`crate::baseline::Method::NAMES`].
    pub method: &'static str,
    /// Pixels whose colour was NaN, infinite or beyond all measure (1e27 times the typical radiance) and was repaired
    /// from its neighbours.
    pub repaired_color: usize,
    /// Pixels whose colour was negative in some channel (kept, for they may be right, but counted).
    pub negative_color: usize,
    /// Pixels whose variance was NaN, infinite or negative and was replaced, the colour's and the features'.
    pub repaired_variance: usize,
    /// Pixels of features that were NaN, or infinite in anything but a depth or a position, and were replaced,
    /// summed over the features. What is farther than 1e15, as a miss is, is moved there and not counted.
    pub repaired_features: usize,
    /// Pixels of half buffers, the colour's and the features', that were no numbers where the colour is one.
    pub repaired_halves: usize,
    /// The same of AOVs, summed over them.
    pub repaired_aovs: usize,
    /// Outliers that were taken out before the fit.
    pub outliers: usize,
    /// Energy of each channel taken out with them, to be given back after the fit.
    pub energy_moved: [f64; 3],
    /// Centres fitted, over all stages and candidates.
    pub centres: usize,
    /// Of those, centres that the coverage test added to the grid.
    pub coverage_centres: usize,
    /// How often each order 0..=3 was the best, over the last stage's centres.
    pub orders: [usize; 4],
    /// Columns of the features that the fit uses.
    pub columns: Vec<String>,
    /// Frames beside this one that were used.
    pub beside: Vec<Beside>,
    /// Things done without or left out, each with its reason.
    pub notes: Vec<String>,
}

impl Summary {
    /// Adds the counts of a further part of the picture; notes that are there already are not repeated.
    fn add(&mut self, part: &Self) {
        self.method = part.method;
        self.repaired_color += part.repaired_color;
        self.negative_color += part.negative_color;
        self.repaired_variance += part.repaired_variance;
        self.repaired_features += part.repaired_features;
        self.repaired_halves += part.repaired_halves;
        self.repaired_aovs += part.repaired_aovs;
        self.outliers += part.outliers;
        self.energy_moved.iter_mut().zip(part.energy_moved).for_each(|(sum, energy)| *sum += energy);
        self.centres += part.centres;
        self.coverage_centres += part.coverage_centres;
        self.orders.iter_mut().zip(part.orders).for_each(|(sum, count)| *sum += count);
        for note in &part.notes {
            if !self.notes.contains(note) {
                self.notes.push(note.clone());
            }
        }
    }
}
