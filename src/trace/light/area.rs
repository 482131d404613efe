//! Surfaces that glow.

use std::f32::consts::{PI, TAU};

use super::{Extent, LightSample};
use crate::trace::math::{Aabb, Basis, ROUNDING, Vec3, luminance};
use crate::trace::sampling::{Distribution, concentric_disk, triangle};
use crate::trace::shape::{Disk, Sphere};
use crate::trace::world::Triangle;

/// The surface of a light.
#[derive(Debug, Clone)]
pub enum AreaShape {
    /// A parallelogram.
    Parallelogram {
        /// A corner.
        corner: Vec3,
        /// The edges from it.
        edges: [Vec3; 2],
        /// Unit normal.
        normal: Vec3,
        /// [`Surface::error`](crate::trace::shape::Surface::error) of its points.
        error: f32,
    },
    /// Triangles, chosen by area.
    Triangles(Vec<Triangle>, Distribution),
    /// A sphere.
    Sphere(Sphere),
    /// A disk.
    Disk(Disk),
}

/// A glowing surface.
#[derive(Debug, Clone)]
pub struct Emitter {
    shape: AreaShape,
    radiance: Vec3,
    area: f32,
}

/// A point of the surface, with its unit normal and [`Surface::error`](crate::trace::shape::Surface::error).
type SurfacePoint = (Vec3, Vec3, f32);

impl Emitter {
    /// `shape` with the same `radiance` everywhere and in all directions of its outer side.
    pub fn new(shape: AreaShape, radiance: Vec3) -> Self {
        let area = match &shape {
            AreaShape::Parallelogram { edges: [a, b], .. } => {
                a.cast::<f64>().cross(&b.cast()).norm() as f32 // the square of large edges leaves single precision
            }
            AreaShape::Triangles(_, areas) => areas.total(),
            AreaShape::Sphere(sphere) => sphere.area(),
            AreaShape::Disk(disk) => disk.area(),
        };
        Self { shape, radiance, area }
    }

    /// Samples light that reaches `from`.
    pub fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let (point, normal, error) = match &self.shape {
            AreaShape::Sphere(sphere) => return self.sample_cone(sphere, from, u),
            AreaShape::Parallelogram { corner, edges: [a, b], normal, error } => {
                (corner + a * u[0] + b * u[1], *normal, *error)
            }
            AreaShape::Triangles(triangles, areas) => on_triangles(triangles, areas, u),
            AreaShape::Disk(disk) => {
                let [x, y] = concentric_disk(u);
                let normal = disk.normal();
                (disk.placement.to_world.point(Vec3::new(x, y, 0.0)), normal, disk.error(normal))
            }
        };
        let way = point - from;
        let distance2 = way.norm_squared();
        let distance = distance2.sqrt();
        let direction = way / distance;
        let cos = -direction.dot(&normal);
        let pdf = distance2 / (cos * self.area);
        (cos > 0.0 && pdf.is_finite()).then_some(LightSample {
            direction,
            distance,
            end: Some(off_light(point, normal, error, distance)),
            radiance: self.radiance,
            pdf,
            delta: false,
        })
    }

    /// The density over solid angle with which [`Emitter::sample`] takes the point that a ray from
    /// `from` meets at `distance` under the cosine `cos` to the light's normal.
    pub fn pdf(&self, from: Vec3, distance: f32, cos: f32) -> f32 {
        match &self.shape {
            AreaShape::Sphere(sphere) => cone(sphere, from).map_or(0.0, |cone| cone.pdf),
            _ => distance * distance / (cos * self.area),
        }
    }

    fn sample_cone(&self, sphere: &Sphere, from: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let cone = cone(sphere, from)?;
        let drop = u[0] * cone.height; // 1 − cos θ
        let sin2 = drop * (2.0 - drop); // from the drop: 1 − cos² would lose a small angle's digits
        let (sin_phi, cos_phi) = (TAU * u[1]).sin_cos();
        let local = Vec3::new(sin2.sqrt() * cos_phi, sin2.sqrt() * sin_phi, 1.0 - drop);
        let chord = (sphere.radius * sphere.radius - cone.distance * cone.distance * sin2).max(0.0).sqrt();
        let direction = Basis::around(cone.axis).to_world(local);
        let distance = cone.distance * (1.0 - drop) - chord;
        let normal = (from + direction * distance - sphere.center).normalize();
        let point = sphere.center + normal * sphere.radius;
        Some(LightSample {
            direction,
            distance,
            end: Some(off_light(point, normal, sphere.error(normal), distance)),
            radiance: self.radiance,
            pdf: cone.pdf,
            delta: false,
        })
    }

    /// Where it is and where it shines.
    pub fn extent(&self) -> Extent {
        let (bounds, axis, spread) = match &self.shape {
            AreaShape::Parallelogram { corner, edges: [a, b], normal, .. } => {
                (Aabb::around([*corner, corner + a, corner + b, corner + a + b]), *normal, 0.0)
            }
            AreaShape::Sphere(sphere) => (sphere.bounds(), Vec3::z(), PI),
            AreaShape::Disk(disk) => (disk.bounds(), disk.normal(), 0.0),
            AreaShape::Triangles(triangles, _) => {
                let bounds = Aabb::around(triangles.iter().flat_map(|t| t.corners));
                let sum: Vec3 = triangles.iter().map(|t| t.normal() * (t.area() / self.area)).sum();
                let axis = sum.try_normalize(1e-6).unwrap_or_else(Vec3::z);
                let least = triangles.iter().map(|t| t.normal().dot(&axis)).fold(1.0, f32::min);
                (bounds, axis, least.clamp(-1.0, 1.0).acos())
            }
        };
        let power = PI * self.area * luminance(self.radiance);
        Extent { bounds, axis, spread, reach: PI / 2.0, power }
    }
}

fn on_triangles(triangles: &[Triangle], areas: &Distribution, u: [f32; 2]) -> SurfacePoint {
    let (i, rest) = areas.sample(u[0]);
    let [v, w] = triangle([rest, u[1]]);
    let [a, b, c] = triangles[i].corners;
    (a * (1.0 - v - w) + b * v + c * w, triangles[i].normal(), triangles[i].error())
}

/// Where a ray from `distance` away to the light's `point` is to end: the light's own hit test errs with
/// the length of the ray too.
fn off_light(point: Vec3, normal: Vec3, error: f32, distance: f32) -> Vec3 {
    point + normal * (error + ROUNDING * distance)
}

/// The cone of directions in which a point sees a sphere.
struct Cone {
    axis: Vec3,
    distance: f32,
    height: f32, // 1 − cosine of its half angle
    pdf: f32,
}

/// None from inside, where the sphere shows its dark side.
fn cone(sphere: &Sphere, from: Vec3) -> Option<Cone> {
    let way = sphere.center - from;
    let distance = way.norm();
    let sin2 = (sphere.radius / distance).powi(2);
    if sin2 >= 1.0 {
        return None;
    }
    let height = sin2 / (1.0 + (1.0 - sin2).sqrt()); // keeps its digits when the sphere is far away
    Some(Cone { axis: way / distance, distance, height, pdf: 1.0 / (TAU * height) })
}
