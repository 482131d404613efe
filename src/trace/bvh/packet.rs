//! Four triangles side by side, met by one ray at once (Möller and Trumbore 1997).

use wide::f32x4;

use crate::trace::math::{Ray, Vec3, dot4, splat};

/// How far outside of its edges a triangle is still met, relative to their length: what rounding would let
/// through between two triangles of one large face.
const EDGE_SLACK: f32 = 4.0 * f32::EPSILON;

/// Four triangles, each a corner and two edges; an unused lane has no extent and is never hit.
#[derive(Debug, Clone)]
pub struct Packet {
    corner: [f32x4; 3],
    edges: [[f32x4; 3]; 2],
    triangles: [u32; 4],
}

/// Where a ray meets a triangle of a packet.
#[derive(Debug, Clone, Copy)]
pub struct PacketHit {
    /// Distance along the ray, in lengths of its direction.
    pub t: f32,
    /// Barycentric coordinates of the second and third corner.
    pub uv: [f32; 2],
    /// The triangle, by its index in the level.
    pub triangle: u32,
}

#[inline(always)]
fn cross(a: &[f32x4; 3], b: &[f32x4; 3]) -> [f32x4; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

impl Packet {
    /// Packs up to four triangles, given by index and corners.
    pub fn new(triangles: &[(u32, [Vec3; 3])]) -> Self {
        let lane = |f: &dyn Fn(&[Vec3; 3]) -> f32| {
            f32x4::from(std::array::from_fn(|l| triangles.get(l).map_or(0.0, |(_, corners)| f(corners))))
        };
        let edge =
            |k: usize| std::array::from_fn(|axis| lane(&|corners| corners[k][axis] - corners[0][axis]));
        Self {
            corner: std::array::from_fn(|axis| lane(&|corners| corners[0][axis])),
            edges: [edge(1), edge(2)],
            triangles: std::array::from_fn(|l| triangles.get(l).map_or(0, |(index, _)| *index)),
        }
    }

    /// The nearest hit of `ray` in (0, `t_max`).
    #[inline(always)]
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<PacketHit> {
        let (origin, direction) = (splat(ray.origin), splat(ray.direction));
        let from_corner = [0, 1, 2].map(|axis| origin[axis] - self.corner[axis]);
        let [e1, e2] = &self.edges;
        let p = cross(&direction, e2);
        let q = cross(&from_corner, e1);
        let inverse = f32x4::ONE / dot4(e1, &p); // infinite in an unused lane, where no test below holds
        let u = dot4(&from_corner, &p) * inverse;
        let v = dot4(&direction, &q) * inverse;
        let t = dot4(e2, &q) * inverse;
        let (least, most) = (f32x4::splat(-EDGE_SLACK), f32x4::splat(1.0 + EDGE_SLACK));
        let inside = u.simd_ge(least) & v.simd_ge(least) & (u + v).simd_le(most);
        let hit = inside & t.simd_gt(f32x4::ZERO) & t.simd_lt(f32x4::splat(t_max));
        let mut lanes = hit.to_bitmask();
        if lanes == 0 {
            return None;
        }
        let (t, u, v) = (t.to_array(), u.to_array(), v.to_array());
        let mut nearest = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            nearest = if t[lane] < t[nearest] { lane } else { nearest };
            lanes &= lanes - 1;
        }
        let l = nearest & 3;
        Some(PacketHit { t: t[l], uv: [u[l], v[l]], triangle: self.triangles[l] })
    }
}
