//! Noisy features are filtered before the fit sees them.
//!
//! A feature's noise may be the colour's own (visibility comes from the very same shadow rays), and a
//! fit through it reproduces that noise while its risk looks small. NLM over the feature's own planes
//! (Rousselle, Knaus, Zwicker 2012), weighted by the feature's own variance, takes it out.

use super::nlm;
use super::variance;
use crate::frame::Feature;
use crate::image::Plane;
use crate::options::PrefilterOptions;
use std::borrow::Cow;

/// The planes of `feature`, filtered where a variance (or half buffers) says how noisy they are; `noisy`
/// tells whether it says so of any pixel of the whole picture.
pub fn apply(feature: Cow<'_, Feature>, noisy: bool, options: &PrefilterOptions) -> Vec<Plane> {
    if !options.enabled || !noisy {
        return planes(feature);
    }
    let variances = match (&feature.var_of_mean, &feature.halves) {
        (Some(given), _) => Cow::Borrowed(given),
        (None, Some([a, b])) => {
            let pairs = a.iter().zip(b);
            Cow::Owned(pairs.map(|(a, b)| variance::smooth(&variance::from_halves(a, b), 1)).collect())
        }
        (None, None) => return planes(feature),
    };
    let PrefilterOptions { window_radius, patch_radius, bandwidth, .. } = *options;
    nlm::filter(&feature.planes, &variances, window_radius, patch_radius, bandwidth)
}

/// The planes of a feature, copied only where it is not given away.
fn planes(feature: Cow<'_, Feature>) -> Vec<Plane> {
    match feature {
        Cow::Borrowed(feature) => feature.planes.clone(),
        Cow::Owned(feature) => feature.planes,
    }
}
