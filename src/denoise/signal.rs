//! What the fits read, and one stage of them.

use super::basis::Basis;
use super::design::Design;
use super::forgiveness;
use super::guides::{Guided, Guides};
use super::observer::Log;
use super::reconstruct;
use super::reconstruction::{Pilot, Reconstruction};
use super::solver::Problem;
use super::temporal::Warped;
use super::tiles::Area;
use super::{coarse, variance};
use crate::error::Result;
use crate::image::{Plane, Rgb, sum_of_channels};
use crate::options::{Kernel, Options};

/// A noisy picture ready for the fits: repaired, exposed, without outliers.
pub struct Signal {
    /// The colour's channels, then every AOV's.
    pub targets: Vec<Plane>,
    /// Of the colour's mean.
    pub variance: Rgb,
    /// The same, smoothed.
    pub smoothed: Rgb,
    /// The features.
    pub design: Design,
}

impl Signal {
    /// A signal whose noise is `variance`, which the options tell how to smooth.
    pub fn new(targets: Vec<Plane>, variance: Rgb, design: Design, options: &Options) -> Self {
        let smoothed = smoothed(&variance, options);
        Self { targets, variance, smoothed, design }
    }

    /// Takes its noise for `variance` from now on.
    pub fn set_variance(&mut self, variance: Rgb, options: &Options) {
        self.smoothed = smoothed(&variance, options);
        self.variance = variance;
    }

    /// The noisy colour.
    pub fn color(&self) -> [&Plane; 3] {
        std::array::from_fn(|c| &self.targets[c])
    }

    /// The same at half the resolution.
    pub fn halved(&self, options: &Options) -> Self {
        let targets = self.targets.iter().map(coarse::halve).collect();
        let variance = self.variance.each_ref().map(coarse::halve_variance);
        Self::new(targets, variance, self.design.halved(), options)
    }

    /// What pixels are compared by.
    fn guided(&self) -> Guided<'_> {
        Guided {
            color: self.color(),
            variance: &self.variance,
            trusted: variance::trusted,
            albedo: self.design.albedo.as_ref(),
            features: &self.design.planes,
            spreads: &self.design.spreads,
        }
    }
}

fn smoothed(variance: &Rgb, options: &Options) -> Rgb {
    variance.each_ref().map(|plane| variance::smooth(plane, options.variance_radius))
}

/// The fits of a signal, stage by stage.
pub struct Fits<'a> {
    signal: &'a Signal,
    beside: Vec<Warped>,
    options: &'a Options,
    basis: Basis,
    noise: Plane,
    guides: Guides,
}

/// What a stage is asked for.
pub struct Asked<'a> {
    pub kernels: &'a [Kernel],
    /// Factors on their bandwidths; what comes of each is averaged.
    pub bandwidths: &'a [f32],
    /// The summed weight that a pixel needs.
    pub coverage: f32,
    pub area: Area,
    /// How many of the signal's targets.
    pub targets: usize,
    /// Whether no stage follows.
    pub last: bool,
}

impl<'a> Fits<'a> {
    /// Of `signal` with the samples of the frames `beside`.
    pub fn new(signal: &'a Signal, beside: Vec<Warped>, options: &'a Options) -> Self {
        let basis = Basis::new(options.window_radius, signal.design.planes.len(), options.max_order);
        let noise = sum_of_channels(&signal.smoothed);
        Self { signal, beside, options, basis, noise, guides: Guides::default() }
    }

    /// One stage, which knows of the true picture what `pilot` says.
    ///
    /// # Errors
    /// When the run is to stop.
    pub fn stage(
        &mut self,
        asked: &Asked<'_>,
        pilot: Option<Pilot>,
        log: &mut Log<'_>,
    ) -> Result<Reconstruction> {
        let (signal, options) = (self.signal, self.options);
        let forgiven = pilot.as_ref().filter(|_| options.tolerance > 0.0);
        let forgiven = forgiven.map(|pilot| forgiveness::after(&pilot.color, signal, &self.noise, options));
        let guides = std::mem::take(&mut self.guides);
        self.guides = guides.turned_to(asked.kernels, signal.guided(), options, forgiven.as_ref());
        if let Some(forgiven) = &forgiven {
            for Warped { guides, .. } in &mut self.beside {
                *guides = std::mem::take(guides).forgiving(forgiven, options);
            }
        }
        let targets: Vec<&Plane> = signal.targets[..asked.targets].iter().collect();
        let problem = Problem {
            targets: &targets,
            variance: &signal.smoothed,
            noise: &self.noise,
            pilot: pilot.as_ref(),
            features: &signal.design.planes,
            feature_noise: &signal.design.noise,
            guides: &self.guides,
            albedo: signal.design.albedo.as_ref(),
            beside: &self.beside,
            basis: &self.basis,
            options,
        };
        let pass = |(n, factor): (usize, &f32)| {
            let kernels: Vec<Kernel> = asked.kernels.iter().map(|kernel| kernel.widened(*factor)).collect();
            let tick = |done| {
                log.progress((n as f32 + done) / asked.bandwidths.len() as f32);
                log.observer.go_on()
            };
            reconstruct::run(&problem, &kernels, asked.coverage, asked.area, &tick)
        };
        let passes = asked.bandwidths.iter().enumerate().map(pass);
        let sums = passes.reduce(|all, pass| Ok(all?.and(pass?)));
        let sums = sums.expect("the options' check wants at least one bandwidth")?;
        if asked.last {
            self.guides = Guides::default(); // the result has room where these were
        }
        let result = sums.into_reconstruction(&targets, &self.noise, pilot);
        log.summary.centres += result.fits;
        log.summary.coverage_centres += result.coverage_fits;
        log.summary.orders = result.orders;
        Ok(result)
    }
}
