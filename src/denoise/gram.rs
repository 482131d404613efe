//! The hot kernel: weighted Gram matrices of one window.
//!
//! For the columns x_0 … x_{p−1} of the design, the right-hand sides that follow them, weights w and
//! noise variances σ² it accumulates (method of one factorisation for every order)
//!
//! - A = Σ w x xᵀ, p × p, and behind each of its rows
//! - b = Σ w x y for every right-hand side y, p × r
//! - B = Σ w² σ² x xᵀ, p × p
//!
//! in `f32` lanes: a window has some hundred pixels, so a lane adds a few dozen products and the sums
//! are good to about 1e-6 of √(A_ii A_jj). The fit's pivot threshold is three orders above that.
//! [`scalar`] is the readable twin, in `f64`; the test compares the two.
//!
//! The order of the sums is that of the lanes. So AVX-512 machines use eight of their lanes here, and give the bits
//! of those with AVX2. `[choice]` One order for all widths instead, sixteen sums that narrower vectors make in turns,
//! takes AVX2 ×2.3 of the time.

use pulp::{Arch, Simd, WithSimd};

/// Columns are stored with a stride that is a multiple of this many samples, zero padded: the widest
/// vector (AVX-512) holds 16, and whatever is not summed uses it.
pub const LANES: usize = 16;

/// The most products that a lane adds one behind the other; longer sums are made of such parts. One sum over a
/// window of 15×15 rounds more, and ξ of a picture whose noise is 1e-4 of its light was off by 2e-3, in four
/// lanes and, by the weights' last digits, in eight.
const CHAIN: usize = 16;

/// The columns of one window: `p` design columns, then `r` right-hand sides, each `stride` long.
#[derive(Debug, Clone, Copy)]
pub struct Columns<'a> {
    /// All columns, one behind the other; finite where there is no sample.
    pub data: &'a [f32],
    /// Samples from one column to the next; a multiple of [`LANES`].
    pub stride: usize,
    /// Number of design columns.
    pub p: usize,
    /// Number of right-hand sides.
    pub r: usize,
    /// Weights, `stride` long, zero where there is no sample.
    pub weights: &'a [f32],
    /// w·σ² per pixel (so that B's factor w²σ² is this times the weight), `stride` long.
    pub weighted_noise: &'a [f32],
}

/// The sums of one window.
#[derive(Debug, Clone, Default)]
pub struct Gram {
    /// Σ w x xᵀ and Σ w x y, row major, p × (p + r).
    pub a: Vec<f32>,
    /// Σ w² σ² x xᵀ, row major, p × p.
    pub b: Vec<f32>,
    /// Scratch: w·x and w²σ²·x of the two columns at hand.
    products: Vec<f32>,
}

/// Fills `gram` from `columns` with the vectors that `arch` offers, eight lanes at the most.
pub fn accumulate(arch: Arch, columns: Columns<'_>, gram: &mut Gram) {
    let Columns { p, r, stride, .. } = columns;
    debug_assert!(stride.is_multiple_of(LANES) && columns.data.len() == (p + r) * stride);
    gram.a.resize(p * (p + r), 0.0);
    gram.b.resize(p * p, 0.0);
    gram.products.resize(4 * stride, 0.0);
    at_most_eight_lanes(arch).dispatch(Kernel { columns, gram });
}

/// AVX2 for AVX-512, any other as it is.
fn at_most_eight_lanes(arch: Arch) -> Arch {
    match arch {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(simd) => Arch::V3(*simd),
        other => other,
    }
}

struct Kernel<'a> {
    columns: Columns<'a>,
    gram: &'a mut Gram,
}

impl WithSimd for Kernel<'_> {
    type Output = ();

    /// Walks the design columns in pairs (i, i+1) and pairs each with the columns j ≥ i in threes, so
    /// that 7 loads feed 12 multiply-adds.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Columns { data, stride, p, r, weights, weighted_noise } = self.columns;
        let Gram { a, b, products } = self.gram;
        let (data, width) = (S::as_simd_f32s(data).0, p + r);
        let (w, wn) = (S::as_simd_f32s(weights).0, S::as_simd_f32s(weighted_noise).0);
        let (products, vectors) = (S::as_mut_simd_f32s(products).0, w.len());
        debug_assert!(vectors * size_of::<S::f32s>() == stride * size_of::<f32>());
        let column = |j: usize| &data[j * vectors..(j + 1) * vectors];

        let mut i = 0;
        while i < p {
            let second = (i + 1).min(p - 1); // an odd last column is paired with itself
            let [u0, u1, v0, v1] = parts_of(products, vectors);
            for ((((((u0, u1), v0), v1), &x0), &x1), (&w, &wn)) in
                u0.iter_mut().zip(u1).zip(v0).zip(v1).zip(column(i)).zip(column(second)).zip(w.iter().zip(wn))
            {
                *u0 = simd.mul_f32s(w, x0);
                *u1 = simd.mul_f32s(w, x1);
                *v0 = simd.mul_f32s(wn, *u0);
                *v1 = simd.mul_f32s(wn, *u1);
            }
            let [u0, u1, v0, v1] = parts_of(products, vectors).map(|part| &*part);
            let mut j = i;
            while j < p {
                let at = [j, (j + 1).min(p - 1), (j + 2).min(p - 1)];
                let sums = dots(simd, [u0, u1, v0, v1], at.map(column));
                for (n, &column) in at.iter().enumerate() {
                    for (row, [of_a, of_b]) in [(i, [0, 2]), (second, [1, 3])] {
                        let [sum_a, sum_b] = [of_a, of_b].map(|k| simd.reduce_sum_f32s(sums[k][n]));
                        (a[row * width + column], a[column * width + row]) = (sum_a, sum_a);
                        (b[row * p + column], b[column * p + row]) = (sum_b, sum_b);
                    }
                }
                j += 3;
            }
            let mut j = p;
            while j < width {
                let at = [j, (j + 1).min(width - 1), (j + 2).min(width - 1)];
                let sums = dots(simd, [u0, u1], at.map(column));
                for (n, &column) in at.iter().enumerate() {
                    a[i * width + column] = simd.reduce_sum_f32s(sums[0][n]);
                    a[second * width + column] = simd.reduce_sum_f32s(sums[1][n]);
                }
                j += 3;
            }
            i += 2;
        }
    }
}

/// The first `N` parts of `length`.
#[inline(always)]
fn parts_of<T, const N: usize>(mut all: &mut [T], length: usize) -> [&mut [T]; N] {
    std::array::from_fn(|_| {
        let (part, rest) = std::mem::take(&mut all).split_at_mut(length);
        all = rest;
        part
    })
}

/// The dot products of `L` columns with three.
#[inline(always)]
fn dots<S: Simd, const L: usize>(
    simd: S,
    left: [&[S::f32s]; L],
    right: [&[S::f32s]; 3],
) -> [[S::f32s; 3]; L] {
    let vectors = right[0].len();
    let mut totals = dots_of_part(simd, left, right, 0, vectors.min(CHAIN));
    let mut start = CHAIN;
    while start < vectors {
        let sums = dots_of_part(simd, left, right, start, vectors.min(start + CHAIN));
        for (totals, sums) in totals.iter_mut().zip(sums) {
            totals.iter_mut().zip(sums).for_each(|(total, sum)| *total = simd.add_f32s(*total, sum));
        }
        start += CHAIN;
    }
    totals
}

/// The same of the vectors from `start` to `end`.
#[inline(always)]
fn dots_of_part<S: Simd, const L: usize>(
    simd: S,
    left: [&[S::f32s]; L],
    right: [&[S::f32s]; 3],
    start: usize,
    end: usize,
) -> [[S::f32s; 3]; L] {
    let mut sums = [[simd.splat_f32s(0.0); 3]; L];
    let (left, right) = (left.map(|column| &column[start..end]), right.map(|column| &column[start..end]));
    for k in 0..end - start {
        let right = right.map(|column| column[k]);
        for (sums, left) in sums.iter_mut().zip(left) {
            for (sum, right) in sums.iter_mut().zip(right) {
                *sum = simd.mul_add_e_f32s(left[k], right, *sum);
            }
        }
    }
    sums
}

/// A way to fill a [`Gram`].
#[cfg(test)]
pub type Tier = Box<dyn Fn(Columns<'_>, &mut Gram)>;

/// Every tier of this machine by name, and those of others as far as lanes go: 4 (NEON, SSE), 8 (AVX2)
/// and 16 (AVX-512), without their fused multiply-add.
#[cfg(test)]
pub fn tiers() -> Vec<(&'static str, Tier)> {
    fn native(arch: Arch) -> Tier {
        Box::new(move |columns, gram| accumulate(arch, columns, gram))
    }
    fn emulated<S: Simd>(simd: S) -> Tier {
        Box::new(move |columns, gram| {
            accumulate(Arch::Scalar, columns, gram); // for the sizes
            Kernel { columns, gram }.with_simd(simd);
        })
    }
    let mut tiers = vec![
        ("the widest", native(Arch::new())),
        ("no vectors", native(Arch::Scalar)),
        ("4 lanes", emulated(pulp::Scalar128b)),
        ("8 lanes", emulated(pulp::Scalar256b)),
        ("16 lanes", emulated(pulp::Scalar512b)),
    ];
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        tiers.push(("AVX2", native(Arch::V3(simd))));
    }
    tiers
}

/// The readable twin of [`accumulate`], summed in `f64`.
#[cfg(test)]
pub fn scalar(columns: Columns<'_>) -> Gram {
    let Columns { data, stride, p, r, weights, weighted_noise } = columns;
    let x = |j: usize, n: usize| f64::from(data[j * stride + n]);
    let sum = |f: &dyn Fn(usize) -> f64| (0..stride).map(f).sum::<f64>() as f32;
    let mut gram = Gram { a: vec![0.0; p * (p + r)], b: vec![0.0; p * p], products: vec![] };
    for i in 0..p {
        let w = |n: usize| f64::from(weights[n]);
        for j in 0..p + r {
            gram.a[i * (p + r) + j] = sum(&|n| w(n) * x(i, n) * x(j, n));
        }
        for j in 0..p {
            gram.b[i * p + j] = sum(&|n| w(n) * f64::from(weighted_noise[n]) * x(i, n) * x(j, n));
        }
    }
    gram
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tier_agrees_with_the_scalar_twin() {
        for (p, r, pixels) in [(1, 3, 5), (2, 1, 16), (12, 6, 361), (21, 9, 361)] {
            let stride = pixels_to_stride(pixels);
            let mut seed = 1u32;
            let mut random = || {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (seed >> 8) as f32 / (1 << 24) as f32 - 0.5
            };
            let mut fill = |columns: usize| {
                let mut data = vec![0.0; columns * stride];
                for column in data.chunks_mut(stride) {
                    column[..pixels].fill_with(&mut random);
                }
                data
            };
            let (data, mut weights, mut noise) = (fill(p + r), fill(1), fill(1));
            weights.iter_mut().chain(&mut noise).for_each(|w| *w = w.abs());
            let columns = Columns { data: &data, stride, p, r, weights: &weights, weighted_noise: &noise };
            let slow = scalar(columns);
            for (tier, sum) in tiers() {
                // What a kernel does not write stays NaN and is found.
                let unwritten = |n: usize| vec![f32::NAN; n];
                let mut fast =
                    Gram { a: unwritten(p * (p + r)), b: unwritten(p * p), products: unwritten(4 * stride) };
                sum(columns, &mut fast);
                for (fast, slow) in [(&fast.a, &slow.a), (&fast.b, &slow.b)] {
                    assert_eq!(fast.len(), slow.len());
                    for (index, (f, s)) in fast.iter().zip(slow).enumerate() {
                        assert!((f - s).abs() < 2e-5, "{tier}, p {p}, entry {index}: {f} against {s}");
                    }
                }
            }
        }
    }

    fn pixels_to_stride(pixels: usize) -> usize {
        pixels.next_multiple_of(LANES)
    }
}
