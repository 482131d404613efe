//! The fit of one window: weights, Gram matrices, factorisation, choice of the order, prediction.

use super::basis::Basis;
use super::condition;
use super::distances::{self, Distances, Kind};
use super::fit::Factor;
use super::gram::{self, Columns, Gram};
use super::guides::Guides;
use super::reconstruction::Pilot;
use super::risk::{self, Choice, Evidence, Reference, Totals};
use super::samples::Samples;
use super::temporal::Warped;
use super::vectors;
use super::window::Window;
use crate::image::{Plane, Rgb};
use crate::options::{Kernel, Options};
use pulp::{Simd, WithSimd};

mod stability;

/// What the fits of a stage read. All radiance is exposed (see [`super::exposure`]).
pub struct Problem<'a> {
    /// Noisy planes to reconstruct: R, G, B of the colour, then of every AOV.
    pub targets: &'a [&'a Plane],
    /// Variance of the colour's mean, smoothed.
    pub variance: &'a Rgb,
    /// The sum of its channels.
    pub noise: &'a Plane,
    /// What the stage before has found.
    pub pilot: Option<&'a Pilot>,
    /// Feature planes.
    pub features: &'a [Plane],
    /// The variance of what is left of their noise, of those whose columns are held against it.
    pub feature_noise: &'a [Option<Plane>],
    /// What the stage's kernels compare.
    pub guides: &'a Guides,
    /// Albedo plus its floor, for demodulated kernels.
    pub albedo: Option<&'a Rgb>,
    /// Frames whose samples join those of this one.
    pub beside: &'a [Warped],
    /// The design.
    pub basis: &'a Basis,
    /// All options.
    pub options: &'a Options,
}

/// How fast a frame beside loses weight in windows where the light has changed in part. Its samples would be
/// many on one side of an edge that moved and none on the other, and would bend the fit away from the few.
/// `[choice]` of 0, 1, 2, 4 and 8: the least that does no harm where an edge moves by two pixels that nothing else
/// knows of (docs/TEMPORAL.md).
const BALANCE: i32 = 4;

/// Risks are limited to this, so that their sums stay finite.
const LARGEST_RISK: f32 = 1e30;

/// What is to be had of a fit.
pub struct Fitted<'a> {
    /// The pixels that it speaks for are the first frame's.
    pub samples: &'a Samples,
    /// Reconstruction of every target at those pixels, target after target.
    pub predicted: &'a [f32],
    /// ξ at those pixels, at most [`LARGEST_RISK`].
    pub risks: &'a [f32],
    /// Order and shrinkage.
    pub choice: &'a Choice,
}

/// Buffers of one thread.
pub struct Solver<'a> {
    problem: &'a Problem<'a>,
    arch: pulp::Arch,
    distances: Distances,
    samples: Samples,
    weights: Vec<f32>,
    weighted_noise: Vec<f32>,
    noise: Vec<f32>,
    /// Σ w σ² of every column of the design, 0 where it is not known.
    column_noise: Vec<f64>,
    /// The design's columns, the targets', the pilot's.
    columns: Vec<f32>,
    /// What the right-hand sides were multiplied by.
    scales: Vec<f32>,
    /// Weighted means that were taken out of the right-hand sides.
    means: Vec<f32>,
    scratch: Vec<f32>,
    gram: Gram,
    factor: Factor,
    choice: Choice,
    predicted: Vec<f32>,
    risks: Vec<f32>,
}

/// A fit to be compiled for every kind of vectors. A closure would not be inlined into them, and ran on the
/// baseline's.
struct Run<'s, 'a> {
    solver: &'s mut Solver<'a>,
    window: &'s Window,
    kernel: Kernel,
}

impl WithSimd for Run<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.solver.run(simd, self.window, self.kernel);
    }
}

impl<'a> Solver<'a> {
    /// A solver for `problem`.
    pub fn new(problem: &'a Problem<'a>) -> Self {
        Self {
            problem,
            arch: vectors::widest(),
            distances: Distances::new(problem.options.window_radius, 1 + problem.beside.len()),
            samples: Samples::default(),
            weights: vec![],
            weighted_noise: vec![],
            noise: vec![],
            column_noise: vec![],
            columns: vec![],
            scales: vec![],
            means: vec![],
            scratch: vec![],
            gram: Gram::default(),
            factor: Factor::default(),
            choice: Choice::default(),
            predicted: vec![],
            risks: vec![],
        }
    }

    /// Fits the window with one kernel.
    pub fn fit(&mut self, window: &Window, kernel: Kernel) -> Fitted<'_> {
        self.arch.dispatch(Run { solver: self, window, kernel });
        Fitted {
            samples: &self.samples,
            predicted: &self.predicted,
            risks: &self.risks,
            choice: &self.choice,
        }
    }

    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, window: &Window, kernel: Kernel) {
        let albedo = self.problem.albedo.filter(|_| kernel.demodulate);
        self.weigh(simd, window, kernel);
        if self.samples.is_one() {
            return self.keep(window);
        }
        let scale = self.prepare(simd, window, albedo);
        let arch = self.arch;
        self.factorise(|columns, gram| gram::accumulate(arch, columns, gram));
        let Problem { basis, options, .. } = self.problem;
        let mut choice = std::mem::take(&mut self.choice);
        risk::choose(&self.evidence(simd), basis, options.order_choice, &mut choice);
        self.choice = choice;
        self.predict(scale, albedo);
    }

    /// The fit of a centre that resembles nothing but itself, without its sums: the pixel as it is, and its
    /// noise as the risk. A third of the centres of one picture (glossy teapot) are such, 1 to 4 % of two others.
    fn keep(&mut self, window: &Window) {
        let at = |plane: &Plane| plane.get(window.cx, window.cy);
        self.predicted.clear();
        self.predicted.extend(self.problem.targets.iter().map(|plane| at(plane)));
        self.choice.best = 0;
        self.choice.order = 0.0;
        self.risks.clear();
        self.risks.push((at(self.problem.noise) / 3.0).min(LARGEST_RISK));
    }

    /// All between the weights and the Gram matrices; returns the factor that radiance was scaled by.
    #[inline(always)]
    fn prepare<S: Simd>(&mut self, simd: S, window: &Window, albedo: Option<&Rgb>) -> f32 {
        self.gather(window, albedo);
        let scale = self.scale_radiance(simd);
        self.trust_samples(simd, scale);
        self.condition(simd, window);
        scale
    }

    /// The Gram matrices by `accumulate`, and their factorisation.
    #[inline(always)]
    fn factorise(&mut self, accumulate: impl FnOnce(Columns<'_>, &mut Gram)) {
        let stride = self.samples.stride();
        let p = self.problem.basis.columns();
        let r = self.columns.len() / stride - p;
        let columns = Columns {
            data: &self.columns,
            stride,
            p,
            r,
            weights: &self.weights,
            weighted_noise: &self.weighted_noise,
        };
        accumulate(columns, &mut self.gram);
        let Problem { pilot, options, targets, .. } = self.problem;
        if risk::shrinks(options.order_choice, pilot.is_some()) {
            self.factor.pursue(&self.gram, &self.column_noise, r, targets.len()..r);
        } else {
            self.factor.factorise(&self.gram, &self.column_noise, r);
        }
    }

    /// K_h of every sample.
    #[inline(always)]
    fn weigh<S: Simd>(&mut self, simd: S, window: &Window, kernel: Kernel) {
        let Problem { guides, albedo, beside, options, .. } = self.problem;
        let radius = options.window_radius;
        let demodulated = kernel.demodulate && albedo.is_some();
        let guides = std::iter::once(*guides).chain(beside.iter().map(|beside| &beside.guides));
        let guides = guides.map(|guides| guides.compared(demodulated));
        let kind = Kind { patch_radius: kernel.patch_radius, demodulated };
        let factor = kernel.feature_bandwidth.map(|bandwidth| (kernel.bandwidth / bandwidth).powi(2));
        let distances = self.distances.of(simd, kind, [window.cx, window.cy], guides, factor);
        self.samples.clear();
        let columns = self.problem.targets[0].width();
        for (f, distances) in distances.chunks_exact(distances::square(radius)).enumerate() {
            let trust = f.checked_sub(1).map(|f| {
                let balance = self.samples.mean(0, &beside[f].steady).powi(BALANCE);
                (&beside[f].trust, balance)
            });
            self.samples.add_frame(window, radius, columns, distances, kernel.bandwidth, trust);
        }
    }

    /// The design, the right-hand sides and the noise, over the albedo where that is asked for.
    #[inline(always)]
    fn gather(&mut self, window: &Window, albedo: Option<&Rgb>) {
        let Problem { targets, pilot, variance, noise, features, basis, beside, .. } = self.problem;
        let (stride, p) = (self.samples.stride(), basis.columns());
        let r = targets.len() + pilot.map_or(0, |pilot| pilot.color.len());
        // Every sample of every column is written below: only what fills up the vectors is not.
        self.columns.resize((p + r) * stride, 0.0);
        let samples = self.samples.len();
        self.columns.chunks_exact_mut(stride).for_each(|column| column[samples..].fill(0.0));
        self.noise.clear();
        self.noise.resize(stride, 0.0);
        self.gather_frame(window, 0, targets.iter().copied(), (variance, noise), features, albedo);
        for (f, beside) in beside.iter().enumerate() {
            let albedo = beside.albedo.as_ref().filter(|_| albedo.is_some());
            let noise = (&beside.variance, &beside.noise);
            let targets = beside.targets.iter().take(targets.len());
            self.gather_frame(window, f + 1, targets, noise, &beside.features, albedo);
        }
    }

    /// The samples of one frame. Its pilot is this frame's: what is put for μ at the same place.
    #[inline(always)]
    fn gather_frame(
        &mut self,
        window: &Window,
        frame: usize,
        targets: impl Iterator<Item = &'a Plane>,
        (variance, sum): (&Rgb, &Plane),
        features: &[Plane],
        albedo: Option<&Rgb>,
    ) {
        let Problem { pilot, basis, features: centre, .. } = self.problem;
        let (samples, part) = (&self.samples, self.samples.of_frame(frame));
        let stride = samples.stride();
        let (design, rhs) = self.columns.split_at_mut(basis.columns() * stride);
        basis.fill(samples, frame, features, |f| centre[f].get(window.cx, window.cy), design);
        let planes = targets.chain(pilot.iter().flat_map(|pilot| pilot.color.iter()));
        for (plane, column) in planes.zip(rhs.chunks_exact_mut(stride)) {
            samples.gather(plane, frame, 0.0, &mut column[part.clone()]);
        }
        let noise = &mut self.noise[part.clone()];
        let Some(albedo) = albedo else {
            return samples.gather(sum, frame, 0.0, noise);
        };
        self.scratch.resize(2 * part.len(), 0.0);
        let (buffer, divisor) = self.scratch.split_at_mut(part.len());
        for (c, (plane, albedo)) in variance.iter().zip(albedo).enumerate() {
            samples.gather(plane, frame, 0.0, buffer);
            samples.gather(albedo, frame, 0.0, divisor);
            for ((noise, v), a) in noise.iter_mut().zip(&*buffer).zip(&*divisor) {
                *noise += v / (a * a);
            }
            for column in rhs.chunks_exact_mut(stride).skip(c).step_by(3) {
                column[part.clone()].iter_mut().zip(&*divisor).for_each(|(v, a)| *v /= a);
            }
        }
    }

    /// Scales radiance by the power of two that brings the window's largest, or its noise where that is
    /// larger, to about 1, so that squares stay inside `f32`; returns the factor. AOVs enter no square:
    /// each of their channels has a factor of its own, so that none bears on the colour.
    #[inline(always)]
    fn scale_radiance<S: Simd>(&mut self, simd: S) -> f32 {
        let aovs = 3..self.problem.targets.len();
        let stride = self.samples.stride();
        let rhs = &mut self.columns[self.problem.basis.columns() * stride..];
        let columns = rhs.chunks_exact(stride).enumerate();
        let largest = columns.filter(|(t, _)| !aovs.contains(t)).map(|(_, c)| condition::largest(simd, c));
        let scale = condition::power_of_two_near_inverse(
            largest.fold(0.0, f32::max).max(condition::largest(simd, &self.noise).sqrt()),
        );
        self.scales.clear();
        for (t, column) in rhs.chunks_exact_mut(stride).enumerate() {
            let own = if aovs.contains(&t) {
                condition::power_of_two_near_inverse(condition::largest(simd, column))
            } else {
                scale
            };
            column.iter_mut().for_each(|v| *v *= own);
            self.scales.push(own);
        }
        self.noise.iter_mut().for_each(|v| *v = *v * scale * scale);
        scale
    }

    /// The weight of every sample in the fit: K, less for samples that hold much of the window's noise,
    /// less for pixels much brighter than the centre, whose absolute errors would drown its own.
    #[inline(always)]
    fn trust_samples<S: Simd>(&mut self, simd: S, scale: f32) {
        let Problem { pilot, options, basis, targets, .. } = self.problem;
        let stride = self.samples.stride();
        self.weights.clear();
        self.weights.extend_from_slice(self.samples.kernel());
        let noise = condition::weighted_sum(simd, &self.noise, self.samples.kernel());
        if noise > 0.0 {
            let relative = (options.noise_weight / noise).min(f32::MAX); // noise may be no normal number
            self.weights.iter_mut().zip(&self.noise).for_each(|(w, v)| *w /= 1.0 + v * relative);
        }
        if pilot.is_some() {
            let columns = &self.columns[(basis.columns() + targets.len()) * stride..];
            let (red, rest) = columns.split_at(stride);
            let (green, blue) = rest.split_at(stride);
            let dark = (options.dark_level * scale).powi(2);
            let energy = |i: usize| ((red[i] + green[i] + blue[i]) / 3.0).powi(2) + dark;
            let own = energy(self.samples.centre());
            for (i, w) in self.weights.iter_mut().enumerate() {
                *w *= (2.0 * own / (own + energy(i)).max(f32::MIN_POSITIVE)).min(1.0);
            }
        }
        self.weighted_noise.clear();
        self.weighted_noise.extend(self.weights.iter().zip(&self.noise).map(|(w, v)| w * v));
    }

    /// Centres all columns but the constant, and levels the features' (see [`condition`]), whose noise is taken for that
    /// of the window's centre.
    #[inline(always)]
    fn condition<S: Simd>(&mut self, simd: S, window: &Window) {
        let (p, features) = (self.problem.basis.columns(), self.problem.features.len());
        let stride = self.samples.stride();
        self.means.clear();
        self.column_noise.clear();
        self.column_noise.resize(p, 0.0);
        let total = condition::total(simd, &self.weights);
        for (j, column) in self.columns.chunks_exact_mut(stride).enumerate().skip(1) {
            let mean = condition::centre(simd, column, &self.weights, total);
            if j <= features {
                let scale = f64::from(condition::level(simd, column, &self.weights));
                if let Some(noise) = &self.problem.feature_noise[j - 1] {
                    let noise = f64::from(noise.get(window.cx, window.cy));
                    self.column_noise[j] = noise * scale * scale * f64::from(total);
                }
            } else if j >= p {
                self.means.push(mean);
            }
        }
    }

    /// What the risks are made of.
    #[inline(always)]
    fn evidence<S: Simd>(&self, simd: S) -> Evidence<'_> {
        let Problem { pilot, options, basis, targets, .. } = self.problem;
        let stride = self.samples.stride();
        let (reference, channels) = match (pilot.is_some(), options.plain_first_stage) {
            (true, _) => (Reference::Pilot, targets.len()..targets.len() + 3),
            (false, false) => (Reference::Unbiased, 0..3),
            (false, true) => (Reference::Noisy, 0..3),
        };
        let rhs = &self.columns[(basis.columns() + channels.start) * stride..];
        let energy = rhs.chunks_exact(stride).take(3).map(|y| condition::energy(y, &self.weights));
        let totals = Totals {
            weight: f64::from(condition::total(simd, &self.weights)).max(f64::MIN_POSITIVE),
            energy: energy.sum(),
            noise: f64::from(condition::total(simd, &self.weighted_noise)),
        };
        Evidence { factor: &self.factor, channels, reference, totals }
    }

    /// Evaluates the chosen model at the samples of this frame and puts ξ and the prediction into the targets'
    /// units. `[choice]` ξ of a fit of colour over albedo times every pixel's own albedo squared, not their mean: relMSE
    /// ×0.997 on five scenes, ×0.999 on thirteen others.
    #[inline(always)]
    fn predict(&mut self, scale: f32, albedo: Option<&Rgb>) {
        let targets = self.problem.targets.len();
        let (stride, own) = (self.samples.stride(), self.samples.of_frame(0));
        self.factor.solve(targets, &self.choice.shrink);
        self.predicted.clear();
        self.predicted.resize(targets * own.len(), 0.0);
        for (t, out) in self.predicted.chunks_exact_mut(own.len()).enumerate() {
            let unit = f64::from(self.scales[t]);
            out.fill((f64::from(self.means[t]) / unit) as f32);
            for (beta, column) in self.factor.beta(t).iter().zip(self.columns.chunks_exact(stride)) {
                let beta = (*beta / unit) as f32;
                if beta != 0.0 {
                    out.iter_mut().zip(column).for_each(|(out, x)| *out += beta * x);
                }
            }
        }
        let risk = (self.choice.xi / (f64::from(scale) * f64::from(scale))) as f32;
        self.risks.clear();
        self.risks.resize(own.len(), risk.min(LARGEST_RISK));
        if let Some(albedo) = albedo {
            self.scratch.resize(2 * own.len(), 0.0);
            let (values, squares) = self.scratch.split_at_mut(own.len());
            squares.fill(0.0);
            for (t, out) in self.predicted.chunks_exact_mut(own.len()).enumerate() {
                self.samples.gather(&albedo[t % 3], 0, 0.0, values);
                out.iter_mut().zip(&*values).for_each(|(out, a)| *out *= a);
                if t < 3 {
                    squares.iter_mut().zip(&*values).for_each(|(sum, a)| *sum += a * a);
                }
            }
            for (risk, squares) in self.risks.iter_mut().zip(&*squares) {
                *risk = (*risk * squares / 3.0).min(LARGEST_RISK);
            }
        }
    }
}
