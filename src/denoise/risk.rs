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
    /// Order with the least risk; where components are shrunk, the nearest to what is kept.
    pub best: usize,
    /// Order of the chosen model: the highest in part where components are shrunk.
    pub order: f32,
}

/// Risks of orders are told apart down to this share of the noise; it keeps their ratios finite.
pub const RISK_RESOLUTION: f64 = 1e-3;

/// Sharpness of the soft choice, exp(−8 (ξ_k/ξ_min − 1)). `[choice]` of 2, 4 and 8: relMSE ×1, ×0.999 and ×0.997 on
/// five scenes and on thirteen others (16 to 256 spp).
const SOFTNESS: f64 = 8.0;

/// A factorised window, as the risk sees it.
#[derive(Debug, Clone)]
pub struct Evidence<'a> {
    /// The factorisation.
    pub factor: &'a Factor,
    /// The right-hand sides that are the reference's channels.
    pub channels: Range<usize>,
    /// What is put for the unknown μ.
    pub reference: Reference,
    /// What the components do not hold.
    pub totals: Totals,
}

impl Evidence<'_> {
    /// g of component `i`.
    fn gain(&self, i: usize) -> f64 {
        self.channels.clone().map(|t| self.factor.z(t)[i].powi(2)).sum()
    }

    /// What keeping component `i` with the factor `s` changes.
    fn change(&self, i: usize, s: f64) -> f64 {
        let noise = if self.reference == Reference::Unbiased { 2.0 * s } else { s * s } * self.factor.d()[i];
        noise - (1.0 - (1.0 - s) * (1.0 - s)) * self.gain(i)
    }

    /// The risk of keeping nothing.
    fn start(&self) -> f64 {
        self.totals.energy - if self.reference == Reference::Unbiased { self.totals.noise } else { 0.0 }
    }

    /// ξ_k of every order, mean over the channels; ∞ beyond the highest.
    #[inline(always)]
    pub fn xi(&self, basis: &Basis) -> [f64; 4] {
        let (mut sum, mut from) = (self.start(), 0);
        let mut xi = [f64::INFINITY; 4];
        for (order, xi) in xi.iter_mut().enumerate().take(basis.max_order() + 1) {
            let to = basis.columns_up_to(order);
            sum += (from..to).map(|i| self.change(i, 1.0)).sum::<f64>();
            from = to;
            *xi = self.mean(sum);
        }
        xi
    }

    /// The lowest order whose residual no higher one undercuts: RSS falls by the gain of every column.
    fn least_residual(&self, basis: &Basis) -> usize {
        let gains = |order: usize| {
            let block = basis.columns_up_to(order - 1)..basis.columns_up_to(order);
            block.map(|i| self.gain(i)).sum::<f64>()
        };
        (1..=basis.max_order()).filter(|&order| gains(order) > 0.0).max().unwrap_or(0)
    }

    /// Shrinks every component by itself: (1−s)² g + s² d is least at s = g/(g+d), g without the noise that the pilot
    /// still holds. `[choice]` all of it, against half: relMSE ×0.998 on five scenes and ×0.996 on thirteen others (16 to
    /// 256 spp), against none ×0.994 and ×0.989. The constant carries the energy: it stays.
    fn shrink(&self, shrink: &mut [f64]) {
        shrink[0] = 1.0;
        for (i, s) in shrink.iter_mut().enumerate().skip(1) {
            let d = self.factor.d()[i];
            let g = (self.gain(i) - d).max(0.0);
            *s = if g > 0.0 { g / (g + d) } else { 0.0 };
        }
    }

    /// Keeps the order with the least risk, which it returns, or all orders by their risks.
    #[inline(always)]
    fn keep(&self, basis: &Basis, rule: OrderChoice, shrink: &mut [f64]) -> usize {
        let orders = basis.max_order() + 1;
        let floor = self.mean(self.totals.noise * RISK_RESOLUTION).max(f64::MIN_POSITIVE);
        let risks = self.xi(basis).map(|xi| xi.max(floor));
        let best = match rule {
            OrderChoice::Residual => self.least_residual(basis),
            _ => (1..orders).fold(0, |best, k| if risks[k] < risks[best] { k } else { best }),
        };
        if matches!(rule, OrderChoice::Hard | OrderChoice::Residual) {
            shrink[..basis.columns_up_to(best)].fill(1.0);
            return best;
        }
        #[expect(clippy::disallowed_methods, reason = "a last bit more changed none of 25 pictures")]
        let omega: [f64; 4] = std::array::from_fn(|k| (-SOFTNESS * (risks[k] / risks[best] - 1.0)).exp());
        let total: f64 = omega[..orders].iter().sum();
        for (order, share) in omega[..orders].iter().enumerate() {
            shrink[..basis.columns_up_to(order)].iter_mut().for_each(|s| *s += share / total);
        }
        best
    }

    /// The order of what is kept: of every order that share of its columns.
    #[inline(always)]
    fn order(&self, basis: &Basis, shrink: &[f64]) -> f32 {
        let mut kept = [0.0; 4];
        self.factor.order().iter().zip(shrink).for_each(|(column, s)| kept[basis.order_of(*column)] += s);
        let share = |k: usize| kept[k] / (basis.columns_up_to(k) - basis.columns_up_to(k - 1)) as f64;
        (1..=basis.max_order()).map(share).sum::<f64>() as f32
    }

    /// A sum over pixels and channels as a mean.
    fn mean(&self, sum: f64) -> f64 {
        sum / self.totals.weight / self.channels.len() as f64
    }
}

/// Whether `rule` shrinks every component by itself: only what a pilot says of the light can tell by how much.
pub fn shrinks(rule: OrderChoice, pilot: bool) -> bool {
    rule == OrderChoice::Shrink && pilot
}

/// Fills `choice` for a factorised window.
#[inline(always)]
pub fn choose(evidence: &Evidence<'_>, basis: &Basis, rule: OrderChoice, choice: &mut Choice) {
    let shrink = &mut choice.shrink;
    shrink.clear();
    shrink.resize(basis.columns(), 0.0);
    let best = if shrinks(rule, evidence.reference == Reference::Pilot) {
        evidence.shrink(shrink);
        None
    } else {
        Some(evidence.keep(basis, rule, shrink))
    };
    let changes = shrink.iter().enumerate().map(|(i, s)| evidence.change(i, *s));
    choice.xi = evidence.mean(evidence.start() + changes.sum::<f64>()).max(0.0);
    choice.order = evidence.order(basis, shrink);
    choice.best = best.unwrap_or(choice.order.round() as usize);
}
