//! All geometry of a scene: levels of shapes, each with its hierarchy. Level 0 is the world; the
//! others are groups that instances place in it.

use super::bvh::{Bvh, Item, ItemKind, Leaf, Packet, Split};
use super::math::{Aabb, Ray, Vec3};
use super::plan::effect;
use super::shape::{Disk, Sphere, Surface};
use super::transform::Motion;

/// A triangle and its shape.
#[derive(Debug, Clone, Copy)]
pub struct Triangle {
    /// Corners, counter-clockwise seen from outside.
    pub corners: [Vec3; 3],
    /// Shading normals of the corners, where they have any.
    pub normals: Option<[Vec3; 3]>,
    /// Texture coordinates of the corners.
    pub uv: [[f32; 2]; 3],
    /// Index of the shape it belongs to.
    pub shape: u32,
}

impl Triangle {
    /// Unit normal of its plane.
    #[inline]
    pub fn normal(&self) -> Vec3 {
        self.scaled_normal().normalize()
    }

    /// Its area.
    pub fn area(&self) -> f32 {
        0.5 * self.scaled_normal().norm()
    }

    #[inline]
    fn scaled_normal(&self) -> Vec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(&(c - a))
    }

    #[inline]
    fn surface(&self, [u, v]: [f32; 2]) -> Surface {
        let w = 1.0 - u - v;
        let [a, b, c] = self.corners;
        let normal = self.normal();
        let shading_normal = match self.normals {
            Some([na, nb, nc]) => (na * w + nb * u + nc * v).normalize(),
            None => normal,
        };
        let [ta, tb, tc] = self.uv;
        Surface {
            point: a * w + b * u + c * v,
            normal,
            shading_normal,
            uv: [0, 1].map(|i| ta[i] * w + tb[i] * u + tc[i] * v),
        }
    }
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
        let surface = Surface {
            point: placement.to_world.point(local.point),
            normal: placement.normal_to_world(local.normal),
            shading_normal: placement.normal_to_world(local.shading_normal),
            uv: local.uv,
        };
        (surface, shape)
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
