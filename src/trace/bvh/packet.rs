//! Four triangles side by side, met by one ray at once (Möller and Trumbore 1997).

use crate::trace::math::{Ray, Vec3};

/// One number for each of four children or triangles.
pub type Lanes = [f32; 4];

/// Four triangles, each a corner and two edges; an unused lane has no extent and is never hit.
#[derive(Debug, Clone)]
pub struct Packet {
    corner: [Lanes; 3],
    edges: [[Lanes; 3]; 2],
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
fn each(f: impl Fn(usize) -> f32) -> Lanes {
    [f(0), f(1), f(2), f(3)]
}

#[inline(always)]
fn cross(a: [Lanes; 3], b: [Lanes; 3]) -> [Lanes; 3] {
    let term = |i: usize, j: usize| each(|l| a[i][l] * b[j][l] - a[j][l] * b[i][l]);
    [term(1, 2), term(2, 0), term(0, 1)]
}

#[inline(always)]
fn dot(a: &[Lanes; 3], b: &[Lanes; 3]) -> Lanes {
    each(|l| a[0][l] * b[0][l] + a[1][l] * b[1][l] + a[2][l] * b[2][l])
}

impl Packet {
    /// Packs up to four triangles, given by index and corners.
    pub fn new(triangles: &[(u32, [Vec3; 3])]) -> Self {
        let mut packet = Self { corner: Default::default(), edges: Default::default(), triangles: [0; 4] };
        for (lane, (index, [a, b, c])) in triangles.iter().enumerate() {
            packet.triangles[lane] = *index;
            for axis in 0..3 {
                packet.corner[axis][lane] = a[axis];
                packet.edges[0][axis][lane] = b[axis] - a[axis];
                packet.edges[1][axis][lane] = c[axis] - a[axis];
            }
        }
        packet
    }

    /// The nearest hit of `ray` in (0, `t_max`).
    #[inline(always)]
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<PacketHit> {
        let direction: [Lanes; 3] = std::array::from_fn(|axis| [ray.direction[axis]; 4]);
        let from_corner: [Lanes; 3] = std::array::from_fn(|a| each(|l| ray.origin[a] - self.corner[a][l]));
        let [e1, e2] = &self.edges;
        let p = cross(direction, *e2);
        let q = cross(from_corner, *e1);
        let det = dot(e1, &p);
        let inverse = each(|l| 1.0 / det[l]); // infinite in an unused lane, where no test below holds
        let (du, dv, dt) = (dot(&from_corner, &p), dot(&direction, &q), dot(e2, &q));
        let (u, v, t) =
            (each(|l| du[l] * inverse[l]), each(|l| dv[l] * inverse[l]), each(|l| dt[l] * inverse[l]));
        let mut nearest = None;
        let mut limit = t_max;
        for l in 0..4 {
            if u[l] >= 0.0 && v[l] >= 0.0 && u[l] + v[l] <= 1.0 && t[l] > 0.0 && t[l] < limit {
                limit = t[l];
                nearest = Some(PacketHit { t: t[l], uv: [u[l], v[l]], triangle: self.triangles[l] });
            }
        }
        nearest
    }
}
