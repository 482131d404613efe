//! A diffuse base under a smooth clear coat, with the light that is reflected to and fro between
//! them summed (as Mitsuba's `plastic` with `nonlinear`).

use std::f32::consts::FRAC_1_PI;

use super::{Scatter, diffuse_mean, fresnel};
use crate::trace::math::Vec3;
use crate::trace::sampling::{Random, cosine_hemisphere};

/// A coated diffuse surface.
#[derive(Debug, Clone, Copy)]
pub struct Plastic {
    /// Reflectance of the base.
    pub reflectance: Vec3,
    eta: f32,
    inner_reflectance: f32, // of the coat, met diffusely from below
}

impl Plastic {
    /// A coat of refraction index ratio `eta` over a black base.
    pub fn coat(eta: f32) -> Self {
        let inner_reflectance = diffuse_mean(|cos| fresnel::dielectric(cos, 1.0 / eta).reflected);
        Self { reflectance: Vec3::zeros(), eta, inner_reflectance }
    }

    /// The same coat over a base of `reflectance`.
    pub fn over(self, reflectance: Vec3) -> Self {
        Self { reflectance, ..self }
    }

    /// The base's scattering function times π, without the coat's two crossings.
    fn base(&self) -> Vec3 {
        self.reflectance.map(|r| r / (1.0 - r * self.inner_reflectance)) / (self.eta * self.eta)
    }

    /// Probability to sample the coat, given its reflectance.
    fn coat_share(&self, reflected: f32) -> f32 {
        let base = (1.0 - reflected) * self.reflectance.mean();
        reflected / (reflected + base)
    }

    /// As [`super::Bsdf::eval`], `wi` above the surface.
    pub fn eval(&self, wi: Vec3, wo: Vec3) -> (Vec3, f32) {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return (Vec3::zeros(), 0.0);
        }
        let fi = fresnel::dielectric(wi.z, self.eta).reflected;
        let fo = fresnel::dielectric(wo.z, self.eta).reflected;
        let cosine = wo.z * FRAC_1_PI;
        (self.base() * ((1.0 - fi) * (1.0 - fo) * cosine), (1.0 - self.coat_share(fi)) * cosine)
    }

    /// As [`super::Bsdf::sample`], `wi` above the surface.
    pub fn sample(&self, wi: Vec3, random: &mut Random) -> Option<Scatter> {
        if wi.z <= 0.0 {
            return None;
        }
        let fi = fresnel::dielectric(wi.z, self.eta).reflected;
        let coat = self.coat_share(fi);
        if random.next() < coat {
            let wo = Vec3::new(-wi.x, -wi.y, wi.z);
            return Some(Scatter { wo, weight: Vec3::repeat(fi / coat), pdf: 1.0, delta: true, eta: 1.0 });
        }
        let wo = cosine_hemisphere(random.next_2d());
        let (value, pdf) = self.eval(wi, wo);
        (pdf > 0.0).then_some(Scatter { wo, weight: value / pdf, pdf, delta: false, eta: 1.0 })
    }
}
