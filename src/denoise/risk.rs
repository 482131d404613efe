//! The risk ξ of a fit, by its orthonormal components, and what follows from it: the order.
//!
//! In the basis of [`super::fit::Factor`] component i holds the energy g_i = Σ_t z_{t,i}² and the noise
//! d_i. Keeping it with a factor s (1 keeps, 0 drops) changes the expected squared error by
//! - first stage, unbiased (SURE): −(1−(1−s)²) g_i(y) + 2 s d_i, from Σ w y² − Σ w σ²
//! - first stage as published (y put for μ): −(1−(1−s)²) g_i(y) + s² d_i, from Σ w y²
//! - later stages (the pilot put for μ): −(1−(1−s)²) g_i(μ̂) + s² d_i, from Σ w μ̂²
//!
//! so that the nested orders are running sums, and ξ_k = sum_k / Σ w.

use super::basis::Basis;
use super::fit::Factor;
use crate::options::OrderChoice;
use std::ops::Range;

/// What is put for the unknown μ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// The noisy colour, its bias taken out (SURE).
    Unbiased,
    /// The noisy colour as it is.
    Noisy,
    /// The previous stage's reconstruction.
    Pilot,
}

/// The sums over a window that the components do not hold.
#[derive(Debug, Clone, Copy)]
pub struct Totals {
    /// Σ w.
    pub weight: f64,
    /// Σ w t² over the channels of the reference.
    pub energy: f64,
    /// Σ w σ² over the channels.
    pub noise: f64,
}

/// The chosen model of a window.
#[derive(Debug, Clone, Default)]
pub struct Choice {
    /// Factor of every orthonormal component, 0 to 1.
    pub shrink: Vec<f64>,
    /// ξ of the chosen model, mean over the channels, ≥ 0.
    pub xi: f64,
    /// Order with the least risk.
    pub best: usize,
    /// Order of the chosen model: the highest in part where components are shrunk.
    pub order: f32,
}

/// Risks of orders are told apart down to this share of the noise; it keeps their ratios finite.
const RISK_RESOLUTION: f64 = 1e-3;

/// Sharpness of the soft choice: exp(−2 (ξ_k/ξ_min − 1)), method.md §3.
const SOFTNESS: f64 = 2.0;

/// Fills `choice` for the factorised window; `channels` are the reference's right-hand sides.
#[inline(always)]
pub fn choose(
    factor: &Factor,
    basis: &Basis,
    channels: Range<usize>,
    totals: Totals,
    reference: Reference,
    rule: OrderChoice,
    choice: &mut Choice,
) {
    let p = basis.columns();
    let gain = |i: usize| channels.clone().map(|t| factor.z(t)[i].powi(2)).sum::<f64>();
    let change = |i: usize, s: f64| {
        let noise = if reference == Reference::Unbiased { 2.0 * s } else { s * s } * factor.d()[i];
        noise - (1.0 - (1.0 - s) * (1.0 - s)) * gain(i)
    };
    let start = totals.energy - if reference == Reference::Unbiased { totals.noise } else { 0.0 };
    let floor = (totals.noise * RISK_RESOLUTION).max(f64::MIN_POSITIVE);

    let orders = basis.max_order() + 1;
    let mut risks = [f64::INFINITY; 4];
    let (mut sum, mut from) = (start, 0);
    for (order, risk) in risks.iter_mut().enumerate().take(orders) {
        let to = basis.columns_up_to(order);
        sum += (from..to).map(|i| change(i, 1.0)).sum::<f64>();
        from = to;
        *risk = sum.max(floor);
    }
    choice.best = (1..orders).fold(0, |best, k| if risks[k] < risks[best] { k } else { best });

    choice.shrink.clear();
    choice.shrink.resize(p, 0.0);
    match rule {
        OrderChoice::Hard => choice.shrink[..basis.columns_up_to(choice.best)].fill(1.0),
        OrderChoice::Shrink if reference == Reference::Pilot => {
            // (1−s)² g + s² d is least at s = g/(g+d). The constant carries the energy: it stays.
            choice.shrink[0] = 1.0;
            for i in 1..p {
                let g = gain(i);
                choice.shrink[i] = if g > 0.0 { g / (g + factor.d()[i]) } else { 0.0 };
            }
        }
        OrderChoice::Soft | OrderChoice::Shrink => {
            let omega: [f64; 4] =
                std::array::from_fn(|k| (-SOFTNESS * (risks[k] / risks[choice.best] - 1.0)).exp());
            let total: f64 = omega[..orders].iter().sum();
            for (order, share) in omega[..orders].iter().enumerate() {
                let kept = &mut choice.shrink[..basis.columns_up_to(order)];
                kept.iter_mut().for_each(|s| *s += share / total);
            }
        }
    }
    let risk = start + (0..p).map(|i| change(i, choice.shrink[i])).sum::<f64>();
    choice.xi = (risk / totals.weight / 3.0).max(0.0);
    choice.order = (1..orders)
        .map(|k| {
            let block = &choice.shrink[basis.columns_up_to(k - 1)..basis.columns_up_to(k)];
            (block.iter().sum::<f64>() / block.len() as f64) as f32
        })
        .sum();
}
