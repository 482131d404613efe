//! What the fits know of the surfaces: the feature planes, filtered, those that are constant left out.

use super::coarse;
use super::facts::{Facts, Known};
use super::observer::Log;
use super::prefilter::{self, Prefiltered};
use super::surfaces::Spread;
use crate::error::Result;
use crate::frame::{Feature, FeatureKind};
use crate::image::{Plane, Rgb};
use crate::options::Options;
use rayon::prelude::*;
use std::borrow::Cow;

/// Albedo beyond this is none: what is divided by it and multiplied by it again keeps its order.
const LARGEST_ALBEDO: f32 = 100.0;

/// Albedo under this does not make its noise count for more: what is seen there does not come of it. `[choice]` of 0.01,
/// 0.03, 0.05 and 0.1: the estimated error's deviation from the true one over 35 scenes at 16 to 256 spp, not bounded yet,
/// ×2.21, ×1.70, ×1.66 and ×1.67.
const NOISE_FLOOR: f32 = 0.05;

/// The features of a picture.
#[derive(Default)]
pub struct Design {
    /// Their planes.
    pub planes: Vec<Plane>,
    /// Of what kind each plane is.
    pub kinds: Vec<FeatureKind>,
    /// Which planes are of one feature, and how far it spreads.
    pub spreads: Vec<Spread>,
    /// The albedo, its floor added, that demodulated kernels divide by.
    pub albedo: Option<Rgb>,
    /// The variance of the noise that is left in it, relative to its square; none where it is not known.
    pub albedo_noise: Option<Plane>,
}

impl Design {
    /// Those of `features` that the options ask for; `facts` tell which are noisy or constant, `known` which
    /// planes are a number anywhere.
    ///
    /// # Errors
    /// When the run is to stop.
    pub fn of(
        features: Vec<Cow<'_, Feature>>,
        facts: &Facts,
        known: &Known,
        options: &Options,
        log: &mut Log<'_>,
    ) -> Result<Self> {
        let (asked, others): (Vec<_>, Vec<_>) = features
            .into_iter()
            .enumerate()
            .partition(|(_, feature)| options.features.contains(&feature.kind));
        drop(others);
        let mut design = Self::default();
        for (f, feature) in asked {
            let (name, kind) = (feature.name.clone(), feature.kind);
            let Prefiltered { planes, noise } =
                prefilter::apply(feature, facts.feature_is_noisy(f), &options.prefilter, log.observer)?;
            if let (FeatureKind::Albedo, None, [r, g, b]) = (kind, &design.albedo, &planes[..]) {
                let albedo = [r, g, b];
                design.albedo = Some(albedo.map(|plane| floored(plane, options.albedo_floor)));
                design.albedo_noise = noise.map(|noise| relative(noise, albedo));
            }
            let mut spread = Spread { planes: 0, variance: 0.0, is_distance: kind == FeatureKind::Depth };
            for (i, plane) in planes.into_iter().enumerate() {
                let name = format!("{name}.{i}");
                if facts.feature_is_constant(f, i) {
                    let why = if known.features[f].planes[i] { "constant" } else { "a number at no pixel" };
                    log.note(format!("feature {name}: left out, it is {why}"));
                } else {
                    log.summary.columns.push(name);
                    design.planes.push(plane);
                    design.kinds.push(kind);
                    spread.planes += 1;
                    spread.variance += facts.feature_spread(f, i);
                }
            }
            if spread.planes > 0 {
                design.spreads.push(spread);
            }
        }
        Ok(design)
    }

    /// The same at half the resolution.
    pub fn halved(&self) -> Self {
        Self {
            planes: self.planes.iter().map(coarse::halve).collect(),
            kinds: self.kinds.clone(),
            spreads: self.spreads.clone(),
            albedo: self.albedo.as_ref().map(|albedo| albedo.each_ref().map(coarse::halve)),
            albedo_noise: None, // the blocks' error is not estimated
        }
    }
}

fn floored(albedo: &Plane, floor: f32) -> Plane {
    Plane::par_from_fn(albedo.width(), albedo.height(), |x, y| {
        albedo.get(x, y).clamp(0.0, LARGEST_ALBEDO) + floor
    })
}

/// `noise` over the mean square of the channels of `albedo`.
fn relative(mut noise: Plane, albedo: [&Plane; 3]) -> Plane {
    noise.rows_mut().enumerate().for_each(|(y, row)| {
        for (x, noise) in row.iter_mut().enumerate() {
            let channel = |plane: &&Plane| plane.get(x, y).clamp(0.0, LARGEST_ALBEDO).powi(2);
            *noise /= albedo.iter().map(channel).sum::<f32>() / 3.0 + NOISE_FLOOR.powi(2);
        }
    });
    noise
}
