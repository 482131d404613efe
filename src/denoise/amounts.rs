//! a_j(i): what the prediction of centre j counts for at pixel i of its window.
//!
//! As published a_j(i) is the kernel K_j(i). `[choice]` from the second stage on it is
//! K_j(i)·(floor/(ξ_j + floor))^power, and all kernels' fits join the one average: a centre on a bright disc
//! has a large absolute error and must not speak for the dark pixels beside it.
//! Against the power ½, relMSE at 16 spp: power 1 ×1.03 (twelve scenes), power 0 ×1.04 (nine scenes).
//!
//! `[choice]` a_j(i) also falls towards the window's border, where a polynomial is least certain and where
//! a window that ends shows as an edge: relMSE ×0.987 over thirteen scenes of the tracer at 16 and 64 spp, up
//! to ×0.9 in fog and out of focus, and the blocks that one saw there are gone; ×1.00 on five others.
//!
//! `[choice]` ξ_j is the error near the centre. At a pixel i that the pilot is certain to be brighter than centre j,
//! it is multiplied by (a + b)/2a, with a = L_j² + dark², b = C_i² + dark², C_i the least that i has for certain: dark
//! fits that reach over the rim of something bright made it dark too. relMSE ×1.000 (five scenes at 16 to 256 spp) and ×0.989 (thirteen others), out of focus
//! ×0.8; what bright defocused discs lose of their picture's light at 16 spp falls from 15 to 5 %. Certain by two
//! estimated deviations: by none ×1.040 and ×0.994, for fireflies leave bright pixels in the pilot too.
//!
//! A polynomial beside a lamp may swing far below what any pixel of the window shows: such predictions do not join the
//! average, and the coverage test sees the gap. Black blotches were what they left.

use super::reconstruction::Pilot;
use super::samples::Samples;
use super::solver::{Fitted, Problem};
use super::window::Window;
use crate::image::Plane;
use crate::options::{MAX_WINDOW_RADIUS, Options};

/// The floor of the risk in the average, as a share of the dark level's square.
const RISK_FLOOR: f32 = 0.01;

/// No fit is trusted less than this, so that no power makes all fits of a pixel nothing. Roots do not come so far.
const LEAST_TRUST: f32 = 1e-24;

/// How far below the darkest pixel of its window (or black) a prediction may lie, in dark levels.
const SWING: f32 = 0.02;

/// Predictions beyond this are a fit out of `f32`'s range; with its weight a value must stay in it.
const LARGEST_PREDICTION: f32 = 1e34;

/// The amount of a prediction that does not join the average.
const LEFT_OUT: f32 = -1.0;

/// The amounts of one fit at a time; buffers of one thread.
pub struct Amounts {
    /// By the place in an unclipped window along one axis.
    taper: [f32; 2 * MAX_WINDOW_RADIUS + 1],
    amounts: Vec<f32>,
    /// What the pilot is certain of at the pixels.
    certain: Vec<f32>,
}

impl Amounts {
    /// For the windows of `options`.
    #[expect(clippy::disallowed_methods, reason = "exact by the presets' powers, 0 and 1")]
    pub fn new(options: &Options) -> Self {
        let radius = options.window_radius;
        let share = |at: usize| at.abs_diff(radius) as f32 / (radius + 1) as f32;
        let taper = std::array::from_fn(|at| (1.0 - share(at).powi(2)).max(0.0).powf(options.taper_power));
        Self { taper, amounts: vec![], certain: vec![] }
    }

    /// a of every pixel that the fit of a `window` speaks for; below 0 where what it says is left out.
    pub fn of(&mut self, problem: &Problem<'_>, window: &Window, fitted: &Fitted<'_>) -> &[f32] {
        self.weigh(fitted.samples);
        // In the first stage the risk is that of noisy data: it would favour chance.
        if let Some(pilot) = problem.pilot {
            self.trust(pilot, [window.cx, window.cy], fitted, problem.options);
        }
        self.leave_out(problem.targets, window, fitted, problem.options.dark_level);
        &self.amounts
    }

    /// By K and the taper.
    fn weigh(&mut self, samples: &Samples) {
        let spots = samples.spots(samples.of_frame(0));
        self.amounts.clear();
        self.amounts.extend(spots.iter().zip(samples.kernel()).map(|(spot, k)| {
            let [x, y] = spot.map(usize::from);
            k * self.taper[x] * self.taper[y]
        }));
    }

    /// By the risk of the fit, more of it where a pixel is brighter than the `centre` for certain. The root is the same
    /// on all machines and quick, which powers are not.
    #[expect(
        clippy::disallowed_methods,
        reason = "the presets take the root, or the power 0, which is exact"
    )]
    fn trust(&mut self, pilot: &Pilot, [x, y]: [usize; 2], fitted: &Fitted<'_>, options: &Options) {
        self.certain.resize(self.amounts.len(), 0.0);
        fitted.samples.gather(&pilot.certain, 0, 0.0, &mut self.certain);
        let dark = options.dark_level * options.dark_level;
        let floor = RISK_FLOOR * options.dark_level * options.dark_level;
        let energy = |light: f32| light.max(0.0).powi(2) + dark;
        let here = energy(pilot.light(x, y));
        let share = |(xi, certain): (&f32, &f32)| {
            let there = energy(*certain);
            let brighter = if there > here { (here + there) / (2.0 * here) } else { 1.0 };
            floor / ((xi + floor) * brighter)
        };
        let shares = fitted.risks.iter().zip(&self.certain).map(share);
        let pairs = self.amounts.iter_mut().zip(shares);
        if options.risk_power == 0.5 {
            pairs.for_each(|(a, share)| *a *= share.sqrt());
        } else {
            pairs.for_each(|(a, share)| *a *= share.powf(options.risk_power).max(LEAST_TRUST));
        }
    }

    /// Nothing where a prediction is out of range, or swings.
    fn leave_out(&mut self, targets: &[&Plane], window: &Window, fitted: &Fitted<'_>, dark_level: f32) {
        let swing = -SWING * dark_level;
        for (t, predicted) in fitted.predicted.chunks_exact(self.amounts.len()).enumerate() {
            let swings = t < 3 && predicted.iter().any(|value| *value < swing);
            let least = if swings { window.least(targets[t]).min(0.0) + swing } else { f32::NEG_INFINITY };
            for (a, value) in self.amounts.iter_mut().zip(predicted) {
                *a = if value.abs() <= LARGEST_PREDICTION && *value >= least { *a } else { LEFT_OUT };
            }
        }
    }
}
