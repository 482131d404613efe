//! Where the energy of the outliers goes back to (Moon et al. 2016).
//!
//! ŷ(i) ← ŷ(i)·(1 + Σ_o ρ_o) over the outliers whose windows Ω_o hold i, and the sum over Ω_o of what that adds
//! is e_o, what was taken out. A firefly tells that light is missing, but not how much is missing around it:
//! given back to a window of fixed size, a single one is a bright square.
//!
//! `[choice]` Ω_o grows until the outliers inside are worth [`OutlierOptions::witnesses`] of equal energy, by
//! their effective number (Σ e)²/Σ e², or is the whole picture. For 24, 40 and 64 of them relMSE against windows
//! of 63×63 pixels is ×0.985, ×0.978, ×0.974 (five scenes at 16 to 256 spp; caustics ×0.79 at 16) and ×1.000,
//! ×1.001, ×1.003 (thirteen scenes of the tracer at 16 and 64); of the default, 48, 64 is ×1.000 on both. The whole
//! picture in any case is ×0.968 and ×1.017, and ×1.34 where outliers are local.
//!
//! Where the whole picture does not hold so many, the share 1 − 1/n of their energy is given back, n the effective
//! number: the square of what n chance events tell is 1/n too large in the mean. A lone firefly tells nothing, and
//! the picture does not flicker with it.
//!
//! Windows and gains live on the [lattice](super::energy) that the energy is summed by: bilinear shares leave no
//! edges, and Σ gain·y over the picture without its outliers is what was taken out, to rounding. That picture stands for ŷ
//! in the shares, since it is known before the fits: so a part of a picture can be denoised by what was seen of the
//! whole before.

use super::energy::{Energy, Light, around};
use super::facts::Facts;
use super::observer::Log;
use super::part::Part;
use super::prepare::Prepared;
use crate::error::{Error, ErrorKind, Result};
use crate::image::{Plane, Rect, Rgb};
use crate::options::Options;
use rayon::prelude::*;
use std::borrow::Cow;

/// What a window must hold.
struct Asked {
    /// The least effective number of outliers.
    witnesses: f64,
    /// Whether there must be some light, for each of the colour's channels.
    light: [bool; 3],
}

/// What was taken out and goes back to a window.
struct Gift<'a> {
    /// Of each target.
    taken: &'a [f64],
    window: Rect,
    /// Of the colour's channels, in the window.
    light: [Light; 3],
}

/// What multiplies and is added to every target to give it back its energy.
#[derive(Debug, Clone, PartialEq)]
pub struct Gains {
    columns: usize,
    /// Σ_o ρ_o at the nodes, of each target; empty where nothing was taken out.
    gains: Vec<Vec<f64>>,
    /// Of each target, for every pixel of a picture that is black but for its outliers.
    even: Vec<f64>,
    /// The share of the energy that is given back.
    pub share: f64,
}

/// What gives the outliers of a prepared picture, or of this part of it, their energy back; none where the options ask
/// for no outliers. Their number goes into the summary.
///
/// # Errors
/// When the facts of a part do not hold the whole picture's outliers.
pub fn find<'a>(
    facts: &'a Facts,
    ready: &Prepared<'_>,
    part: &Part,
    options: &Options,
    log: &mut Log<'_>,
) -> Result<Option<Cow<'a, Gains>>> {
    let (count, energy) = ready.removed.count(part.within());
    log.summary.outliers = count;
    log.summary.energy_moved = energy.map(|energy| energy / f64::from(facts.exposure()));
    if !options.outliers.enabled {
        return Ok(None);
    }
    let (width, height) = part.picture;
    let gains = match (&facts.gains, facts.energy.pixels()) {
        (Some(gains), _) => Cow::Borrowed(gains),
        (None, 0) if part.is_whole() => {
            let mut energy = Energy::default();
            energy.add(ready.signal.color(), &ready.removed, part.within(), part.wanted.y);
            Cow::Owned(Gains::of(&energy, options.outliers.witnesses))
        }
        (None, known) => {
            let pixels = width * height;
            let what = format!("the outliers of {known} pixels are known where the picture has {pixels}");
            let error = Error::new(ErrorKind::Usage, what);
            return Err(error.remedy("give every row to Facts::add_outliers first, once"));
        }
    };
    if gains.share < 1.0 {
        let given = format!("{:.0} % of their energy is given back", 100.0 * gains.share);
        log.note(format!("outliers: too few to tell how much light is missing; {given}"));
    }
    Ok(Some(gains))
}

impl Asked {
    /// The nodes that the energy of `node` goes to; none where that is the whole lattice.
    fn window(&self, energy: &Energy, node: usize) -> Option<Rect> {
        let (whole, columns) = (energy.whole(), energy.columns());
        let at = Rect { x: node % columns, y: node / columns, width: 1, height: 1 };
        let reaches = std::iter::successors(Some(0), |reach| Some(reach * 5 / 4 + 1));
        let mut windows = reaches.map(|reach| at.grown(reach, whole.size())).take_while(|w| *w != whole);
        windows.find(|window| self.is_held(energy, *window))
    }

    /// Whether a window holds it.
    fn is_held(&self, energy: &Energy, window: Rect) -> bool {
        let [sum, squares] = energy.witnesses(window);
        let mut light = energy.light(window).into_iter().zip(self.light);
        sum * sum >= self.witnesses * squares && light.all(|(light, asked)| light.is_seen() || !asked)
    }
}

/// What gives target `t` back all `gifts` over the light of `energy`: at the nodes, and for every pixel.
fn spread(gifts: &[Gift<'_>], t: usize, energy: &Energy) -> (Vec<f64>, f64) {
    let (whole, columns) = (energy.whole(), energy.columns());
    let (mut gains, mut even) = (vec![0.0; whole.width * whole.height], 0.0);
    for Gift { taken, window, light } in gifts {
        let (taken, light) = (taken[t], light[t % 3]);
        if light.is_seen() {
            for (i, j) in window.pixels() {
                gains[j * columns + i] += taken / light.sum;
            }
        } else {
            even += taken / energy.pixels() as f64;
        }
    }
    (gains, even)
}

impl Gains {
    /// The gains of every target where windows of `energy` hold so many `witnesses`.
    pub fn of(energy: &Energy, witnesses: f32) -> Self {
        let whole = energy.whole();
        let targets = energy.sources().next().map_or(0, |(_, taken)| taken.len());
        let asked = Asked { witnesses: witnesses.into(), light: energy.light(whole).map(Light::is_seen) };
        let local = asked.is_held(energy, whole);
        let mut share = 1.0;
        if !local && targets > 0 {
            let [sum, squares] = energy.witnesses(whole);
            share = (1.0 - squares / (sum * sum)).clamp(0.0, 1.0);
        }
        let sources: Vec<(usize, &[f64])> = energy.sources().collect();
        let window = |(node, _): &(usize, _)| local.then(|| asked.window(energy, *node)).flatten();
        let windows: Vec<Option<Rect>> = sources.par_iter().map(window).collect();
        // What goes to the whole picture is given back at once.
        let mut rest = vec![0.0; targets];
        let mut gifts: Vec<(&[f64], Rect)> = vec![];
        for ((_, taken), window) in sources.into_iter().zip(windows) {
            match window {
                Some(window) => gifts.push((taken, window)),
                None => rest.iter_mut().zip(taken).for_each(|(rest, taken)| *rest += share * taken),
            }
        }
        gifts.push((&rest, whole));
        let gifts = gifts.into_par_iter();
        let gifts = gifts.map(|(taken, window)| Gift { taken, window, light: energy.light(window) });
        let gifts: Vec<Gift> = gifts.collect();
        let (gains, even) = (0..targets).into_par_iter().map(|t| spread(&gifts, t, energy)).unzip();
        Self { columns: energy.columns(), gains, even, share }
    }

    /// Gives all targets, the colour's and then every AOV's, back their energy. The planes' first pixel has the column and
    /// row `origin` in the picture.
    pub fn give_back(&self, targets: &mut [Plane], origin: (usize, usize)) {
        let beauty: Rgb = std::array::from_fn(|c| targets[c].clone());
        for (t, plane) in targets.iter_mut().enumerate() {
            self.give_plane_back(plane, &beauty[t % 3], t, origin);
        }
    }

    /// Gives `plane`, target `t`, back its energy; `beauty` is the same channel of the beauty before anything
    /// was given back, so that an AOV shares the beauty's shares and sums stay sums.
    fn give_plane_back(&self, plane: &mut Plane, beauty: &Plane, t: usize, origin: (usize, usize)) {
        let Some((gains, even)) = self.gains.get(t).zip(self.even.get(t)) else { return };
        plane.rows_mut().enumerate().for_each(|(y, row)| {
            for (x, (value, light)) in row.iter_mut().zip(beauty.row(y)).enumerate() {
                let nodes = around(origin.0 + x, origin.1 + y, self.columns);
                let gain: f64 = nodes.iter().map(|(node, share)| gains[*node] * share).sum();
                let more = gain * f64::from(*light) + even;
                *value = (f64::from(*value) + more).clamp(f32::MIN.into(), f32::MAX.into()) as f32;
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::energy::tests::{energy, grey};
    use super::super::outlier::{Outlier, Removed, find, replace};
    use super::*;
    use crate::options::{Options, OutlierOptions};
    use proptest::prelude::*;

    fn sum(plane: &Plane) -> f64 {
        plane.data().iter().map(|&v| f64::from(v)).sum()
    }

    /// A picture of any size with fireflies of any height, and the witnesses that are asked for.
    fn pictures() -> impl Strategy<Value = (Plane, f32)> {
        let value = prop_oneof![8 => 0.0f32..2.0, 1 => 1e2f32..1e6, 1 => Just(0.0)];
        (1usize..90, 1usize..90, prop_oneof![Just(1.0f32), Just(8.0), Just(64.0)]).prop_flat_map(
            move |(width, height, witnesses)| {
                prop::collection::vec(value.clone(), width * height)
                    .prop_map(move |data| (Plane::from_vec(width, height, data).unwrap(), witnesses))
            },
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 200,
            rng_seed: proptest::test_runner::RngSeed::Fixed(5),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn what_is_taken_out_is_given_back_to_rounding((mut plane, witnesses) in pictures()) {
            let (width, height) = plane.size();
            let variance = &grey(&Plane::from_fn(width, height, |x, y| plane.get(x, y).powi(2)));
            let options = Options {
                outliers: OutlierOptions { deviations: 3.0, share: 0.0, ..OutlierOptions::default() },
                ..Options::default()
            };
            let outliers = find(&grey(&plane), Some(variance), None, &options);
            let before = sum(&plane);
            let taken = replace(&mut plane, &outliers);
            let out: f64 = taken.iter().map(|&e| f64::from(e)).sum();
            prop_assert!((sum(&plane) + out - before).abs() <= 1e-6 * before);
            let gains = Gains::of(&energy(&plane, &outliers, &taken), witnesses);
            let beauty = plane.clone();
            gains.give_plane_back(&mut plane, &beauty, 0, (0, 0));
            let expected = before - out + gains.share * out;
            prop_assert!((sum(&plane) - expected).abs() <= 1e-6 * before, "{} became {}", expected, sum(&plane));
        }
    }

    #[test]
    fn a_lone_firefly_brightens_nothing_a_few_all_alike_and_many_their_surroundings() {
        let flat = Plane::filled(400, 300, 1.0);
        let at = |x: usize, y: usize| Outlier { x, y, from: (0, 0) };
        let given = |outliers: &[Outlier], taken: &[f32]| {
            let mut plane = flat.clone();
            Gains::of(&energy(&flat, outliers, taken), 64.0).give_plane_back(&mut plane, &flat, 0, (0, 0));
            plane
        };
        assert_eq!(given(&[at(20, 20)], &[120.0]), flat);
        let three = given(&[at(20, 20), at(90, 20), at(20, 200)], &[60.0; 3]); // two thirds of 180
        assert!(three.data().iter().all(|v| (v - 1.001).abs() < 1e-6), "{}", three.get(0, 0));
        // So it is where there is no green and no blue.
        let crowd: Vec<Outlier> = (0..100).map(|k| at(20 + k % 10, 20 + k / 10)).collect();
        let black = Plane::filled(400, 300, 0.0);
        for color in [grey(&flat), [flat.clone(), black.clone(), black]] {
            let mut energy = Energy::default();
            let removed = Removed { outliers: crowd.clone(), taken: vec![vec![1.2; 100]; 3] };
            energy.add(color.each_ref(), &removed, Rect::whole(flat.size()), 0);
            let mut near = flat.clone();
            Gains::of(&energy, 64.0).give_plane_back(&mut near, &flat, 0, (0, 0));
            assert!(near.get(20, 20) > 1.01 && near.get(300, 200) == 1.0, "{}", near.get(20, 20));
        }
    }

    #[test]
    fn what_noise_below_black_had_is_given_back_to_what_it_is_the_noise_of() {
        let size @ (width, height) = (64, 48);
        // Its sum is 0, and so its mean over any row.
        let noise = |x: usize, y: usize| if (x + y).is_multiple_of(2) { 0.2 } else { -0.2 };
        let outliers: Vec<Outlier> =
            (0..60).map(|k| Outlier { x: k, y: 7 * k % height, from: (0, 0) }).collect();
        for light in [0.0, 0.01, 0.05, 1.0] {
            let noisy = Plane::from_fn(width, height, |x, y| light + noise(x, y));
            // A denoised picture, which is not quite without noise.
            let denoised = Plane::from_fn(width, height, |x, y| light + 0.1 * noise(x, y));
            let mut result = denoised.clone();
            let gains = Gains::of(&energy(&noisy, &outliers, &[60.0; 60]), 48.0);
            gains.give_plane_back(&mut result, &denoised, 0, (0, 0));
            let given = sum(&result) - sum(&denoised);
            assert!((given / 3600.0 - 1.0).abs() < 1e-3, "{given} where the light is {light}, {size:?}");
        }
    }

    #[test]
    fn energy_over_black_is_spread_evenly() {
        let mut plane = Plane::filled(3, 3, 0.0);
        let beauty = plane.clone();
        let outliers = [1, 2].map(|x| Outlier { x, y: 1, from: (0, 0) });
        let gains = Gains::of(&energy(&plane, &outliers, &[9.0; 2]), 64.0);
        gains.give_plane_back(&mut plane, &beauty, 0, (0, 0));
        assert_eq!(plane.data(), &[1.0; 9]);
    }
}
