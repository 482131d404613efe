//! Tests only: the fast path (`f32` sums → nested Cholesky → running risks) against the oracle, over
//! the hard cases and every tier of vectors. The bounds stand here, the figures in docs/STABILITY.md, which
//! `BLESS=1 cargo test --lib stability` writes anew.
#![cfg(test)]

mod cases;
mod oracle;

use super::*;
use crate::denoise::gram::Tier;
use crate::denoise::guides::Guided;
use crate::denoise::risk::RISK_RESOLUTION;
use crate::image::{mean_of_channels, sum_of_channels};
use crate::options::OrderChoice;
use cases::Case;
use nalgebra::{DMatrix, DVector};
use oracle::{Model, Oracle};
use std::fs;

/// Bound of [`Outcome::fitted`].
const FITTED_BOUND: f64 = 1e-4;

/// Bound of [`Outcome::risk`], unless the case says otherwise.
const RISK_BOUND: f64 = 1e-3;

/// A risk is the difference of sums as large as the reference's variance in the window, so their
/// rounding is in it: with this share of the variance beside ξ, [`RISK_BOUND`] allows for that of `f32`.
const SUM_RESOLUTION: f64 = 1e-4;

/// What `f32` leaves of the light itself when its mean is taken out, as a share of it: risks that differ by
/// less than its square are the same.
const LIGHT_RESOLUTION: f64 = 4.0 * f32::EPSILON as f64;

/// Where the table stands, and what it stands between.
const DOCUMENT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/STABILITY.md");
const TABLE: [&str; 2] = ["<!-- table: BLESS=1 cargo test --lib stability -->\n", "<!-- end of table -->"];

const KERNEL: Kernel = Kernel::by_color(1, 1.2);

/// How far the fast path is from the oracle in one window, by the tier that is farthest.
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
    /// The most that this may be.
    risk_bound: f64,
    /// Orders that differ though the oracle's risks tell them apart.
    wrong_orders: usize,
    /// Tiers that do not keep to the bounds.
    broken: Vec<&'static str>,
}

impl Outcome {
    fn add(&mut self, tier: &'static str, fitted: f64, risk: f64, wrong_order: bool) {
        self.fitted = larger(self.fitted, fitted);
        self.risk = larger(self.risk, risk);
        self.wrong_orders += usize::from(wrong_order);
        let holds = fitted <= FITTED_BOUND && risk <= self.risk_bound && !wrong_order; // false for NaN
        if !holds {
            self.broken.push(tier);
        }
    }

    /// The larger deviations of two runs of one window.
    fn join(self, other: Self) -> Self {
        Self {
            fitted: larger(self.fitted, other.fitted),
            risk: larger(self.risk, other.risk),
            wrong_orders: self.wrong_orders + other.wrong_orders,
            broken: [self.broken, other.broken].concat(),
            ..other
        }
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

/// Fits the case's window both ways, in the first stage or with a pilot, by every tier of vectors.
fn compare(case: &Case, with_pilot: bool, tiers: &[(&'static str, Tier)]) -> Outcome {
    let options = Options { order_choice: OrderChoice::Hard, ..Options::default() };
    let radius = options.window_radius;
    let basis = Basis::new(radius, case.features.len(), options.max_order);
    let guided = Guided {
        color: case.color.each_ref(),
        variance: &case.variance,
        trusted: Plane::clone,
        albedo: None,
        features: &case.features,
        spreads: &[],
    };
    let guides = Guides::default().turned_to([&KERNEL], guided, &options, None);
    let noise = sum_of_channels(&case.variance);
    let pilot = Pilot { color: case.pilot.clone(), certain: mean_of_channels(&case.pilot) };
    let problem = Problem {
        targets: &case.color.each_ref(),
        variance: &case.variance,
        noise: &noise,
        pilot: with_pilot.then_some(&pilot),
        features: &case.features,
        feature_noise: &vec![None; case.features.len()],
        guides: &guides,
        albedo: None,
        beside: &[],
        basis: &basis,
        options: &options,
    };
    let window = Window::new(case.center.0, case.center.1, radius, case.color[0].size());
    let mut solver = Solver::new(&problem);
    solver.weigh(pulp::Scalar, &window, KERNEL);
    let scale = solver.prepare(pulp::Scalar, &window, None);
    let exact = Exact::new(case, &window, &solver, scale);
    let mut outcome = Outcome {
        pixels: exact.pixels.len(),
        columns: (basis.columns(), exact.oracle.rank()),
        condition: exact.oracle.condition(),
        risk_bound: case.risk_bound.unwrap_or(RISK_BOUND),
        ..Outcome::default()
    };
    for (tier, accumulate) in tiers {
        solver.factorise(accumulate);
        exact.hold(&mut solver, scale, tier, &mut outcome);
    }
    outcome
}

/// What the oracle says of a window.
struct Exact {
    oracle: Oracle,
    models: Vec<Model>,
    targets: Vec<DVector<f64>>,
    reference: Vec<DVector<f64>>,
    /// The samples' pixels.
    pixels: Vec<usize>,
}

impl Exact {
    /// The models of all orders for what `solver` has prepared.
    fn new(case: &Case, window: &Window, solver: &Solver<'_>, scale: f32) -> Self {
        let Problem { basis, pilot, options, .. } = solver.problem;
        let vector = |values: &[f32]| {
            DVector::from_iterator(window.pixels(), values[..window.pixels()].iter().map(|&v| f64::from(v)))
        };
        let plane = |plane: &Plane| {
            let mut values = vec![0.0; window.stride];
            window.gather(plane, 0.0, &mut values);
            vector(&values) * f64::from(scale)
        };
        let pixels: Vec<usize> = {
            let spots = solver.samples.spots(solver.samples.of_frame(0)).iter();
            let (left, top) = window.offset(options.window_radius);
            spots.map(|[x, y]| (usize::from(*y) - top) * window.width + usize::from(*x) - left).collect()
        };
        let spread = |values: &[f32]| {
            let mut all = DVector::zeros(window.pixels());
            pixels.iter().zip(values).for_each(|(&i, &v)| all[i] = f64::from(v));
            all
        };
        let oracle = Oracle::new(design(case, window, basis), spread(&solver.weights), spread(&solver.noise));
        let targets: Vec<_> = case.color.iter().map(plane).collect();
        Self {
            models: (0..=basis.max_order()).map(|order| oracle.model(basis.columns_up_to(order))).collect(),
            reference: pilot.map_or_else(|| targets.clone(), |pilot| pilot.color.iter().map(plane).collect()),
            pixels,
            oracle,
            targets,
        }
    }

    /// Adds to `outcome` how far the factorised `solver` is from this.
    fn hold(&self, solver: &mut Solver<'_>, scale: f32, tier: &'static str, outcome: &mut Outcome) {
        let Problem { basis, options, .. } = solver.problem;
        let evidence = solver.evidence(pulp::Scalar);
        let (fast, noise) = (evidence.xi(basis), evidence.totals.noise / evidence.totals.weight / 3.0);
        let kind = evidence.reference;
        let floor = RISK_RESOLUTION * noise;
        let variation = evidence.totals.energy / evidence.totals.weight / 3.0; // the channels are centred
        let resolution = floor + SUM_RESOLUTION * variation;
        let light = self.reference.iter().map(DVector::amax).fold(0.0, f64::max);
        let nothing = (LIGHT_RESOLUTION * light).powi(2);
        let mut choice = Choice::default();
        risk::choose(&evidence, basis, options.order_choice, &mut choice);
        let best = choice.best;
        solver.choice = choice;

        let (mut fitted, mut risk) = (0.0f64, 0.0f64);
        let mut risks = vec![];
        for (order, model) in self.models.iter().enumerate() {
            let xi = self.oracle.risk(model, &self.reference, kind);
            let off = (fast[order] - xi).abs();
            risk = larger(risk, if off <= nothing { 0.0 } else { share(off, xi.abs() + resolution) });
            risks.push(xi.max(floor));

            solver.choice.shrink.fill(0.0);
            solver.choice.shrink[..basis.columns_up_to(order)].fill(1.0);
            solver.predict(scale, None);
            for (t, target) in self.targets.iter().enumerate() {
                let exact = model.fitted(target);
                let largest = self.pixels.iter().fold(0.0f64, |largest, &i| largest.max(target[i].abs()));
                for (n, &i) in self.pixels.iter().enumerate() {
                    let fast = f64::from(solver.predicted[t * self.pixels.len() + n]) * f64::from(scale);
                    fitted = larger(fitted, share((fast - exact[i]).abs(), largest));
                }
            }
        }
        let least = risks.iter().copied().fold(f64::INFINITY, f64::min);
        let wrong = risks[best] > least + 2.0 * outcome.risk_bound * (least + resolution);
        outcome.add(tier, fitted, risk, wrong);
    }
}

/// The larger of both, and NaN where either is.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// The table, a line for every case.
fn table(outcomes: &[(&str, Outcome)]) -> String {
    let mut table = String::from(
        "| case | pixels | columns | κ | fit | bound | ξ | bound | order |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    for (name, outcome) in outcomes {
        let Outcome { pixels, columns: (all, rank), condition, fitted, risk, risk_bound, .. } = outcome;
        let condition = if condition.is_finite() { format!("{condition:.0e}") } else { "∞".into() };
        let order = if outcome.wrong_orders == 0 { "right" } else { "wrong" };
        let line = format!(
            "| {name} | {pixels} | {rank} of {all} | {condition} | {fitted:.0e} | {FITTED_BOUND:.0e} \
             | {risk:.0e} | {risk_bound:.0e} | {order} |\n"
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
    let tiers = gram::tiers();
    let both = |case: &Case| compare(case, false, &tiers).join(compare(case, true, &tiers));
    let outcomes: Vec<_> = cases::all().iter().map(|case| (case.name, both(case))).collect();
    let table = table(&outcomes);
    println!("{table}");
    let broken = outcomes.iter().filter(|(_, o)| !o.broken.is_empty()).map(|(name, o)| (name, &o.broken));
    let broken: Vec<_> = broken.collect();
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
