//! All geometry of a scene: levels of shapes, each with its hierarchy. Level 0 is the world; the
//! others are groups that instances place in it.

use nalgebra::Vector3;

use super::bvh::{Bvh, Item, ItemKind, Leaf, Packet, Split};
use super::math::{Aabb, ROUNDING, Ray, Vec3};
use super::plan::effect;
use super::shape::{Disk, Sphere, Surface};
use super::transform::{Motion, Placement};

/// A triangle and its shape.
#[derive(Debug, Clone, Copy)]
pub struct Triangle {
    /// Corners, counter-clockwise seen from outside.
    pub corners: [Vec3; 3],
    normal: Vec3,
    error: f32, // of every point's `Surface`
    normals: Option<[Vec3; 3]>,
    uv: [[f32; 2]; 3],
    /// Index of the shape it belongs to.
    pub shape: u32,
}

impl Triangle {
    /// A triangle of shape number `shape`, with its `corners`' shading normals, where they have any, and
    /// texture coordinates.
    pub fn new(corners: [Vec3; 3], normals: Option<[Vec3; 3]>, uv: [[f32; 2]; 3], shape: u32) -> Self {
        let scaled = scaled_normal(&corners);
        let normal = scaled.try_normalize(0.0).unwrap_or_default();
        let error = error(&corners, &normal, scaled.norm());
        Self { corners, normal: normal.cast(), error, normals, uv, shape }
    }

    /// Unit normal of its plane.
    #[inline]
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// [`Surface::error`] of its points.
    pub fn error(&self) -> f32 {
        self.error
    }

    /// Its area.
    pub fn area(&self) -> f32 {
        (0.5 * scaled_normal(&self.corners).norm()) as f32
    }

    #[inline]
    fn surface(&self, [u, v]: [f32; 2]) -> Surface {
        let w = 1.0 - u - v;
        let [a, b, c] = self.corners;
        let shading_normal = match self.normals {
            Some([na, nb, nc]) => (na * w + nb * u + nc * v).normalize(),
            None => self.normal,
        };
        let [ta, tb, tc] = self.uv;
        Surface {
            point: a * w + b * u + c * v,
            normal: self.normal,
            shading_normal,
            uv: [0, 1].map(|i| ta[i] * w + tb[i] * u + tc[i] * v),
            error: self.error,
        }
    }
}

/// The edges from the first corner.
fn edges([a, b, c]: &[Vec3; 3]) -> [Vector3<f64>; 2] {
    [b, c].map(|p| p.cast::<f64>() - a.cast::<f64>())
}

/// The normal with twice the area as length: in double precision, for it is of the edges' square.
fn scaled_normal(corners: &[Vec3; 3]) -> Vector3<f64> {
    let [e1, e2] = edges(corners);
    e1.cross(&e2)
}

/// [`Surface::error`] of a triangle. A point is a sum of the corners; the hit test takes distances off the
/// plane from the determinant of both edges and the way from the first corner, over the edges' product.
/// Along an axis across which the plane lies neither rounds.
fn error(corners: &[Vec3; 3], normal: &Vector3<f64>, twice_area: f64) -> f32 {
    /// Slivers whose test errs by more than this share of their size may shade themselves.
    const MOST: f64 = 1e-3;
    let farthest = corners.iter().fold(Vec3::zeros(), |most, corner| most.sup(&corner.abs()));
    let [e1, e2] = edges(corners).map(|edge| edge.abs());
    let (way, size) = (e1.sup(&e2), e1.amax().max(e2.amax()));
    let determinant: f64 = (0..3)
        .map(|i| way[i] * (e1[(i + 1) % 3] * e2[(i + 2) % 3] + e1[(i + 2) % 3] * e2[(i + 1) % 3]))
        .sum();
    let rounding = f64::from(ROUNDING);
    let of_test = (rounding * determinant / twice_area).min(MOST * size);
    (rounding * normal.abs().dot(&farthest.cast()) + of_test) as f32
}

/// Whatever has a leaf of its own.
#[derive(Debug, Clone, Copy)]
pub enum Solid {
    /// A sphere of a shape.
    Sphere(Sphere, u32),
    /// A disk of a shape.
    Disk(Disk, u32),
    /// A level, placed.
    Instance {
        /// Which level.
        level: u32,
        /// Where.
        motion: Motion,
    },
}

/// A set of triangles and solids with its hierarchy.
#[derive(Debug, Clone)]
pub struct Level {
    triangles: Vec<Triangle>,
    solids: Vec<Solid>,
    packets: Vec<Packet>,
    bvh: Bvh,
    bounds: Aabb,
}

/// Where a ray meets the world.
#[derive(Debug, Clone, Copy)]
pub struct Hit {
    /// Distance along the ray.
    pub t: f32,
    uv: [f32; 2],
    primitive: Leaf, // a packet's hit is stored by the triangle's index
    instance: u32,   // index of the instance among the world's solids, or NONE
}

const NONE: u32 = u32::MAX;

impl Level {
    /// Builds a level. `below` are the levels that its instances place.
    pub fn new(triangles: Vec<Triangle>, solids: Vec<Solid>, below: &[Level], split: Split) -> Self {
        let item = |kind, (index, bounds): (usize, Aabb)| Item { bounds, kind, index: index as u32 };
        let flat = triangles.iter().map(|t| Aabb::around(t.corners)).enumerate();
        let round = solids.iter().map(|solid| solid_bounds(solid, below)).enumerate();
        let items: Vec<Item> = flat
            .map(|entry| item(ItemKind::Triangle, entry))
            .chain(round.map(|entry| item(ItemKind::Solid, entry)))
            .collect();
        let bounds = items.iter().fold(Aabb::EMPTY, |b, item| b.union(&item.bounds));
        let bvh = Bvh::new(items, split);
        let corners = |indices: &Vec<u32>| -> Vec<_> {
            indices.iter().map(|&i| (i, triangles[i as usize].corners)).collect()
        };
        let packets = bvh.packets().iter().map(|indices| Packet::new(&corners(indices))).collect();
        Self { triangles, solids, packets, bvh, bounds }
    }

    /// Nodes of its hierarchy.
    pub fn node_count(&self) -> usize {
        self.bvh.node_count()
    }

    /// The nearest hit before `t_max`, or with `ANY` just some hit. `solid` meets instances.
    #[inline(always)]
    fn search<const ANY: bool>(
        &self,
        ray: &Ray,
        mut t_max: f32,
        meet_instance: impl Fn(u32, f32) -> Option<Hit>,
    ) -> Option<Hit> {
        let mut found = None;
        self.bvh.traverse(ray, &mut t_max, |leaf, t_max| {
            let hit =
                match leaf {
                    Leaf::Packet(index) => self.packets[index as usize].intersect(ray, *t_max).map(|hit| {
                        Hit { t: hit.t, uv: hit.uv, primitive: Leaf::Packet(hit.triangle), instance: NONE }
                    }),
                    Leaf::Solid(index) => {
                        let t = match &self.solids[index as usize] {
                            Solid::Sphere(sphere, _) => sphere.intersect(ray, *t_max),
                            Solid::Disk(disk, _) => disk.intersect(ray, *t_max),
                            Solid::Instance { .. } => {
                                if let Some(hit) = meet_instance(index, *t_max) {
                                    *t_max = hit.t;
                                    found = Some(hit);
                                }
                                return ANY && found.is_some();
                            }
                        };
                        t.map(|t| Hit { t, uv: [0.0; 2], primitive: leaf, instance: NONE })
                    }
                };
            if let Some(hit) = hit {
                *t_max = hit.t;
                found = Some(hit);
            }
            ANY && found.is_some()
        });
        found
    }
}

fn solid_bounds(solid: &Solid, below: &[Level]) -> Aabb {
    match solid {
        Solid::Sphere(sphere, _) => sphere.bounds(),
        Solid::Disk(disk, _) => disk.bounds(),
        Solid::Instance { level, motion } => motion.bounds(&below[*level as usize].bounds),
    }
}

/// The world and the groups that it places.
#[derive(Debug, Clone)]
pub struct World {
    top: Level,
    groups: Vec<Level>,
}

impl World {
    /// A world of `top`, whose instances place `groups`.
    pub fn new(top: Level, groups: Vec<Level>) -> Self {
        Self { top, groups }
    }

    /// Nodes of all hierarchies.
    pub fn node_count(&self) -> usize {
        self.top.node_count() + self.groups.iter().map(Level::node_count).sum::<usize>()
    }

    /// Triangles that are stored, each instanced group counted once.
    pub fn triangle_count(&self) -> usize {
        self.top.triangles.len() + self.groups.iter().map(|group| group.triangles.len()).sum::<usize>()
    }

    /// The nearest hit of `ray`.
    pub fn closest<const E: u32>(&self, ray: &Ray) -> Option<Hit> {
        self.search::<E, false>(ray, f32::INFINITY)
    }

    /// Whether anything lies on `ray` before `t_max`.
    pub fn occluded<const E: u32>(&self, ray: &Ray, t_max: f32) -> bool {
        self.search::<E, true>(ray, t_max).is_some()
    }

    #[inline(always)]
    fn search<const E: u32, const ANY: bool>(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.top.search::<ANY>(ray, t_max, |index, t_max| {
            if E & effect::INSTANCES == 0 {
                return None;
            }
            let Solid::Instance { level, motion } = &self.top.solids[index as usize] else { return None };
            let local = motion.at(ray.time).ray_to_local(ray);
            let hit = self.groups[*level as usize].search::<ANY>(&local, t_max, |_, _| None)?;
            Some(Hit { instance: index, ..hit })
        })
    }

    /// Where the point at `hit` of `ray` is at another `time`.
    pub fn moved<const E: u32>(&self, ray: &Ray, hit: &Hit, time: f32) -> Vec3 {
        let point = ray.at(hit.t);
        if E & effect::INSTANCES == 0 || hit.instance == NONE {
            return point;
        }
        match &self.top.solids[hit.instance as usize] {
            Solid::Instance { motion, .. } => {
                motion.at(time).to_world.point(motion.at(ray.time).to_local.point(point))
            }
            _ => point,
        }
    }

    /// The surface at `hit` of `ray`, and the index of its shape.
    #[inline(always)]
    pub fn surface<const E: u32>(&self, ray: &Ray, hit: &Hit) -> (Surface, u32) {
        if E & effect::INSTANCES == 0 || hit.instance == NONE {
            return self.top.surface(ray, hit);
        }
        let Solid::Instance { level, motion } = &self.top.solids[hit.instance as usize] else {
            return self.top.surface(ray, hit);
        };
        let placement = motion.at(ray.time);
        let (local, shape) = self.groups[*level as usize].surface(&placement.ray_to_local(ray), hit);
        (placed(&placement, &local), shape)
    }
}

/// The surface `local` of a group where `placement` puts it. Its error grows by the rounding of the point's
/// way into the world and of a ray's way back.
#[inline(always)]
fn placed(placement: &Placement, local: &Surface) -> Surface {
    let Placement { to_world, to_local } = placement;
    let scaled = to_local.linear.tr_mul(&local.normal); // as long as a length of 1 along it is in the group
    let (point, normal, per_length) = (to_world.point(local.point), scaled.normalize(), scaled.norm());
    let there = to_world.linear.abs() * local.point.abs() + to_world.shift.abs();
    let back = to_local.linear.abs() * point.abs() + to_local.shift.abs();
    let of_back = local.error + ROUNDING * back.dot(&local.normal.abs());
    Surface {
        point,
        normal,
        shading_normal: placement.normal_to_world(local.shading_normal),
        uv: local.uv,
        error: ROUNDING * there.dot(&normal.abs()) + of_back / per_length,
    }
}

impl Level {
    #[inline]
    fn surface(&self, ray: &Ray, hit: &Hit) -> (Surface, u32) {
        match hit.primitive {
            Leaf::Packet(index) => {
                let triangle = &self.triangles[index as usize];
                (triangle.surface(hit.uv), triangle.shape)
            }
            Leaf::Solid(index) => match &self.solids[index as usize] {
                Solid::Sphere(sphere, shape) => (sphere.surface(ray.at(hit.t)), *shape),
                Solid::Disk(disk, shape) => (disk.surface(ray.at(hit.t)), *shape),
                Solid::Instance { .. } => unreachable!("groups hold no instances"),
            },
        }
    }
}
