//! How surfaces scatter light. Directions are local: the shading normal is the z axis, `wi` points to
//! where the path came from, `wo` to where it goes on, both away from the surface. Materials that do
//! not transmit look the same from both sides.

mod conductor;
mod dielectric;
mod fresnel;
mod microfacet;
mod plastic;

use std::f32::consts::{FRAC_1_PI, PI};

pub use conductor::Conductor;
pub use dielectric::Dielectric;
pub use plastic::Plastic;

use super::math::Vec3;
use super::sampling::{Random, cosine_hemisphere};
use super::texture::Texture;

/// A scattering function at one point of a surface.
#[derive(Debug, Clone, Copy)]
pub enum Bsdf {
    /// Lambert's law, with this reflectance.
    Diffuse(Vec3),
    /// A metal.
    Conductor(Conductor),
    /// Glass, water.
    Dielectric(Dielectric),
    /// A diffuse base under a smooth clear coat.
    Plastic(Plastic),
}

/// A sampled continuation of a path.
#[derive(Debug, Clone, Copy)]
pub struct Scatter {
    /// Its direction.
    pub wo: Vec3,
    /// Scattering function times cosine over density.
    pub weight: Vec3,
    /// Density over solid angle; 1 for a `delta`.
    pub pdf: f32,
    /// Whether this is the only direction the lobe has.
    pub delta: bool,
    /// Ratio of refraction indices crossed; 1 for reflection.
    pub eta: f32,
}

impl Bsdf {
    /// Whether it has nothing but single directions, so that sampling lights is of no use.
    pub fn is_delta(&self) -> bool {
        match self {
            Bsdf::Diffuse(_) | Bsdf::Plastic(_) => false,
            Bsdf::Conductor(conductor) => conductor.roughness == 0.0,
            Bsdf::Dielectric(dielectric) => dielectric.roughness == 0.0,
        }
    }

    /// Whether its continuation shows other surfaces, more or less sharply.
    pub fn is_glossy(&self) -> bool {
        !matches!(self, Bsdf::Diffuse(_))
    }

    /// Scattering function times cosine of `wo`, and the density with which `sample` takes `wo`;
    /// without single directions.
    pub fn eval(&self, wi: Vec3, wo: Vec3) -> (Vec3, f32) {
        let (wi_up, wo_up) = above(wi, wo);
        match self {
            Bsdf::Diffuse(reflectance) => diffuse_eval(*reflectance, wi, wo),
            Bsdf::Conductor(conductor) => conductor.eval(wi_up, wo_up),
            Bsdf::Dielectric(dielectric) => dielectric.eval(wi, wo),
            Bsdf::Plastic(plastic) => plastic.eval(wi_up, wo_up),
        }
    }

    /// Samples a continuation; none when the sample is absorbed.
    pub fn sample(&self, wi: Vec3, random: &mut Random) -> Option<Scatter> {
        let turned = |scatter: Scatter| Scatter { wo: above(wi, scatter.wo).1, ..scatter };
        match self {
            Bsdf::Diffuse(reflectance) => diffuse_sample(*reflectance, wi, random),
            Bsdf::Conductor(conductor) => conductor.sample(above(wi, wi).0, random).map(turned),
            Bsdf::Dielectric(dielectric) => dielectric.sample(wi, random),
            Bsdf::Plastic(plastic) => plastic.sample(above(wi, wi).0, random).map(turned),
        }
    }

    /// The albedo that the feature buffer records: what the surface makes of white light, seen straight.
    pub fn albedo(&self) -> Vec3 {
        match self {
            Bsdf::Diffuse(reflectance) => *reflectance,
            Bsdf::Conductor(conductor) => conductor.albedo(),
            Bsdf::Dielectric(_) => Vec3::repeat(1.0),
            Bsdf::Plastic(plastic) => plastic.reflectance,
        }
    }
}

/// Both directions mirrored so that `wi` lies above the surface.
fn above(wi: Vec3, wo: Vec3) -> (Vec3, Vec3) {
    let sign = 1f32.copysign(wi.z);
    (Vec3::new(wi.x, wi.y, wi.z * sign), Vec3::new(wo.x, wo.y, wo.z * sign))
}

/// [`Bsdf::eval`] of a diffuse surface.
#[inline]
pub fn diffuse_eval(reflectance: Vec3, wi: Vec3, wo: Vec3) -> (Vec3, f32) {
    if wi.z * wo.z <= 0.0 {
        return (Vec3::zeros(), 0.0);
    }
    let pdf = wo.z.abs() * FRAC_1_PI;
    (reflectance * pdf, pdf)
}

/// [`Bsdf::sample`] of a diffuse surface.
#[inline]
pub fn diffuse_sample(reflectance: Vec3, wi: Vec3, random: &mut Random) -> Option<Scatter> {
    let up = cosine_hemisphere(random.next_2d());
    let pdf = up.z * FRAC_1_PI;
    let wo = Vec3::new(up.x, up.y, up.z.copysign(wi.z));
    (pdf > 0.0).then_some(Scatter { wo, weight: reflectance, pdf, delta: false, eta: 1.0 })
}

/// A material: a scattering function whose parameters may vary over the surface.
#[derive(Debug, Clone)]
pub enum Material {
    /// Lambert's law.
    Diffuse(Texture),
    /// A metal.
    Conductor(Conductor),
    /// Glass, water.
    Dielectric(Dielectric),
    /// A diffuse base under a smooth clear coat.
    Plastic {
        /// The base's reflectance.
        reflectance: Texture,
        /// The coat.
        coat: Plastic,
    },
}

impl Material {
    /// The scattering function at texture coordinates `uv`.
    pub fn at(&self, uv: [f32; 2]) -> Bsdf {
        match self {
            Material::Diffuse(reflectance) => Bsdf::Diffuse(reflectance.at(uv)),
            Material::Conductor(conductor) => Bsdf::Conductor(*conductor),
            Material::Dielectric(dielectric) => Bsdf::Dielectric(*dielectric),
            Material::Plastic { reflectance, coat } => Bsdf::Plastic(coat.over(reflectance.at(uv))),
        }
    }

    /// Its texture, where it has one.
    pub fn texture(&self) -> Option<&Texture> {
        match self {
            Material::Diffuse(texture) | Material::Plastic { reflectance: texture, .. } => Some(texture),
            _ => None,
        }
    }
}

/// Mean of `reflected(cos θ)` over a diffusely lit hemisphere, by the midpoint rule in sin² θ.
fn diffuse_mean(reflected: impl Fn(f32) -> f32) -> f32 {
    const STEPS: usize = 4096;
    let cos = |i: usize| (1.0 - (i as f64 + 0.5) / STEPS as f64).sqrt() as f32;
    ((0..STEPS).map(|i| f64::from(reflected(cos(i)))).sum::<f64>() / STEPS as f64) as f32
}

/// Solid angle of the sphere, for densities.
pub const SPHERE: f32 = 4.0 * PI;
