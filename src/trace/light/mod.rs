//! Lights, each of which can be sampled from any point.

mod area;
mod choice;
mod environment;
mod tree;

use std::f32::consts::PI;

pub use area::{AreaShape, Emitter};
pub use choice::Lights;
pub use environment::Environment;
pub use tree::{Extent, LightTree};

use super::math::{Aabb, Vec3, luminance};

/// A source of light.
#[derive(Debug, Clone)]
pub enum Light {
    /// Shines from a point into all directions.
    Point {
        /// Where it is.
        position: Vec3,
        /// Radiant intensity (power per solid angle).
        intensity: Vec3,
    },
    /// Shines from a point into a cone: fully up to the beam's angle, then falling linearly with the
    /// angle to nothing at the cut-off.
    Spot {
        /// Where it is.
        position: Vec3,
        /// Unit direction of the beam.
        axis: Vec3,
        /// Radiant intensity in the beam.
        intensity: Vec3,
        /// Half angle of the beam, in radians.
        beam: f32,
        /// Half angle of the whole cone, in radians, greater than `beam`.
        cutoff: f32,
    },
    /// Shines from infinitely far away in one direction.
    Directional {
        /// Unit direction in which the light travels.
        direction: Vec3,
        /// Irradiance on a surface that faces it.
        irradiance: Vec3,
    },
    /// A surface that glows on its outer side.
    Area(Emitter),
    /// Radiance from all around.
    Environment(Environment),
}

/// Light that reaches a point from one direction, unless something is in between.
#[derive(Debug, Clone, Copy)]
pub struct LightSample {
    /// Unit direction towards the light.
    pub direction: Vec3,
    /// How far away it is; infinite for distant lights.
    pub distance: f32,
    /// Where a ray to the light ends: just off its surface, so that it does not meet that; none for
    /// distant lights.
    pub end: Option<Vec3>,
    /// Radiance; for lights that have a single direction, irradiance.
    pub radiance: Vec3,
    /// Density over solid angle; 1 where the light has a single direction.
    pub pdf: f32,
    /// Whether the light has a single direction, which no other sampling can find.
    pub delta: bool,
}

impl Light {
    /// Samples light that reaches `from`; none when the sample sends none there.
    pub fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<LightSample> {
        match self {
            Light::Point { position, intensity } => Some(from_point(*position, from, *intensity)),
            Light::Spot { position, axis, intensity, beam, cutoff } => {
                let sample = from_point(*position, from, *intensity);
                let angle = (-sample.direction.dot(axis)).clamp(-1.0, 1.0).acos();
                let share = ((cutoff - angle) / (cutoff - beam)).clamp(0.0, 1.0);
                (share > 0.0).then_some(LightSample { radiance: sample.radiance * share, ..sample })
            }
            Light::Directional { direction, irradiance } => Some(LightSample {
                direction: -*direction,
                distance: f32::INFINITY,
                end: None,
                radiance: *irradiance,
                pdf: 1.0,
                delta: true,
            }),
            Light::Area(emitter) => emitter.sample(from, u),
            Light::Environment(environment) => environment.sample(u),
        }
    }

    /// Where a light of finite extent is and where it shines; none for distant ones.
    pub fn extent(&self) -> Option<Extent> {
        let point = |p: Vec3| Aabb { min: p, max: p };
        match self {
            Light::Point { position, intensity } => Some(Extent {
                bounds: point(*position),
                axis: Vec3::z(),
                spread: PI,
                reach: PI / 2.0,
                power: 4.0 * PI * luminance(*intensity),
            }),
            Light::Spot { position, axis, intensity, cutoff, .. } => Some(Extent {
                bounds: point(*position),
                axis: *axis,
                spread: 0.0,
                reach: *cutoff,
                power: 4.0 * PI * luminance(*intensity),
            }),
            Light::Area(emitter) => Some(emitter.extent()),
            Light::Directional { .. } | Light::Environment(_) => None,
        }
    }
}

fn from_point(position: Vec3, from: Vec3, intensity: Vec3) -> LightSample {
    let way = position - from;
    let distance = way.norm();
    LightSample {
        direction: way / distance,
        distance,
        end: Some(position),
        radiance: intensity / (distance * distance),
        pdf: 1.0,
        delta: true,
    }
}
