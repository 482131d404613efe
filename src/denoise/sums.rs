//! The overlap average: what all fits that reach a pixel predict there, summed with their amounts.
//!
//! Pixel i gets ŷ(i) = Σ_j a_j(i) ŷ_j(i) / Σ_j a_j(i) over the centres j, and so do its risk and its order. A pixel that
//! nothing covers keeps its noisy value.

use super::reconstruction::{Pilot, Reconstruction};
use super::solver::Fitted;
use super::tiles::TILE;
use super::window::Window;
use crate::image::{Plane, Rect};
use rayon::prelude::*;

/// Sums of one pixel besides its targets: Σ a, Σ aξ, Σ a·order, Σ K.
const EXTRA: usize = 4;

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
    /// None yet over `rect`, of so many `targets`.
    pub fn new(rect: Rect, targets: usize, counted: Rect) -> Self {
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

    /// Where centres are counted.
    pub fn counted(&self) -> Rect {
        self.counted
    }

    /// Σ K at a pixel.
    pub fn coverage(&self, x: usize, y: usize) -> f32 {
        self.data[self.at(x, y) + self.depth - 1]
    }

    /// Takes the fits so far for those on the grid.
    pub fn end_grid(&mut self) {
        self.grid_fits = self.fits;
    }

    /// Adds what a fit predicts for the pixels of a `window`, with their `amounts`; those below 0 are left out. The
    /// radius is that of unclipped windows.
    pub fn add_fit(&mut self, window: &Window, radius: usize, fitted: &Fitted<'_>, amounts: &[f32]) {
        let spots = fitted.samples.spots(fitted.samples.of_frame(0));
        let (targets, order) = (self.depth - EXTRA, fitted.choice.order);
        for (i, ((spot, &k), &a)) in spots.iter().zip(fitted.samples.kernel()).zip(amounts).enumerate() {
            if a < 0.0 {
                continue;
            }
            let [x, y] = spot.map(usize::from);
            let pixel = self.pixel(window.cx + x - radius, window.cy + y - radius);
            let (sums, extra) = pixel.split_at_mut(targets);
            for (sum, predicted) in sums.iter_mut().zip(fitted.predicted.chunks_exact(spots.len())) {
                *sum += a * predicted[i];
            }
            for (sum, term) in extra.iter_mut().zip([a, a * fitted.risks[i], a * order, k]) {
                *sum += term;
            }
        }
        self.any = true;
        if self.counted.contains(window.cx, window.cy) {
            self.fits += 1;
            self.orders[fitted.choice.best] += 1;
        }
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
    pub fn add(&mut self, tiles: &[Sums]) {
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
