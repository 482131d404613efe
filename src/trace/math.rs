//! Vectors, rays, boxes and orthonormal bases of the tracer.

use nalgebra::Vector3;
use wide::f32x4;

/// A point, direction or linear RGB colour.
pub type Vec3 = Vector3<f32>;

/// Bound of the rounding of a sum of products as long as a hit takes, relative to the sum of their
/// magnitudes: up to eight roundings of half an ulp (the γ of Higham 2002, used so by PBRT-v4, section 6.8).
pub const ROUNDING: f32 = 4.0 * f32::EPSILON;
/// Share of the distance by which a shadow ray stops short of its end, for the rounding of distances.
const SHADOW_SHORTENING: f32 = 4.0 * ROUNDING;

/// A ray; the direction has unit length in world space, any length inside an instance.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Start.
    pub origin: Vec3,
    /// Direction.
    pub direction: Vec3,
    /// Moment in the shutter interval, 0 to 1.
    pub time: f32,
}

impl Ray {
    /// The point at distance `t`.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }

    /// The ray from its start, which may have been moved off a surface, to the point `end`, and where it
    /// stops short of that; without an end it goes on for ever.
    #[inline]
    pub fn aimed(self, end: Option<Vec3>) -> (Self, f32) {
        let Some(end) = end else { return (self, f32::INFINITY) };
        let way = end - self.origin;
        let length = way.norm();
        (Self { direction: way / length, ..self }, length * (1.0 - SHADOW_SHORTENING))
    }
}

/// A box with axis-aligned faces; empty when `min > max`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Least coordinates.
    pub min: Vec3,
    /// Greatest coordinates.
    pub max: Vec3,
}

impl Aabb {
    /// Holds nothing.
    pub const EMPTY: Self = Self {
        min: Vec3::new(f32::INFINITY, f32::INFINITY, f32::INFINITY),
        max: Vec3::new(f32::NEG_INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY),
    };

    /// The smallest box around `points`.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| b.union(&Self { min: p, max: p }))
    }

    /// The smallest box around both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.inf(&other.min), max: self.max.sup(&other.max) }
    }

    /// Its middle.
    pub fn center(&self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Length, width and height.
    pub fn extent(&self) -> Vec3 {
        self.max - self.min
    }

    /// Half its surface area; 0 when empty.
    pub fn half_area(&self) -> f32 {
        let e = self.extent().sup(&Vec3::zeros());
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    /// The eight corners.
    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { self.min[axis] } else { self.max[axis] };
            Vec3::new(pick(0), pick(1), pick(2))
        })
    }
}

/// A right-handed orthonormal basis around a normal.
#[derive(Debug, Clone, Copy)]
pub struct Basis {
    s: Vec3,
    t: Vec3,
    n: Vec3,
}

impl Basis {
    /// A basis whose third axis is the unit vector `n` (Duff et al. 2017, without branches).
    #[inline]
    pub fn around(n: Vec3) -> Self {
        let sign = 1f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// From the basis to the world.
    #[inline]
    pub fn to_world(self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }

    /// From the world to the basis.
    #[inline]
    pub fn to_local(self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(&self.s), v.dot(&self.t), v.dot(&self.n))
    }
}

/// `v` with unit length, none when it is zero: in double precision, for squares of single may leave it.
pub fn direction(v: Vector3<f64>) -> Option<Vec3> {
    v.try_normalize(0.0).map(|unit| unit.cast())
}

/// Luminance of linear Rec. 709 RGB.
#[inline]
pub fn luminance(c: Vec3) -> f32 {
    0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z
}

/// `v` mirrored at the unit vector `n`, both pointing away from the surface.
#[inline]
pub fn reflect(v: Vec3, n: Vec3) -> Vec3 {
    n * (2.0 * v.dot(&n)) - v
}

/// Every coordinate of `v` in all four lanes.
#[inline(always)]
pub fn splat(v: Vec3) -> [f32x4; 3] {
    [f32x4::splat(v.x), f32x4::splat(v.y), f32x4::splat(v.z)]
}

/// The scalar products of four pairs of vectors.
#[inline(always)]
pub fn dot4(a: &[f32x4; 3], b: &[f32x4; 3]) -> f32x4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
