//! The columns of the design, ordered so that the models of order 0, 1, 2, 3 nest.
//!
//! [1 | features | x, y | x², xy, y² | x³, x²y, xy², y³], x and y relative to the centre in units of the
//! window's radius, features relative to the centre's.

use super::samples::Samples;
use crate::image::Plane;

/// Exponents of x and y, order by order.
const MONOMIALS: [(i32, i32); 9] = [(1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)];

/// Columns of the polynomial up to order 0, 1, 2, 3, without the constant.
const MONOMIALS_UP_TO: [usize; 4] = [0, 2, 5, 9];

/// The design of all windows of one radius.
#[derive(Debug, Clone)]
pub struct Basis {
    radius: usize,
    features: usize,
    max_order: usize,
    /// The monomials over a full window, one behind the other.
    monomials: Vec<f32>,
}

impl Basis {
    /// A basis of `features` planes and polynomials up to `max_order`.
    pub fn new(radius: usize, features: usize, max_order: usize) -> Self {
        let side = 2 * radius + 1;
        let coordinate = |i: usize| (i as f32 - radius as f32) / radius as f32;
        let mut monomials = Vec::new();
        for (a, b) in &MONOMIALS[..MONOMIALS_UP_TO[max_order]] {
            for y in 0..side {
                monomials.extend((0..side).map(|x| coordinate(x).powi(*a) * coordinate(y).powi(*b)));
            }
        }
        Self { radius, features, max_order, monomials }
    }

    /// Number of columns of the model of `order`.
    pub fn columns_up_to(&self, order: usize) -> usize {
        1 + self.features + MONOMIALS_UP_TO[order]
    }

    /// Number of columns of the largest model.
    pub fn columns(&self) -> usize {
        self.columns_up_to(self.max_order)
    }

    /// The highest order.
    pub fn max_order(&self) -> usize {
        self.max_order
    }

    /// Writes the columns of the samples of one frame, each `stride` long; beyond the samples nothing is
    /// written. From every feature its value at the centre, `centre`, is taken.
    #[inline(always)]
    pub fn fill(
        &self,
        samples: &Samples,
        frame: usize,
        features: &[Plane],
        centre: impl Fn(usize) -> f32,
        columns: &mut [f32],
    ) {
        let part = samples.of_frame(frame);
        let mut columns = columns.chunks_exact_mut(samples.stride()).map(|column| &mut column[part.clone()]);
        if let Some(constant) = columns.next() {
            constant.fill(1.0);
        }
        for ((f, feature), column) in features.iter().enumerate().zip(&mut columns) {
            samples.gather(feature, part.clone(), centre(f), column);
        }
        let side = 2 * self.radius + 1;
        let spots = samples.spots(part.clone());
        for (monomial, column) in self.monomials.chunks_exact(side * side).zip(columns) {
            for (value, spot) in column.iter_mut().zip(spots) {
                *value = monomial[usize::from(spot[1]) * side + usize::from(spot[0])];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::window::Window;
    use super::*;

    #[test]
    fn a_clipped_window_has_the_columns_of_its_place() {
        let feature = Plane::from_fn(6, 4, |x, y| (x + 100 * y) as f32);
        let window = Window::new(1, 3, 2, (6, 4)); // columns 0..4, rows 1..4
        let basis = Basis::new(2, 1, 2);
        assert_eq!((basis.columns(), basis.columns_up_to(0)), (7, 2));
        let mut samples = Samples::default();
        samples.add_frame(&window, 2, 6, &[0.0; 40], 1.0, None);
        let stride = samples.stride();
        let mut out = vec![0.0; basis.columns() * stride];
        basis.fill(&samples, 0, std::slice::from_ref(&feature), |_| feature.get(1, 3), &mut out);
        let at = |column: usize, x: usize, y: usize| out[column * stride + (y - 1) * 4 + x];
        assert_eq!(at(0, 3, 2), 1.0);
        assert_eq!(at(1, 3, 2), feature.get(3, 2) - feature.get(1, 3));
        assert_eq!((at(2, 3, 2), at(3, 3, 2)), (1.0, -0.5));
        assert_eq!((at(4, 3, 2), at(5, 3, 2), at(6, 3, 2)), (1.0, -0.5, 0.25));
        assert_eq!(out[stride - 1], 0.0);
    }
}
