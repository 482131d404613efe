//! Do the components still sum to the beauty?

use serde::Serialize;

use crate::image::{Plane, Rgb};

/// [choice] Components whose sum deviates by more (RMS, relative to the beauty's) do not sum. A half float's
/// rounding is at most 2⁻¹¹ ≈ 0.0005 of the value, once for each component and once for the beauty.
pub(super) const SUM_TOLERANCE: f64 = 2e-3;

/// How far a sum of pictures is from the picture that it ought to be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Deviation {
    /// The largest difference of a channel of a pixel, in the picture's units.
    pub largest: f64,
    /// The root of the mean squared difference over that of the mean squared picture; NaN where nothing
    /// could be judged.
    pub relative_rms: f64,
    /// Samples that are NaN or infinite in one of the pictures, and so are not judged.
    pub not_finite: usize,
}

/// A set of components and how well it sums to the beauty.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SumCheck {
    /// What the components are.
    pub set: String,
    /// The layers that are summed.
    pub layers: Vec<String>,
    /// Of the noisy pictures, as stored.
    pub before: Deviation,
    /// Of the denoised ones, as computed: 32-bit floats, before they are rounded to the file's pixel types.
    pub after: Option<Deviation>,
}

/// The differences of sums of pictures from the picture that they ought to be, so far. Summed row by row,
/// so that it does not depend on how many rows are added at once.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Differences {
    largest: f64,
    error: f64,
    energy: f64,
    judged: usize,
    not_finite: usize,
}

impl Differences {
    /// Adds the next rows of `total` and of what ought to sum to it.
    pub(super) fn add(&mut self, total: [&Plane; 3], addends: &[[&Plane; 3]]) {
        for y in 0..total[0].height() {
            let (mut error, mut energy) = (0.0, 0.0);
            for (c, plane) in total.iter().enumerate() {
                for (x, &value) in plane.row(y).iter().enumerate() {
                    let value = f64::from(value);
                    let sum: f64 = addends.iter().map(|addend| f64::from(addend[c].get(x, y))).sum();
                    let difference = (sum - value).abs();
                    if !difference.is_finite() {
                        self.not_finite += 1;
                        continue;
                    }
                    self.judged += 1;
                    self.largest = self.largest.max(difference);
                    error += difference * difference;
                    energy += value * value;
                }
            }
            self.error += error;
            self.energy += energy;
        }
    }

    /// What they come to.
    pub(super) fn deviation(&self) -> Deviation {
        let relative_rms = match (self.judged, self.error) {
            (0, _) => f64::NAN,
            (_, 0.0) => 0.0,
            (_, error) => (error / self.energy).sqrt(),
        };
        Deviation { largest: self.largest, relative_rms, not_finite: self.not_finite }
    }
}

impl Deviation {
    /// Of the sum of `addends` from `total`, all of one size.
    pub(super) fn of(total: &Rgb, addends: &[&Rgb]) -> Self {
        let addends: Vec<_> = addends.iter().map(|addend| addend.each_ref()).collect();
        let mut differences = Differences::default();
        differences.add(total.each_ref(), &addends);
        differences.deviation()
    }

    /// Whether the sum is the picture up to the rounding of half floats.
    pub fn is_small(&self) -> bool {
        self.relative_rms < SUM_TOLERANCE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_that_lacks_a_tenth_deviates_by_a_tenth_and_nan_is_counted() {
        let grey = |v: f32| -> Rgb { std::array::from_fn(|_| Plane::filled(4, 3, v)) };
        let (total, mut a, b) = (grey(2.0), grey(1.5), grey(0.5));
        let exact = Deviation::of(&total, &[&a, &b]);
        assert_eq!(exact, Deviation { largest: 0.0, relative_rms: 0.0, not_finite: 0 });
        let lacking = Deviation::of(&total, &[&a, &grey(0.3)]);
        assert!((lacking.relative_rms - 0.1).abs() < 1e-6 && (lacking.largest - 0.2).abs() < 1e-6);
        assert!(exact.is_small() && !lacking.is_small());
        a[1].data_mut()[5] = f32::NAN;
        assert_eq!(Deviation::of(&total, &[&a, &b]).not_finite, 1);
        let nothing = Deviation::of(&total, &[&grey(f32::NAN)]);
        assert!(nothing.relative_rms.is_nan() && !nothing.is_small(), "{nothing:?}");
    }
}
