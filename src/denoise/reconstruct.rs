//! One stage of the reconstruction: sparse centres, then centres where those leave gaps.
//!
//! Every centre j predicts all pixels of its window, and the pixel i is the [average](super::sums) of what it is
//! predicted to be, weighted by [a_j(i)](super::amounts).
//!
//! A grid of centres alone leaves pixels that no window reaches with any weight. After the grid every
//! pixel whose summed kernel is under what is asked becomes a centre itself, unless it has next to no
//! noise: then it stays as it is. `[choice]` such a centre gets the widest kernels alone: so little
//! resembles it that narrow ones would give the pixel back as it is. Half the fits, relMSE ×0.975
//! (three scenes at 64 spp).

use super::amounts::Amounts;
use super::solver::{Problem, Solver};
use super::sums::Sums;
use super::tiles::{Area, tested, tiles};
use super::window::Window;
use crate::error::Result;
use crate::image::{Plane, Rect};
use crate::options::Kernel;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Tiles in flight between two gatherings; bounds the memory.
const GROUP: usize = 256;

/// Where noise variance is under this share of the radiance's square, which is noise of one per cent, a pixel
/// that resembles nothing is not worth a fit of its own. `[choice]` against 1e-8: relMSE ×1.000 (18 scenes at
/// 16 to 256 spp), up to ×0.7 of the time where a bright sky shows detail.
const NEGLIGIBLE_NOISE: f32 = 1e-4;

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

    let on_grid = |i: usize| i % spacing == spacing / 2;
    in_tiles(problem, &mut sums, &grid_tiles, &tick, |centres, local, tile| {
        for y in (tile.y..tile.y + tile.height).filter(|y| on_grid(y + area.origin.1)) {
            for x in (tile.x..tile.x + tile.width).filter(|x| on_grid(x + area.origin.0)) {
                centres.add((x, y), kernels, local);
            }
        }
    })?;
    sums.end_grid();
    let bandwidth = kernels.iter().fold(0.0f32, |widest, kernel| widest.max(kernel.bandwidth));
    let widest: Vec<Kernel> =
        kernels.iter().copied().filter(|kernel| kernel.bandwidth == bandwidth).collect();
    let grid = Plane::par_from_fn(width, height, |x, y| sums.coverage(x, y));
    in_tiles(problem, &mut sums, &tested, &tick, |centres, local, tile| {
        for y in tile.y..tile.y + tile.height {
            for x in tile.x..tile.x + tile.width {
                let covered = grid.get(x, y) + local.coverage(x, y);
                if covered < coverage && worth_a_fit(problem, x, y) {
                    centres.add((x, y), &widest, local);
                }
            }
        }
    })?;
    Ok(sums)
}

/// Runs `work` on every tile, in parallel, and adds what it sums to `sums` in the tiles' order. `work`
/// gets what to fit centres with, the tile's own sums and the tile; `tick` is called before, and its error ends the work.
fn in_tiles(
    problem: &Problem<'_>,
    sums: &mut Sums,
    tiles: &[Rect],
    tick: &(impl Fn() -> Result<()> + Sync),
    work: impl Fn(&mut Centres<'_>, &mut Sums, Rect) + Sync,
) -> Result<()> {
    let (radius, size) = (problem.options.window_radius, problem.targets[0].size());
    let (targets, counted) = (problem.targets.len(), sums.counted());
    for group in tiles.chunks(GROUP) {
        let done: Result<Vec<Sums>> = group
            .par_iter()
            .map_init(
                || Centres::new(problem),
                |centres, tile| {
                    tick()?;
                    let mut local = Sums::new(tile.grown(radius, size), targets, counted);
                    work(centres, &mut local, *tile);
                    Ok(local)
                },
            )
            .collect();
        sums.add(&done?);
    }
    Ok(())
}

/// What one thread fits centres with.
struct Centres<'a> {
    problem: &'a Problem<'a>,
    solver: Solver<'a>,
    amounts: Amounts,
}

impl<'a> Centres<'a> {
    fn new(problem: &'a Problem<'a>) -> Self {
        Self { problem, solver: Solver::new(problem), amounts: Amounts::new(problem.options) }
    }

    /// Fits every kernel at a centre and adds what it predicts.
    fn add(&mut self, (cx, cy): (usize, usize), kernels: &[Kernel], sums: &mut Sums) {
        let radius = self.problem.options.window_radius;
        let window = Window::new(cx, cy, radius, self.problem.targets[0].size());
        for kernel in kernels {
            let fitted = self.solver.fit(&window, *kernel);
            let amounts = self.amounts.of(self.problem, &window, &fitted);
            sums.add_fit(&window, radius, &fitted, amounts);
        }
    }
}

fn worth_a_fit(problem: &Problem<'_>, x: usize, y: usize) -> bool {
    let radiance: f32 = problem.targets[..3].iter().map(|c| c.get(x, y).powi(2)).sum();
    problem.noise.get(x, y) > NEGLIGIBLE_NOISE * (radiance + problem.options.dark_level.powi(2))
}
