//! Patch distances as published, offset by offset, for the two baselines that weigh by them.
//!
//! Δ²(p,q) = ((u_p−u_q)² − (V_p + min(V_p,V_q))) / (ε + V_p + V_q), averaged over a patch; a bandwidth k
//! divides it by k². The pipeline's own [weights](crate::denoise) sum numerator and denominator over the
//! channels before dividing; here every channel is divided by itself, and then [`Channels`] decides.

use crate::denoise::vectors;
use crate::denoise::weights::{Guide, exp_negative};
use crate::image::{Plane, Rect};
use rayon::prelude::*;
use std::ops::Range;

/// Rows of one task; fixed, so that nothing depends on the number of threads.
pub const BAND: usize = 16;

/// How the channels' distances become one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channels {
    /// Their mean (Rousselle, Knaus, Zwicker 2012).
    Mean,
    /// The largest: every channel must agree (Bitterli et al. 2016).
    Largest,
}

/// A picture whose patches are compared.
pub struct Patches {
    guides: Vec<Guide>,
    size: (usize, usize),
    window_radius: usize,
    patch_radius: usize,
    channels: Channels,
}

/// Buffers for the distances of one offset.
#[derive(Default)]
pub struct Scratch {
    delta: Vec<f32>,
    boxed: Vec<f32>,
    channel: Vec<f32>,
}

impl Patches {
    /// For windows of `window_radius` and patches of `patch_radius` over `planes`, whose noise has
    /// `variances`.
    pub fn new(
        planes: &[Plane],
        variances: &[Plane],
        [window_radius, patch_radius]: [usize; 2],
        channels: Channels,
    ) -> Self {
        let (whole, radii) = (Rect::whole(planes[0].size()), [window_radius, patch_radius]);
        let guides = planes.iter().zip(variances);
        let guides = guides.map(|(plane, variance)| Guide::new(&[plane], &[variance], whole, radii));
        Self { guides: guides.collect(), size: planes[0].size(), window_radius, patch_radius, channels }
    }

    /// Radius of the windows.
    pub fn window_radius(&self) -> usize {
        self.window_radius
    }

    /// Width and height.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// The picture's rows in bands of [`BAND`].
    pub fn bands(&self) -> Vec<Range<usize>> {
        let height = self.size.1;
        (0..height).step_by(BAND).map(|y| y..(y + BAND).min(height)).collect()
    }

    /// The columns whose neighbour at `dx` lies in the picture.
    pub fn columns(&self, dx: isize) -> Range<usize> {
        let width = self.size.0 as isize;
        let start = (-dx).clamp(0, width);
        start as usize..(width - dx.max(0)).max(start) as usize
    }

    /// Writes Δ² of every pixel of `rows` and its neighbour at `offset`, row by row; neighbours outside
    /// the picture get a value as well.
    #[inline(always)]
    pub fn distances(&self, rows: Range<usize>, offset: [isize; 2], scratch: &mut Scratch, out: &mut [f32]) {
        let (width, f) = (self.size.0, self.patch_radius);
        let patch = 2 * f + 1;
        scratch.boxed.resize((rows.len() + 2 * f) * width, 0.0);
        scratch.channel.resize(out.len(), 0.0);
        let mean = self.channels == Channels::Mean;
        let share = 1.0 / (patch * patch * if mean { self.guides.len() } else { 1 }) as f32;
        for (c, guide) in self.guides.iter().enumerate() {
            for (i, row) in scratch.boxed.chunks_exact_mut(width).take(rows.len() + 2 * f).enumerate() {
                let y = rows.start as isize + i as isize - f as isize;
                guide.patch_row([0, y], offset, f, &mut scratch.delta, row);
            }
            for (i, row) in scratch.channel.chunks_exact_mut(width).enumerate() {
                row.fill(0.0);
                for boxed in scratch.boxed[i * width..].chunks_exact(width).take(patch) {
                    row.iter_mut().zip(boxed).for_each(|(d, b)| *d += b);
                }
            }
            let pairs = out.iter_mut().zip(&scratch.channel);
            match (c, mean) {
                (0, _) => pairs.for_each(|(out, d)| *out = d * share),
                (_, true) => pairs.for_each(|(out, d)| *out += d * share),
                (_, false) => pairs.for_each(|(out, d)| *out = out.max(d * share)),
            }
        }
    }
}

/// w = exp(−max(0, Δ²)/k²), 0 where that is under `threshold`.
#[inline(always)]
pub fn weigh(distances: &[f32], bandwidth: f32, threshold: f32, weights: &mut [f32]) {
    let scale = 1.0 / (bandwidth * bandwidth);
    for (weight, &distance) in weights.iter_mut().zip(distances) {
        let w = exp_negative(distance.max(0.0) * scale);
        *weight = if w < threshold { 0.0 } else { w };
    }
}

/// Weighted means of `planes` over the windows, with the weights of `patches`.
pub fn filter(patches: &Patches, planes: &[&Plane], bandwidth: f32, threshold: f32) -> Vec<Plane> {
    let arch = vectors::widest();
    let bands: Vec<Vec<f32>> = patches
        .bands()
        .into_par_iter()
        .map(|rows| {
            arch.dispatch(
                #[inline(always)]
                || filter_band(patches, planes, rows, bandwidth, threshold),
            )
        })
        .collect();
    let (width, height) = patches.size();
    let plane = |t: usize| {
        let parts = bands.iter().map(|band| band.chunks_exact(band.len() / planes.len()).nth(t));
        let data: Vec<f32> = parts.flatten().flatten().copied().collect();
        Plane::from_vec(width, height, data).expect("the bands cover the picture")
    };
    (0..planes.len()).map(plane).collect()
}

#[inline(always)]
fn filter_band(
    patches: &Patches,
    planes: &[&Plane],
    rows: Range<usize>,
    bandwidth: f32,
    threshold: f32,
) -> Vec<f32> {
    let (width, height) = patches.size();
    let size = rows.len() * width;
    let mut sums = vec![0.0; planes.len() * size];
    let (mut total, mut distances, mut weights) = (vec![0.0; size], vec![0.0; size], vec![0.0; size]);
    let mut scratch = Scratch::default();
    let radius = patches.window_radius() as isize;
    for dy in -radius..=radius {
        for dx in -radius..=radius {
            let columns = patches.columns(dx);
            if columns.is_empty() {
                continue;
            }
            patches.distances(rows.clone(), [dx, dy], &mut scratch, &mut distances);
            weigh(&distances, bandwidth, threshold, &mut weights);
            let from = (columns.start as isize + dx) as usize;
            for (i, y) in rows.clone().enumerate() {
                let Some(qy) = y.checked_add_signed(dy).filter(|&q| q < height) else { continue };
                let at = i * width + columns.start..i * width + columns.end;
                let w = &weights[at.clone()];
                total[at.clone()].iter_mut().zip(w).for_each(|(t, w)| *t += w);
                for (plane, sums) in planes.iter().zip(sums.chunks_exact_mut(size)) {
                    let values = &plane.row(qy)[from..];
                    sums[at.clone()].iter_mut().zip(w).zip(values).for_each(|((s, w), v)| *s += w * v);
                }
            }
        }
    }
    for sums in sums.chunks_exact_mut(size) {
        sums.iter_mut().zip(&total).for_each(|(s, t)| *s /= t);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pictures() -> (Vec<Plane>, Vec<Plane>) {
        let plane = |c: usize| Plane::from_fn(9, 20, |x, y| ((x * (7 + c) + y * 13) % 11) as f32);
        let noise = |c: usize| Plane::from_fn(9, 20, |x, _| 0.3 + 0.1 * (x + c) as f32);
        ((0..3).map(plane).collect(), (0..3).map(noise).collect())
    }

    #[test]
    fn the_distances_are_those_of_the_formula() {
        let (u, v) = pictures();
        for channels in [Channels::Mean, Channels::Largest] {
            let patches = Patches::new(&u, &v, [2, 1], channels);
            let mut out = vec![0.0; 4 * 9];
            patches.distances(16..20, [1, -2], &mut Scratch::default(), &mut out);
            let (x, y) = (4, 18);
            let of = |c: usize| {
                let mut sum = 0.0;
                for (px, py) in (3..6).flat_map(|px| (17..20).map(move |py| (px, py))) {
                    let (a, b) = (u[c].get(px, py), u[c].get(px + 1, py - 2));
                    let (va, vb) = (v[c].get(px, py), v[c].get(px + 1, py - 2));
                    sum += ((a - b).powi(2) - (va + va.min(vb))) / (1e-10 + va + vb) / 9.0;
                }
                sum
            };
            let expected = match channels {
                Channels::Mean => (of(0) + of(1) + of(2)) / 3.0,
                Channels::Largest => of(0).max(of(1)).max(of(2)),
            };
            let got = out[(y - 16) * 9 + x];
            assert!((got - expected).abs() < 1e-4 * expected.abs(), "{got} against {expected}");
        }
    }

    #[test]
    fn a_filter_of_patches_of_one_pixel_is_the_weighted_mean() {
        let (u, v) = pictures();
        let patches = Patches::new(&u[..1], &v[..1], [2, 0], Channels::Mean);
        let filtered = filter(&patches, &[&u[0]], 1.5, 0.05);
        let (mut sum, mut total) = (0.0, 0.0);
        for (x, y) in (6..9).flat_map(|x| (14..19).map(move |y| (x, y))) {
            let (d, vp, vq) = (u[0].get(8, 16) - u[0].get(x, y), v[0].get(8, 16), v[0].get(x, y));
            let w = (-((d * d - (vp + vp.min(vq))) / (1e-10 + vp + vq)).max(0.0) / 2.25).exp();
            let w = if w < 0.05 { 0.0 } else { w };
            sum += w * u[0].get(x, y);
            total += w;
        }
        assert!((filtered[0].get(8, 16) - sum / total).abs() < 1e-4);
    }
}
