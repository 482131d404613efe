//! Columns of a window are brought to where `f32` sums are good: about zero and of size one.
//!
//! The model holds a constant in every order, so that a shift of a feature, a monomial or a right-hand
//! side changes nothing but the rounding: a depth at 1e6, or light a thousand times its noise, would
//! else leave only the last digits for what varies. It also makes a pivot the share of a column's
//! *variation* that is new, which does not depend on where the column's zero is.

use super::gram::LANES;

/// Columns are enlarged by no more than 2^60: pixels without weight must stay finite too.
const LARGEST_SCALE: f32 = (1u64 << 60) as f32;

/// Takes the weighted mean out of `column` and returns what was taken out (`column` and `weights`, which sum
/// to `total`, are whole vectors long; where there is no sample the weight is zero). The mean is good to some
/// 1e-6 of the values: near enough, for it is the very number returned that has been taken out.
#[inline(always)]
pub fn centre(column: &mut [f32], weights: &[f32], total: f32) -> f32 {
    let mean = if total > 0.0 { weighted_sum(column, weights) / total } else { 0.0 };
    column.iter_mut().for_each(|x| *x -= mean);
    mean
}

/// Σ w x, lane by lane.
#[inline(always)]
pub fn weighted_sum(column: &[f32], weights: &[f32]) -> f32 {
    let mut sums = [0.0f32; LANES];
    for (x, w) in column.chunks_exact(LANES).zip(weights.chunks_exact(LANES)) {
        for lane in 0..LANES {
            sums[lane] += w[lane] * x[lane];
        }
    }
    sums.iter().sum()
}

/// Σ w, lane by lane.
#[inline(always)]
pub fn total(weights: &[f32]) -> f32 {
    let mut sums = [0.0f32; LANES];
    for w in weights.chunks_exact(LANES) {
        for lane in 0..LANES {
            sums[lane] += w[lane];
        }
    }
    sums.iter().sum()
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
pub fn largest(column: &[f32]) -> f32 {
    let mut largest = [0.0f32; LANES];
    for x in column.chunks_exact(LANES) {
        for lane in 0..LANES {
            let value = x[lane].abs();
            largest[lane] = if value > largest[lane] { value } else { largest[lane] };
        }
    }
    largest.into_iter().fold(0.0, f32::max)
}

/// Multiplies `column` by the power of two that brings the largest value of any weight to about 1.
#[inline(always)]
pub fn level(column: &mut [f32], weights: &[f32]) {
    let mut largest = [0.0f32; LANES];
    for (x, w) in column.chunks_exact(LANES).zip(weights.chunks_exact(LANES)) {
        for lane in 0..LANES {
            let value = if w[lane] > 0.0 { x[lane].abs() } else { 0.0 };
            largest[lane] = if value > largest[lane] { value } else { largest[lane] };
        }
    }
    let scale = power_of_two_near_inverse(largest.into_iter().fold(0.0, f32::max)).min(LARGEST_SCALE);
    column.iter_mut().for_each(|x| *x *= scale);
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
        let mean = centre(&mut column, &weights, total(&weights));
        assert!((mean - 1_000_002.0).abs() < 1.0);
        assert_eq!(column[2] - column[0], 4.0);
        assert_eq!(column[4], -mean, "without weight, and so without meaning");
        column[..4].copy_from_slice(&[3e-20, -1e-20, 0.0, 1.0]);
        level(&mut column, &weights);
        assert_eq!(column[0], 3e-20 * LARGEST_SCALE);
        assert!(column[3].is_finite());
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
