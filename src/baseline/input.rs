//! What every baseline starts from and ends in: the frame repaired and exposed, the result put back.

use crate::denoise::exposure::{expose, unexpose_error};
use crate::denoise::sanitize::{self, Clean};
use crate::denoise::{Facts, Silent, prefilter, variance};
use crate::frame::{Aov, Denoised, Feature, FeatureKind, Frame, Summary};
use crate::image::{Plane, Rect, Rgb};
use crate::options::{Options, PrefilterOptions};
use std::borrow::Cow;

/// A frame without NaN and infinity, at an exposure at which absolute constants are meant.
pub struct Input<'a> {
    frame: &'a Frame,
    facts: Facts,
    /// The repaired planes.
    pub clean: Clean<'a>,
    /// Variance of the mean of the colour: given, from the halves, or from the picture itself.
    pub variance: Rgb,
    exposure: f32,
    /// What happened so far.
    pub summary: Summary,
}

/// What a baseline makes of an [`Input`], exposed.
pub struct Output {
    /// The colour's planes, then every AOV's.
    pub targets: Vec<Plane>,
    /// Mean squared error, where the method has an estimate.
    pub mse: Option<Plane>,
    /// The order of the fits: 0 for weighted means, 1 for linear models.
    pub order: f32,
    /// Where the method would sample next.
    pub sampling_priority: Option<Plane>,
}

/// The kinds of features that methods with no choice of their own look at: those that the pipeline fits by default.
pub fn kinds() -> Vec<FeatureKind> {
    Options::default().features
}

impl<'a> Input<'a> {
    /// Repairs and exposes `frame` for the method named `method`.
    pub fn new(frame: &'a Frame, method: &'static str) -> Self {
        let mut summary = Summary { method, ..Summary::default() };
        let facts = Facts::of(frame);
        let all = Rect::whole((frame.width(), frame.height()));
        let exposure = facts.exposure();
        let mut clean = sanitize::apply(frame.into(), &facts.known(), exposure, all, &mut summary);
        clean.expose(exposure);
        let variance = variance::of_mean(&mut clean, &mut summary);
        Self { frame, facts, clean, variance, exposure, summary }
    }

    /// Width and height.
    pub fn size(&self) -> (usize, usize) {
        self.clean.color[0].size()
    }

    /// The variance of the mean of one half of the samples: twice that of all of them.
    pub fn variance_of_half(&self) -> Rgb {
        let (width, height) = self.size();
        std::array::from_fn(|c| Plane::from_fn(width, height, |x, y| 2.0 * self.variance[c].get(x, y)))
    }

    /// The AOVs' planes.
    pub fn aovs(&self) -> impl Iterator<Item = &Plane> {
        self.clean.aovs.iter().flatten()
    }

    /// The colour's planes, then the AOVs'.
    pub fn targets(&self) -> Vec<&Plane> {
        self.clean.targets().collect()
    }

    /// The features of the kinds that a regression uses, the pipeline's by default, each with its number in the frame.
    pub fn feature_list(&self) -> impl Iterator<Item = (usize, &Feature)> {
        let kinds = kinds();
        self.clean
            .features
            .iter()
            .map(|feature| &**feature)
            .enumerate()
            .filter(move |(_, feature)| kinds.contains(&feature.kind))
    }

    /// The feature planes for a regression, prefiltered, constant ones left out; their names go into the
    /// summary.
    pub fn features(&mut self, options: &PrefilterOptions) -> Vec<Plane> {
        let (mut planes, mut columns) = (vec![], vec![]);
        for (f, feature) in self.feature_list() {
            let noisy = self.facts.feature_is_noisy(f);
            let filtered = prefilter::apply(Cow::Borrowed(feature), noisy, options, &Silent);
            for (i, plane) in filtered.expect("nobody stops it").planes.into_iter().enumerate() {
                if !self.facts.feature_is_constant(f, i) {
                    columns.push(format!("{}.{i}", feature.name));
                    planes.push(plane);
                }
            }
        }
        self.summary.columns = columns;
        planes
    }

    /// Puts `output` back into the frame's units. A value that left `f32`'s range on the way is the noisy
    /// one instead, which the notes tell.
    #[expect(clippy::manual_clamp, reason = "NaN is to become 0")]
    pub fn finish(mut self, output: Output) -> Denoised {
        let (width, height) = self.size();
        let mut kept = 0;
        let mut planes = output.targets.into_iter().zip(self.clean.targets()).map(|(mut plane, noisy)| {
            for (value, noisy) in plane.data_mut().iter_mut().zip(noisy.data()) {
                if !value.is_finite() {
                    *value = *noisy;
                    kept += 1;
                }
            }
            expose(&mut plane, self.exposure.recip());
            plane
        });
        let mut next = || -> Rgb {
            std::array::from_fn(|_| planes.next().expect("a method returns every target it was given"))
        };
        let color = next();
        let names = self.frame.aovs().iter().map(|aov| aov.name.clone());
        let aovs = names.map(|name| Aov { name, color: next() }).collect();
        drop(planes);
        if kept > 0 {
            self.summary.notes.push(format!("{kept} values out of range were kept as they came"));
        }
        if output.mse.is_none() {
            self.summary.notes.push("the method has no estimate of its error here".into());
        }
        Denoised {
            color,
            aovs,
            mse: output.mse.map(|mut mse| {
                unexpose_error(&mut mse, self.exposure);
                mse
            }),
            order: Plane::filled(width, height, output.order),
            sampling_priority: output.sampling_priority.map(|mut plane| {
                plane.data_mut().iter_mut().for_each(|v| *v = v.max(0.0).min(f32::MAX));
                plane
            }),
            summary: self.summary,
        }
    }
}

/// What is added to the squared radiance under a relative error that steers samples, so that black
/// pixels do not draw them all (Rousselle, Knaus, Zwicker 2012; `[choice]` for every method alike).
const PRIORITY_EPSILON: f32 = 1e-3;

/// A squared error over the squared radiance of the picture: what a sampling map is made of.
pub fn relative_error(mse: &Plane, picture: &[Plane]) -> Plane {
    Plane::from_fn(mse.width(), mse.height(), |x, y| {
        let mean = picture[..3].iter().map(|plane| plane.get(x, y)).sum::<f32>() / 3.0;
        mse.get(x, y) / (mean * mean + PRIORITY_EPSILON)
    })
}

/// The mean of two planes.
pub fn mean(a: &Plane, b: &Plane) -> Plane {
    Plane::from_fn(a.width(), a.height(), |x, y| 0.5 * a.get(x, y) + 0.5 * b.get(x, y))
}
