//! Clear materials: one smooth boundary, or GGX facets of it (Walter et al. 2007).

use super::{Scatter, fresnel, microfacet};
use crate::trace::math::{Vec3, reflect};
use crate::trace::sampling::Random;

/// A boundary between two clear media; the normal points to the outer one.
#[derive(Debug, Clone, Copy)]
pub struct Dielectric {
    /// Refraction index inside over outside.
    pub eta: f32,
    /// GGX width α; 0 for a smooth boundary.
    pub roughness: f32,
}

/// `wi` refracted at facet `h`, whose side it may be on either of.
fn refract(wi: Vec3, h: Vec3, cos_t: f32, eta: f32) -> Vec3 {
    h * (wi.dot(&h) / eta + cos_t) - wi / eta
}

impl Dielectric {
    /// As [`super::Bsdf::eval`]. Radiance is scaled by the squared index ratio where it crosses.
    pub fn eval(&self, wi: Vec3, wo: Vec3) -> (Vec3, f32) {
        if self.roughness == 0.0 || wi.z == 0.0 || wo.z == 0.0 {
            return (Vec3::zeros(), 0.0);
        }
        let reflects = wi.z * wo.z > 0.0;
        let eta = if wi.z > 0.0 { self.eta } else { 1.0 / self.eta };
        let half = if reflects { wi + wo } else { wi + wo * eta };
        let h = half.normalize() * 1f32.copysign(half.z);
        let (ih, oh) = (wi.dot(&h), wo.dot(&h));
        let f = fresnel::dielectric(ih, self.eta).reflected;
        let d = microfacet::density(h, self.roughness);
        let gi = microfacet::visible(wi, h, self.roughness);
        let g = gi * microfacet::visible(wo, h, self.roughness);
        let seen = gi * d * ih.abs() / wi.z.abs(); // density of the facet among those seen from wi
        if reflects {
            let value = f * d * g / (4.0 * wi.z.abs());
            (Vec3::repeat(value), f * seen / (4.0 * oh.abs()))
        } else {
            let stretch = oh.abs() / (ih + eta * oh).powi(2);
            // The 1/η² of radiance cancels the η² of the change of variables.
            let value = (1.0 - f) * d * g * ih.abs() * stretch / wi.z.abs();
            (Vec3::repeat(value), (1.0 - f) * seen * eta * eta * stretch)
        }
    }

    /// As [`super::Bsdf::sample`].
    pub fn sample(&self, wi: Vec3, random: &mut Random) -> Option<Scatter> {
        if wi.z == 0.0 {
            return None;
        }
        let h = match self.roughness == 0.0 {
            true => Vec3::z(),
            false => microfacet::sample(wi * 1f32.copysign(wi.z), self.roughness, random.next_2d()),
        };
        let boundary = fresnel::dielectric(wi.dot(&h), self.eta);
        let reflects = random.next() < boundary.reflected;
        let wo = match reflects {
            true => reflect(wi, h),
            false => refract(wi, h, boundary.cos_t, boundary.eta),
        };
        if (wi.z * wo.z > 0.0) != reflects {
            return None; // the facet sends it through the surface: a second bounce, which is not modelled
        }
        let (eta, scale) = if reflects { (1.0, 1.0) } else { (boundary.eta, boundary.eta.powi(-2)) };
        if self.roughness == 0.0 {
            return Some(Scatter { wo, weight: Vec3::repeat(scale), pdf: 1.0, delta: true, eta });
        }
        let pdf = self.eval(wi, wo).1;
        let weight = Vec3::repeat(scale * microfacet::visible(wo, h, self.roughness));
        (pdf > 0.0).then_some(Scatter { wo, weight, pdf, delta: false, eta })
    }
}
