//! Metals: a mirror, or GGX facets of one.

use super::{Scatter, fresnel, microfacet};
use crate::trace::math::{Vec3, reflect};
use crate::trace::sampling::Random;

/// A metal.
#[derive(Debug, Clone, Copy)]
pub struct Conductor {
    /// Real part of the refraction index, per channel.
    pub eta: Vec3,
    /// Imaginary part (absorption), per channel.
    pub k: Vec3,
    /// Factor on the reflectance, 0 to 1.
    pub tint: Vec3,
    /// GGX width α; 0 for a perfect mirror.
    pub roughness: f32,
}

impl Conductor {
    /// Reflectance seen straight.
    pub fn albedo(&self) -> Vec3 {
        self.reflectance(1.0)
    }

    fn reflectance(&self, cos: f32) -> Vec3 {
        fresnel::conductor(cos, self.eta, self.k).component_mul(&self.tint)
    }

    /// As [`super::Bsdf::eval`], `wi` above the surface.
    pub fn eval(&self, wi: Vec3, wo: Vec3) -> (Vec3, f32) {
        if self.roughness == 0.0 || wi.z <= 0.0 || wo.z <= 0.0 {
            return (Vec3::zeros(), 0.0);
        }
        let h = (wi + wo).normalize();
        let d = microfacet::density(h, self.roughness);
        let g = microfacet::visible(wi, h, self.roughness);
        let value = self.reflectance(wi.dot(&h))
            * (d * g * microfacet::visible(wo, h, self.roughness) / (4.0 * wi.z));
        (value, d * g / (4.0 * wi.z))
    }

    /// As [`super::Bsdf::sample`], `wi` above the surface.
    pub fn sample(&self, wi: Vec3, random: &mut Random) -> Option<Scatter> {
        if wi.z <= 0.0 {
            return None;
        }
        if self.roughness == 0.0 {
            let wo = Vec3::new(-wi.x, -wi.y, wi.z);
            return Some(Scatter { wo, weight: self.reflectance(wi.z), pdf: 1.0, delta: true, eta: 1.0 });
        }
        let h = microfacet::sample(wi, self.roughness, random.next_2d());
        let wo = reflect(wi, h);
        if wo.z <= 0.0 {
            return None;
        }
        let pdf = microfacet::visible_density(wi, h, self.roughness) / (4.0 * wo.dot(&h));
        let weight = self.reflectance(wi.dot(&h)) * microfacet::visible(wo, h, self.roughness);
        (pdf > 0.0).then_some(Scatter { wo, weight, pdf, delta: false, eta: 1.0 })
    }
}
