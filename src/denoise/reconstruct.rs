//! One stage of the reconstruction: sparse centres, the coverage test, the overlap average.
//!
//! Every centre j predicts all pixels of its window; pixel i gets ŷ(i) = Σ_j a_j(i) ŷ_j(i) / Σ_j a_j(i).
//! As published a_j(i) is the kernel K_j(i). `[choice]` from the second stage on it is
//! K_j(i)·(floor/(ξ_j + floor))^power, and all kernels' fits join the one average: a centre on a bright disc
//! has a large absolute error and must not speak for the dark pixels beside it.
//! Against the power ½, relMSE at 16 spp: power 1 ×1.03 (twelve scenes), power 0 ×1.04 (nine scenes).
//!
//! `[choice]` a_j(i) also falls towards the window's border, where a polynomial is least certain and where
//! a window that ends shows as an edge: relMSE ×0.987 over thirteen scenes of the tracer at 16 and 64 spp, up
//! to ×0.9 in fog and out of focus, and the blocks that one saw there are gone; ×1.00 on five others.
//!
//! `[choice]` ξ_j is the error near the centre. At a pixel i that the pilot is certain to be brighter than centre j,
//! it is multiplied by (a + b)/2a, with a = L_j² + dark², b = C_i² + dark², C_i the least that i has for certain: dark
//! fits that reach over the rim of something bright made it dark too. relMSE ×1.000 (five scenes at 16 to 256 spp) and ×0.989 (thirteen others), out of focus
//! ×0.8; what bright defocused discs lose of their picture's light at 16 spp falls from 15 to 5 %. Certain by two
//! estimated deviations: by none ×1.040 and ×0.994, for fireflies leave bright pixels in the pilot too.
//!
//! A grid of centres alone leaves pixels that no window reaches with any weight. After the grid every
//! pixel whose summed kernel is under what is asked becomes a centre itself, unless it has next to no
//! noise: then it stays as it is. `[choice]` such a centre gets the widest kernels alone: so little
//! resembles it that narrow ones would give the pixel back as it is. Half the fits, relMSE ×0.975
//! (three scenes at 64 spp).
//!
//! The picture is cut into tiles whose place and size are constants, each tile's sums are formed in one
//! order, and tiles are added in their order: the bits do not depend on the threads. The coverage test
//! of a tile sees the centres of the grid and those it has added itself, not what other tiles add. So a
//! pixel depends on pixels within a bounded distance alone, wherever the picture is cut.

use super::exposure;
use super::forgiveness;
use super::solver::{Pilot, Problem, Solver};
use super::window::Window;
use crate::error::Result;
use crate::image::{Plane, Rect, Rgb, mean_of_channels};
use crate::options::{Kernel, MAX_WINDOW_RADIUS, Options};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Side of a tile in pixels: large enough that the windows' overhang is no burden and few pixels are
/// covered twice at its border, small enough that all threads have work.
const TILE: usize = 32;

/// Tiles in flight between two gatherings; bounds the memory.
const GROUP: usize = 256;

/// Where noise variance is under this share of the radiance's square, which is noise of one per cent, a pixel
/// that resembles nothing is not worth a fit of its own. `[choice]` against 1e-8: relMSE ×1.000 (18 scenes at
/// 16 to 256 spp), up to ×0.7 of the time where a bright sky shows detail.
const NEGLIGIBLE_NOISE: f32 = 1e-4;

/// The floor of the risk in the average, as a share of the dark level's square.
const RISK_FLOOR: f32 = 0.01;

/// No fit is trusted less than this, so that no power makes all fits of a pixel nothing. Roots do not come so far.
const LEAST_TRUST: f32 = 1e-24;

/// Estimated deviations of the pilot by which a pixel is certainly brighter.
const CERTAINTY: f32 = 2.0;

/// How far below the darkest pixel of its window (or black) a prediction may lie, in dark levels.
const SWING: f32 = 0.02;

/// Predictions beyond this are a fit out of `f32`'s range; with its weight a value must stay in it.
const LARGEST_PREDICTION: f32 = 1e34;

/// What a stage gives, exposed.
pub struct Reconstruction {
    /// Reconstruction of every target.
    pub targets: Vec<Plane>,
    /// Estimated mean squared error, averaged over the channels: the fits' risk.
    pub mse: Plane,
    /// The squared difference from the stage before, averaged over the channels, where there was one.
    pub change: Option<Plane>,
    /// Order, averaged over the fits that cover the pixel.
    pub order: Plane,
    /// Fits.
    pub fits: usize,
    /// Of those, fits of centres that the coverage test added.
    pub coverage_fits: usize,
    /// How often each order had the least risk.
    pub orders: [usize; 4],
}

impl Reconstruction {
    /// What needed no fits: `targets` are right as they are.
    pub fn exact(targets: Vec<Plane>) -> Self {
        let (width, height) = targets[0].size();
        let [mse, order] = [0.0; 2].map(|none| Plane::filled(width, height, none));
        Self { targets, mse, change: None, order, fits: 0, coverage_fits: 0, orders: [0; 4] }
    }

    /// Brings what was multiplied by `exposure` back.
    pub fn unexpose(&mut self, exposure: f32) {
        self.targets.iter_mut().for_each(|plane| exposure::expose(plane, exposure.recip()));
        exposure::unexpose_error(&mut self.mse, exposure);
    }

    /// The colour: the first three targets.
    pub fn color(&self) -> Rgb {
        std::array::from_fn(|c| self.targets[c].clone())
    }

    /// What the next stage makes use of, the rest given up.
    pub fn into_pilot(self) -> Pilot {
        let mut targets = self.targets.into_iter();
        let color: Rgb = std::array::from_fn(|_| targets.next().expect("the colour is always a target"));
        let mut certain = mean_of_channels(&color);
        certain.combine(&self.mse, |light, mse| (light - CERTAINTY * mse.sqrt()).max(0.0));
        Pilot { color, certain }
    }
}

/// Sums of one pixel besides its targets: Σ a, Σ aξ, Σ a·order, Σ K.
const EXTRA: usize = 4;

/// Where a stage works; in the coordinates of the planes, which may be a part of the picture.
#[derive(Debug, Clone, Copy)]
pub struct Area {
    /// Column and row of the planes' first pixel in the picture, which the tiles and the grid are laid on.
    pub origin: (usize, usize),
    /// The pixels that are to come out as if the planes were the whole picture.
    pub wanted: Rect,
    /// The pixels whose centres are counted.
    pub counted: Rect,
}

/// How far around the wanted pixels a stage reads, patches aside: fits that reach them, those that the
/// coverage test sees with them, and their windows.
pub const fn reach(window_radius: usize) -> usize {
    3 * window_radius + TILE - 1
}

/// How much farther than the fits a stage looks at the one before: patches, and what it forgives in them.
pub fn more_of_a_pilot(options: &Options) -> usize {
    options.largest_patch() + forgiveness::RADIUS
}

impl Area {
    /// The areas of all stages, the last of which is this one, on planes of `size`.
    pub fn of_stages(self, size: (usize, usize), options: &Options) -> Vec<Self> {
        let before = |area: &Self| Some(Self { wanted: area.reads(size, options), ..*area });
        let mut areas: Vec<Self> =
            std::iter::successors(Some(self), before).take(options.stages.len()).collect();
        areas.reverse();
        areas
    }

    /// The pixels that are read of planes of `size`: where the stage before must be right.
    fn reads(&self, size: (usize, usize), options: &Options) -> Rect {
        let radius = options.window_radius;
        let around = 2 * radius + more_of_a_pilot(options);
        tested(self.wanted, self.origin, size, radius).grown(around, size)
    }
}

/// The tiles whose coverage centres reach `wanted`.
fn tested(wanted: Rect, origin: (usize, usize), size: (usize, usize), radius: usize) -> Rect {
    let reach = wanted.grown(radius, size);
    let out = |from: usize, length: usize, origin: usize, limit: usize| {
        let first = ((from + origin) / TILE * TILE).saturating_sub(origin);
        let end = ((from + length + origin).next_multiple_of(TILE) - origin).min(limit);
        (first, end - first)
    };
    let (x, width) = out(reach.x, reach.width, origin.0, size.0);
    let (y, height) = out(reach.y, reach.height, origin.1, size.1);
    Rect { x, y, width, height }
}

/// `rect` cut along the tiles, row by row.
fn tiles(rect: Rect, origin: (usize, usize)) -> Vec<Rect> {
    let cuts = |from: usize, length: usize, origin: usize| {
        let end = from + length;
        let next = move |at: &usize| Some((at + origin + 1).next_multiple_of(TILE) - origin);
        let starts = std::iter::successors(Some(from), next).take_while(move |at| *at < end);
        starts.map(move |at| (at, ((at + origin + 1).next_multiple_of(TILE) - origin).min(end) - at))
    };
    let columns: Vec<_> = cuts(rect.x, rect.width, origin.0).collect();
    let rows = cuts(rect.y, rect.height, origin.1);
    rows.flat_map(|(y, height)| columns.iter().map(move |&(x, width)| Rect { x, y, width, height })).collect()
}

/// Sums over a part of the picture: per pixel the targets', then [`EXTRA`] more.
pub struct Sums {
    rect: Rect,
    depth: usize,
    data: Vec<f32>,
    /// Whether any fit was added.
    any: bool,
    /// Whether they are several, of which each has a Σ a of 1.
    joined: bool,
    /// Where centres are counted.
    counted: Rect,
    fits: usize,
    /// Of those, the ones on the grid.
    grid_fits: usize,
    orders: [usize; 4],
}

impl Sums {
    fn new(rect: Rect, targets: usize, counted: Rect) -> Self {
        let depth = targets + EXTRA;
        let data = vec![0.0; rect.width * rect.height * depth];
        Self { rect, depth, data, any: false, joined: false, counted, fits: 0, grid_fits: 0, orders: [0; 4] }
    }

    fn at(&self, x: usize, y: usize) -> usize {
        ((y - self.rect.y) * self.rect.width + x - self.rect.x) * self.depth
    }

    fn pixel(&mut self, x: usize, y: usize) -> &mut [f32] {
        let at = self.at(x, y);
        &mut self.data[at..at + self.depth]
    }

    fn coverage(&self, x: usize, y: usize) -> f32 {
        self.data[self.at(x, y) + self.depth - 1]
    }

    /// Divides by Σ a. A pixel that nothing covers keeps its noisy value, of `targets`, and its `noise`, the sum of the
    /// channels' variances. The `pilot` is the stage before.
    pub fn into_reconstruction(
        self,
        targets: &[&Plane],
        noise: &Plane,
        pilot: Option<Pilot>,
    ) -> Reconstruction {
        let (width, count) = (self.rect.width, targets.len());
        let mean = |k: usize, x: usize, y: usize, otherwise: &dyn Fn(usize, usize) -> f32| {
            let pixel = &self.data[(y * width + x) * self.depth..][..self.depth];
            if pixel[count] > 0.0 { pixel[k] / pixel[count] } else { otherwise(x, y) }
        };
        let plane = |k: usize, otherwise: &(dyn Fn(usize, usize) -> f32 + Sync)| {
            Plane::par_from_fn(width, self.rect.height, |x, y| mean(k, x, y, otherwise))
        };
        let change = pilot.map(|pilot| {
            Plane::par_from_fn(width, self.rect.height, |x, y| {
                let now = |c: usize| mean(c, x, y, &|x, y| targets[c].get(x, y));
                let before = pilot.color.iter().map(|plane| plane.get(x, y));
                before.enumerate().map(|(c, before)| (now(c) - before).powi(2)).sum::<f32>() / 3.0
            })
        });
        Reconstruction {
            change,
            targets: targets.iter().enumerate().map(|(t, noisy)| plane(t, &|x, y| noisy.get(x, y))).collect(),
            mse: plane(count + 1, &|x, y| noise.get(x, y) / 3.0),
            order: plane(count + 2, &|_, _| 0.0),
            fits: self.fits,
            coverage_fits: self.fits - self.grid_fits,
            orders: self.orders,
        }
    }

    /// Those of both, of which each counts the same at every pixel, whatever it has summed there.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        let (depth, count, joined) = (self.depth, self.depth - EXTRA, self.joined);
        let total = |pixel: &[f32]| if pixel[count] > 0.0 { pixel[count] } else { 1.0 };
        let pixels = self.data.par_chunks_exact_mut(depth).zip(other.data.par_chunks_exact(depth));
        pixels.with_min_len(TILE * TILE).for_each(|(own, others)| {
            let totals = [if joined { 1.0 } else { total(own) }, total(others)];
            own.iter_mut().zip(others).for_each(|(own, other)| *own = *own / totals[0] + other / totals[1]);
        });
        self.joined = true;
        self.fits += other.fits;
        self.grid_fits += other.grid_fits;
        self.orders.iter_mut().zip(other.orders).for_each(|(a, b)| *a += b);
        self
    }

    /// Adds those of tiles, in their order; rows in parallel.
    fn add(&mut self, tiles: &[Sums]) {
        let tiles: Vec<&Sums> = tiles.iter().filter(|tile| tile.any).collect();
        let (top, left) = (self.rect.y, self.rect.x);
        let row = (self.rect.width * self.depth).max(1);
        self.data.par_chunks_exact_mut(row).enumerate().for_each(|(y, sums)| {
            for tile in &tiles {
                let Some(dy) = (y + top).checked_sub(tile.rect.y).filter(|dy| *dy < tile.rect.height) else {
                    continue;
                };
                let row = tile.rect.width * tile.depth;
                let sums = &mut sums[(tile.rect.x - left) * tile.depth..][..row];
                sums.iter_mut().zip(&tile.data[dy * row..]).for_each(|(a, b)| *a += b);
            }
        });
        for tile in tiles {
            self.fits += tile.fits;
            self.orders.iter_mut().zip(tile.orders).for_each(|(a, b)| *a += b);
        }
    }
}

/// Sums what the fits of one stage with all its kernels predict. Pixels need a summed weight of `coverage`;
/// `tick` hears the share that is done, before every tile.
///
/// # Errors
/// Those of `tick`, which end the work.
pub fn run(
    problem: &Problem<'_>,
    kernels: &[Kernel],
    coverage: f32,
    area: Area,
    tick: &(dyn Fn(f32) -> Result<()> + Sync),
) -> Result<Sums> {
    let size @ (width, height) = problem.targets[0].size();
    let (spacing, radius) = (problem.options.center_spacing, problem.options.window_radius);
    let mut sums = Sums::new(Rect::whole(size), problem.targets.len(), area.counted);
    let tested = tested(area.wanted, area.origin, size, radius);
    let (grid_tiles, tested) = (tiles(tested.grown(radius, size), area.origin), tiles(tested, area.origin));
    let (done, all) = (AtomicUsize::new(0), grid_tiles.len() + tested.len());
    let tick = || tick(done.fetch_add(1, Ordering::Relaxed) as f32 / all as f32);

    let taper = taper(radius, problem.options.taper_power);
    let on_grid = |i: usize| i % spacing == spacing / 2;
    in_tiles(problem, &mut sums, &grid_tiles, &tick, |solver, local, tile| {
        for y in (tile.y..tile.y + tile.height).filter(|y| on_grid(y + area.origin.1)) {
            for x in (tile.x..tile.x + tile.width).filter(|x| on_grid(x + area.origin.0)) {
                center(problem, solver, local, (x, y), kernels, &taper);
            }
        }
    })?;
    sums.grid_fits = sums.fits;
    let bandwidth = kernels.iter().fold(0.0f32, |widest, kernel| widest.max(kernel.bandwidth));
    let widest: Vec<Kernel> =
        kernels.iter().copied().filter(|kernel| kernel.bandwidth == bandwidth).collect();
    let grid = Plane::par_from_fn(width, height, |x, y| sums.coverage(x, y));
    in_tiles(problem, &mut sums, &tested, &tick, |solver, local, tile| {
        for y in tile.y..tile.y + tile.height {
            for x in tile.x..tile.x + tile.width {
                let covered = grid.get(x, y) + local.coverage(x, y);
                if covered < coverage && worth_a_fit(problem, x, y) {
                    center(problem, solver, local, (x, y), &widest, &taper);
                }
            }
        }
    })?;
    Ok(sums)
}

/// Runs `work` on every tile, in parallel, and adds what it sums to `sums` in the tiles' order. `work`
/// gets a solver, the tile's own sums and the tile; `tick` is called before, and its error ends the work.
fn in_tiles(
    problem: &Problem<'_>,
    sums: &mut Sums,
    tiles: &[Rect],
    tick: &(impl Fn() -> Result<()> + Sync),
    work: impl Fn(&mut Solver<'_>, &mut Sums, Rect) + Sync,
) -> Result<()> {
    let (radius, size) = (problem.options.window_radius, problem.targets[0].size());
    let (targets, counted) = (problem.targets.len(), sums.counted);
    for group in tiles.chunks(GROUP) {
        let done: Result<Vec<Sums>> = group
            .par_iter()
            .map_init(
                || Solver::new(problem),
                |solver, tile| {
                    tick()?;
                    let mut local = Sums::new(tile.grown(radius, size), targets, counted);
                    work(solver, &mut local, *tile);
                    Ok(local)
                },
            )
            .collect();
        sums.add(&done?);
    }
    Ok(())
}

/// What predictions count for by their place in an unclipped window along one axis.
type Taper = [f32; 2 * MAX_WINDOW_RADIUS + 1];

/// The taper of windows of `radius`.
fn taper(radius: usize, power: f32) -> Taper {
    let share = |at: usize| at.abs_diff(radius) as f32 / (radius + 1) as f32;
    std::array::from_fn(|at| (1.0 - share(at).powi(2)).max(0.0).powf(power))
}

/// Fits every kernel at a centre and adds what it predicts.
fn center(
    problem: &Problem<'_>,
    solver: &mut Solver<'_>,
    sums: &mut Sums,
    (cx, cy): (usize, usize),
    kernels: &[Kernel],
    taper: &Taper,
) {
    let options = problem.options;
    let window = Window::new(cx, cy, options.window_radius, problem.targets[0].size());
    let [mut amounts, mut certain, mut shares]: [Vec<f32>; 3] = Default::default();
    let dark = options.dark_level * options.dark_level;
    let energy = |light: f32| light.max(0.0).powi(2) + dark;
    let floor = RISK_FLOOR * options.dark_level * options.dark_level;
    let here = problem.pilot.map_or(f32::INFINITY, |pilot| energy(pilot.light(cx, cy)));
    for kernel in kernels {
        let fitted = solver.fit(&window, *kernel);
        let order = fitted.choice.order;
        let own = fitted.samples.of_frame(0);
        let spots = fitted.samples.spots(own.clone());
        certain.resize(own.len(), 0.0);
        amounts.clear();
        amounts.extend(spots.iter().zip(fitted.samples.kernel()).map(|(spot, k)| {
            let [x, y] = spot.map(usize::from);
            k * taper[x] * taper[y]
        }));
        // In the first stage the risk is that of noisy data: it would favour chance.
        if let Some(pilot) = problem.pilot {
            fitted.samples.gather(&pilot.certain, 0, 0.0, &mut certain);
            shares.clear();
            shares.extend(fitted.risks.iter().zip(&certain).map(|(xi, certain)| {
                let there = energy(*certain);
                let dark = if there > here { (here + there) / (2.0 * here) } else { 1.0 };
                floor / ((xi + floor) * dark)
            }));
            trust(&mut amounts, &shares, options.risk_power);
        }
        for (t, predicted) in fitted.predicted.chunks_exact(own.len()).enumerate() {
            // A polynomial beside a lamp may swing far below what any pixel of the window shows: such predictions
            // do not join the average, and the coverage test sees the gap. Black blotches were what they left.
            let swing = -SWING * options.dark_level;
            let swings = t < 3 && predicted.iter().any(|value| *value < swing);
            let least =
                if swings { window.least(problem.targets[t]).min(0.0) + swing } else { f32::NEG_INFINITY };
            for (a, value) in amounts.iter_mut().zip(predicted) {
                *a = if value.abs() <= LARGEST_PREDICTION && *value >= least { *a } else { -1.0 };
            }
        }
        for (i, ((spot, &k), &a)) in spots.iter().zip(fitted.samples.kernel()).zip(&*amounts).enumerate() {
            if a < 0.0 {
                continue;
            }
            let [x, y] = spot.map(usize::from);
            let pixel = sums.pixel(cx + x - options.window_radius, cy + y - options.window_radius);
            let (targets, extra) = pixel.split_at_mut(problem.targets.len());
            for (sum, predicted) in targets.iter_mut().zip(fitted.predicted.chunks_exact(own.len())) {
                *sum += a * predicted[i];
            }
            for (sum, term) in extra.iter_mut().zip([a, a * fitted.risks[i], a * order, k]) {
                *sum += term;
            }
        }
        sums.any = true;
        if sums.counted.contains(cx, cy) {
            sums.fits += 1;
            sums.orders[fitted.choice.best] += 1;
        }
    }
}

/// Multiplies `amounts` by `shares` to a power, which takes none out of `f32`. The root is the same on all machines and
/// quick, which powers are not.
fn trust(amounts: &mut [f32], shares: &[f32], power: f32) {
    let pairs = amounts.iter_mut().zip(shares);
    if power == 0.5 {
        pairs.for_each(|(a, share)| *a *= share.sqrt());
    } else {
        pairs.for_each(|(a, share)| *a *= share.powf(power).max(LEAST_TRUST));
    }
}

fn worth_a_fit(problem: &Problem<'_>, x: usize, y: usize) -> bool {
    let radiance: f32 = problem.targets[..3].iter().map(|c| c.get(x, y).powi(2)).sum();
    problem.noise.get(x, y) > NEGLIGIBLE_NOISE * (radiance + problem.options.dark_level.powi(2))
}
