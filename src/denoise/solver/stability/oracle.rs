//! The oracle: a window's weighted least squares the slow way, in `f64`, column by column and pixel by
//! pixel. It shares no arithmetic with the fast path: no normal equations, no Cholesky, no nesting.
#![cfg(test)]

use crate::denoise::fit::PIVOT_THRESHOLD;
use crate::denoise::risk::Reference;
use nalgebra::{DMatrix, DVector};

/// What rounding leaves of a column that the columns before it explain, as a share of its length.
const ROUNDING: f64 = 1e-13;

/// A window's problem: what the fast path is given, in `f64`.
pub struct Oracle {
    /// Columns as they are in the picture: features neither centred nor scaled.
    design: DMatrix<f64>,
    /// Weight of every pixel.
    weights: DVector<f64>,
    /// σ² of every pixel, summed over the channels.
    noise: DVector<f64>,
    /// Columns that those before them do not explain.
    kept: Vec<usize>,
}

/// A model's hat matrix and its fitted values at pixels of no weight too.
pub struct Model {
    /// H over all pixels, H_ij = 0 for pixels j of no weight.
    hat: DMatrix<f64>,
}

impl Oracle {
    /// Decides which columns to keep: by the model's rule, a column of which the columns before it
    /// leave no more than [`PIVOT_THRESHOLD`] of its energy about its mean adds nothing.
    pub fn new(design: DMatrix<f64>, weights: DVector<f64>, noise: DVector<f64>) -> Self {
        // A decomposition of NaN would not end.
        assert!(
            design.iter().chain(&weights).chain(&noise).all(|v| v.is_finite()),
            "the input is not finite"
        );
        let root = weights.map(f64::sqrt);
        let total = weights.sum();
        let mut basis: Vec<DVector<f64>> = vec![];
        let mut kept = vec![];
        for (j, column) in design.column_iter().enumerate() {
            let mean = if j == 0 { 0.0 } else { column.dot(&weights) / total };
            let energy = column.add_scalar(-mean).component_mul(&root).norm_squared();
            let whole = column.component_mul(&root);
            let mut rest = whole.clone();
            for _twice in 0..2 {
                basis.iter().for_each(|q| rest -= q * q.dot(&rest));
            }
            let least = (PIVOT_THRESHOLD * energy).max((ROUNDING * whole.norm()).powi(2));
            if rest.norm_squared() > least {
                basis.push(rest.normalize());
                kept.push(j);
            }
        }
        Self { design, weights, noise, kept }
    }

    /// Number of columns kept.
    pub fn rank(&self) -> usize {
        self.kept.len()
    }

    /// Condition number of √W X with its columns as they come; ∞ when it is singular to rounding.
    pub fn condition(&self) -> f64 {
        let root = self.weights.map(f64::sqrt);
        let weighted =
            DMatrix::from_fn(self.design.nrows(), self.design.ncols(), |i, j| root[i] * self.design[(i, j)]);
        let values = weighted.singular_values();
        let (largest, least) = (values.max(), values.min());
        if least > f64::EPSILON * largest { largest / least } else { f64::INFINITY }
    }

    /// The model of the first `columns` columns, H = X (√W X)⁺ √W by singular values.
    pub fn model(&self, columns: usize) -> Model {
        let kept: Vec<usize> = self.kept.iter().copied().filter(|&j| j < columns).collect();
        let root = self.weights.map(f64::sqrt);
        let n = self.design.nrows();
        let unit = |j: usize| self.design.column(j).component_mul(&root).norm().recip();
        let scaled = DMatrix::from_fn(n, kept.len(), |i, k| self.design[(i, kept[k])] * unit(kept[k]));
        let weighted = DMatrix::from_fn(n, kept.len(), |i, k| root[i] * scaled[(i, k)]);
        let inverse = weighted.svd(true, true).pseudo_inverse(0.0).expect("both sides were asked for");
        let mut hat = scaled * inverse;
        for (mut column, root) in hat.column_iter_mut().zip(&root) {
            column *= *root;
        }
        Model { hat }
    }

    /// ξ of a model from its hat matrix (method §1), mean over the channels of `reference`: bias and
    /// variance, pixel by pixel; in the unbiased first stage the residual less the noise it holds.
    pub fn risk(&self, model: &Model, channels: &[DVector<f64>], reference: Reference) -> f64 {
        let (h, w, v) = (&model.hat, &self.weights, &self.noise);
        let bias: f64 =
            channels.iter().map(|mu| (h * mu - mu).component_mul(&w.map(f64::sqrt)).norm_squared()).sum();
        let noise: f64 = match reference {
            Reference::Unbiased => (0..w.len()).map(|i| w[i] * v[i] * (2.0 * h[(i, i)] - 1.0)).sum(),
            Reference::Noisy | Reference::Pilot => {
                (0..w.len()).map(|i| w[i] * h.row(i).iter().zip(v).map(|(h, v)| h * h * v).sum::<f64>()).sum()
            }
        };
        (bias + noise) / (w.sum() * channels.len() as f64)
    }
}

impl Model {
    /// Fitted values at every pixel.
    pub fn fitted(&self, y: &DVector<f64>) -> DVector<f64> {
        &self.hat * y
    }
}
