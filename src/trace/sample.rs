//! What one path brings home, and which of it is recorded.

use serde::Serialize;

use super::bsdf::Bsdf;
use super::math::Vec3;
use super::plan::effect;
use super::shape::Surface;

/// At which surface the features are recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FeatureMode {
    /// None are recorded.
    None,
    /// At the first surface, whatever it is.
    #[default]
    FirstHit,
    /// At the first surface that is not a perfect mirror or clear glass, seen through those.
    FirstRough,
}

/// Numbers per pixel of the first surface's features: albedo 3, normal 3, position 3, depth 1,
/// visibility 1.
pub const FEATURES: usize = 11;
/// Numbers per pixel of the second surface's features: albedo 3, normal 3, depth 1.
pub const SECOND_FEATURES: usize = 7;
const VISIBILITY: usize = FEATURES - 1;

/// Everything that one path measures. A miss leaves features 0 and visibility 1.
#[derive(Debug, Clone)]
pub struct Sample {
    /// Radiance.
    pub color: Vec3,
    /// Features of the first surface.
    pub features: [f32; FEATURES],
    /// Features of what a glossy first surface shows; 0 on others.
    pub second: [f32; SECOND_FEATURES],
    /// How far what it saw first is from its place in the frame before (2) and in the next (2), in pixels;
    /// 0 unless the render is a frame of an animation.
    pub motion: [f32; 4],
    /// Radiance of each light group; empty unless they are kept apart.
    pub groups: Vec<Vec3>,
    stage: Stage,
    distance: f32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    First,
    Second,
    Done,
}

impl Sample {
    /// An empty sample with room for `groups` light groups.
    pub fn new(groups: usize) -> Self {
        Self {
            color: Vec3::zeros(),
            features: [0.0; FEATURES],
            second: [0.0; SECOND_FEATURES],
            motion: [0.0; 4],
            groups: vec![Vec3::zeros(); groups],
            stage: Stage::Done,
            distance: 0.0,
        }
    }

    /// Empties it for the next path.
    pub fn reset(&mut self, mode: FeatureMode) {
        self.color = Vec3::zeros();
        self.groups.fill(Vec3::zeros());
        if mode != FeatureMode::None {
            self.features = [0.0; FEATURES];
            self.features[VISIBILITY] = 1.0;
            self.second = [0.0; SECOND_FEATURES];
            self.stage = Stage::First;
            self.distance = 0.0;
        }
    }

    /// Adds radiance that light group `group` sent.
    #[inline(always)]
    pub fn add<const E: u32>(&mut self, radiance: Vec3, group: u32) {
        self.color += radiance;
        if E & effect::LIGHT_GROUPS != 0 && !self.groups.is_empty() {
            self.groups[group as usize] += radiance;
        }
    }

    /// Whether further surfaces are still to be recorded.
    #[inline(always)]
    pub fn is_recording(&self) -> bool {
        self.stage != Stage::Done
    }

    /// Records a surface met after `length` more of the path. True when it is the one whose features
    /// are kept, so that its light sample tells the visibility.
    pub fn surface(&mut self, mode: FeatureMode, surface: &Surface, bsdf: &Bsdf, length: f32) -> bool {
        self.distance += length;
        let (albedo, normal) = (bsdf.albedo(), surface.shading_normal);
        match self.stage {
            Stage::First if mode == FeatureMode::FirstRough && bsdf.is_delta() => false,
            Stage::First => {
                self.features[0..3].copy_from_slice(albedo.as_slice());
                self.features[3..6].copy_from_slice(normal.as_slice());
                self.features[6..9].copy_from_slice(surface.point.as_slice());
                self.features[9] = self.distance;
                self.stage = if bsdf.is_glossy() { Stage::Second } else { Stage::Done };
                true
            }
            Stage::Second => {
                self.second[0..3].copy_from_slice(albedo.as_slice());
                self.second[3..6].copy_from_slice(normal.as_slice());
                self.second[6] = self.distance;
                self.stage = Stage::Done;
                false
            }
            Stage::Done => false,
        }
    }

    /// Records whether the light sample of the recorded surface reached its light.
    pub fn visibility(&mut self, reached: bool) {
        self.features[VISIBILITY] = f32::from(u8::from(reached));
    }

    /// Ends the recording: what follows is no longer seen through sharp surfaces.
    pub fn end_recording(&mut self) {
        self.stage = Stage::Done;
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        let all = |v: &[f32]| v.iter().all(|x| x.is_finite());
        all(self.color.as_slice()) && all(&self.features) && all(&self.second)
    }
}
