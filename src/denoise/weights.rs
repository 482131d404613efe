//! Weights of a window: how much each pixel resembles the centre.
//!
//! The distance is the variance-normalised patch distance of Rousselle, Knaus, Zwicker 2012,
//! Δ²(p,q) = Σ_c ((u_p−u_q)² − (V_p + min(V_p,V_q))) / (ε + Σ_c (V_p + V_q + τ²(u_p² + u_q²))), averaged over the
//! patch; τ, a share of the radiance that counts as noise does, is ours. The bandwidth k divides it by k², and
//! w = exp(−max(0, Δ²/k²)).
//!
//! `[choice]` numerator and denominator are summed over the channels before the division, where the
//! paper divides channel by channel: relMSE ×0.94 over three scenes at 64 spp, and a third of the divisions.

use super::gram::LANES;
use crate::image::{Plane, Rect, TASK_ROWS};
use pulp::Simd;
use rayon::prelude::*;
use std::borrow::Borrow;

/// ε: keeps the distance finite where neither pixel has any noise, of a picture that is exposed.
const DISTANCE_EPSILON: f32 = 1e-10;

/// Where Δ²/k² is beyond this, ln 20, w is under 0.05 and set to 0 (Rousselle, Knaus, Zwicker 2012).
const FARTHEST: f32 = 2.995_732;

/// Guides are limited to this, so that squared differences stay finite.
const LARGEST_GUIDE: f32 = 1e15;

/// Planes to compare pixels by, each with the variance of its noise, padded by replication.
#[derive(Debug, Clone)]
pub struct Guide {
    planes: Vec<Vec<f32>>,
    variances: Vec<Vec<f32>>,
    /// Summed over the planes.
    noise: Vec<f32>,
    /// The noise and the tolerance's squares, summed over the planes: what differences are measured by.
    level: Vec<f32>,
    epsilon: f32,
    stride: usize,
    pad: usize,
}

/// Samples from one row of a window's distances to the next: whole vectors.
pub const fn distance_stride(radius: usize) -> usize {
    (2 * radius + 1).next_multiple_of(LANES)
}

/// Samples from one row of a plane of that `width` to the next, `pad` at either end and whole vectors of a
/// window in the last column.
pub fn padded_stride(width: usize, pad: usize) -> usize {
    width + 2 * pad + LANES
}

/// The pixels `rect` of a picture of `size` and those up to `pad` around them, in rows of [`padded_stride`], continued
/// by the picture's border, from `low` to `high`. `value` fills a part of a row, given by its first column and its row.
pub fn padded(
    size: (usize, usize),
    rect: Rect,
    pad: usize,
    [low, high]: [f32; 2],
    value: impl Fn([usize; 2], &mut [f32]) + Sync,
) -> Vec<f32> {
    let stride = padded_stride(rect.width, pad);
    let mut out = vec![0.0; stride * (rect.height + 2 * pad)];
    let left = pad.saturating_sub(rect.x);
    let right = (rect.width + 2 * pad).min(pad + size.0 - rect.x);
    out.par_chunks_exact_mut(stride).with_min_len(TASK_ROWS).enumerate().for_each(|(row, out)| {
        let y = (rect.y + row).saturating_sub(pad).min(size.1 - 1);
        let inside = &mut out[left..right];
        value([rect.x + left - pad, y], inside);
        inside.iter_mut().for_each(|v| *v = v.clamp(low, high));
        let (first, last) = (out[left], out[right - 1]);
        out[..left].fill(first);
        out[right..].fill(last);
    });
    out
}

impl Guide {
    /// A guide of the pixels `rect` of a picture of `size`, for windows of `window_radius` and patches of up to
    /// `patch_radius`, which tolerates nothing. `value` and `variance` fill a part of a row of each of `count` planes, given
    /// by its first column and its row.
    pub fn of(
        size: (usize, usize),
        rect: Rect,
        [window_radius, patch_radius]: [usize; 2],
        count: usize,
        value: impl Fn(usize, [usize; 2], &mut [f32]) + Sync,
        variance: impl Fn(usize, [usize; 2], &mut [f32]) + Sync,
    ) -> Self {
        let pad = window_radius + patch_radius;
        let stride = padded_stride(rect.width, pad);
        let limits = [-LARGEST_GUIDE, LARGEST_GUIDE];
        let planes: Vec<_> =
            (0..count).map(|n| padded(size, rect, pad, limits, |at, out| value(n, at, out))).collect();
        let limits = [0.0, LARGEST_GUIDE * LARGEST_GUIDE];
        let variances: Vec<_> =
            (0..count).map(|n| padded(size, rect, pad, limits, |at, out| variance(n, at, out))).collect();
        let mut noise = vec![0.0; planes[0].len()];
        noise.par_chunks_exact_mut(stride).with_min_len(TASK_ROWS).enumerate().for_each(|(y, noise)| {
            for variance in &variances {
                noise.iter_mut().zip(&variance[y * stride..]).for_each(|(sum, v)| *sum += v);
            }
        });
        let level = noise.clone();
        Self { planes, variances, noise, level, epsilon: DISTANCE_EPSILON, stride, pad }
    }

    /// The same of a whole picture, where differences of the share `tolerance` of the planes count as noise does: as far
    /// as is `forgiven` of its square, 0 to 1, or wholly.
    #[must_use]
    pub fn tolerating(mut self, tolerance: f32, forgiven: Option<&Plane>) -> Self {
        let forgiven = forgiven.map(|forgiven| {
            let fill = |at, out: &mut [f32]| forgiven.copy_row(at, out);
            padded(forgiven.size(), Rect::whole(forgiven.size()), self.pad, [0.0, 1.0], fill)
        });
        let Self { planes, noise, level, stride, .. } = &mut self;
        let rows = level.par_chunks_exact_mut(*stride);
        rows.with_min_len(TASK_ROWS).enumerate().for_each(|(y, level)| {
            let from = y * *stride;
            level.fill(0.0);
            for plane in &*planes {
                level.iter_mut().zip(&plane[from..]).for_each(|(sum, v)| *sum += (tolerance * v).powi(2));
            }
            if let Some(forgiven) = &forgiven {
                level.iter_mut().zip(&forgiven[from..]).for_each(|(level, share)| *level *= share);
            }
            level.iter_mut().zip(&noise[from..]).for_each(|(level, noise)| *level += noise);
        });
        self
    }

    /// The same of planes of any unit: by an ε that is less than any variance. By the picture's a feature in a
    /// millionth of its unit was filtered so that the result's error was ×1.5.
    #[must_use]
    pub fn of_any_unit(self) -> Self {
        Self { epsilon: f32::MIN_POSITIVE, ..self }
    }

    /// The same of `planes` with these `variances`.
    pub fn new(
        planes: &[impl Borrow<Plane> + Sync],
        variances: &[impl Borrow<Plane> + Sync],
        rect: Rect,
        radii: [usize; 2],
    ) -> Self {
        let size = planes[0].borrow().size();
        let value = |n: usize, at, out: &mut [f32]| planes[n].borrow().copy_row(at, out);
        let variance = |n: usize, at, out: &mut [f32]| variances[n].borrow().copy_row(at, out);
        Self::of(size, rect, radii, planes.len(), value, variance)
    }

    /// Fills `out` with a part of row `y` of plane `n`, from column `x` on.
    pub fn copy_row(&self, n: usize, at: [usize; 2], out: &mut [f32]) {
        self.copy(&self.planes[n], at, out);
    }

    /// The same of its variance.
    pub fn copy_variance_row(&self, n: usize, at: [usize; 2], out: &mut [f32]) {
        self.copy(&self.variances[n], at, out);
    }

    fn copy(&self, from: &[f32], [x, y]: [usize; 2], out: &mut [f32]) {
        let start = (y + self.pad) * self.stride + x + self.pad;
        out.copy_from_slice(&from[start..start + out.len()]);
    }

    /// Writes the differences of the pixel at column `x` and row `y` and all pixels of the window around it in
    /// `other`, both guides of a colour: `2·radius + 1` rows of [`distance_stride`]; pixels outside the picture
    /// have a value as well.
    #[inline(always)]
    pub fn differences<S: Simd>(
        &self,
        simd: S,
        other: &Self,
        [x, y]: [isize; 2],
        radius: usize,
        out: &mut [f32],
    ) {
        let at = |x: isize, y: isize| {
            ((y + self.pad as isize) * self.stride as isize + x + self.pad as isize) as usize
        };
        let (p, length, radius) = (at(x, y), distance_stride(radius), radius as isize);
        let all = |value: f32| simd.splat_f32s(value);
        let here: [_; 3] = std::array::from_fn(|c| [all(self.planes[c][p]), all(self.variances[c][p])]);
        let (noise, least) = (all(self.noise[p]), all(self.epsilon + self.level[p]));
        for (out, y) in out.chunks_exact_mut(length).zip(y - radius..) {
            let row = at(x - radius, y);
            let there: [_; 3] = std::array::from_fn(|c| {
                vectors::<S>(&other.planes[c], row, length).zip(vectors::<S>(
                    &other.variances[c],
                    row,
                    length,
                ))
            });
            let [red, green, blue] = there;
            let there = red.zip(green).zip(blue).zip(vectors::<S>(&other.level, row, length));
            for ((((red, green), blue), &other), out) in there.zip(S::as_mut_simd_f32s(out).0) {
                let mut numerator = all(0.0);
                for ([value, variance], (&v, &n)) in here.into_iter().zip([red, green, blue]) {
                    let difference = simd.sub_f32s(value, v);
                    let excess =
                        simd.sub_f32s(simd.mul_f32s(difference, difference), simd.min_f32s(variance, n));
                    numerator = simd.add_f32s(numerator, excess);
                }
                *out = simd.div_f32s(simd.sub_f32s(numerator, noise), simd.add_f32s(least, other));
            }
        }
    }

    /// Writes what [`Self::delta_row`] writes, summed over 2·`patch_radius` + 1 pixels of the row around each pixel
    /// from column `x` of row `y` on, as many as `out` holds; `delta` is to work in.
    #[inline(always)]
    pub fn patch_row(
        &self,
        [x, y]: [isize; 2],
        offset: [isize; 2],
        patch_radius: usize,
        delta: &mut Vec<f32>,
        out: &mut [f32],
    ) {
        delta.resize(out.len() + 2 * patch_radius, 0.0);
        self.delta_row([x - patch_radius as isize, y], offset, delta);
        out.copy_from_slice(&delta[..out.len()]);
        for shift in 1..=2 * patch_radius {
            out.iter_mut().zip(&delta[shift..]).for_each(|(sum, delta)| *sum += delta);
        }
    }

    /// Writes the differences of pixels p and p + offset, p from column `x` of row `y` on, as many as `out` holds; up
    /// to the padding they may lie outside the picture.
    #[inline(always)]
    fn delta_row(&self, [x, y]: [isize; 2], [dx, dy]: [isize; 2], out: &mut [f32]) {
        let at = |x: isize, y: isize| {
            ((y + self.pad as isize) * self.stride as isize + x + self.pad as isize) as usize
        };
        let (p, q) = (at(x, y), at(x + dx, y + dy));
        let (p, q) = (p..p + out.len(), q..q + out.len());
        out.fill(0.0);
        for (plane, variance) in self.planes.iter().zip(&self.variances) {
            let here = plane[p.clone()].iter().zip(&variance[p.clone()]);
            let there = plane[q.clone()].iter().zip(&variance[q.clone()]);
            for ((out, (&up, &vp)), (&uq, &vq)) in out.iter_mut().zip(here).zip(there) {
                *out += excess((up, vp), (uq, vq));
            }
        }
        let levels = self.level[p.clone()].iter().zip(&self.level[q]);
        for ((out, noise), (lp, lq)) in out.iter_mut().zip(&self.noise[p]).zip(levels) {
            *out = difference(*out, *noise, self.epsilon + *lp + *lq);
        }
    }
}

/// `length` samples from `from` on, whole vectors.
#[inline(always)]
pub fn vectors<S: Simd>(samples: &[f32], from: usize, length: usize) -> std::slice::Iter<'_, S::f32s> {
    S::as_simd_f32s(&samples[from..from + length]).0.iter()
}

/// What one channel of the pixels p and q, each a value and its variance, adds to the distance's numerator,
/// but for V_p.
#[inline(always)]
fn excess((up, vp): (f32, f32), (uq, vq): (f32, f32)) -> f32 {
    let difference = up - uq;
    difference * difference - if vp < vq { vp } else { vq }
}

/// The pixels' difference, from the channels' excess, Σ_c V_p and what it is measured by.
#[inline(always)]
fn difference(excess: f32, noise: f32, level: f32) -> f32 {
    (excess - noise) / level
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
    for (b, block) in distances.as_chunks::<LANES>().0.iter().enumerate() {
        let mut bits = 0;
        for (i, distance) in block.iter().enumerate() {
            bits |= u32::from(*distance <= farthest) << i;
        }
        near |= bits << (b * LANES);
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
        let guide = Guide::new(&[&u; 3], &[&v; 3], Rect::whole(u.size()), [2, 0]).tolerating(0.1, None);
        let mut row = vec![0.0; 21];
        guide.delta_row([0, 2], [1, -2], &mut row);
        let mut out = vec![0.0; 5 * distance_stride(2)];
        for (x, &expected) in row[..21].iter().enumerate() {
            guide.differences(pulp::Scalar, &guide, [x as isize, 2], 2, &mut out);
            assert_eq!(out[3], expected);
        }
    }

    #[test]
    fn a_guide_of_a_part_is_the_whole_one_there() {
        let u = Plane::from_fn(21, 15, |x, y| ((x * 7 + y * 13) % 11) as f32);
        let v = Plane::from_fn(21, 15, |x, y| 0.1 + ((x + 3 * y) % 5) as f32);
        let guide = |rect| Guide::new(&[&u; 2], &[&v; 2], rect, [2, 1]);
        let whole = guide(Rect::whole(u.size()));
        // A corner, the middle, all columns.
        for (x, y, width, height) in [(0, 0, 5, 4), (7, 6, 4, 3), (0, 9, 21, 6), (16, 2, 5, 13)] {
            let part = guide(Rect { x, y, width, height });
            for (row, offset) in (-1..=height as isize).flat_map(|row| [(row, [2, -2]), (row, [-2, 1])]) {
                let mut rows = [vec![0.0; width + 2], vec![0.0; width + 2]];
                part.delta_row([-1, row], offset, &mut rows[0]);
                whole.delta_row([x as isize - 1, y as isize + row], offset, &mut rows[1]);
                assert_eq!(rows[0], rows[1], "{x}, {y}: row {row}");
            }
        }
    }
}
