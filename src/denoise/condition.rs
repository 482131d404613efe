//! Columns of a window are brought to where `f32` sums are good: about zero and of size one.
//!
//! The model holds a constant in every order, so that a shift of a feature, a monomial or a right-hand
//! side changes nothing but the rounding: a depth at 1e6, or light a thousand times its noise, would
//! else leave only the last digits for what varies. It also makes a pivot the share of a column's
//! *variation* that is new, which does not depend on where the column's zero is.

use super::gram::LANES;
use pulp::Simd;

/// Columns are enlarged by no more than 2^60: pixels without weight must stay finite too.
const LARGEST_SCALE: f32 = (1u64 << 60) as f32;

/// Takes the weighted mean out of `column` and returns what was taken out (`column` and `weights`, which sum
/// to `total`, are whole vectors long; where there is no sample the weight is zero). The mean is good to some
/// 1e-6 of the values: near enough, for it is the very number returned that has been taken out.
#[inline(always)]
pub fn centre<S: Simd>(simd: S, column: &mut [f32], weights: &[f32], total: f32) -> f32 {
    let mean = if total > 0.0 { weighted_sum(simd, column, weights) / total } else { 0.0 };
    let all = simd.splat_f32s(mean);
    S::as_mut_simd_f32s(column).0.iter_mut().for_each(|x| *x = simd.sub_f32s(*x, all));
    mean
}

/// Σ w x, lane by lane.
#[inline(always)]
pub fn weighted_sum<S: Simd>(simd: S, column: &[f32], weights: &[f32]) -> f32 {
    let (column, weights) = (S::as_simd_f32s(column).0, S::as_simd_f32s(weights).0);
    let turns = turns::<S>();
    let mut sums = [simd.splat_f32s(0.0); LANES];
    for (x, w) in column.chunks_exact(turns).zip(weights.chunks_exact(turns)) {
        for k in 0..turns {
            sums[k] = simd.mul_add_e_f32s(w[k], x[k], sums[k]);
        }
    }
    joined(simd, sums)
}

/// Σ w, lane by lane.
#[inline(always)]
pub fn total<S: Simd>(simd: S, weights: &[f32]) -> f32 {
    let turns = turns::<S>();
    let mut sums = [simd.splat_f32s(0.0); LANES];
    for w in S::as_simd_f32s(weights).0.chunks_exact(turns) {
        for k in 0..turns {
            sums[k] = simd.add_f32s(sums[k], w[k]);
        }
    }
    joined(simd, sums)
}

/// Vectors that make [`LANES`] sums, however narrow they are: a sum of all samples one behind the other would
/// round more.
#[inline(always)]
fn turns<S: Simd>() -> usize {
    LANES * size_of::<f32>() / size_of::<S::f32s>()
}

/// The sum of all [`LANES`] lanes by halves, in the order in which those of one vector are added: the bits do not
/// depend on its width.
#[inline(always)]
fn joined<S: Simd>(simd: S, mut sums: [S::f32s; LANES]) -> f32 {
    let mut half = turns::<S>() / 2;
    while half > 0 {
        (0..half).for_each(|k| sums[k] = simd.add_f32s(sums[k], sums[k + half]));
        half /= 2;
    }
    simd.reduce_sum_f32s(sums[0])
}

/// Σ w x², lane by lane in `f64`: what explains nearly all of it is subtracted from it.
#[inline(always)]
pub fn energy(column: &[f32], weights: &[f32]) -> f64 {
    let mut sums = [0.0f64; LANES];
    for (x, w) in column.chunks_exact(LANES).zip(weights.chunks_exact(LANES)) {
        for lane in 0..LANES {
            sums[lane] += f64::from(x[lane]).powi(2) * f64::from(w[lane]);
        }
    }
    sums.iter().sum()
}

/// The largest magnitude in `column`.
#[inline(always)]
pub fn largest<S: Simd>(simd: S, column: &[f32]) -> f32 {
    let largest = |largest, &x| simd.max_f32s(simd.abs_f32s(x), largest);
    simd.reduce_max_f32s(S::as_simd_f32s(column).0.iter().fold(simd.splat_f32s(0.0), largest))
}

/// Multiplies `column` by the power of two that brings the largest value of any weight to about 1, and returns it.
#[inline(always)]
pub fn level<S: Simd>(simd: S, column: &mut [f32], weights: &[f32]) -> f32 {
    let column = S::as_mut_simd_f32s(column).0;
    let (none, mut largest) = (simd.splat_f32s(0.0), simd.splat_f32s(0.0));
    for (&x, &w) in column.iter().zip(S::as_simd_f32s(weights).0) {
        let value = simd.select_f32s(simd.greater_than_f32s(w, none), simd.abs_f32s(x), none);
        largest = simd.max_f32s(value, largest);
    }
    let scale = power_of_two_near_inverse(simd.reduce_max_f32s(largest)).min(LARGEST_SCALE);
    let all = simd.splat_f32s(scale);
    column.iter_mut().for_each(|x| *x = simd.mul_f32s(*x, all));
    scale
}

/// 2^−e for a value of 2^e to 2^(e+1), without leaving the normal numbers; 1 for 0.
#[inline(always)]
pub fn power_of_two_near_inverse(value: f32) -> f32 {
    const EXPONENT: u32 = 0x7f80_0000;
    if value == 0.0 {
        return 1.0;
    }
    let inverse = (254u32 << 23).saturating_sub(value.to_bits() & EXPONENT).max(1 << 23);
    f32::from_bits(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_is_centred_where_it_has_weight_and_levelled_there() {
        let mut column = [0.0; LANES];
        column[..4].copy_from_slice(&[1e6, 1e6 + 2.0, 1e6 + 4.0, 7.0]);
        let mut weights = [0.0; LANES];
        weights[..3].copy_from_slice(&[1.0, 2.0, 1.0]);
        let mean = centre(pulp::Scalar, &mut column, &weights, total(pulp::Scalar, &weights));
        assert!((mean - 1_000_002.0).abs() < 1.0);
        assert_eq!(column[2] - column[0], 4.0);
        assert_eq!(column[4], -mean, "without weight, and so without meaning");
        column[..4].copy_from_slice(&[3e-20, -1e-20, 0.0, 1.0]);
        assert_eq!(level(pulp::Scalar, &mut column, &weights), LARGEST_SCALE);
        assert_eq!(column[0], 3e-20 * LARGEST_SCALE);
        assert!(column[3].is_finite());
    }

    #[test]
    fn sums_do_not_depend_on_the_width() {
        let [column, weights] =
            [7, 11].map(|n| std::array::from_fn::<_, 240, _>(|i| ((i * i) % n) as f32 / 3.0));
        fn sums<S: Simd>(simd: S, column: &[f32], weights: &[f32]) -> [u32; 2] {
            [weighted_sum(simd, column, weights), total(simd, weights)].map(f32::to_bits)
        }
        let one = sums(pulp::Scalar, &column, &weights);
        assert_eq!(sums(pulp::Scalar128b, &column, &weights), one);
        assert_eq!(sums(pulp::Scalar256b, &column, &weights), one);
        assert_eq!(sums(pulp::Scalar512b, &column, &weights), one);
    }

    #[test]
    fn the_scale_is_an_exact_power_of_two() {
        assert_eq!(power_of_two_near_inverse(1.0), 1.0);
        assert_eq!(power_of_two_near_inverse(1.9), 1.0);
        assert_eq!(power_of_two_near_inverse(8.5), 0.125);
        assert_eq!(power_of_two_near_inverse(0.25), 4.0);
        assert_eq!(power_of_two_near_inverse(0.0), 1.0);
        assert!(power_of_two_near_inverse(1e38) >= f32::MIN_POSITIVE);
        assert!(power_of_two_near_inverse(1e-40).is_finite());
    }
}
