//! Collaborative first-order regression: around every pixel a linear function of position and features is
//! fitted by weighted least squares, predicts the whole window, and all windows' predictions are averaged by
//! the weights that they were fitted with (Bitterli et al. 2016, section 4).
//!
//! The normal equations are the pipeline's: centred and levelled columns, Gram matrix, Cholesky with a
//! pivot threshold. Distances are kept for a band of rows, so that several bandwidths share them.

use crate::baseline::patches::{Patches, Scratch, weigh};
use crate::denoise::condition;
use crate::denoise::fit::Factor;
use crate::denoise::gram::{self, Columns, Gram};
use crate::denoise::vectors;
use crate::denoise::window::Window;
use crate::image::Plane;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

/// Bands in flight between two gatherings; bounds the memory.
const GROUP: usize = 16;

/// Columns before the features: constant, x and y.
const POSITION: usize = 3;

/// Regresses `targets` on `features` with the weights of `patches`: the planes of all targets, once for each
/// of `bandwidths`.
pub fn regress(
    targets: &[&Plane],
    features: &[Plane],
    patches: &Patches,
    bandwidths: &[f32],
) -> Vec<Vec<Plane>> {
    let (width, height) = patches.size();
    let problem = Problem { targets, features, patches, bandwidths };
    let mut sums: Vec<Sums> = bandwidths.iter().map(|_| Sums::new(0..height, width, targets.len())).collect();
    for group in patches.bands().chunks(GROUP) {
        let done: Vec<Vec<Sums>> = group
            .par_iter()
            .map_init(|| Solver::new(&problem), |solver, rows| solver.band(rows.clone()))
            .collect();
        for band in &done {
            sums.iter_mut().zip(band).for_each(|(sums, band)| sums.add(band));
        }
    }
    sums.into_iter().map(|sums| sums.means(height)).collect()
}

struct Problem<'a> {
    targets: &'a [&'a Plane],
    features: &'a [Plane],
    patches: &'a Patches,
    bandwidths: &'a [f32],
}

/// Sums over some rows: one plane of rows for every target, one for the weights.
struct Sums {
    rows: Range<usize>,
    width: usize,
    planes: Vec<Vec<f32>>,
}

impl Sums {
    fn new(rows: Range<usize>, width: usize, targets: usize) -> Self {
        let planes = vec![vec![0.0; rows.len() * width]; targets + 1];
        Self { rows, width, planes }
    }

    fn add(&mut self, other: &Sums) {
        let start = (other.rows.start - self.rows.start) * self.width;
        for (plane, other) in self.planes.iter_mut().zip(&other.planes) {
            plane[start..].iter_mut().zip(other).for_each(|(a, b)| *a += b);
        }
    }

    fn means(mut self, height: usize) -> Vec<Plane> {
        let weights = self.planes.pop().expect("the weights are the last plane");
        let mean = |mut sums: Vec<f32>| {
            sums.iter_mut().zip(&weights).for_each(|(sum, w)| *sum /= w);
            Plane::from_vec(self.width, height, sums).expect("the sums cover the picture")
        };
        self.planes.into_iter().map(mean).collect()
    }
}

/// Buffers of one thread.
struct Solver<'a> {
    problem: &'a Problem<'a>,
    arch: Arch,
    scratch: Scratch,
    /// Distances of the band's pixels, offset by offset.
    volume: Vec<f32>,
    distances: Vec<f32>,
    weights: Vec<f32>,
    /// The Gram kernel's noise, which this method does not ask for.
    silence: Vec<f32>,
    columns: Vec<f32>,
    means: Vec<f32>,
    gram: Gram,
    factor: Factor,
    keep: Vec<f64>,
    /// It does not ask for the features' own noise.
    column_noise: Vec<f64>,
    predicted: Vec<f32>,
}

/// A band to be compiled for every kind of vectors.
struct Band<'s, 'a> {
    solver: &'s mut Solver<'a>,
    rows: Range<usize>,
}

impl WithSimd for Band<'_, '_> {
    type Output = Vec<Sums>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Sums> {
        self.solver.run(simd, self.rows)
    }
}

impl<'a> Solver<'a> {
    fn new(problem: &'a Problem<'a>) -> Self {
        Self {
            problem,
            arch: vectors::widest(),
            scratch: Scratch::default(),
            volume: vec![],
            distances: vec![],
            weights: vec![],
            silence: vec![],
            columns: vec![],
            means: vec![],
            gram: Gram::default(),
            factor: Factor::default(),
            keep: vec![1.0; POSITION + problem.features.len()],
            column_noise: vec![0.0; POSITION + problem.features.len()],
            predicted: vec![],
        }
    }

    /// All windows whose centres lie in `rows`.
    fn band(&mut self, rows: Range<usize>) -> Vec<Sums> {
        self.arch.dispatch(Band { solver: self, rows })
    }

    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, rows: Range<usize>) -> Vec<Sums> {
        let Problem { targets, patches, bandwidths, .. } = *self.problem;
        let (width, height) = patches.size();
        let radius = patches.window_radius();
        let reach = rows.start.saturating_sub(radius)..(rows.end + radius).min(height);
        let mut sums: Vec<Sums> =
            bandwidths.iter().map(|_| Sums::new(reach.clone(), width, targets.len())).collect();
        self.fill_volume(rows.clone());
        for y in rows.clone() {
            for x in 0..width {
                let window = Window::new(x, y, radius, (width, height));
                self.gather(&window, (y - rows.start) * width + x, rows.len() * width);
                for (bandwidth, sums) in bandwidths.iter().zip(&mut sums) {
                    self.fit(simd, &window, *bandwidth);
                    self.predict(&window, sums);
                }
            }
        }
        sums
    }

    #[inline(always)]
    fn fill_volume(&mut self, rows: Range<usize>) {
        let patches = self.problem.patches;
        let (radius, layer) = (patches.window_radius() as isize, rows.len() * patches.size().0);
        let side = 2 * patches.window_radius() + 1;
        self.volume.resize(side * side * layer, 0.0);
        let offsets = (-radius..=radius).flat_map(|dy| (-radius..=radius).map(move |dx| [dx, dy]));
        for (offset, out) in offsets.zip(self.volume.chunks_exact_mut(layer)) {
            patches.distances(rows.clone(), offset, &mut self.scratch, out);
        }
    }

    /// The window's distances, design and right-hand sides; `pixel` is the centre's place in a layer of the
    /// volume, a layer being `layer` long.
    #[inline(always)]
    fn gather(&mut self, window: &Window, pixel: usize, layer: usize) {
        let Problem { targets, features, patches, .. } = *self.problem;
        let (stride, pixels) = (window.stride, window.pixels());
        let radius = patches.window_radius();
        let side = 2 * radius + 1;
        let (first_x, first_y) = window.offset(radius);
        self.distances.clear();
        for y in first_y..first_y + window.height {
            let offsets = y * side + first_x..y * side + first_x + window.width;
            self.distances.extend(offsets.map(|offset| self.volume[offset * layer + pixel]));
        }
        self.means.clear();
        self.means.resize(targets.len(), 0.0);
        self.columns.clear();
        self.columns.resize((POSITION + features.len() + targets.len()) * stride, 0.0);
        let mut columns = self.columns.chunks_exact_mut(stride);
        let mut next = || columns.next().expect("there is room for every column");
        next()[..pixels].fill(1.0);
        let (x, y) = (next(), next());
        for i in 0..pixels {
            let (column, row) = (window.x0 + i % window.width, window.y0 + i / window.width);
            x[i] = column as f32 - window.cx as f32;
            y[i] = row as f32 - window.cy as f32;
        }
        for feature in features {
            window.gather(feature, feature.get(window.cx, window.cy), next());
        }
        targets.iter().for_each(|target| window.gather(target, 0.0, next()));
    }

    /// Weighs and factorises. Columns that an earlier bandwidth has centred and levelled are so again.
    #[inline(always)]
    fn fit<S: Simd>(&mut self, simd: S, window: &Window, bandwidth: f32) {
        let (stride, p, r) = (window.stride, self.keep.len(), self.problem.targets.len());
        self.weights.clear();
        self.weights.resize(stride, 0.0);
        weigh(&self.distances, bandwidth, 0.0, &mut self.weights);
        self.silence.clear();
        self.silence.resize(stride, 0.0);
        let total = condition::total(simd, &self.weights);
        for (j, column) in self.columns.chunks_exact_mut(stride).enumerate().skip(1) {
            let mean = condition::centre(simd, column, &self.weights, total);
            if j < p {
                condition::level(simd, column, &self.weights);
            } else {
                self.means[j - p] += mean;
            }
        }
        let columns = Columns {
            data: &self.columns,
            stride,
            p,
            r,
            weights: &self.weights,
            weighted_noise: &self.silence,
        };
        gram::accumulate(self.arch, columns, &mut self.gram);
        self.factor.factorise(&self.gram, &self.column_noise, r);
    }

    /// Adds the weighted predictions of all of the window's pixels.
    #[inline(always)]
    fn predict(&mut self, window: &Window, sums: &mut Sums) {
        let stride = window.stride;
        let r = self.problem.targets.len();
        let add = |plane: &mut [f32], values: &[f32]| {
            for (y, values) in values.chunks_exact(window.width).take(window.height).enumerate() {
                let at = (window.y0 + y - sums.rows.start) * sums.width + window.x0;
                plane[at..at + window.width].iter_mut().zip(values).for_each(|(sum, v)| *sum += v);
            }
        };
        self.factor.solve(r, &self.keep);
        for t in 0..r {
            self.predicted.clear();
            self.predicted.resize(stride, self.means[t]);
            for (beta, column) in self.factor.beta(t).iter().zip(self.columns.chunks_exact(stride)) {
                let beta = *beta as f32;
                self.predicted.iter_mut().zip(column).for_each(|(out, x)| *out += beta * x);
            }
            self.predicted.iter_mut().zip(&self.weights).for_each(|(out, w)| *out *= w);
            add(&mut sums.planes[t], &self.predicted);
        }
        add(&mut sums.planes[r], &self.weights);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baseline::patches::Channels;

    #[test]
    fn a_first_order_function_is_reproduced_whatever_the_weights() {
        let feature = Plane::from_fn(24, 21, |x, y| ((x * 5 + y * 3) % 7) as f32);
        let target =
            Plane::from_fn(24, 21, |x, y| 2.0 + 0.1 * x as f32 - 0.05 * y as f32 + 0.3 * feature.get(x, y));
        let variance = Plane::filled(24, 21, 0.5);
        let single = std::slice::from_ref;
        let patches = Patches::new(single(&target), single(&variance), [4, 1], Channels::Largest);
        for result in regress(&[&target], single(&feature), &patches, &[0.5, 1.0]) {
            for (got, expected) in result[0].data().iter().zip(target.data()) {
                assert!((got - expected).abs() < 1e-4, "{got} against {expected}");
            }
        }
    }
}
