//! Shapes that are not triangles: spheres and disks.

use std::f32::consts::{FRAC_1_PI, PI};

use nalgebra::Matrix3;

use super::math::{Aabb, ROUNDING, Ray, Vec3};
use super::transform::Placement;

/// A hit point with what shading needs to know about the surface there.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    /// The point.
    pub point: Vec3,
    /// Unit normal of the true surface, on its outer side.
    pub normal: Vec3,
    /// Unit normal for shading: interpolated on meshes with normals.
    pub shading_normal: Vec3,
    /// Texture coordinates.
    pub uv: [f32; 2],
    /// How far off the surface, along the normal, rounding may put the point or the surface's own hit test.
    pub error: f32,
}

impl Surface {
    /// The ray that leaves into `direction`, from just so far off that it cannot meet the surface again.
    #[inline]
    pub fn leaving(&self, direction: Vec3, time: f32) -> Ray {
        let offset = if direction.dot(&self.normal) < 0.0 { -self.error } else { self.error };
        Ray { origin: self.point + self.normal * offset, direction, time }
    }
}

/// A sphere.
#[derive(Debug, Clone, Copy)]
pub struct Sphere {
    /// Its middle.
    pub center: Vec3,
    /// Its radius, positive.
    pub radius: f32,
    /// Rotation from the world to the sphere's poles, for texture coordinates.
    pub to_poles: Matrix3<f32>,
}

impl Sphere {
    /// The space it takes.
    pub fn bounds(&self) -> Aabb {
        let r = Vec3::repeat(self.radius);
        Aabb { min: self.center - r, max: self.center + r }
    }

    /// The nearest distance in (0, `t_max`) at which `ray` meets it. The discriminant is that of
    /// Haines et al. 2019, which keeps its digits when the sphere is small or far away.
    #[inline]
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<f32> {
        let from_center = ray.origin - self.center;
        let a = ray.direction.norm_squared();
        let b = -from_center.dot(&ray.direction);
        let nearest = from_center + ray.direction * (b / a);
        let discriminant = self.radius * self.radius - nearest.norm_squared();
        if discriminant < 0.0 {
            return None;
        }
        let c = from_center.norm_squared() - self.radius * self.radius;
        let q = b + (a * discriminant).sqrt().copysign(b);
        let (first, second) = if b > 0.0 { (c / q, q / a) } else { (q / a, c / q) };
        [first, second].into_iter().find(|&t| t > 0.0 && t < t_max)
    }

    /// The surface at a hit point, which is moved onto the sphere exactly.
    #[inline]
    pub fn surface(&self, hit: Vec3) -> Surface {
        let normal = (hit - self.center).normalize();
        let local = self.to_poles * normal;
        let phi = local.y.atan2(local.x);
        let u = phi * (0.5 * FRAC_1_PI);
        Surface {
            error: self.error(normal),
            point: self.center + normal * self.radius,
            normal,
            shading_normal: normal,
            uv: [if u < 0.0 { u + 1.0 } else { u }, local.z.clamp(-1.0, 1.0).acos() * FRAC_1_PI],
        }
    }

    /// [`Surface::error`] where the unit normal is `normal`. The hit test squares the radius: counted twice.
    #[inline]
    pub fn error(&self, normal: Vec3) -> f32 {
        ROUNDING * (self.center.abs().dot(&normal.abs()) + 2.0 * self.radius)
    }

    /// Its area.
    pub fn area(&self) -> f32 {
        4.0 * PI * self.radius * self.radius
    }
}

/// The unit disk in the plane z = 0, placed.
#[derive(Debug, Clone, Copy)]
pub struct Disk {
    /// Where it is.
    pub placement: Placement,
}

impl Disk {
    /// The space it takes.
    pub fn bounds(&self) -> Aabb {
        let m = &self.placement.to_world;
        let reach = Vec3::from_fn(|i, _| m.linear[(i, 0)].hypot(m.linear[(i, 1)]));
        Aabb { min: m.shift - reach, max: m.shift + reach }
    }

    /// The distance in (0, `t_max`) at which `ray` meets it.
    #[inline]
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<f32> {
        let local = self.placement.ray_to_local(ray);
        let t = -local.origin.z / local.direction.z;
        let p = local.at(t);
        (t > 0.0 && t < t_max && p.x * p.x + p.y * p.y <= 1.0).then_some(t)
    }

    /// The surface at a hit point.
    #[inline]
    pub fn surface(&self, hit: Vec3) -> Surface {
        let p = self.placement.to_local.point(hit);
        let normal = self.normal();
        let phi = p.y.atan2(p.x) * (0.5 * FRAC_1_PI);
        Surface {
            error: self.error(normal),
            point: self.placement.to_world.point(Vec3::new(p.x, p.y, 0.0)),
            normal,
            shading_normal: normal,
            uv: [p.x.hypot(p.y), if phi < 0.0 { phi + 1.0 } else { phi }],
        }
    }

    /// Its unit normal.
    pub fn normal(&self) -> Vec3 {
        self.placement.normal_to_world(Vec3::z())
    }

    /// [`Surface::error`] where the unit normal is `normal`: to the disk's plane and back.
    #[inline]
    pub fn error(&self, normal: Vec3) -> f32 {
        let m = &self.placement.to_world;
        let reach = m.shift.abs() + m.linear.column(0).abs() + m.linear.column(1).abs();
        2.0 * ROUNDING * normal.abs().dot(&reach)
    }

    /// Its area.
    pub fn area(&self) -> f32 {
        let m = self.placement.to_world.linear.cast::<f64>(); // products of large edges leave single precision
        (f64::from(PI) * m.column(0).cross(&m.column(1)).norm()) as f32
    }
}
