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

/// Weights under this are set to 0 (Rousselle, Knaus, Zwicker 2012).
const WEIGHT_THRESHOLD: f32 = 0.05;

/// Guides are limited to this, so that squared differences stay finite.
const LARGEST_GUIDE: f32 = 1e15;

/// Samples that the inner loops take at once.
const BLOCK: usize = 8;

/// Planes to compare pixels by, each with the variance of its noise, padded by replication.
#[derive(Debug, Clone)]
pub struct Guide {
    planes: Vec<Vec<f32>>,
    variances: Vec<Vec<f32>>,
    stride: usize,
    pad: usize,
}

/// Samples from one row of a window's distances to the next.
pub fn distance_stride(radius: usize) -> usize {
    (2 * radius + 1).next_multiple_of(BLOCK)
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
        Self {
            planes: planes.iter().map(|p| padded(p, -LARGEST_GUIDE, LARGEST_GUIDE)).collect(),
            variances: variances.iter().map(|v| padded(v, 0.0, LARGEST_GUIDE * LARGEST_GUIDE)).collect(),
            stride,
            pad,
        }
    }

    /// Writes the distances from the patch at (`x`, `y`) to the patches of `other`, a guide of the same kind
    /// (or this one), at all offsets of the window: `2·radius + 1` rows of [`distance_stride`]; offsets
    /// outside the picture get a value as well.
    #[inline(always)]
    pub fn distances(
        &self,
        other: &Self,
        x: usize,
        y: usize,
        radius: usize,
        patch_radius: usize,
        out: &mut [f32],
    ) {
        let row = distance_stride(radius);
        let patch = 2 * patch_radius + 1;
        let inverse = 1.0 / (patch * patch) as f32;
        let origin = |y: usize| y * self.stride + x + self.pad;
        for (dy, out) in out.chunks_exact_mut(row).enumerate() {
            for (block, out) in out.chunks_exact_mut(BLOCK).enumerate() {
                let mut sum = [0.0f32; BLOCK];
                for py in 0..patch {
                    let p = origin(y + self.pad + py - patch_radius) - patch_radius;
                    let q = origin(y + self.pad + py + dy - patch_radius - radius) - patch_radius - radius;
                    for px in 0..patch {
                        self.add_differences(p + px, other, q + px + block * BLOCK, &mut sum);
                    }
                }
                out.iter_mut().zip(sum).for_each(|(out, sum)| *out = sum * inverse);
            }
        }
    }

    /// Adds to `sum` the difference of the sample at `p` and each of those of `other` from `q` on.
    #[inline(always)]
    fn add_differences(&self, p: usize, other: &Self, q: usize, sum: &mut [f32; BLOCK]) {
        let mut numerator = [0.0f32; BLOCK];
        let mut scale = [DISTANCE_EPSILON; BLOCK];
        let here = self.planes.iter().zip(&self.variances);
        for ((plane, variance), (planes, variances)) in here.zip(other.planes.iter().zip(&other.variances)) {
            let (up, vp) = (plane[p], variance[p]);
            let (uq, vq) = (&planes[q..q + BLOCK], &variances[q..q + BLOCK]);
            for i in 0..BLOCK {
                let terms = terms((up, vp), (uq[i], vq[i]));
                numerator[i] += terms.0;
                scale[i] += terms.1;
            }
        }
        for i in 0..BLOCK {
            sum[i] += numerator[i] / scale[i];
        }
    }

    /// Writes the difference of pixel p and p + offset for p in row `y` from column −`margin` on, as many
    /// as `out` holds.
    #[inline(always)]
    pub fn delta_row(&self, y: isize, [dx, dy]: [isize; 2], margin: usize, out: &mut [f32]) {
        let at = |y: isize, dx: isize| {
            let start =
                (y + self.pad as isize) * self.stride as isize + self.pad as isize - margin as isize + dx;
            start as usize..start as usize + out.len()
        };
        let (p, q) = (at(y, 0), at(y + dy, dx));
        for (c, out) in out.chunks_mut(BLOCK).enumerate() {
            let n = out.len();
            let (mut numerator, mut scale) = ([0.0f32; BLOCK], [DISTANCE_EPSILON; BLOCK]);
            for (plane, variance) in self.planes.iter().zip(&self.variances) {
                let cut =
                    |range: &std::ops::Range<usize>| range.start + c * BLOCK..range.start + c * BLOCK + n;
                let (up, uq) = (&plane[cut(&p)], &plane[cut(&q)]);
                let (vp, vq) = (&variance[cut(&p)], &variance[cut(&q)]);
                for i in 0..n {
                    let terms = terms((up[i], vp[i]), (uq[i], vq[i]));
                    numerator[i] += terms.0;
                    scale[i] += terms.1;
                }
            }
            for i in 0..n {
                out[i] = numerator[i] / scale[i];
            }
        }
    }
}

/// What one channel of the pixels p and q, each a value and its variance, adds to the distance's
/// numerator and denominator.
#[inline(always)]
fn terms((up, vp): (f32, f32), (uq, vq): (f32, f32)) -> (f32, f32) {
    let difference = up - uq;
    (difference * difference - (vp + vp.min(vq)), vp + vq)
}

/// w = exp(−max(0, Δ²)/k²), 0 where that is under the threshold.
#[inline(always)]
pub fn kernel(distances: &[f32], bandwidth: f32, weights: &mut [f32]) {
    let scale = 1.0 / (bandwidth * bandwidth);
    for (weight, &distance) in weights.iter_mut().zip(distances) {
        let w = exp_negative(distance.max(0.0) * scale);
        *weight = if w < WEIGHT_THRESHOLD { 0.0 } else { w };
    }
}

/// exp(−x) for x ≥ 0 to about 1e-6, without a branch, so that it vectorises: 2^(−x log₂e) split into
/// the exponent's bits and a polynomial of the fraction.
#[inline(always)]
pub(crate) fn exp_negative(x: f32) -> f32 {
    let t = x.min(80.0) * std::f32::consts::LOG2_E;
    let whole = (t + 0.5) as i32; // to the nearest: the fraction is −½ to ½
    let f = whole as f32 - t;
    let p = 1.0
        + f * (std::f32::consts::LN_2
            + f * (0.240_226_5
                + f * (0.055_504_11 + f * (0.009_618_129 + f * (0.001_333_356 + f * 0.000_154_035)))));
    p * f32::from_bits(((127 - whole) << 23) as u32)
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
    fn the_distance_is_that_of_the_formula_and_forgives_noise() {
        let u = Plane::from_fn(7, 5, |x, y| (x * x + 3 * y) as f32);
        let v = Plane::from_fn(7, 5, |x, _| 0.5 + x as f32);
        let guide = Guide::new(std::slice::from_ref(&u), std::slice::from_ref(&v), 2, 1);
        let row = distance_stride(2);
        let mut out = vec![0.0; 5 * row];
        guide.distances(&guide, 3, 2, 2, 1, &mut out);
        assert!(out[2 * row + 2] < 0.0, "a patch is nearer to itself than its noise lets expect");
        let mut expected = 0.0;
        for (py, px) in (0..3).flat_map(|y| (0..3).map(move |x| (y, x))) {
            let (p, q) = ((2 + px, 1 + py), (1 + px, 2 + py)); // offset (−1, +1)
            let (up, uq, vp, vq) = (u.get(p.0, p.1), u.get(q.0, q.1), v.get(p.0, p.1), v.get(q.0, q.1));
            expected += ((up - uq).powi(2) - (vp + vp.min(vq))) / (1e-10 + vp + vq) / 9.0;
        }
        assert!((out[3 * row + 1] - expected).abs() < 1e-5 * expected.abs());
    }

    #[test]
    fn rows_of_differences_agree_with_single_distances() {
        let u = Plane::from_fn(21, 5, |x, y| ((x * 7 + y * 13) % 11) as f32);
        let v = Plane::filled(21, 5, 0.3);
        let guide = Guide::new(&[u], &[v], 2, 0);
        let mut row = vec![0.0; 21];
        guide.delta_row(2, [1, -2], 0, &mut row);
        let mut out = vec![0.0; 5 * distance_stride(2)];
        for (x, &expected) in row.iter().enumerate() {
            guide.distances(&guide, x, 2, 2, 0, &mut out);
            assert_eq!(out[3], expected);
        }
    }
}
