//! Choosing one of many lights for a point: a binary tree over the lights of finite extent, descended
//! by an estimate of what each half contributes (Conty Estévez and Kulla 2018). The cost grows with
//! the logarithm of their number.

use std::f32::consts::PI;

use crate::trace::math::{Aabb, Vec3};

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

#[derive(Debug, Clone)]
struct Node {
    extent: Bound,
    /// The second child (the first follows its parent), or none in a leaf.
    second: Option<u32>,
    light: u32,
}

/// The tree.
#[derive(Debug, Clone, Default)]
pub struct LightTree {
    nodes: Vec<Node>,
    /// For each light, the turns from the root to its leaf, lowest bit first.
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

    fn add(&mut self, lights: &mut [(u32, Extent)], path: u64, depth: u32) {
        let index = self.nodes.len();
        let extent = lights[1..].iter().fold(lights[0].1, |sum, (_, extent)| sum.union(extent));
        self.nodes.push(Node { extent: Bound::new(&extent), second: None, light: lights[0].0 });
        if lights.len() == 1 {
            self.paths[lights[0].0 as usize] = path;
            return;
        }
        let axis = extent.bounds.extent().imax();
        let middle = lights.len() / 2;
        let key = |(index, extent): &(u32, Extent)| (extent.bounds.center()[axis], *index);
        lights.sort_by(|a, b| key(a).0.total_cmp(&key(b).0).then(key(a).1.cmp(&key(b).1)));
        let (first, second) = lights.split_at_mut(middle);
        self.add(first, path, depth + 1);
        self.nodes[index].second = Some(self.nodes.len() as u32);
        self.add(second, path | 1 << depth, depth + 1);
    }

    /// Chooses a light for `point` (with `normal` on a surface) by `u`: its index and probability.
    /// None when no light can reach the point.
    pub fn sample(&self, point: Vec3, normal: Option<Vec3>, mut u: f32) -> Option<(usize, f32)> {
        let mut probability = 1.0;
        let mut index = 0;
        while let Some(second) = self.nodes[index].second {
            let share = self.first_share(index, point, normal)?;
            if u < share {
                u /= share;
                probability *= share;
                index += 1;
            } else {
                u = (u - share) / (1.0 - share);
                probability *= 1.0 - share;
                index = second as usize;
            }
        }
        Some((self.nodes[index].light as usize, probability))
    }

    /// The probability of [`LightTree::sample`] to choose `light`.
    pub fn probability(&self, point: Vec3, normal: Option<Vec3>, light: usize) -> f32 {
        let mut path = self.paths[light];
        let mut probability = 1.0;
        let mut index = 0;
        while let Some(second) = self.nodes[index].second {
            let Some(share) = self.first_share(index, point, normal) else { return 0.0 };
            let turn = path & 1 == 1;
            probability *= if turn { 1.0 - share } else { share };
            index = if turn { second as usize } else { index + 1 };
            path >>= 1;
        }
        probability
    }

    /// The first child's share of what both children of node `index` contribute.
    fn first_share(&self, index: usize, point: Vec3, normal: Option<Vec3>) -> Option<f32> {
        let second = self.nodes[index].second? as usize;
        let first = self.nodes[index + 1].extent.importance(point, normal);
        let second = self.nodes[second].extent.importance(point, normal);
        let sum = first + second;
        (sum > 0.0).then(|| first / sum)
    }
}

/// Cosine of max(0, a − b), for angles given by sine and cosine.
fn cos_difference((sin_a, cos_a): (f32, f32), (sin_b, cos_b): (f32, f32)) -> f32 {
    if cos_a > cos_b { 1.0 } else { cos_a * cos_b + sin_a * sin_b }
}

fn with_sine(cos: f32) -> (f32, f32) {
    ((1.0 - cos * cos).max(0.0).sqrt(), cos)
}

/// An [`Extent`] as the descent wants it.
#[derive(Debug, Clone, Copy)]
struct Bound {
    center: Vec3,
    radius: f32, // half diagonal of the box
    axis: Vec3,
    spread: (f32, f32), // sine and cosine
    cos_reach: f32,
    power: f32,
}

impl Bound {
    fn new(extent: &Extent) -> Self {
        Self {
            center: extent.bounds.center(),
            radius: 0.5 * extent.bounds.extent().norm(),
            axis: extent.axis,
            spread: extent.spread.sin_cos(),
            cos_reach: extent.reach.cos(),
            power: extent.power,
        }
    }

    /// An upper estimate, up to a constant factor, of the light that reaches `point`.
    #[inline(always)]
    fn importance(&self, point: Vec3, normal: Option<Vec3>) -> f32 {
        let way = point - self.center;
        let distance2 = way.norm_squared().max(f32::MIN_POSITIVE);
        let inverse = 1.0 / distance2.sqrt();
        // The angle under which the sphere around the box is seen is taken off every other angle.
        let sin_subtended = self.radius * inverse;
        let least_angle = match self.spread.1 <= -1.0 || sin_subtended >= 1.0 {
            true => 1.0, // its normals point everywhere, or it surrounds the point
            false => {
                let off_axis = with_sine((self.axis.dot(&way) * inverse).clamp(-1.0, 1.0));
                let subtended = (sin_subtended, (1.0 - sin_subtended * sin_subtended).sqrt());
                cos_difference(with_sine(cos_difference(off_axis, self.spread)), subtended)
            }
        };
        if least_angle <= self.cos_reach {
            return 0.0;
        }
        // cos(a − b) ≤ cos a + sin b: an estimate from above is as good here, and needs no root.
        let facing = normal.map_or(1.0, |n| (n.dot(&way).abs() * inverse + sin_subtended).min(1.0));
        // The half diagonal as least distance keeps lights that surround the point finite.
        self.power * least_angle.max(0.0) * facing / distance2.max(self.radius * self.radius)
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
