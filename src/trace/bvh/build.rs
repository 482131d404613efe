//! Building the hierarchy from the top: by the surface area heuristic over bins (Wald 2007), or at
//! the median, which exists to be compared with.

use wide::f32x4;

use super::{Bvh, Child, Item, ItemKind, KIND_NODE, KIND_PACKET, KIND_SOLID, LEVELS, Node};
use crate::trace::math::Aabb;

/// How a set of items is divided in two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Split {
    /// Where the expected cost of a ray is least.
    #[default]
    Sah,
    /// In the middle of the longest axis' order.
    Median,
}

const BINS: usize = 16;
/// Triangles of a packet, which cost as much as one.
const PACKET: usize = 4;

pub fn build(mut items: Vec<Item>, split: Split) -> Bvh {
    let mut bvh = Bvh { nodes: vec![], packets: vec![] };
    if !items.is_empty() {
        add_node(&mut bvh, &mut items, split, 0);
    }
    bvh
}

fn bounds_of(items: &[Item]) -> Aabb {
    items.iter().fold(Aabb::EMPTY, |b, item| b.union(&item.bounds))
}

fn is_leaf(items: &[Item]) -> bool {
    items.len() == 1 || items.len() <= PACKET && items.iter().all(|item| item.kind == ItemKind::Triangle)
}

/// Adds the node over `items`, `depth` levels below the root, and all below it; returns its index.
fn add_node(bvh: &mut Bvh, items: &mut [Item], split: Split, depth: u32) -> usize {
    let index = bvh.nodes.len();
    bvh.nodes.push(Node { bounds: [[f32x4::ZERO; 3]; 2], children: [Child(0); 4] });
    let mut bounds = [[[f32::INFINITY; 4]; 3], [[f32::NEG_INFINITY; 4]; 3]];
    // Parts of equal number from where on one more level of others could leave too few for the rest.
    let evenly = 4usize.saturating_pow(LEVELS - 1 - depth) < items.len();
    for (lane, part) in quarters(items, split, evenly).into_iter().enumerate() {
        let space = bounds_of(part);
        let child = match is_leaf(part) {
            true => add_leaf(bvh, part),
            false => Child::new(KIND_NODE, add_node(bvh, part, split, depth + 1)),
        };
        for (corner, place) in bounds.iter_mut().zip([space.min, space.max]) {
            for (lanes, coordinate) in corner.iter_mut().zip(place.iter()) {
                lanes[lane] = *coordinate;
            }
        }
        bvh.nodes[index].children[lane] = child;
    }
    bvh.nodes[index].bounds = bounds.map(|corner| corner.map(f32x4::from));
    index
}

fn add_leaf(bvh: &mut Bvh, items: &[Item]) -> Child {
    match items[0].kind {
        ItemKind::Solid => Child::new(KIND_SOLID, items[0].index as usize),
        ItemKind::Triangle => {
            bvh.packets.push(items.iter().map(|item| item.index).collect());
            Child::new(KIND_PACKET, bvh.packets.len() - 1)
        }
    }
}

/// Divides `items` into up to four parts: the part with the largest surface is divided next. Where that
/// leaves room, leaves of several triangles are divided too: their boxes are tested for free. If `evenly`,
/// the part with the most items is divided next, and in the middle.
fn quarters(items: &mut [Item], split: Split, evenly: bool) -> Vec<&mut [Item]> {
    let mut parts = vec![items];
    while parts.len() < 4 {
        let size = |part: &[Item]| if evenly { part.len() as f32 } else { bounds_of(part).half_area() };
        let rank = |part: &[Item]| (!is_leaf(part), size(part));
        let divisible = (0..parts.len()).filter(|&i| parts[i].len() > 1);
        let widest = divisible.max_by(|&a, &b| {
            let (a, b) = (rank(parts[a]), rank(parts[b]));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        let Some(widest) = widest else { break };
        let part = parts.remove(widest);
        let middle = match split {
            Split::Sah if !evenly => sah(part),
            _ => median(part),
        };
        let (left, right) = part.split_at_mut(middle);
        parts.push(left);
        parts.push(right);
    }
    parts
}

fn median(items: &mut [Item]) -> usize {
    let axis = bounds_of(items).extent().imax();
    let middle = items.len() / 2;
    let key = |item: &Item| item.bounds.center()[axis];
    items.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)).then(a.index.cmp(&b.index)));
    middle
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    load: usize, // a triangle counts 1, anything else as much as a full packet
}

fn load(item: &Item) -> usize {
    match item.kind {
        ItemKind::Triangle => 1,
        ItemKind::Solid => PACKET,
    }
}

/// The cost of testing a set, in packets times half its surface.
fn cost(bin: &Bin) -> f32 {
    if bin.load == 0 { 0.0 } else { bin.bounds.half_area() * bin.load.div_ceil(PACKET) as f32 }
}

/// Sorts `items` into the two sides of the cheapest plane between bins; returns the right side's start.
fn sah(items: &mut [Item]) -> usize {
    let centers = Aabb::around(items.iter().map(|item| item.bounds.center()));
    let extent = centers.extent();
    let bin_of = |item: &Item, axis: usize| {
        let place = (item.bounds.center()[axis] - centers.min[axis]) / extent[axis];
        ((place * BINS as f32) as usize).min(BINS - 1)
    };
    let mut best = (f32::INFINITY, 0, 0);
    for axis in (0..3).filter(|&axis| extent[axis] > 0.0) {
        let mut bins = [Bin { bounds: Aabb::EMPTY, load: 0 }; BINS];
        for item in items.iter() {
            let bin = &mut bins[bin_of(item, axis)];
            bin.bounds = bin.bounds.union(&item.bounds);
            bin.load += load(item);
        }
        let rights = sweep(bins.iter().rev());
        for (plane, left) in sweep(bins.iter()).iter().enumerate().take(BINS - 1) {
            let right = rights[BINS - 2 - plane];
            let total = left + right;
            if total < best.0 {
                best = (total, axis, plane);
            }
        }
    }
    let (least, axis, plane) = best;
    if least == f32::INFINITY {
        return items.len() / 2; // all centres coincide: any halves will do
    }
    partition(items, |item| bin_of(item, axis) <= plane)
}

/// The cost of the first n + 1 bins together, for every n.
fn sweep<'a>(bins: impl Iterator<Item = &'a Bin>) -> Vec<f32> {
    bins.scan(Bin { bounds: Aabb::EMPTY, load: 0 }, |sum, bin| {
        *sum = Bin { bounds: sum.bounds.union(&bin.bounds), load: sum.load + bin.load };
        Some(cost(sum))
    })
    .collect()
}

/// Moves the items for which `left` holds to the front; returns their number.
fn partition(items: &mut [Item], left: impl Fn(&Item) -> bool) -> usize {
    let mut middle = 0;
    for i in 0..items.len() {
        if left(&items[i]) {
            items.swap(i, middle);
            middle += 1;
        }
    }
    middle
}

#[cfg(test)]
mod tests {
    use super::super::{INDEX_MASK, KIND_SHIFT};
    use super::*;
    use crate::trace::math::Vec3;

    /// Sizes that grow from item to item make every split cut off a few: a tree that is near the depth of
    /// the search's stack must divide what is left evenly.
    #[test]
    fn no_tree_is_deeper_than_the_search_can_go() {
        let solid = |index: u32| {
            let end = Vec3::repeat((index as f32 * 0.5).exp2());
            Item { bounds: Aabb { min: end, max: end * 1.01 }, kind: ItemKind::Solid, index }
        };
        let mut items: Vec<Item> = (0..64).map(solid).collect();
        let mut bvh = Bvh { nodes: vec![], packets: vec![] };
        add_node(&mut bvh, &mut items, Split::Sah, LEVELS - 3);
        let mut reached = 0;
        let mut below = vec![(Child(0), LEVELS - 2)];
        while let Some((child, level)) = below.pop() {
            match child.0 >> KIND_SHIFT {
                KIND_NODE => {
                    assert!(level <= LEVELS, "level {level}");
                    let node = &bvh.nodes[(child.0 & INDEX_MASK) as usize];
                    let real = |lane: &usize| node.bounds[0][0].to_array()[*lane].is_finite();
                    below.extend((0..4).filter(real).map(|lane| (node.children[lane], level + 1)));
                }
                _ => reached += 1,
            }
        }
        assert_eq!(reached, 64);
    }
}
