//! Nonlinearly weighted first-order regression (Bitterli, Rousselle, Moon, Iglesias-Guitián, Adler, Mitchell,
//! Jarosz, Novák, EGSR 2016), with the constants of the authors' implementation.
//!
//! 1. Features are filtered, each half by the other's weights (section 5.1).
//! 2. Each half of the colour is regressed on the other half's features with the other half's weights, once for
//!    each bandwidth; every window predicts all of its pixels (5.2).
//! 3. The other half tells the error of each bandwidth; smoothed errors choose between them, and the
//!    choice is smoothed the same way (5.3).
//! 4. The mean of both halves is regressed once more on the mean features, weighted by itself (5.4).
//!
//! `[choice]` a feature without halves is filtered by its own weights and serves both halves of the colour. On
//! our textured room that costs 8 % of relMSE at 16 spp and 2 % at 64, on foliage nothing. Against the authors'
//! program, which had them, on five scenes at 16, 64 and 256 spp: geometric mean 0.98, 14 of 15 cases within 5 %
//! or better, and 1.10 in a textured room at 16 spp.
//!
//! Without halves of the colour there is no error to choose by: one regression with the widest bandwidth on
//! the picture itself is all. AOVs have no halves either: the operators of both halves' regressions are
//! applied to the AOV itself, so that their sum differs from the beauty by what the two operators make of
//! the halves' difference.

mod regression;

use super::input::{Input, Output, mean};
use super::patches::{Channels, Patches, filter};
use crate::denoise::variance;
use crate::error::Result;
use crate::frame::{Denoised, Feature, Frame};
use crate::image::{Plane, Rgb};
use crate::options::within;
use regression::regress;
use serde::{Deserialize, Serialize};

/// Features are filtered with these radii of window and patch, and bandwidth.
const FEATURE_FILTER: ([usize; 2], f32) = ([5, 3], 0.5);

/// The mean of the filtered features is filtered again with these.
const FINAL_FEATURE_FILTER: ([usize; 2], f32) = ([2, 3], 0.5);

/// Errors and the choice between them are smoothed with these, weighted by the noisy colour.
const ERROR_FILTER: ([usize; 2], f32) = ([9, 1], 1.0);

/// Estimated errors are limited to this, so that their sums stay finite.
const LARGEST_ERROR: f64 = 1e30;

/// Constants of the method; the defaults are the publication's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Radius of the windows, 1 to 15.
    pub window_radius: usize,
    /// Radius of the patches, 0 to 7.
    pub patch_radius: usize,
    /// The bandwidths between which the first pass chooses; the last pass has the second.
    pub bandwidths: [f32; 2],
}

impl Default for Options {
    fn default() -> Self {
        Self { window_radius: 9, patch_radius: 3, bandwidths: [0.5, 1.0] }
    }
}

impl Options {
    /// Checks every range.
    ///
    /// # Errors
    /// [`crate::ErrorKind::Usage`] names the option and what it may be.
    pub fn check(&self) -> Result<()> {
        within("window_radius", self.window_radius, 1..=15)?;
        within("patch_radius", self.patch_radius, 0..=7)?;
        self.bandwidths.iter().try_for_each(|&k| within("bandwidths", k, 1e-3..=1e3))
    }

    fn patches(&self, guide: &[Plane], variance: &[Plane]) -> Patches {
        Patches::new(guide, variance, [self.window_radius, self.patch_radius], Channels::Largest)
    }
}

/// Denoises `frame`.
///
/// # Errors
/// When an option is out of its range.
pub fn denoise(frame: &Frame, options: &Options) -> Result<Denoised> {
    options.check()?;
    let mut input = Input::new(frame, "nfor");
    let features = prefiltered(&mut input);
    let output = match &input.clean.halves {
        Some(halves) => dual(&input, halves, &features, options),
        None => {
            let patches = options.patches(&input.clean.color, &input.variance);
            let mut results = regress(&input.targets(), &features[0], &patches, &options.bandwidths[1..]);
            let targets = results.pop().expect("one result for one bandwidth");
            Output { targets, mse: None, order: 1.0, sampling_priority: None }
        }
    };
    Ok(input.finish(output))
}

/// Steps 2 to 4.
fn dual(input: &Input<'_>, halves: &[Rgb; 2], features: &[Vec<Plane>; 2], options: &Options) -> Output {
    let variance = input.variance_of_half();
    let [a, b] = [0, 1].map(|half| {
        let other = 1 - half;
        let planes: Vec<&Plane> = halves[half].iter().chain(input.aovs()).collect();
        let patches = options.patches(&halves[other], &variance);
        regress(&planes, &features[other], &patches, &options.bandwidths)
    });

    let mut mse = Plane::filled(input.size().0, input.size().1, 0.0);
    let selections: Vec<Plane> = (0..3)
        .map(|c| {
            let noisy = |k: usize| error(input, halves, [&a[k][c], &b[k][c]], c);
            let (selection, error) = select(input, [noisy(0), noisy(1)], c);
            mse.data_mut().iter_mut().zip(error.data()).for_each(|(sum, e)| *sum += e / 3.0);
            selection
        })
        .collect();
    let chosen = |results: &[Vec<Plane>]| -> Vec<Plane> {
        (0..results[0].len()).map(|t| blend(&results[0][t], &results[1][t], &selections[t % 3])).collect()
    };
    let (a, b) = (chosen(&a), chosen(&b));
    let combined: Vec<Plane> = a.iter().zip(&b).map(|(a, b)| mean(a, b)).collect();
    let residual: Vec<Plane> = a.iter().zip(&b).take(3).map(|(a, b)| variance::from_halves(a, b)).collect();

    let features = combined_features(features);
    let patches = options.patches(&combined[..3], &residual);
    let planes: Vec<&Plane> = combined.iter().collect();
    let mut results = regress(&planes, &features, &patches, &options.bandwidths[1..]);
    let targets = results.pop().expect("one result for one bandwidth");
    Output { targets, mse: Some(mse), order: 1.0, sampling_priority: None }
}

/// The noisy error of channel `c` of the halves' results, each judged by the other half:
/// ½ Σ ((other − result)² − variance of the other), less the variance that the mean of both is spared.
fn error(input: &Input<'_>, [half_a, half_b]: &[Rgb; 2], [a, b]: [&Plane; 2], c: usize) -> Plane {
    Plane::from_fn(a.width(), a.height(), |x, y| {
        let at = |plane: &Plane| f64::from(plane.get(x, y));
        let noise = 2.0 * at(&input.variance[c]);
        let of = |other: &Plane, result: &Plane| (at(other) - at(result)).powi(2) - noise;
        let spared = (at(b) - at(a)).powi(2) / 4.0;
        let error = 0.5 * (of(&half_b[c], a) + of(&half_a[c], b)) - spared;
        error.clamp(-LARGEST_ERROR, LARGEST_ERROR) as f32
    })
}

/// How much of the second bandwidth's result to take, and the error after the choice.
fn select(input: &Input<'_>, noisy: [Plane; 2], c: usize) -> (Plane, Plane) {
    let (radii, bandwidth) = ERROR_FILTER;
    let single = std::slice::from_ref;
    let patches =
        Patches::new(single(&input.clean.color[c]), single(&input.variance[c]), radii, Channels::Mean);
    let errors = filter(&patches, &[&noisy[0], &noisy[1]], bandwidth, 0.0);
    let (width, height) = input.size();
    let first = |x: usize, y: usize| errors[0].get(x, y) < errors[1].get(x, y);
    let choice = Plane::from_fn(width, height, |x, y| if first(x, y) { 0.0 } else { 1.0 });
    let selection = filter(&patches, &[&choice], bandwidth, 0.0).pop().expect("one plane for one plane");
    let mut error = blend(&errors[0], &errors[1], &selection);
    error.data_mut().iter_mut().for_each(|e| *e = e.max(0.0));
    (selection, error)
}

/// a + share · (b − a).
fn blend(a: &Plane, b: &Plane, share: &Plane) -> Plane {
    Plane::from_fn(a.width(), a.height(), |x, y| a.get(x, y) + share.get(x, y) * (b.get(x, y) - a.get(x, y)))
}

/// Step 1: the features of both halves, constant ones left out.
fn prefiltered(input: &mut Input<'_>) -> [Vec<Plane>; 2] {
    let mut halves = [vec![], vec![]];
    let mut columns = vec![];
    for (_, feature) in input.feature_list() {
        for i in 0..feature.planes.len() {
            let [a, b] = cross_filtered(feature, i);
            if a.data().iter().chain(b.data()).any(|v| *v != a.data()[0]) {
                columns.push(format!("{}.{i}", feature.name));
                halves[0].push(a);
                halves[1].push(b);
            }
        }
    }
    input.summary.columns = columns;
    halves
}

fn cross_filtered(feature: &Feature, i: usize) -> [Plane; 2] {
    let (radii, bandwidth) = FEATURE_FILTER;
    let filtered = |plane: &Plane, guide: &Plane, variance: &Plane| {
        let single = std::slice::from_ref;
        let patches = Patches::new(single(guide), single(variance), radii, Channels::Mean);
        filter(&patches, &[plane], bandwidth, 0.0).pop().expect("one plane for one plane")
    };
    let given = feature.var_of_mean.as_ref().map(|variance| variance[i].clone());
    let times = |mut variance: Plane, factor: f32| {
        variance.data_mut().iter_mut().for_each(|v| *v *= factor);
        variance
    };
    match (&feature.halves, given) {
        (Some([a, b]), given) => {
            let (a, b) = (&a[i], &b[i]);
            let variance = given.unwrap_or_else(|| variance::smooth(&variance::from_halves(a, b), 1));
            let variance = times(variance, 2.0); // of one half
            [filtered(a, b, &variance), filtered(b, a, &variance)]
        }
        (None, Some(variance)) => {
            let plane = filtered(&feature.planes[i], &feature.planes[i], &variance);
            [plane.clone(), plane]
        }
        (None, None) => [feature.planes[i].clone(), feature.planes[i].clone()],
    }
}

/// The mean of both halves' features, filtered once more by what noise their difference shows.
fn combined_features([a, b]: &[Vec<Plane>; 2]) -> Vec<Plane> {
    let (radii, bandwidth) = FINAL_FEATURE_FILTER;
    let combine = |(a, b): (&Plane, &Plane)| {
        if a == b {
            return a.clone();
        }
        let (plane, variance) = (mean(a, b), variance::from_halves(a, b));
        let single = std::slice::from_ref;
        let patches = Patches::new(single(&plane), single(&variance), radii, Channels::Mean);
        filter(&patches, &[&plane], bandwidth, 0.0).pop().expect("one plane for one plane")
    };
    a.iter().zip(b).map(combine).collect()
}
