//! Fresnel's equations for unpolarised light.

use crate::trace::math::Vec3;

/// Reflection and refraction at a smooth boundary.
#[derive(Debug, Clone, Copy)]
pub struct Boundary {
    /// Share of the light that is reflected.
    pub reflected: f32,
    /// Cosine of the refracted direction, of the other sign than the incident one's.
    pub cos_t: f32,
    /// Refraction index of the far side over that of the near side.
    pub eta: f32,
}

/// At a boundary with index ratio `eta` (below the surface over above), for an incident cosine of
/// either sign.
pub fn dielectric(cos_i: f32, eta: f32) -> Boundary {
    let eta = if cos_i >= 0.0 { eta } else { 1.0 / eta };
    let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    if sin2_t >= 1.0 {
        return Boundary { reflected: 1.0, cos_t: 0.0, eta };
    }
    let (ci, ct) = (cos_i.abs(), (1.0 - sin2_t).sqrt());
    let across = (ci - eta * ct) / (ci + eta * ct);
    let along = (eta * ci - ct) / (eta * ci + ct);
    Boundary { reflected: 0.5 * (across * across + along * along), cos_t: -ct.copysign(cos_i), eta }
}

/// Reflectance of a metal with complex index `eta + i k` for each colour channel.
pub fn conductor(cos_i: f32, eta: Vec3, k: Vec3) -> Vec3 {
    Vec3::from_fn(|c, _| conductor_channel(cos_i, eta[c], k[c]))
}

fn conductor_channel(cos_i: f32, eta: f32, k: f32) -> f32 {
    let (cos2, sin2) = (cos_i * cos_i, 1.0 - cos_i * cos_i);
    let t0 = eta * eta - k * k - sin2;
    let a2_b2 = (t0 * t0 + 4.0 * eta * eta * k * k).max(0.0).sqrt();
    let a = (0.5 * (a2_b2 + t0)).max(0.0).sqrt();
    let across_sum = a2_b2 + cos2;
    let across = (across_sum - 2.0 * a * cos_i) / (across_sum + 2.0 * a * cos_i);
    let along_sum = a2_b2 * cos2 + sin2 * sin2;
    let along_mixed = 2.0 * a * cos_i * sin2;
    let along = across * (along_sum - along_mixed) / (along_sum + along_mixed);
    0.5 * (across + along)
}
