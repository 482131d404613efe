//! Weights of a window: how much each pixel resembles the centre.
//!
//! The distance is the variance-normalised patch distance of Rousselle, Knaus, Zwicker 2012,
//! Δ²(p,q) = Σ_c ((u_p−u_q)² − (V_p + min(V_p,V_q))) / (ε + Σ_c (V_p + V_q)), averaged over the patch; the
//! bandwidth k divides it by k², and w = exp(−max(0, Δ²/k²)).
//!
//! `[choice]` numerator and denominator are summed over the channels before the division, where the
//! paper divides channel by channel: relMSE ×0.94 over three scenes at 64 spp, and a third of the divisions.

use crate::image::Plane;

/// Keeps the distance finite where neither pixel has any noise.
const DISTANCE_EPSILON: f32 = 1e-10;

/// Where Δ²/k² is beyond this, ln 20, w is under 0.05 and set to 0 (Rousselle, Knaus, Zwicker 2012).
const FARTHEST: f32 = 2.995_732;

/// Guides are limited to this, so that squared differences stay finite.
const LARGEST_GUIDE: f32 = 1e15;

/// Samples that the inner loops take at once.
pub const BLOCK: usize = 8;

/// Planes to compare pixels by, each with the variance of its noise, padded by replication.
#[derive(Debug, Clone)]
pub struct Guide {
    planes: Vec<Vec<f32>>,
    variances: Vec<Vec<f32>>,
    /// Summed over the planes.
    noise: Vec<f32>,
    stride: usize,
    pad: usize,
}

/// Samples from one row of a window's distances to the next.
pub fn distance_stride(radius: usize) -> usize {
    whole_blocks(2 * radius + 1)
}

/// `samples`, rounded up to what the inner loops take at once; a guide's rows have room for it.
pub fn whole_blocks(samples: usize) -> usize {
    samples.next_multiple_of(BLOCK)
}

impl Guide {
    /// A guide for windows of `window_radius` and patches of up to `patch_radius`.
    pub fn new(planes: &[Plane], variances: &[Plane], window_radius: usize, patch_radius: usize) -> Self {
        let pad = window_radius + patch_radius;
        let stride = planes[0].width() + 2 * pad + BLOCK;
        let padded = |plane: &Plane, low: f32, high: f32| {
            let (w, h) = plane.size();
            let mut out = Vec::with_capacity(stride * (h + 2 * pad));
            for y in 0..h + 2 * pad {
                let row = plane.row(y.saturating_sub(pad).min(h - 1));
                out.extend(std::iter::repeat_n(row[0].clamp(low, high), pad));
                out.extend(row.iter().map(|v| v.clamp(low, high)));
                out.resize((y + 1) * stride, row[w - 1].clamp(low, high));
            }
            out
        };
        let planes = planes.iter().map(|p| padded(p, -LARGEST_GUIDE, LARGEST_GUIDE)).collect();
        let variances: Vec<Vec<f32>> =
            variances.iter().map(|v| padded(v, 0.0, LARGEST_GUIDE * LARGEST_GUIDE)).collect();
        let mut noise = variances[0].clone();
        for variance in &variances[1..] {
            noise.iter_mut().zip(variance).for_each(|(sum, v)| *sum += v);
        }
        Self { planes, variances, noise, stride, pad }
    }

    /// Writes the differences of the pixel at column `x` and row `y` and all pixels of the window around it in
    /// `other`, a guide of the same kind (or this one): `2·radius + 1` rows of [`distance_stride`]; pixels
    /// outside the picture have a value as well.
    #[inline(always)]
    pub fn differences(&self, other: &Self, [x, y]: [isize; 2], radius: usize, out: &mut [f32]) {
        let at = |x: isize, y: isize| {
            ((y + self.pad as isize) * self.stride as isize + x + self.pad as isize) as usize
        };
        let (p, radius) = (at(x, y), radius as isize);
        let rows = out.chunks_exact_mut(distance_stride(radius as usize));
        for (out, y) in rows.zip(y - radius..) {
            let row = at(x - radius, y);
            for (block, out) in out.chunks_exact_mut(BLOCK).enumerate() {
                let q = row + block * BLOCK;
                let mut numerator = [0.0f32; BLOCK];
                let here = self.planes.iter().zip(&self.variances);
                for ((plane, variance), (planes, variances)) in
                    here.zip(other.planes.iter().zip(&other.variances))
                {
                    let (up, vp) = (plane[p], variance[p]);
                    let (uq, vq) = (&planes[q..q + BLOCK], &variances[q..q + BLOCK]);
                    for i in 0..BLOCK {
                        numerator[i] += excess((up, vp), (uq[i], vq[i]));
                    }
                }
                let (noise, noises) = (self.noise[p], &other.noise[q..q + BLOCK]);
                for i in 0..BLOCK {
                    out[i] = difference(numerator[i], noise, noises[i]);
                }
            }
        }
    }

    /// Writes the difference of pixel p and p + offset for p in row `y` from column −`margin` on, as many
    /// as `out` holds: at least those of the row and its margins, and whole blocks (see [`whole_blocks`]).
    #[inline(always)]
    pub fn delta_row(&self, y: isize, [dx, dy]: [isize; 2], margin: usize, out: &mut [f32]) {
        let at = |x: isize, y: isize| {
            ((y + self.pad as isize) * self.stride as isize + x + self.pad as isize - margin as isize)
                as usize
        };
        let (p, q) = (at(0, y), at(dx, y + dy));
        for (c, out) in out.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
            let cut = |from: usize| from + c * BLOCK..from + (c + 1) * BLOCK;
            let mut numerator = [0.0f32; BLOCK];
            for (plane, variance) in self.planes.iter().zip(&self.variances) {
                let (up, uq) = (&plane[cut(p)], &plane[cut(q)]);
                let (vp, vq) = (&variance[cut(p)], &variance[cut(q)]);
                for i in 0..BLOCK {
                    numerator[i] += excess((up[i], vp[i]), (uq[i], vq[i]));
                }
            }
            let (np, nq) = (&self.noise[cut(p)], &self.noise[cut(q)]);
            for i in 0..BLOCK {
                out[i] = difference(numerator[i], np[i], nq[i]);
            }
        }
    }
}

/// What one channel of the pixels p and q, each a value and its variance, adds to the distance's numerator,
/// but for V_p.
#[inline(always)]
fn excess((up, vp): (f32, f32), (uq, vq): (f32, f32)) -> f32 {
    let difference = up - uq;
    difference * difference - if vp < vq { vp } else { vq }
}

/// The pixels' difference, from the channels' excess and their summed variances Σ_c V_p and Σ_c V_q.
#[inline(always)]
fn difference(excess: f32, noise: f32, other: f32) -> f32 {
    (excess - noise) / (DISTANCE_EPSILON + noise + other)
}

/// w = exp(−max(0, Δ²)/k²), 0 where that is too little.
#[inline(always)]
pub fn kernel(distances: &[f32], bandwidth: f32, weights: &mut [f32]) {
    let scale = 1.0 / (bandwidth * bandwidth);
    for (weight, &distance) in weights.iter_mut().zip(distances) {
        let x = if distance > 0.0 { distance * scale } else { 0.0 };
        *weight = if x > FARTHEST { 0.0 } else { exp_negative(x) };
    }
}

/// Which of the distances of a row of a window have weight, a bit for each.
#[inline(always)]
pub fn near(distances: &[f32], bandwidth: f32) -> u32 {
    let farthest = FARTHEST * bandwidth * bandwidth;
    let mut near = 0;
    for (b, block) in distances.as_chunks::<BLOCK>().0.iter().enumerate() {
        let mut bits = 0;
        for (i, distance) in block.iter().enumerate() {
            bits |= u32::from(*distance <= farthest) << i;
        }
        near |= bits << (b * BLOCK);
    }
    near
}

/// exp(−x) for x ≥ 0 to about 1e-6, without a branch, so that it vectorises: 2^(−x log₂e) split into
/// the exponent's bits and a polynomial of the fraction.
#[inline(always)]
pub(crate) fn exp_negative(x: f32) -> f32 {
    const LARGEST: f32 = 80.0;
    // What is added to it loses its fraction, and the low bits are what is left.
    const SHIFT: f32 = 1.5 * (1u32 << 23) as f32;
    let t = if x < LARGEST { x } else { LARGEST } * std::f32::consts::LOG2_E;
    let whole = t + SHIFT;
    let f = whole - SHIFT - t; // −½ to ½
    let p = 1.0
        + f * (std::f32::consts::LN_2
            + f * (0.240_226_5
                + f * (0.055_504_11 + f * (0.009_618_129 + f * (0.001_333_356 + f * 0.000_154_035)))));
    p * f32::from_bits((127u32 << 23).wrapping_sub(whole.to_bits() << 23))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_is_good_to_single_precision() {
        for i in 0..4000 {
            let x = i as f32 * 0.01;
            let exact = (-f64::from(x)).exp();
            assert!((f64::from(exp_negative(x)) - exact).abs() <= 3e-6 * exact, "{x}");
        }
        assert_eq!(exp_negative(0.0), 1.0);
        assert!(exp_negative(f32::INFINITY) < 1e-30);
    }

    #[test]
    fn rows_of_differences_agree_with_single_distances() {
        let u = Plane::from_fn(21, 5, |x, y| ((x * 7 + y * 13) % 11) as f32);
        let v = Plane::filled(21, 5, 0.3);
        let guide = Guide::new(&[u], &[v], 2, 0);
        let mut row = vec![0.0; whole_blocks(21)];
        guide.delta_row(2, [1, -2], 0, &mut row);
        let mut out = vec![0.0; 5 * distance_stride(2)];
        for (x, &expected) in row[..21].iter().enumerate() {
            guide.differences(&guide, [x as isize, 2], 2, &mut out);
            assert_eq!(out[3], expected);
        }
    }
}
