//! A homogeneous medium that fills a box, or all space.

use std::f32::consts::TAU;

use super::bsdf::SPHERE;
use super::math::{Aabb, Basis, Ray, Vec3};
use super::sampling::{Random, direction};

/// A medium that absorbs and scatters.
#[derive(Debug, Clone, Copy)]
pub struct Medium {
    /// Extinction per unit length, per channel.
    pub extinction: Vec3,
    /// Share of it that is scattering, per channel.
    pub albedo: Vec3,
    /// Mean cosine of scattering (Henyey and Greenstein 1941), in (−1, 1).
    pub anisotropy: f32,
    /// The space it fills; everything when none.
    pub bounds: Option<Aabb>,
}

/// What became of a ray in the medium.
#[derive(Debug, Clone, Copy)]
pub struct Flight {
    /// Where it was scattered; none when it got through.
    pub scattered_at: Option<f32>,
    /// Factor on the path's throughput.
    pub weight: Vec3,
}

impl Medium {
    /// The part of `ray` up to `t_max` that lies in the medium, as start and length.
    fn stretch(&self, ray: &Ray, t_max: f32) -> (f32, f32) {
        let Some(bounds) = &self.bounds else { return (0.0, t_max) };
        let (mut enter, mut leave) = (0f32, t_max);
        for axis in 0..3 {
            let inverse = 1.0 / ray.direction[axis];
            let a = (bounds.min[axis] - ray.origin[axis]) * inverse;
            let b = (bounds.max[axis] - ray.origin[axis]) * inverse;
            enter = enter.max(a.min(b)); // max and min drop the NaN of a ray inside a face's plane
            leave = leave.min(a.max(b));
        }
        (enter, (leave - enter).max(0.0))
    }

    fn transmitted(&self, length: f32) -> Vec3 {
        self.extinction.map(|s| if s == 0.0 { 1.0 } else { (-s * length).exp() })
    }

    /// The share of light that gets along `ray` up to `t_max`.
    #[inline]
    pub fn transmittance(&self, ray: &Ray, t_max: f32) -> Vec3 {
        self.transmitted(self.stretch(ray, t_max).1)
    }

    /// Samples whether and where `ray` is scattered before `t_max`. The free path follows one channel's
    /// extinction, chosen evenly where they differ; the density is that of all three together.
    #[inline]
    pub fn sample(&self, ray: &Ray, t_max: f32, random: &mut Random) -> Flight {
        let (start, length) = self.stretch(ray, t_max);
        let gray = self.extinction.amax() == self.extinction.amin();
        let channel = if gray { 0 } else { ((random.next() * 3.0) as usize).min(2) };
        let free = -(1.0 - random.next()).ln() / self.extinction[channel];
        if free < length {
            let through = self.transmitted(free);
            let density = through.component_mul(&self.extinction).mean();
            let weight = through.component_mul(&self.extinction).component_mul(&self.albedo) / density;
            Flight { scattered_at: Some(start + free), weight }
        } else {
            let through = self.transmitted(length);
            Flight { scattered_at: None, weight: through / through.mean() }
        }
    }

    /// Density of scattering by an angle with cosine `cos` between old and new direction of travel.
    #[inline]
    pub fn phase(&self, cos: f32) -> f32 {
        let g = self.anisotropy;
        let base = 1.0 + g * g - 2.0 * g * cos;
        (1.0 - g * g) / (SPHERE * base * base.sqrt())
    }

    /// Samples a new direction of travel by [`Medium::phase`].
    pub fn scatter(&self, travel: Vec3, random: &mut Random) -> Vec3 {
        let g = self.anisotropy;
        let [u, v] = random.next_2d();
        let cos = if g.abs() < 1e-3 {
            1.0 - 2.0 * u
        } else {
            let root = (1.0 - g * g) / (1.0 - g + 2.0 * g * u);
            (1.0 + g * g - root * root) / (2.0 * g)
        };
        Basis::around(travel).to_world(direction(cos.clamp(-1.0, 1.0), TAU * v))
    }
}
