//! One stage of the reconstruction: sparse centres, the coverage test, the overlap average.
//!
//! Every centre j predicts all pixels of its window; pixel i gets ŷ(i) = Σ_j a_j(i) ŷ_j(i) / Σ_j a_j(i).
//! As published a_j(i) is the kernel K_j(i). `[choice]` from the second stage on it is
//! K_j(i)·(ξ_j + floor)^−power, and all kernels' fits join the one average: a centre on a bright disc
//! has a large absolute error and must not speak for the dark pixels beside it.
//! Against the power ½, relMSE at 16 spp: power 1 ×1.03 (twelve scenes), power 0 ×1.04 (nine scenes).
//!
//! A grid of centres alone leaves pixels that no window reaches with any weight. After the grid every
//! pixel whose summed kernel is under `min_coverage` becomes a centre itself, unless it has next to no
//! noise: then it stays as it is. `[choice]` such a centre gets the widest kernels alone: so little
//! resembles it that narrow ones would give the pixel back as it is. Half the fits, relMSE ×0.975
//! (three scenes at 64 spp).
//!
//! The picture is cut into bands of rows whose height is a constant, each band's sums are formed in
//! one order, and bands are added in their order: the bits do not depend on the threads.

use super::solver::{Problem, Solver};
use super::window::Window;
use crate::image::{Plane, Rgb};
use crate::options::Kernel;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Rows of one band: enough that the halo is no burden, few enough that all threads have work.
const BAND: usize = 16;

/// Bands in flight between two gatherings; bounds the memory.
const GROUP: usize = 32;

/// Noise variance under this share of the radiance's square is not worth a fit.
const NEGLIGIBLE_NOISE: f32 = 1e-8;

/// The floor of the risk in the average, as a share of the dark level's square.
const RISK_FLOOR: f32 = 0.01;

/// Risks are limited to this, so that their sums stay finite.
const LARGEST_RISK: f32 = 1e30;

/// How far below the darkest pixel of its window (or black) a prediction may lie, in dark levels.
const SWING: f32 = 0.02;

/// Predictions beyond this are a fit out of `f32`'s range; with its weight a value must stay in it.
const LARGEST_PREDICTION: f32 = 1e34;

/// What a stage gives, exposed.
pub struct Stage {
    /// Reconstruction of every target.
    pub targets: Vec<Plane>,
    /// Estimated mean squared error, averaged over the channels.
    pub mse: Plane,
    /// Order, averaged over the fits that cover the pixel.
    pub order: Plane,
    /// Fits.
    pub fits: usize,
    /// Of those, fits of centres that the coverage test added.
    pub coverage_fits: usize,
    /// How often each order had the least risk.
    pub orders: [usize; 4],
}

impl Stage {
    /// The colour: the first three targets.
    pub fn color(&self) -> Rgb {
        std::array::from_fn(|c| self.targets[c].clone())
    }
}

/// Sums of one pixel besides its targets: Σ a, Σ aξ, Σ a·order, Σ K.
const EXTRA: usize = 4;

/// Sums over some rows of the picture: per pixel the targets', then [`EXTRA`] more.
struct Sums {
    y0: usize,
    width: usize,
    depth: usize,
    data: Vec<f32>,
    fits: usize,
    orders: [usize; 4],
}

impl Sums {
    fn new(y0: usize, rows: usize, width: usize, targets: usize) -> Self {
        let depth = targets + EXTRA;
        Self { y0, width, depth, data: vec![0.0; rows * width * depth], fits: 0, orders: [0; 4] }
    }

    fn pixel(&mut self, x: usize, y: usize) -> &mut [f32] {
        let at = ((y - self.y0) * self.width + x) * self.depth;
        &mut self.data[at..at + self.depth]
    }

    fn coverage(&self, x: usize, y: usize) -> f32 {
        self.data[((y - self.y0) * self.width + x) * self.depth + self.depth - 1]
    }

    fn add(&mut self, other: &Sums) {
        let start = (other.y0 - self.y0) * self.width * self.depth;
        self.data[start..].iter_mut().zip(&other.data).for_each(|(a, b)| *a += b);
        self.fits += other.fits;
        self.orders.iter_mut().zip(other.orders).for_each(|(a, b)| *a += b);
    }
}

/// Runs one stage with all its kernels; `progress` hears the share that is done.
pub fn run(problem: &Problem<'_>, kernels: &[Kernel], progress: &(dyn Fn(f32) + Sync)) -> Stage {
    let (width, height) = problem.targets[0].size();
    let spacing = problem.options.center_spacing;
    let mut sums = Sums::new(0, height, width, problem.targets.len());
    let bands = height.div_ceil(BAND);
    let done = AtomicUsize::new(0);
    let tick = || progress(done.fetch_add(1, Ordering::Relaxed) as f32 / (2 * bands) as f32);

    let on_grid = |i: usize| i % spacing == spacing / 2;
    in_bands(problem, &mut sums, |solver, local, rows| {
        for y in rows.filter(|&y| on_grid(y)) {
            for x in (spacing / 2..width).step_by(spacing) {
                center(problem, solver, local, (x, y), kernels);
            }
        }
        tick();
    });
    let grid_fits = sums.fits;
    let bandwidth = kernels.iter().fold(0.0f32, |widest, kernel| widest.max(kernel.bandwidth));
    let widest: Vec<Kernel> =
        kernels.iter().copied().filter(|kernel| kernel.bandwidth == bandwidth).collect();
    let grid = Plane::from_fn(width, height, |x, y| sums.coverage(x, y));
    in_bands(problem, &mut sums, |solver, local, rows| {
        for y in rows {
            for x in 0..width {
                let coverage = grid.get(x, y) + local.coverage(x, y);
                if coverage < problem.options.min_coverage && worth_a_fit(problem, x, y) {
                    center(problem, solver, local, (x, y), &widest);
                }
            }
        }
        tick();
    });
    finish(problem, sums, grid_fits)
}

/// Runs `work` on every band, in parallel, and adds what it sums to `sums` in the bands' order. `work`
/// gets a solver, the band's own sums and its rows.
fn in_bands(
    problem: &Problem<'_>,
    sums: &mut Sums,
    work: impl Fn(&mut Solver<'_>, &mut Sums, Range<usize>) + Sync,
) {
    let (width, height) = problem.targets[0].size();
    let radius = problem.options.window_radius;
    let bands: Vec<usize> = (0..height.div_ceil(BAND)).collect();
    for group in bands.chunks(GROUP) {
        let done: Vec<Sums> = group
            .par_iter()
            .map_init(
                || Solver::new(problem),
                |solver, band| {
                    let rows = band * BAND..((band + 1) * BAND).min(height);
                    let y0 = rows.start.saturating_sub(radius);
                    let y1 = (rows.end + radius).min(height);
                    let mut local = Sums::new(y0, y1 - y0, width, problem.targets.len());
                    work(solver, &mut local, rows);
                    local
                },
            )
            .collect();
        done.iter().for_each(|band| sums.add(band));
    }
}

/// Fits every kernel at a centre and adds what it predicts.
fn center(
    problem: &Problem<'_>,
    solver: &mut Solver<'_>,
    sums: &mut Sums,
    (cx, cy): (usize, usize),
    kernels: &[Kernel],
) {
    let options = problem.options;
    let window = Window::new(cx, cy, options.window_radius, problem.targets[0].size());
    // A polynomial beside a lamp may swing far below what any pixel of the window shows: such predictions
    // do not join the average, and the coverage test sees the gap. Black blotches were what they left.
    let least: [f32; 3] = std::array::from_fn(|c| {
        let rows = window.y0..window.y0 + window.height;
        let values = rows.flat_map(|y| &problem.targets[c].row(y)[window.x0..window.x0 + window.width]);
        values.fold(0.0f32, |least, v| least.min(*v)) - SWING * options.dark_level
    });
    for kernel in kernels {
        let fitted = solver.fit(&window, *kernel);
        let (xi, order) = ((fitted.choice.xi as f32).min(LARGEST_RISK), fitted.choice.order);
        let floor = RISK_FLOOR * options.dark_level * options.dark_level;
        // In the first stage the risk is that of noisy data: it would favour chance.
        let trust = if problem.pilot.is_some() { (xi + floor).powf(-options.risk_power) } else { 1.0 };
        for (i, &k) in fitted.kernel[..window.pixels()].iter().enumerate().filter(|(_, k)| **k > 0.0) {
            let within = |t: usize| {
                let value = fitted.predicted[t * window.stride + i];
                value.abs() <= LARGEST_PREDICTION && (t >= 3 || value >= least[t])
            };
            if !(0..problem.targets.len()).all(within) {
                continue;
            }
            let pixel = sums.pixel(window.x0 + i % window.width, window.y0 + i / window.width);
            let a = k * trust;
            let (targets, extra) = pixel.split_at_mut(problem.targets.len());
            for (t, value) in targets.iter_mut().enumerate() {
                *value += a * fitted.predicted[t * window.stride + i];
            }
            for (value, term) in extra.iter_mut().zip([a, a * xi, a * order, k]) {
                *value += term;
            }
        }
        sums.fits += 1;
        sums.orders[fitted.choice.best] += 1;
    }
}

fn worth_a_fit(problem: &Problem<'_>, x: usize, y: usize) -> bool {
    let noise: f32 = problem.variance.iter().map(|v| v.get(x, y)).sum();
    let radiance: f32 = problem.targets[..3].iter().map(|c| c.get(x, y).powi(2)).sum();
    noise > NEGLIGIBLE_NOISE * (radiance + problem.options.dark_level.powi(2))
}

/// Divides by Σ a; a pixel that nothing covers keeps its noisy value.
fn finish(problem: &Problem<'_>, sums: Sums, grid_fits: usize) -> Stage {
    let (width, height) = problem.targets[0].size();
    let count = problem.targets.len();
    let plane = |k: usize, otherwise: &dyn Fn(usize, usize) -> f32| {
        Plane::from_fn(width, height, |x, y| {
            let pixel = &sums.data[(y * width + x) * sums.depth..][..sums.depth];
            if pixel[count] > 0.0 { pixel[k] / pixel[count] } else { otherwise(x, y) }
        })
    };
    let noise = |x: usize, y: usize| problem.variance.iter().map(|v| v.get(x, y)).sum::<f32>() / 3.0;
    Stage {
        targets: (0..count).map(|t| plane(t, &|x, y| problem.targets[t].get(x, y))).collect(),
        mse: plane(count + 1, &noise),
        order: plane(count + 2, &|_, _| 0.0),
        fits: sums.fits,
        coverage_fits: sums.fits - grid_fits,
        orders: sums.orders,
    }
}
