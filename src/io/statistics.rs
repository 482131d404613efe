//! What the numbers of a channel come to, over the whole picture.

use super::bounds::{NO_SURFACE, is_above_one};
use crate::image::Plane;

/// Of the rows that were added so far. Summed row by row, so that it does not depend on how many are added
/// at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Statistics {
    /// The least and the largest finite value.
    least: f32,
    largest: f32,
    /// Values that are NaN or infinite.
    pub(super) non_finite: usize,
    /// The same of the values that a surface can have.
    least_seen: f32,
    largest_seen: f32,
    /// Values beyond them.
    pub(super) misses: usize,
    /// Values above 1.
    pub(super) above_one: usize,
    /// Of the finite values.
    sum: f64,
    finite: usize,
}

impl Default for Statistics {
    fn default() -> Self {
        let (low, high) = (f32::NEG_INFINITY, f32::INFINITY);
        Self {
            least: high,
            largest: low,
            non_finite: 0,
            least_seen: high,
            largest_seen: low,
            misses: 0,
            above_one: 0,
            sum: 0.0,
            finite: 0,
        }
    }
}

impl Statistics {
    /// Of a whole plane.
    pub(super) fn of(plane: &Plane) -> Self {
        let mut statistics = Self::default();
        statistics.add(plane);
        statistics
    }

    /// Adds the next rows.
    pub(super) fn add(&mut self, rows: &Plane) {
        for y in 0..rows.height() {
            let mut sum = 0.0;
            for &value in rows.row(y) {
                if value.is_finite() {
                    (self.least, self.largest) = (self.least.min(value), self.largest.max(value));
                    self.finite += 1;
                    sum += f64::from(value);
                } else {
                    self.non_finite += 1;
                }
                if value.abs() < NO_SURFACE {
                    self.least_seen = self.least_seen.min(value);
                    self.largest_seen = self.largest_seen.max(value);
                }
                self.misses += usize::from(value.abs() >= NO_SURFACE);
                self.above_one += usize::from(is_above_one(value));
            }
            self.sum += sum;
        }
    }

    /// The least and the largest finite value.
    pub(super) fn range(&self) -> Option<(f32, f32)> {
        (self.least <= self.largest).then_some((self.least, self.largest))
    }

    /// The same of the values that a surface can have.
    pub(super) fn seen(&self) -> Option<(f32, f32)> {
        (self.least_seen <= self.largest_seen).then_some((self.least_seen, self.largest_seen))
    }

    /// The mean of the finite values.
    pub(super) fn mean(&self) -> f32 {
        (self.sum / self.finite as f64) as f32
    }
}
