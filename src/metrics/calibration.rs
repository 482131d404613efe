//! Is the estimated error true? How well a denoiser knows what it got wrong.

use super::{mean, rel_mse, relative_mean};
use crate::error::{Error, ErrorKind, Result};
use crate::image::{Plane, Rgb};

/// Pixels are sorted by their estimate and cut into this many groups, equal in size to one.
const GROUPS: usize = 10;

/// The estimated squared error beside the true one, both relative as in relMSE: of the absolute ones a few bright
/// pixels are the most.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Calibration {
    /// Mean estimate over mean true error: 1 is unbiased, less is too confident. `null` in JSON
    /// (infinite or NaN) when the result is exact.
    pub ratio: f64,
    /// Spearman's rank correlation between both, over pixels, −1 to 1; NaN when either is constant.
    /// A pixel's true error is one draw of a random variable, so even a perfect estimate of its
    /// expectation stays clearly under 1.
    pub rank_correlation: f64,
    /// Groups of pixels of rising estimate: (mean estimate, mean true error). Averaged over many
    /// pixels the draws' chance is gone: a calibrated estimate gives equal pairs.
    pub groups: Vec<(f64, f64)>,
}

/// Judges the estimated error `mse` (squared error averaged over the channels, one value a pixel), which is held
/// against the mean of the reference's channels squared.
///
/// # Errors
/// When the sizes differ or a pixel of the pictures or the estimate is NaN or infinite.
pub fn calibration(mse: &Plane, result: &Rgb, reference: &Rgb) -> Result<Calibration> {
    let truth = rel_mse(result, reference)?.plane;
    if mse.size() != reference[0].size() {
        return Err(Error::new(ErrorKind::Lacking, "the estimated error differs from the picture in size"));
    }
    if let Some(i) = mse.data().iter().position(|value| !value.is_finite()) {
        let (x, y) = (i % mse.width(), i / mse.width());
        return Err(Error::new(
            ErrorKind::Lacking,
            format!("the estimated error is not finite at pixel ({x}, {y})"),
        ));
    }
    let values = |plane: Plane| plane.data().iter().map(|&value| f64::from(value)).collect::<Vec<_>>();
    let [truth, estimate] = [truth, relative_mean(mse, reference)].map(values);
    let mut by_estimate: Vec<usize> = (0..truth.len()).collect();
    by_estimate.sort_by(|&a, &b| estimate[a].total_cmp(&estimate[b]).then(a.cmp(&b)));
    let place = |g: usize| g * by_estimate.len() / GROUPS;
    let groups = (0..GROUPS).map(|g| &by_estimate[place(g)..place(g + 1)]);
    let group = |members: &[usize]| {
        let of = |values: &[f64]| members.iter().map(|&i| values[i]).sum::<f64>() / members.len() as f64;
        (of(&estimate), of(&truth))
    };
    Ok(Calibration {
        ratio: mean(&estimate) / mean(&truth),
        rank_correlation: correlation(&ranks(&estimate), &ranks(&truth)),
        groups: groups.filter(|members| !members.is_empty()).map(group).collect(),
    })
}

/// Each value's place in the sorted order; equal values share their mean place.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    for tie in order.chunk_by(|&a, &b| values[a] == values[b]) {
        let place = first as f64 + (tie.len() - 1) as f64 / 2.0;
        tie.iter().for_each(|&i| ranks[i] = place);
        first += tie.len();
    }
    ranks
}

/// Pearson's correlation.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - mean_a, b - mean_b);
        (ab, aa, bb) = (ab + a * b, aa + a * a, bb + b * b);
    }
    ab / (aa * bb).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::REL_MSE_EPSILON;

    fn black(width: usize, height: usize) -> Rgb {
        std::array::from_fn(|_| Plane::filled(width, height, 0.0))
    }

    #[test]
    fn an_estimate_that_is_twice_the_truth_is_correlated_and_off_by_two() {
        let error = |x: usize, y: usize| (1 + x + 10 * y) as f32;
        let result: Rgb = std::array::from_fn(|_| Plane::from_fn(10, 5, error));
        let mse = Plane::from_fn(10, 5, |x, y| 2.0 * error(x, y) * error(x, y));
        let c = calibration(&mse, &result, &black(10, 5)).unwrap();
        assert!((c.ratio - 2.0).abs() < 1e-9 && (c.rank_correlation - 1.0).abs() < 1e-12);
        assert_eq!(c.groups.len(), GROUPS);
        assert!(c.groups.iter().all(|(estimate, truth)| (estimate / truth - 2.0).abs() < 1e-6));
        let first = (1.0 + 4.0 + 9.0 + 16.0 + 25.0) / 5.0 / REL_MSE_EPSILON;
        assert!((c.groups[0].1 / first - 1.0).abs() < 1e-6, "relative to black, which is ε");
    }

    #[test]
    fn the_opposite_order_gives_minus_one_and_ties_share_their_rank() {
        let result: Rgb = std::array::from_fn(|_| Plane::from_fn(6, 1, |x, _| x as f32));
        let mse = Plane::from_fn(6, 1, |x, _| 6.0 - x as f32);
        assert!((calibration(&mse, &result, &black(6, 1)).unwrap().rank_correlation + 1.0).abs() < 1e-12);
        assert_eq!(ranks(&[3.0, 1.0, 3.0, 0.0]), [2.5, 1.0, 2.5, 0.0]);
    }

    #[test]
    fn groups_are_equal_and_as_many_as_there_are_pixels_for() {
        let groups = |pixels: usize| {
            let mse = Plane::from_fn(pixels, 1, |x, _| x as f32);
            calibration(&mse, &black(pixels, 1), &black(pixels, 1)).unwrap().groups
        };
        let last: Vec<_> =
            groups(21)[8..].iter().map(|group| (group.0 * REL_MSE_EPSILON * 100.0).round()).collect();
        assert_eq!(last, [1650.0, 1900.0]);
        assert_eq!([0, 3, 10, 21].map(|pixels| groups(pixels).len()), [0, 3, 10, 10]);
    }

    #[test]
    fn an_estimate_that_is_not_finite_is_named() {
        let mut mse = Plane::filled(4, 3, 1.0);
        mse.data_mut()[6] = f32::NAN;
        let message = calibration(&mse, &black(4, 3), &black(4, 3)).unwrap_err().to_string();
        assert!(message.contains("(2, 1)"), "{message}");
    }
}
