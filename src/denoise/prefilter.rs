//! Noisy features are filtered before the fit sees them.
//!
//! A feature's noise may be the colour's own (visibility comes from the very same shadow rays), and a
//! fit through it reproduces that noise while its risk looks small. NLM over the feature's own planes
//! (Rousselle, Knaus, Zwicker 2012), weighted by the feature's own variance, takes it out.

use super::nlm;
use super::observer::Observer;
use super::variance;
use crate::error::Result;
use crate::frame::Feature;
use crate::image::Plane;
use crate::options::PrefilterOptions;
use std::borrow::Cow;

/// A feature as the fits see it.
pub struct Prefiltered {
    /// Its planes.
    pub planes: Vec<Plane>,
    /// The variance of what is left of their noise, averaged over the planes; none where it is not known.
    pub noise: Option<Plane>,
}

/// The planes of `feature`, filtered where a variance (or half buffers) says how noisy they are; `noisy`
/// tells whether it says so of any pixel of the whole picture.
///
/// # Errors
/// When `observer` stops the run.
pub fn apply(
    feature: Cow<'_, Feature>,
    noisy: bool,
    options: &PrefilterOptions,
    observer: &dyn Observer,
) -> Result<Prefiltered> {
    let as_it_is = |feature| Ok(Prefiltered { planes: planes(feature), noise: None });
    if !options.enabled || !noisy {
        return as_it_is(feature);
    }
    let variances: Vec<Plane> = match (&feature.var_of_mean, &feature.halves) {
        (Some(given), _) => given.iter().map(believed).collect(),
        (None, Some([a, b])) => {
            let pairs = a.iter().zip(b);
            pairs.map(|(a, b)| variance::smooth(&variance::from_halves(a, b), RADIUS)).collect()
        }
        (None, None) => return as_it_is(feature),
    };
    let PrefilterOptions { window_radius, patch_radius, bandwidth, .. } = *options;
    let nlm::Filtered { planes, weights } =
        nlm::filter(&feature.planes, &variances, window_radius, patch_radius, bandwidth, observer)?;
    let noise = Plane::par_from_fn(weights.width(), weights.height(), |x, y| {
        let variance: f32 = variances.iter().map(|plane| plane.get(x, y) / variances.len() as f32).sum();
        variance / weights.get(x, y)
    });
    Ok(Prefiltered { planes, noise: Some(noise) })
}

/// Radius over which the variance of a feature is averaged.
const RADIUS: usize = 1;

/// The share of its neighbourhood's variance that every pixel's is at least. `[choice]` of 0, ¼, ½ and 1: relMSE ×1, ×0.989,
/// ×0.989 and ×0.996 on five scenes, ×1, ×0.992, ×0.990 and ×0.985 on thirteen others, ×1, ×0.993, ×0.991 and ×0.992 on
/// seventeen; MSE at ½ ×0.996, ×0.990, ×0.967 (16 to 256 spp).
const LEAST_SHARE: f32 = 0.5;

/// `variance`, at least half of its mean over 3×3 pixels. Where an edge takes a small part of a pixel, all of its few
/// samples may have missed it: without noise it would resemble nothing, and stay as far off as it is.
fn believed(variance: &Plane) -> Plane {
    let mut believed = variance::smooth(variance, RADIUS);
    believed.combine(variance, |around, own| own.max(LEAST_SHARE * around));
    believed
}

/// The planes of a feature, copied only where it is not given away.
fn planes(feature: Cow<'_, Feature>) -> Vec<Plane> {
    match feature {
        Cow::Borrowed(feature) => feature.planes.clone(),
        Cow::Owned(feature) => feature.planes,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::denoise::Silent;
    use crate::frame::FeatureKind;

    #[test]
    fn a_pixel_without_noise_among_noisy_ones_is_believed_no_more_than_a_share() {
        let variance = Plane::from_fn(17, 9, |x, y| if x == 8 && y != 4 { 9.0 } else { 0.0 });
        let believed = believed(&variance);
        assert_eq!(believed.get(8, 4), LEAST_SHARE * 2.0, "two of nine are noisy");
        assert_eq!(believed.get(8, 7), variance.get(8, 7));
        assert_eq!(believed.get(3, 4), 0.0, "where nothing around is noisy there is no noise");
    }

    #[test]
    fn what_is_left_of_the_noise_is_what_it_says() {
        let mut seed = 7u32;
        let mut uniform = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let mut gaussian = || 0.1 * (0..12).map(|_| uniform()).sum::<f32>();
        let truth = |x: usize| if x < 32 { 0.2 } else { 0.8 };
        let noisy = Plane::from_fn(64, 64, |x, _| truth(x) + gaussian());
        let feature = Feature::new("x", FeatureKind::Other, vec![noisy])
            .with_variance_of_mean(vec![Plane::filled(64, 64, 0.01)]);
        let Prefiltered { planes, noise } =
            apply(Cow::Owned(feature), true, &PrefilterOptions::default(), &Silent).unwrap();
        let noise = noise.expect("its variance is known");
        let mean = |f: &dyn Fn(usize, usize) -> f32| {
            (0..64).flat_map(|y| (0..64).map(move |x| (x, y))).map(|(x, y)| f64::from(f(x, y))).sum::<f64>()
                / 4096.0
        };
        let [is, said] =
            [mean(&|x, y| (planes[0].get(x, y) - truth(x)).powi(2)), mean(&|x, y| noise.get(x, y))];
        assert!(is < 0.003 && (0.5..2.0).contains(&(said / is)), "{said} instead of {is}");
    }

    #[test]
    fn the_unit_of_a_feature_does_not_matter() {
        let grain = |x: usize, y: usize| ((x * 7919 + y * 104_729) % 13) as f32 / 13.0 - 0.5;
        let filtered = |unit: f32| {
            let plane = |f: &dyn Fn(usize, usize) -> f32| Plane::from_fn(24, 17, f);
            let step = |x: usize| if x < 12 { 0.3 } else { 0.8 };
            let feature = Feature::new(
                "x",
                FeatureKind::Other,
                vec![plane(&|x, y| unit * (step(x) + 0.1 * grain(x, y)))],
            );
            // Of every seventh pixel it is claimed that it has no noise.
            let known = |x: usize, y: usize| (x + 5 * y).is_multiple_of(7);
            let variance = plane(&|x, y| if known(x, y) { 0.0 } else { unit * unit * 1e-3 });
            apply(
                Cow::Owned(feature.with_variance_of_mean(vec![variance])),
                true,
                &PrefilterOptions::default(),
                &Silent,
            )
            .unwrap()
            .planes
            .remove(0)
        };
        let plain = filtered(1.0);
        for unit in [2f32.powi(-30), 2f32.powi(30)] {
            let mut back = filtered(unit);
            back.change(|v| v / unit);
            assert_eq!(back, plain, "{unit}");
        }
    }
}
