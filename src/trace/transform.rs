//! Affine transforms, and shapes' and cameras' motion over the shutter interval.

use nalgebra::{Matrix3, Matrix4};

use super::math::{Aabb, Ray, Vec3};

/// An affine map: a linear part and a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine {
    /// The linear part.
    pub linear: Matrix3<f32>,
    /// The image of the origin.
    pub shift: Vec3,
}

impl Affine {
    /// Leaves everything where it is.
    pub fn identity() -> Self {
        Self { linear: Matrix3::identity(), shift: Vec3::zeros() }
    }

    /// The affine part of a homogeneous matrix whose last row is 0 0 0 1.
    pub fn from_matrix(m: &Matrix4<f64>) -> Self {
        let m: Matrix4<f32> = m.map(|x| x as f32);
        Self { linear: m.fixed_view::<3, 3>(0, 0).into(), shift: m.fixed_view::<3, 1>(0, 3).into() }
    }

    /// The map of points.
    #[inline]
    pub fn point(&self, p: Vec3) -> Vec3 {
        self.linear * p + self.shift
    }

    /// The inverse map; none when the linear part is singular.
    pub fn inverse(&self) -> Option<Self> {
        let linear = self.linear.try_inverse()?;
        Some(Self { linear, shift: -(linear * self.shift) })
    }

    /// The element-wise mean of `self` and `other`, `share` of it from `other`.
    pub fn blend(&self, other: &Self, share: f32) -> Self {
        Self {
            linear: self.linear * (1.0 - share) + other.linear * share,
            shift: self.shift * (1.0 - share) + other.shift * share,
        }
    }
}

/// An affine map and its inverse, of which every ray needs both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// From the shape to the world.
    pub to_world: Affine,
    /// From the world to the shape.
    pub to_local: Affine,
}

impl Placement {
    /// A placement by `to_world`; none when it is singular.
    pub fn new(to_world: Affine) -> Option<Self> {
        Some(Self { to_world, to_local: to_world.inverse()? })
    }

    /// `ray` as the shape sees it; distances along it stay what they are.
    #[inline]
    pub fn ray_to_local(&self, ray: &Ray) -> Ray {
        Ray {
            origin: self.to_local.point(ray.origin),
            direction: self.to_local.linear * ray.direction,
            time: ray.time,
        }
    }

    /// A normal of the shape in the world, of unit length.
    #[inline]
    pub fn normal_to_world(&self, n: Vec3) -> Vec3 {
        self.to_local.linear.tr_mul(&n).normalize()
    }
}

/// Where an instance is during the shutter interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// It stands still.
    Still(Placement),
    /// Its matrix changes evenly from the first to the second.
    Linear(Affine, Affine),
}

impl Motion {
    /// The placement at `time`, 0 to 1. Scene loading has made sure that no moment is singular.
    #[inline(always)]
    pub fn at(&self, time: f32) -> Placement {
        match self {
            Motion::Still(placement) => *placement,
            Motion::Linear(start, end) => {
                let to_world = start.blend(end, time);
                let to_local = to_world.inverse().unwrap_or_else(Affine::identity);
                Placement { to_world, to_local }
            }
        }
    }

    /// The box in the world that holds `local` at all times: corners move along straight lines.
    pub fn bounds(&self, local: &Aabb) -> Aabb {
        let placed = |to_world: &Affine| Aabb::around(local.corners().map(|c| to_world.point(c)));
        match self {
            Motion::Still(placement) => placed(&placement.to_world),
            Motion::Linear(start, end) => placed(start).union(&placed(end)),
        }
    }
}
