//! The GGX distribution of facet normals (Walter et al. 2007), sampled by what is visible (Heitz 2018).
//! Shadowing and masking are independent, as in Mitsuba, whose results ours are checked against.

use std::f32::consts::{PI, TAU};

use crate::trace::math::Vec3;

/// Density of facets with normal `h` for width `alpha`.
pub fn density(h: Vec3, alpha: f32) -> f32 {
    let cos2 = h.z * h.z;
    let a2 = alpha * alpha;
    let root = h.x * h.x + h.y * h.y + cos2 * a2;
    if h.z <= 0.0 { 0.0 } else { a2 / (PI * root * root) }
}

/// Share of the facets `h` that is seen from `v` (Smith); 0 when `v` sees their other side.
pub fn visible(v: Vec3, h: Vec3, alpha: f32) -> f32 {
    if v.dot(&h) * v.z <= 0.0 {
        return 0.0;
    }
    let slope2 = alpha * alpha * (v.x * v.x + v.y * v.y) / (v.z * v.z);
    2.0 / (1.0 + (1.0 + slope2).sqrt())
}

/// Density of [`sample`] at `h`, seen from `v` above the surface.
pub fn visible_density(v: Vec3, h: Vec3, alpha: f32) -> f32 {
    visible(v, h, alpha) * v.dot(&h).abs() * density(h, alpha) / v.z.abs()
}

/// A facet normal in proportion to what is seen of it from `v`, above the surface.
pub fn sample(v: Vec3, alpha: f32, u: [f32; 2]) -> Vec3 {
    let stretched = Vec3::new(alpha * v.x, alpha * v.y, v.z).normalize();
    let across2 = stretched.x * stretched.x + stretched.y * stretched.y;
    let t1 = match across2 > 0.0 {
        true => Vec3::new(-stretched.y, stretched.x, 0.0) / across2.sqrt(),
        false => Vec3::x(),
    };
    let t2 = stretched.cross(&t1);
    let (r, phi) = (u[0].sqrt(), TAU * u[1]);
    let (sin, cos) = phi.sin_cos();
    let p1 = r * cos;
    let blend = 0.5 * (1.0 + stretched.z);
    let p2 = (1.0 - blend) * (1.0 - p1 * p1).max(0.0).sqrt() + blend * r * sin;
    let p3 = (1.0 - p1 * p1 - p2 * p2).max(0.0).sqrt();
    let h = t1 * p1 + t2 * p2 + stretched * p3;
    Vec3::new(alpha * h.x, alpha * h.y, h.z.max(1e-6)).normalize()
}
