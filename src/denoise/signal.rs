//! What the fits read, and all their stages over it.

use super::basis::Basis;
use super::guides::{Guided, Guides};
use super::reconstruct::{self, Area};
use super::solver::{Beside, Problem};
use super::surfaces::Spread;
use super::{Observer, Stage, coarse, variance};
use crate::frame::Summary;
use crate::image::{Plane, Rgb, sum_of_channels};
use crate::options::Options;
use std::borrow::Cow;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A noisy picture ready for the fits: repaired, exposed, without outliers.
pub struct Signal<'a> {
    /// The colour's channels, then every AOV's.
    pub targets: Vec<Cow<'a, Plane>>,
    /// Of the colour's mean.
    pub variance: Rgb,
    /// The same, smoothed.
    pub smoothed: Rgb,
    /// The features of the design, filtered.
    pub features: Vec<Plane>,
    /// What these planes belong to.
    pub spreads: Vec<Spread>,
    /// The albedo, its floor added.
    pub albedo: Option<Rgb>,
}

impl Signal<'_> {
    /// The same at half the resolution.
    pub fn halved(&self, variance_radius: usize) -> Signal<'static> {
        let variance = self.variance.each_ref().map(coarse::halve_variance);
        Signal {
            targets: self.targets.iter().map(|plane| Cow::Owned(coarse::halve(plane))).collect(),
            smoothed: variance.each_ref().map(|plane| variance::smooth(plane, variance_radius)),
            variance,
            features: self.features.iter().map(coarse::halve).collect(),
            spreads: self.spreads.clone(),
            albedo: self.albedo.as_ref().map(|albedo| albedo.each_ref().map(coarse::halve)),
        }
    }

    /// Estimates the variance again, from what a fit by the first estimate leaves.
    pub fn look_again(&mut self, area: Area, options: &Options, observer: &dyn Observer) {
        let options = Options {
            stages: options.stages[..1].to_vec(),
            min_coverage: options.min_coverage * options.pilot_coverage,
            ..options.clone()
        };
        let first = AsOne::new(observer, 1);
        let fit = self.reconstruct(&[], &[area], &options, &first, &mut Summary::default());
        for (c, variance) in self.variance.iter_mut().enumerate() {
            *variance = variance::from_residual(&self.targets[c], &fit.targets[c], variance);
            self.smoothed[c] = variance::smooth(variance, options.variance_radius);
        }
    }

    /// What pixels are compared by.
    fn guided(&self) -> Guided<'_> {
        Guided {
            color: std::array::from_fn(|c| &*self.targets[c]),
            variance: &self.variance,
            trusted: variance::trusted,
            albedo: self.albedo.as_ref(),
            features: &self.features,
            spreads: &self.spreads,
        }
    }

    /// Multi-stage reconstruction: y for μ at first, then the stage before (Moon et al. 2016).
    pub fn reconstruct(
        &self,
        beside: &[Beside<'_>],
        areas: &[Area],
        options: &Options,
        observer: &dyn Observer,
        summary: &mut Summary,
    ) -> reconstruct::Stage {
        let mut guides = Guides::default();
        let basis = Basis::new(options.window_radius, self.features.len(), options.max_order);
        let noise = sum_of_channels(&self.smoothed);
        let mut stage: Option<reconstruct::Stage> = None;
        for (n, (kernels, area)) in options.stages.iter().zip(areas).enumerate() {
            observer.stage(Stage::Fit(n + 1));
            let last = n + 1 == options.stages.len();
            let pilot = stage.take().map(reconstruct::Stage::into_pilot);
            guides = guides.turned_to(kernels, self.guided(), options);
            // Only the last stage's operator is applied to the AOVs.
            let count = if last { self.targets.len() } else { 3 };
            let targets: Vec<&Plane> = self.targets[..count].iter().map(|plane| &**plane).collect();
            let problem = Problem {
                targets: &targets,
                variance: &self.smoothed,
                noise: &noise,
                pilot: pilot.as_ref(),
                features: &self.features,
                guides: &guides,
                albedo: self.albedo.as_ref(),
                beside,
                basis: &basis,
                options,
            };
            let coverage = options.min_coverage * if last { 1.0 } else { options.pilot_coverage };
            let sums = reconstruct::run(&problem, kernels, coverage, *area, &|done| observer.progress(done));
            // The result has room where these were.
            drop(pilot);
            if last {
                guides = Guides::default();
            }
            let result = sums.into_stage(&targets, &noise);
            summary.centres += result.fits;
            summary.coverage_centres += result.coverage_fits;
            summary.orders = result.orders;
            stage = Some(result);
        }
        stage.expect("the options' check wants at least one stage")
    }
}

/// Reports a reconstruction of several stages to an observer as a single stage.
pub struct AsOne<'a> {
    observer: &'a dyn Observer,
    stages: usize,
    begun: AtomicUsize,
}

impl<'a> AsOne<'a> {
    /// For `stages` stages, reported as `observer`'s current one.
    pub fn new(observer: &'a dyn Observer, stages: usize) -> Self {
        Self { observer, stages, begun: AtomicUsize::new(0) }
    }
}

impl Observer for AsOne<'_> {
    fn stage(&self, _stage: Stage) {
        self.begun.fetch_add(1, Ordering::Relaxed);
    }

    fn progress(&self, done: f32) {
        let before = self.begun.load(Ordering::Relaxed).saturating_sub(1);
        self.observer.progress((before as f32 + done) / self.stages as f32);
    }
}
