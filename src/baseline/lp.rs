//! Linear predictions (Moon, Iglesias-Guitian, Yoon, Mitchell: Adaptive Rendering with Linear Predictions,
//! SIGGRAPH 2015).
//!
//! Around sparse centres a model linear in position and features grows ring by ring by recursive least
//! squares. Every new ring is first predicted by the model of the rings inside it; the squared prediction
//! error less the sample's variance accumulates to the estimated error of a window of that size, and the
//! window with the least is kept. Overlapping predictions are averaged. Where nothing predicts a pixel,
//! centres are added on ever finer grids.
//!
//! `[choice]` windows reach 19×19 pixels; the first grid's spacing is 8; features are filtered as the pipeline
//! filters them. A window of one pixel errs by the mean variance of the 3×3 pixels around it. `[choice]` the recursion starts from a prior: slopes are as
//! large as the window's colours vary beyond their noise, the constant is free. Without it the second
//! ring, predicted by a model of ten unknowns from nine pixels, would decide against every larger window.
//! AOVs go through the beauty's operator: the gains of the recursion and the window are the colour's.

use super::input::{Input, Output, relative_error};
use crate::denoise::window::Window;
use crate::error::Result;
use crate::frame::{Denoised, Frame};
use crate::image::{Plane, mean_of_channels};
use crate::options::{PrefilterOptions, within};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Rows of one task; fixed, so that nothing depends on the number of threads.
const BAND: usize = 16;

/// The prior's variance of the constant, and the most that a slope may have, in units of the noise.
const LOOSE_PRIOR: f64 = 1e8;

/// Constants of the method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Radius of the largest window, 1 to 15.
    pub window_radius: usize,
    /// Spacing of the first grid of centres, 1 to 64; every further one is half as wide.
    pub spacing: usize,
    /// The filter of noisy features.
    pub prefilter: PrefilterOptions,
}

impl Default for Options {
    fn default() -> Self {
        Self { window_radius: 9, spacing: 8, prefilter: PrefilterOptions::default() }
    }
}

impl Options {
    /// Checks every range.
    ///
    /// # Errors
    /// [`crate::ErrorKind::Usage`] names the option and what it may be.
    pub fn check(&self) -> Result<()> {
        within("window_radius", self.window_radius, 1..=15)?;
        within("spacing", self.spacing, 1..=64)?;
        super::prefilter(&self.prefilter)
    }
}

/// Denoises `frame`.
///
/// # Errors
/// When an option is out of its range.
pub fn denoise(frame: &Frame, options: &Options) -> Result<Denoised> {
    options.check()?;
    let mut input = Input::new(frame, "lp");
    let features = input.features(&options.prefilter);
    let output = {
        let noise = mean_of_channels(&input.variance);
        let scene = Scene {
            targets: input.targets(),
            noise: &noise,
            features: &features,
            radius: options.window_radius,
        };
        scene.reconstruct(options.spacing)
    };
    input.summary.centres = output.1;
    Ok(input.finish(output.0))
}

/// What the models are fitted to.
struct Scene<'a> {
    targets: Vec<&'a Plane>,
    noise: &'a Plane,
    features: &'a [Plane],
    radius: usize,
}

/// Sums over some rows: per pixel the targets', then Σ ξ, then the number of predictions.
struct Sums {
    y0: usize,
    width: usize,
    depth: usize,
    data: Vec<f64>,
}

impl Sums {
    fn new(rows: std::ops::Range<usize>, width: usize, depth: usize) -> Self {
        Self { y0: rows.start, width, depth, data: vec![0.0; rows.len() * width * depth] }
    }

    fn pixel(&mut self, x: usize, y: usize) -> &mut [f64] {
        let at = ((y - self.y0) * self.width + x) * self.depth;
        &mut self.data[at..at + self.depth]
    }

    fn add(&mut self, other: &Sums) {
        let start = (other.y0 - self.y0) * self.width * self.depth;
        self.data[start..].iter_mut().zip(&other.data).for_each(|(a, b)| *a += b);
    }
}

impl Scene<'_> {
    /// The average of all models' predictions, and the number of models.
    fn reconstruct(&self, mut spacing: usize) -> (Output, usize) {
        let (width, height) = self.noise.size();
        let depth = self.targets.len() + 2;
        let mut sums = Sums::new(0..height, width, depth);
        let mut models = 0;
        loop {
            let covered: Vec<bool> =
                sums.data.chunks_exact(depth).map(|pixel| pixel[depth - 1] > 0.0).collect();
            let on_grid = |i: usize| i % spacing == spacing / 2;
            let bands: Vec<(Sums, usize)> = (0..height.div_ceil(BAND))
                .into_par_iter()
                .map(|band| {
                    let rows = band * BAND..((band + 1) * BAND).min(height);
                    let reach = rows.start.saturating_sub(self.radius)..(rows.end + self.radius).min(height);
                    let mut local = Sums::new(reach, width, depth);
                    let mut models = 0;
                    for y in rows.filter(|&y| on_grid(y)) {
                        for x in (0..width).filter(|&x| on_grid(x) && !covered[y * width + x]) {
                            self.predict(x, y, &mut local);
                            models += 1;
                        }
                    }
                    (local, models)
                })
                .collect();
            for (local, count) in &bands {
                sums.add(local);
                models += count;
            }
            if spacing == 1 {
                break;
            }
            spacing /= 2;
        }
        let plane = |k: usize| {
            Plane::from_fn(width, height, |x, y| {
                let pixel = &sums.data[(y * width + x) * depth..][..depth];
                (pixel[k] / pixel[depth - 1]) as f32
            })
        };
        let targets: Vec<Plane> = (0..self.targets.len()).map(plane).collect();
        let mse = plane(depth - 2);
        let sampling_priority = Some(relative_error(&mse, &targets));
        (Output { targets, mse: Some(mse), order: 1.0, sampling_priority }, models)
    }

    /// Grows the model of a centre and adds what it predicts over the window that it keeps.
    fn predict(&self, cx: usize, cy: usize, sums: &mut Sums) {
        let design = Design::new(self, Window::new(cx, cy, self.radius, self.noise.size()));
        let mut model = Model::new(&design, self.targets.len());
        let mut y = vec![0.0; self.targets.len()];
        let mut observe = |model: &mut Model, at: (usize, usize)| {
            y.iter_mut().zip(&self.targets).for_each(|(y, t)| *y = f64::from(t.get(at.0, at.1)));
            model.add(&design.row(at), &y);
        };
        observe(&mut model, (cx, cy));
        let (mut error, mut count) = (0.0, 0);
        // The pixel alone errs by its noise.
        let near = Window::new(cx, cy, 1, self.noise.size());
        let around =
            (near.y0..near.y0 + near.height).flat_map(|y| &self.noise.row(y)[near.x0..near.x0 + near.width]);
        let own = around.map(|&v| f64::from(v)).sum::<f64>() / near.pixels() as f64;
        let mut best = (own, 0, model.beta.clone());
        for radius in 1..=self.radius {
            let ring = design.ring(radius);
            for &at in &ring {
                let x = design.row(at);
                let squared =
                    |c: usize| (f64::from(self.targets[c].get(at.0, at.1)) - model.value(c, &x)).powi(2);
                error += (0..3).map(squared).sum::<f64>() / 3.0 - f64::from(self.noise.get(at.0, at.1));
            }
            count += ring.len();
            ring.iter().for_each(|&at| observe(&mut model, at));
            let xi = error / count.max(1) as f64;
            if xi <= best.0 {
                best = (xi, radius, model.beta.clone());
            }
        }
        let (xi, radius, beta) = best;
        model.beta = beta;
        for at in (0..=radius).flat_map(|r| design.ring(r)) {
            let x = design.row(at);
            let pixel = sums.pixel(at.0, at.1);
            let (targets, extra) = pixel.split_at_mut(self.targets.len());
            targets.iter_mut().enumerate().for_each(|(t, sum)| *sum += model.value(t, &x));
            extra[0] += xi.max(0.0);
            extra[1] += 1.0;
        }
    }
}

/// The columns of one centre: constant, position, features, the last two relative to the centre and of
/// size one over the largest window.
struct Design<'a> {
    scene: &'a Scene<'a>,
    window: Window,
    scales: Vec<f64>,
    /// How much larger than the noise the colours' variation in the largest window is.
    signal_to_noise: f64,
}

impl<'a> Design<'a> {
    fn new(scene: &'a Scene<'a>, window: Window) -> Self {
        let rows = || window.y0..window.y0 + window.height;
        let columns = || window.x0..window.x0 + window.width;
        let pixels = || rows().flat_map(move |y| columns().map(move |x| (x, y)));
        let scales = scene.features.iter().map(|feature| {
            let centre = feature.get(window.cx, window.cy);
            let largest = pixels().fold(0.0f32, |most, (x, y)| most.max((feature.get(x, y) - centre).abs()));
            if largest > 0.0 { f64::from(largest).recip() } else { 0.0 }
        });
        let scales = scales.collect();
        let n = window.pixels() as f64;
        let noise = pixels().map(|(x, y)| f64::from(scene.noise.get(x, y))).sum::<f64>() / n;
        let variation = scene.targets[..3].iter().map(|plane| {
            let value = |(x, y): (usize, usize)| f64::from(plane.get(x, y));
            let mean = pixels().map(value).sum::<f64>() / n;
            pixels().map(|at| (value(at) - mean).powi(2)).sum::<f64>() / n
        });
        let signal = (variation.sum::<f64>() / 3.0 - noise).max(0.0);
        let signal_to_noise = if noise > 0.0 { signal / noise } else { f64::INFINITY };
        Self { scene, window, scales, signal_to_noise }
    }

    fn row(&self, (x, y): (usize, usize)) -> Vec<f64> {
        let Window { cx, cy, .. } = self.window;
        let relative = |a: usize, b: usize| (a as f64 - b as f64) / self.scene.radius as f64;
        let features = self.scene.features.iter().zip(&self.scales);
        let features = features.map(|(f, scale)| (f64::from(f.get(x, y)) - f64::from(f.get(cx, cy))) * scale);
        [1.0, relative(x, cx), relative(y, cy)].into_iter().chain(features).collect()
    }

    /// The pixels at `radius` from the centre that lie in the picture, row by row.
    fn ring(&self, radius: usize) -> Vec<(usize, usize)> {
        let Window { cx, cy, .. } = self.window;
        let inner = Window::new(cx, cy, radius, self.scene.noise.size());
        let rows = inner.y0..inner.y0 + inner.height;
        let all = rows.flat_map(|y| (inner.x0..inner.x0 + inner.width).map(move |x| (x, y)));
        all.filter(|&(x, y)| x.abs_diff(cx).max(y.abs_diff(cy)) == radius).collect()
    }
}

/// A linear model under recursive least squares.
struct Model {
    columns: usize,
    /// The coefficients' covariance in units of the noise, columns × columns.
    covariance: Vec<f64>,
    /// One row of coefficients for every target.
    beta: Vec<f64>,
    /// Scratch: covariance times the sample's row.
    gain: Vec<f64>,
}

impl Model {
    fn new(design: &Design<'_>, targets: usize) -> Self {
        let columns = 3 + design.scales.len();
        let mut covariance = vec![0.0; columns * columns];
        let slope = design.signal_to_noise.min(LOOSE_PRIOR);
        for i in 0..columns {
            covariance[i * columns + i] = if i == 0 { LOOSE_PRIOR } else { slope };
        }
        Self { columns, covariance, beta: vec![0.0; targets * columns], gain: vec![0.0; columns] }
    }

    /// The prediction of target `t` at a pixel with the row `x`.
    fn value(&self, t: usize, x: &[f64]) -> f64 {
        self.beta[t * self.columns..][..self.columns].iter().zip(x).map(|(b, x)| b * x).sum()
    }

    /// Takes in a pixel with the row `x` and the targets' values `y`.
    fn add(&mut self, x: &[f64], y: &[f64]) {
        let Self { columns, covariance, beta, gain } = self;
        for (g, row) in gain.iter_mut().zip(covariance.chunks_exact(*columns)) {
            *g = row.iter().zip(x).map(|(p, x)| p * x).sum();
        }
        let scale = 1.0 / (1.0 + gain.iter().zip(x).map(|(g, x)| g * x).sum::<f64>());
        for (beta, y) in beta.chunks_exact_mut(*columns).zip(y) {
            let error = y - beta.iter().zip(x).map(|(b, x)| b * x).sum::<f64>();
            beta.iter_mut().zip(&*gain).for_each(|(b, g)| *b += g * scale * error);
        }
        for (row, left) in covariance.chunks_exact_mut(*columns).zip(&*gain) {
            row.iter_mut().zip(&*gain).for_each(|(p, right)| *p -= left * right * scale);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recursion_gives_the_least_squares_of_all_pixels_with_the_prior() {
        // One slope: β = Σxy / (Σx² + 1/P), the constant and position unused.
        let mut model = Model { columns: 1, covariance: vec![4.0], beta: vec![0.0], gain: vec![0.0] };
        let samples = [(1.0, 2.5), (-0.5, 0.3), (2.0, 3.0)];
        samples.iter().for_each(|&(x, y)| model.add(&[x], &[y]));
        let sum = |f: fn((f64, f64)) -> f64| samples.iter().map(|&s| f(s)).sum::<f64>();
        let expected = sum(|(x, y)| x * y) / (sum(|(x, _)| x * x) + 0.25);
        assert!((model.beta[0] - expected).abs() < 1e-12);
        assert!((model.covariance[0] - 1.0 / (sum(|(x, _)| x * x) + 0.25)).abs() < 1e-12);
    }

    #[test]
    fn the_window_of_a_linear_function_grows_to_the_limit_and_stops_at_an_edge() {
        let feature = Plane::from_fn(40, 30, |x, y| ((x * 7 + y * 11) % 5) as f32);
        let target = |edge: usize| {
            Plane::from_fn(40, 30, |x, y| {
                1.0 + 0.02 * x as f32 - 0.03 * y as f32
                    + 0.05 * feature.get(x, y)
                    + if x >= edge { 9.0 } else { 0.0 }
            })
        };
        // The noise that is stated: with none the centre alone is as good as any window.
        let noise = Plane::filled(40, 30, 1e-2);
        let window = |edge: usize| {
            let planes = [target(edge), target(edge), target(edge)];
            let features = [feature.clone()];
            let scene =
                Scene { targets: planes.iter().collect(), noise: &noise, features: &features, radius: 9 };
            let mut sums = Sums::new(0..30, 40, 5);
            scene.predict(20, 15, &mut sums);
            for (i, pixel) in sums.data.chunks_exact(5).enumerate().filter(|(_, p)| p[4] > 0.0) {
                let truth = f64::from(planes[0].data()[i]);
                assert!((pixel[0] - truth).abs() < 1e-2, "{} against {truth}", pixel[0]);
            }
            sums.data.chunks_exact(5).filter(|pixel| pixel[4] > 0.0).count()
        };
        assert_eq!(window(99), 19 * 19);
        // The edge lies 5 columns from the centre: the window ends before it.
        assert_eq!(window(25), 9 * 9);
    }
}
