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
    /// The variance of what is left of their noise, where it is known: of distances alone, whose columns are held against
    /// it. `[choice]` Where an edge takes a part of a pixel, the noise of its normal and albedo is the colour's too, but
    /// no neighbour knows that part better: relMSE by depth, with normals, with albedo ×1.000, ×1.004, ×1.008 on five
    /// scenes, ×0.994, ×0.989, ×0.993 on thirteen others.
    pub noise: Vec<Option<Plane>>,
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
                design.albedo_noise = noise.as_ref().map(|noise| relative(noise, albedo));
            }
            let is_distance = kind == FeatureKind::Depth;
            let noise = noise.filter(|_| is_distance);
            let mut spread = Spread { planes: 0, variance: 0.0, is_distance };
            for (i, plane) in planes.into_iter().enumerate() {
                let name = format!("{name}.{i}");
                if facts.feature_is_constant(f, i) {
                    let why = if known.features[f].planes[i] { "constant" } else { "a number at no pixel" };
                    log.note(format!("feature {name}: left out, it is {why}"));
                } else {
                    log.summary.columns.push(name);
                    design.planes.push(plane);
                    design.noise.push(noise.clone());
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
            noise: self.noise.iter().map(|plane| plane.as_ref().map(coarse::halve_variance)).collect(),
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
fn relative(noise: &Plane, albedo: [&Plane; 3]) -> Plane {
    let mut noise = noise.clone();
    noise.rows_mut().enumerate().for_each(|(y, row)| {
        for (x, noise) in row.iter_mut().enumerate() {
            let channel = |plane: &&Plane| plane.get(x, y).clamp(0.0, LARGEST_ALBEDO).powi(2);
            *noise /= albedo.iter().map(channel).sum::<f32>() / 3.0 + NOISE_FLOOR.powi(2);
        }
    });
    noise
}
