//! Choosing one of many lights for a point: a tree over the lights of finite extent, descended by an
//! estimate of what each child contributes (Conty Estévez and Kulla 2018). Nodes have four children,
//! whose estimates are made side by side in SIMD registers; a hundred lights are four levels.

use std::f32::consts::PI;

use wide::f32x4;

use crate::trace::math::{Aabb, Vec3, dot4, splat};

/// Where light comes from and where it goes.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    /// The space the sources take.
    pub bounds: Aabb,
    /// Unit axis of the cone that holds their normals.
    pub axis: Vec3,
    /// Half angle of that cone.
    pub spread: f32,
    /// Angle around a normal up to which light is sent.
    pub reach: f32,
    /// Radiant power.
    pub power: f32,
}

/// Children of a node.
const WIDTH: usize = 4;
/// Bits of a path that tell the turn at one node.
const TURN_BITS: u32 = WIDTH.ilog2();

/// A child: a node, or with this bit set a light.
#[derive(Debug, Clone, Copy)]
struct Child(u32);

const LEAF: u32 = 1 << 31;

/// The extents of four children, as the descent wants them; a child that is missing has no power.
#[derive(Debug, Clone)]
struct Node {
    center: [f32x4; 3],
    radius: f32x4, // half diagonal of the box
    power: f32x4,
    cones: Option<Box<Cones>>, // none when all four shine everywhere
    children: [Child; WIDTH],
}

/// The directions into which four children shine.
#[derive(Debug, Clone)]
struct Cones {
    axis: [f32x4; 3],
    sin_spread: f32x4,
    cos_spread: f32x4,
    cos_reach: f32x4,
}

/// The tree.
#[derive(Debug, Clone, Default)]
pub struct LightTree {
    nodes: Vec<Node>,
    /// For each light, the turns from the root to its leaf, lowest bits first.
    paths: Vec<u64>,
}

impl LightTree {
    /// A tree over the lights of `lights`, given with their index; indices are below `count`.
    pub fn new(mut lights: Vec<(u32, Extent)>, count: usize) -> Self {
        let mut tree = Self { nodes: vec![], paths: vec![0; count] };
        if !lights.is_empty() {
            tree.add(&mut lights, 0, 0);
        }
        tree
    }

    /// Whether there is no light in it.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Adds the node over `lights` and all below it, `depth` bits of turns below the root.
    fn add(&mut self, lights: &mut [(u32, Extent)], path: u64, depth: u32) -> usize {
        let index = self.nodes.len();
        let mut parts = quarters(lights);
        let extents: Vec<Extent> = parts.iter().map(|part| union(part)).collect();
        self.nodes.push(Node::new(&extents));
        for (turn, part) in parts.iter_mut().enumerate() {
            let path = path | (turn as u64) << depth;
            self.nodes[index].children[turn] = if let [(light, _)] = part {
                self.paths[*light as usize] = path;
                Child(*light | LEAF)
            } else {
                Child(self.add(part, path, depth + TURN_BITS) as u32)
            };
        }
        index
    }

    /// Chooses a light for `point` by `u`: its index and probability. `normal` is that of a surface that
    /// scatters only to its side; without one, light may arrive from anywhere. None when no light can
    /// reach the point.
    #[inline]
    pub fn sample(&self, point: Vec3, normal: Option<Vec3>, mut u: f32) -> Option<(usize, f32)> {
        let place = Place::new(point, normal);
        let mut probability = 1.0;
        let mut index = 0;
        loop {
            let node = &self.nodes[index];
            let shares = Shares::new(node.importance(&place))?;
            let turn = shares.turn(u);
            u = shares.rest(u, turn);
            probability *= shares.probability(turn);
            let child = node.children[turn].0;
            if child & LEAF != 0 {
                return Some(((child & !LEAF) as usize, probability));
            }
            index = child as usize;
        }
    }

    /// The probability of [`LightTree::sample`] to choose `light`.
    pub fn probability(&self, point: Vec3, normal: Option<Vec3>, light: usize) -> f32 {
        let place = Place::new(point, normal);
        let mut path = self.paths[light];
        let mut probability = 1.0;
        let mut index = 0;
        loop {
            let node = &self.nodes[index];
            let Some(shares) = Shares::new(node.importance(&place)) else { return 0.0 };
            let turn = path as usize & (WIDTH - 1);
            probability *= shares.probability(turn);
            let child = node.children[turn].0;
            if child & LEAF != 0 {
                return probability;
            }
            index = child as usize;
            path >>= TURN_BITS;
        }
    }
}

/// Divides `lights` into up to four parts of nearly equal number, each at the middle of its longest axis.
fn quarters(lights: &mut [(u32, Extent)]) -> Vec<&mut [(u32, Extent)]> {
    let mut parts = vec![lights];
    while parts.len() < WIDTH {
        let largest = (0..parts.len()).max_by_key(|&i| (parts[i].len(), std::cmp::Reverse(i)));
        let Some(largest) = largest.filter(|&i| parts[i].len() > 1) else { break };
        let part = parts.remove(largest);
        let axis = union(part).bounds.extent().imax();
        let key = |(index, extent): &(u32, Extent)| (extent.bounds.center()[axis], *index);
        part.sort_by(|a, b| key(a).0.total_cmp(&key(b).0).then(key(a).1.cmp(&key(b).1)));
        let (first, second) = part.split_at_mut(part.len() / 2);
        parts.extend([first, second]);
    }
    parts
}

fn union(lights: &[(u32, Extent)]) -> Extent {
    lights[1..].iter().fold(lights[0].1, |sum, (_, extent)| sum.union(extent))
}

/// Where light is to be chosen for.
struct Place {
    point: [f32x4; 3],
    normal: Option<[f32x4; 3]>,
}

impl Place {
    #[inline(always)]
    fn new(point: Vec3, normal: Option<Vec3>) -> Self {
        Self { point: splat(point), normal: normal.map(splat) }
    }
}

/// What four children contribute, and the sums of the first one to all four.
struct Shares {
    importance: [f32; WIDTH],
    sums: [f32; WIDTH],
}

impl Shares {
    /// None when no child contributes.
    #[inline(always)]
    fn new(importance: f32x4) -> Option<Self> {
        let importance = importance.to_array();
        let mut sums = importance;
        for i in 1..WIDTH {
            sums[i] += sums[i - 1];
        }
        (sums[WIDTH - 1] > 0.0).then_some(Self { importance, sums })
    }

    /// The child that `u` falls to; never one that contributes nothing.
    #[inline(always)]
    fn turn(&self, u: f32) -> usize {
        let total = self.sums[WIDTH - 1];
        let target = u * total;
        let passed = self.sums.iter().filter(|&&sum| sum <= target).count();
        let last = self.sums.iter().filter(|&&sum| sum < total).count(); // where rounding ends up at most
        passed.min(last)
    }

    /// `u` stretched to [0, 1) inside the child that it fell to.
    #[inline(always)]
    fn rest(&self, u: f32, turn: usize) -> f32 {
        let before = self.sums[turn] - self.importance[turn];
        let rest = (u * self.sums[WIDTH - 1] - before) / self.importance[turn];
        rest.clamp(0.0, 1.0 - f32::EPSILON / 2.0)
    }

    #[inline(always)]
    fn probability(&self, turn: usize) -> f32 {
        self.importance[turn] / self.sums[WIDTH - 1]
    }
}

/// Cosine of max(0, a − b), for angles given by sine and cosine.
#[inline(always)]
fn cos_difference((sin_a, cos_a): (f32x4, f32x4), (sin_b, cos_b): (f32x4, f32x4)) -> f32x4 {
    cos_a.simd_gt(cos_b).select(f32x4::ONE, cos_a * cos_b + sin_a * sin_b)
}

#[inline(always)]
fn with_sine(cos: f32x4) -> (f32x4, f32x4) {
    ((f32x4::ONE - cos * cos).fast_max(f32x4::ZERO).sqrt(), cos)
}

impl Node {
    /// A node over up to four children.
    fn new(extents: &[Extent]) -> Self {
        let lanes = |value: &dyn Fn(&Extent) -> f32| {
            f32x4::from(std::array::from_fn(|i| extents.get(i).map_or(0.0, value)))
        };
        let vector = |value: &dyn Fn(&Extent) -> Vec3| [0, 1, 2].map(|axis| lanes(&|e| value(e)[axis]));
        let everywhere = extents.iter().all(|extent| extent.spread >= PI);
        let cones = || Cones {
            axis: vector(&|extent| extent.axis),
            sin_spread: lanes(&|extent| extent.spread.sin()),
            cos_spread: lanes(&|extent| extent.spread.cos()),
            cos_reach: lanes(&|extent| extent.reach.cos()),
        };
        Self {
            center: vector(&|extent| extent.bounds.center()),
            radius: lanes(&|extent| 0.5 * extent.bounds.extent().norm()),
            power: lanes(&|extent| extent.power),
            cones: (!everywhere).then(|| Box::new(cones())),
            children: [Child(LEAF); WIDTH],
        }
    }

    /// Upper estimates, up to a constant factor, of the light that reaches `place` from each child.
    #[inline(always)]
    fn importance(&self, place: &Place) -> f32x4 {
        let way: [f32x4; 3] = std::array::from_fn(|axis| self.center[axis] - place.point[axis]);
        let distance2 = dot4(&way, &way).fast_max(f32x4::splat(f32::MIN_POSITIVE));
        let inverse = f32x4::ONE / distance2.sqrt();
        // The angle under which the sphere around the box is seen is taken off every other angle.
        let sin_subtended = self.radius * inverse;
        // The half diagonal as least distance keeps lights that surround the point finite.
        let mut importance = self.power / distance2.fast_max(self.radius * self.radius);
        if let Some(normal) = &place.normal {
            // cos a + sin b is positive just where cos(a − b) is, and needs no root.
            let facing = dot4(normal, &way) * inverse + sin_subtended;
            importance *= facing.fast_max(f32x4::ZERO).fast_min(f32x4::ONE);
        }
        match &self.cones {
            Some(cones) => importance * cones.least_cosine(&way, inverse, sin_subtended),
            None => importance,
        }
    }
}

impl Cones {
    /// Cosine of the least angle between a child's normals and the direction to the point; 0 where the
    /// child does not shine there.
    #[inline(always)]
    fn least_cosine(&self, way: &[f32x4; 3], inverse: f32x4, sin_subtended: f32x4) -> f32x4 {
        let off_axis =
            with_sine((-dot4(&self.axis, way) * inverse).fast_max(-f32x4::ONE).fast_min(f32x4::ONE));
        let (cos_subtended, _) = with_sine(sin_subtended); // the other leg of the same triangle
        let off_normals = cos_difference(off_axis, (self.sin_spread, self.cos_spread));
        let least = cos_difference(with_sine(off_normals), (sin_subtended, cos_subtended));
        let surrounds = sin_subtended.simd_ge(f32x4::ONE) | self.cos_spread.simd_le(-f32x4::ONE);
        let least = surrounds.select(f32x4::ONE, least);
        least.simd_gt(self.cos_reach).select(least.fast_max(f32x4::ZERO), f32x4::ZERO)
    }
}

impl Extent {
    fn union(&self, other: &Self) -> Self {
        let (axis, spread) = union_of_cones((self.axis, self.spread), (other.axis, other.spread));
        Self {
            bounds: self.bounds.union(&other.bounds),
            axis,
            spread,
            reach: self.reach.max(other.reach),
            power: self.power + other.power,
        }
    }
}

/// The smallest cone around two cones, each an axis and a half angle.
fn union_of_cones(a: (Vec3, f32), b: (Vec3, f32)) -> (Vec3, f32) {
    let (wide, slim) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    let between = wide.0.dot(&slim.0).clamp(-1.0, 1.0).acos();
    if (between + slim.1).min(PI) <= wide.1 {
        return wide;
    }
    let spread = 0.5 * (wide.1 + between + slim.1);
    let turn_axis = wide.0.cross(&slim.0);
    if spread >= PI || turn_axis.norm_squared() < 1e-12 {
        return (wide.0, PI);
    }
    let turn =
        nalgebra::Rotation3::from_axis_angle(&nalgebra::Unit::new_normalize(turn_axis), spread - wide.1);
    (turn * wide.0, spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lamp(i: u32) -> (u32, Extent) {
        let hash = |k: u32| {
            (i.wrapping_mul(2_654_435_761).wrapping_add(k.wrapping_mul(40_503)) >> 8) as f32
                / (1u32 << 24) as f32
        };
        let place = Vec3::new(hash(1), hash(2), hash(3)) * 4.0;
        let (spread, reach) = if i.is_multiple_of(3) { (PI, PI / 2.0) } else { (0.0, 1.2) };
        let axis = (Vec3::new(hash(4), hash(5), hash(6)) - Vec3::repeat(0.5)).normalize();
        let bounds = Aabb { min: place, max: place + Vec3::repeat(0.1) };
        (i, Extent { bounds, axis, spread, reach, power: 1.0 + hash(7) })
    }

    #[test]
    fn probabilities_sum_to_one_and_are_those_of_the_samples() {
        let tree = LightTree::new((0..37).map(lamp).collect(), 37);
        let (point, normal) = (Vec3::new(1.0, 0.3, 2.0), Some(Vec3::y()));
        let told: Vec<f32> = (0..37).map(|i| tree.probability(point, normal, i)).collect();
        assert!((told.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        const DRAWS: u32 = 100_000;
        let mut drawn = [0u32; 37];
        for k in 0..DRAWS {
            let (light, probability) = tree.sample(point, normal, (k as f32 + 0.5) / DRAWS as f32).unwrap();
            assert!((probability - told[light]).abs() <= 1e-5 * probability);
            drawn[light] += 1;
        }
        for (light, &count) in drawn.iter().enumerate() {
            let expected = told[light] * DRAWS as f32;
            assert!((count as f32 - expected).abs() <= 3.0 + 1e-3 * expected, "{light}: {count}, {expected}");
        }
    }

    /// A light that shines on the point must have a chance: a choice that forgets it would be biased.
    #[test]
    fn whatever_shines_on_the_point_can_be_chosen() {
        let lights: Vec<_> = (0..37).map(lamp).collect();
        let tree = LightTree::new(lights.clone(), 37);
        let point = Vec3::new(2.0, -1.0, 2.0);
        for (i, extent) in lights {
            let way = (point - extent.bounds.center()).normalize();
            let shines = extent.spread == PI || way.dot(&extent.axis) > extent.reach.cos();
            assert!(!shines || tree.probability(point, Some(Vec3::y()), i as usize) > 0.0, "{i}");
        }
    }
}
