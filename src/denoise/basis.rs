//! The columns of the design, ordered so that the models of order 0, 1, 2, 3 nest.
//!
//! [1 | features | x, y | x², xy, y² | x³, x²y, xy², y³], x and y relative to the centre in units of the
//! window's radius, features relative to the centre's.

use super::samples::Samples;
use crate::image::Plane;

/// Of which two earlier monomials each is the product, order by order, from x² on behind x and y.
const PRODUCTS: [(usize, usize); 7] = [(0, 0), (0, 1), (1, 1), (2, 0), (2, 1), (0, 4), (4, 1)];

/// Columns of the polynomial up to order 0, 1, 2, 3, without the constant.
const MONOMIALS_UP_TO: [usize; 4] = [0, 2, 5, 9];

/// The design of all windows of one radius.
#[derive(Debug, Clone)]
pub struct Basis {
    features: usize,
    max_order: usize,
    /// x or y of the columns or rows of a full window.
    coordinates: Vec<f32>,
}

impl Basis {
    /// A basis of `features` planes and polynomials up to `max_order`.
    pub fn new(radius: usize, features: usize, max_order: usize) -> Self {
        let coordinates = (0..=2 * radius).map(|i| (i as f32 - radius as f32) / radius as f32).collect();
        Self { features, max_order, coordinates }
    }

    /// Number of columns of the model of `order`.
    pub fn columns_up_to(&self, order: usize) -> usize {
        1 + self.features + MONOMIALS_UP_TO[order]
    }

    /// The lowest order whose model holds `column`.
    pub fn order_of(&self, column: usize) -> usize {
        (0..self.max_order).find(|order| column < self.columns_up_to(*order)).unwrap_or(self.max_order)
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
        let (part, stride) = (samples.of_frame(frame), samples.stride());
        let (constant, rest) = columns.split_at_mut(stride);
        let (of_features, monomials) = rest.split_at_mut(self.features * stride);
        constant[part.clone()].fill(1.0);
        for ((f, feature), column) in features.iter().enumerate().zip(of_features.chunks_exact_mut(stride)) {
            samples.gather(feature, frame, centre(f), &mut column[part.clone()]);
        }
        let monomials = &mut monomials[..MONOMIALS_UP_TO[self.max_order] * stride];
        for (axis, column) in monomials.chunks_exact_mut(stride).take(2).enumerate() {
            for (value, spot) in column[part.clone()].iter_mut().zip(samples.spots(part.clone())) {
                *value = self.coordinates[usize::from(spot[axis])];
            }
        }
        for (n, &(a, b)) in (2..monomials.len() / stride).zip(&PRODUCTS) {
            let (earlier, new) = monomials.split_at_mut(n * stride);
            let factor = |of: usize| &earlier[of * stride..][part.clone()];
            for ((value, a), b) in new[part.clone()].iter_mut().zip(factor(a)).zip(factor(b)) {
                *value = a * b;
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
        samples.add_frame(&window, 2, 6, &[0.0; 80], 1.0, None);
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
