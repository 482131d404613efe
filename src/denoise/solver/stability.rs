//! Tests only: the fast path (`f32` sums → nested Cholesky → running risks) against the oracle, over
//! the hard cases. The bounds stand here, the figures in docs/STABILITY.md, which
//! `BLESS=1 cargo test --lib stability` writes anew.
#![cfg(test)]

mod cases;
mod oracle;

use super::*;
use crate::denoise::risk::RISK_RESOLUTION;
use cases::Case;
use nalgebra::{DMatrix, DVector};
use oracle::Oracle;
use std::fs;

/// Bound of [`Outcome::fitted`].
const FITTED_BOUND: f64 = 1e-4;

/// Bound of [`Outcome::risk`].
const RISK_BOUND: f64 = 1e-3;

/// A risk is the difference of sums as large as the reference's variance in the window, so their
/// rounding is in it: with this share of the variance beside ξ, [`RISK_BOUND`] allows for that of `f32`.
const SUM_RESOLUTION: f64 = 1e-4;

/// Where the table stands, and what it stands between.
const DOCUMENT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/STABILITY.md");
const TABLE: [&str; 2] = ["<!-- table: BLESS=1 cargo test --lib stability -->\n", "<!-- end of table -->"];

const KERNEL: Kernel = Kernel { patch_radius: 1, bandwidth: 1.2, demodulate: false };

/// How far the fast path is from the oracle in one window.
#[derive(Default)]
struct Outcome {
    /// Pixels that have weight.
    pixels: usize,
    /// Columns of the largest model, and how many of them the oracle keeps.
    columns: (usize, usize),
    /// Condition number of the weighted design as it comes.
    condition: f64,
    /// Largest deviation of a fitted value at a pixel of the kernel, over all orders and channels, as
    /// a share of the channel's largest value there.
    fitted: f64,
    /// Largest deviation of a ξ_k, as a share of ξ_k, what risks are told apart by and what sums hold.
    risk: f64,
    /// Orders that differ though the oracle's risks tell them apart.
    wrong_orders: usize,
}

impl Outcome {
    /// The larger deviations of two runs of one window.
    fn join(self, other: Self) -> Self {
        Self {
            fitted: self.fitted.max(other.fitted),
            risk: self.risk.max(other.risk),
            wrong_orders: self.wrong_orders + other.wrong_orders,
            ..other
        }
    }

    fn holds(&self) -> bool {
        // Written so that NaN fails.
        self.fitted <= FITTED_BOUND && self.risk <= RISK_BOUND && self.wrong_orders == 0
    }
}

/// `part` of `whole`, where nothing of nothing is nothing.
fn share(part: f64, whole: f64) -> f64 {
    if part == 0.0 { 0.0 } else { part / whole }
}

/// The window's design in `f64`, straight from the planes.
fn design(case: &Case, window: &Window, basis: &Basis) -> DMatrix<f64> {
    let radius = 7.0;
    DMatrix::from_fn(window.pixels(), basis.columns(), |i, j| {
        let (x, y) = (window.x0 + i % window.width, window.y0 + i / window.width);
        let offset = |at: usize, center: usize| (at as f64 - center as f64) / radius;
        let (u, v) = (offset(x, window.cx), offset(y, window.cy));
        match j.checked_sub(1) {
            None => 1.0,
            Some(f) if f < case.features.len() => f64::from(case.features[f].get(x, y)),
            Some(f) => match f - case.features.len() {
                0 => u,
                1 => v,
                2 => u * u,
                3 => u * v,
                4 => v * v,
                5 => u * u * u,
                6 => u * u * v,
                7 => u * v * v,
                _ => v * v * v,
            },
        }
    })
}

/// Fits the case's window both ways, in the first stage or with a pilot.
fn compare(case: &Case, with_pilot: bool) -> Outcome {
    let options = Options { order_choice: crate::options::OrderChoice::Hard, ..Options::default() };
    let radius = options.window_radius;
    let basis = Basis::new(radius, case.features.len(), options.max_order);
    let guide = Guide::new(&case.color, &case.variance, radius, KERNEL.patch_radius);
    let problem = Problem {
        targets: case.color.iter().collect(),
        variance: &case.variance,
        pilot: with_pilot.then_some(&case.pilot),
        features: &case.features,
        guide: &guide,
        albedo: None,
        basis: &basis,
        options: &options,
    };
    let window = Window::new(case.center.0, case.center.1, radius, case.color[0].size());
    let mut solver = Solver::new(&problem);
    let best = solver.fit(&window, KERNEL).choice.best;
    let scale = solver.factorise(&window, KERNEL, None);

    let vector = |values: &[f32]| {
        DVector::from_iterator(window.pixels(), values[..window.pixels()].iter().map(|&v| f64::from(v)))
    };
    let plane = |plane: &Plane| {
        let mut values = vec![0.0; window.stride];
        window.gather(plane, 0.0, &mut values);
        vector(&values) * f64::from(scale)
    };
    let oracle = Oracle::new(design(case, &window, &basis), vector(&solver.weights), vector(&solver.noise));
    let targets: Vec<_> = case.color.iter().map(plane).collect();
    let reference: Vec<_> = if with_pilot { case.pilot.iter().map(plane).collect() } else { targets.clone() };
    let covered: Vec<usize> = (0..window.pixels()).filter(|&i| solver.kernel[i] > 0.0).collect();

    let mut outcome = Outcome {
        pixels: covered.len(),
        columns: (basis.columns(), oracle.rank()),
        condition: oracle.condition(),
        ..Outcome::default()
    };
    let evidence = solver.evidence(&window);
    let (fast, noise) = (evidence.xi(&basis), evidence.totals.noise / evidence.totals.weight / 3.0);
    let kind = evidence.reference;
    let floor = RISK_RESOLUTION * noise;
    let variation = evidence.totals.energy / evidence.totals.weight / 3.0; // the channels are centred
    let resolution = floor + SUM_RESOLUTION * variation;
    let mut risks = vec![];
    for order in 0..=options.max_order {
        let columns = basis.columns_up_to(order);
        let model = oracle.model(columns);
        let risk = oracle.risk(&model, &reference, kind);
        outcome.risk = outcome.risk.max(share((fast[order] - risk).abs(), risk.abs() + resolution));
        risks.push(risk.max(floor));

        solver.choice.shrink.fill(0.0);
        solver.choice.shrink[..columns].fill(1.0);
        solver.predict(&window, scale, None);
        for (t, target) in targets.iter().enumerate() {
            let fitted = model.fitted(target);
            let largest = covered.iter().fold(0.0f64, |largest, &i| largest.max(target[i].abs()));
            for &i in &covered {
                let fast = f64::from(solver.predicted[t * window.stride + i]) * f64::from(scale);
                outcome.fitted = outcome.fitted.max(share((fast - fitted[i]).abs(), largest));
            }
        }
    }
    let least = risks.iter().copied().fold(f64::INFINITY, f64::min);
    outcome.wrong_orders = usize::from(risks[best] > least + 2.0 * RISK_BOUND * (least + resolution));
    outcome
}

/// The table, a line for every case.
fn table(outcomes: &[(&str, Outcome)]) -> String {
    let mut table = String::from(
        "| case | pixels | columns | κ | fit | bound | ξ | bound | order |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    for (name, outcome) in outcomes {
        let Outcome { pixels, columns: (all, rank), condition, fitted, risk, .. } = outcome;
        let condition = if condition.is_finite() { format!("{condition:.0e}") } else { "∞".into() };
        let order = if outcome.wrong_orders == 0 { "right" } else { "wrong" };
        let line = format!(
            "| {name} | {pixels} | {rank} of {all} | {condition} | {fitted:.0e} | {FITTED_BOUND:.0e} \
             | {risk:.0e} | {RISK_BOUND:.0e} | {order} |\n"
        );
        table.push_str(&line);
    }
    table
}

/// What of a table is the same on every machine: the cases and their bounds.
fn promises(table: &str) -> Vec<[&str; 3]> {
    let cells = table.lines().map(|line| line.split('|').map(str::trim).collect::<Vec<_>>());
    cells.filter(|c| c.len() > 8).map(|c| [c[1], c[6], c[8]]).collect()
}

#[test]
#[allow(clippy::print_stdout, reason = "the table is what this test is for")]
fn the_fast_path_keeps_to_the_oracle() {
    let outcomes: Vec<_> =
        cases::all().iter().map(|case| (case.name, compare(case, false).join(compare(case, true)))).collect();
    let table = table(&outcomes);
    println!("{table}");
    let broken: Vec<_> = outcomes.iter().filter(|(_, o)| !o.holds()).map(|(name, _)| name).collect();
    assert!(broken.is_empty(), "out of bounds: {broken:?}");

    let document = fs::read_to_string(DOCUMENT).unwrap();
    let (before, rest) = document.split_once(TABLE[0]).unwrap();
    let (written, after) = rest.split_once(TABLE[1]).unwrap();
    if std::env::var_os("BLESS").is_some() {
        fs::write(DOCUMENT, [before, TABLE[0], &table, TABLE[1], after].concat()).unwrap();
        panic!("the table was written anew: look at it, then test without BLESS");
    }
    assert_eq!(promises(written), promises(&table), "docs/STABILITY.md: write the table with BLESS=1");
}
