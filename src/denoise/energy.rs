//! The energy of a picture's outliers and its other light, summed by nodes.
//!
//! The nodes are a lattice [`SPACING`] pixels apart. A pixel belongs to the four nodes around it by bilinear shares. Negative
//! samples count as they are: Σ ŷ is about Σ y, where Σ max(0, y) is the noise's about black. A window whose samples
//! cancel to less than [`LEAST_LIGHT`] of their magnitudes has no light that gains could multiply.

use super::outlier::Removed;
use crate::image::{Plane, Rect};

/// Pixels from one node to the next.
const SPACING: usize = 32;

/// The share of Σ |y| that Σ y is at least where there is light: of noise about black it is 0.04 by chance, over a
/// node's pixels.
const LEAST_LIGHT: f64 = 0.1;

/// The outliers of a picture, and its other light, by nodes; of the rows that were added so far.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Energy {
    /// Nodes of a row.
    columns: usize,
    nodes: Vec<Node>,
    pixels: usize,
}

/// What belongs to a node.
#[derive(Debug, Clone, PartialEq, Default)]
struct Node {
    /// Of the colour's channels, without outliers.
    light: [Light; 3],
    /// Σ e and Σ e² over the outliers, e the mean over the colour's channels.
    witnesses: [f64; 2],
    /// What was taken out of each target.
    taken: Vec<f64>,
}

/// The light of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Light {
    /// Σ y.
    pub sum: f64,
    /// Σ |y|.
    magnitude: f64,
}

impl Light {
    fn of(value: f32) -> Self {
        let sum = f64::from(value);
        Self { sum, magnitude: sum.abs() }
    }

    fn add(&mut self, share: f64, other: Self) {
        self.sum += share * other.sum;
        self.magnitude += share * other.magnitude;
    }

    /// Whether it is more than noise about black.
    pub fn is_seen(self) -> bool {
        self.sum > LEAST_LIGHT * self.magnitude
    }
}

/// The first of the two nodes around a pixel, along one axis, and the share of the second.
fn between(at: usize) -> (usize, f64) {
    (at / SPACING, (at % SPACING) as f64 / SPACING as f64)
}

/// The four nodes around a pixel and their shares, in a lattice of `columns`.
pub fn around(x: usize, y: usize, columns: usize) -> [(usize, f64); 4] {
    let ((i, u), (j, v)) = (between(x), between(y));
    let node = j * columns + i;
    [
        (node, (1.0 - u) * (1.0 - v)),
        (node + 1, u * (1.0 - v)),
        (node + columns, (1.0 - u) * v),
        (node + columns + 1, u * v),
    ]
}

impl Energy {
    /// Adds the next rows of a picture, `rows` of the planes in their full width, of which the first is the
    /// picture's row `y`: the colour without its outliers, and what was `removed`.
    pub fn add(&mut self, color: [&Plane; 3], removed: &Removed, rows: Rect, y: usize) {
        let Removed { outliers, taken } = removed;
        self.columns = rows.width.div_ceil(SPACING) + 1;
        let last = y + rows.height;
        self.nodes.resize((last.div_ceil(SPACING) + 1) * self.columns, Node::default());
        self.pixels += rows.width * rows.height;
        for dy in 0..rows.height {
            self.add_light(color, rows.y + dy, y + dy);
        }
        for (k, o) in outliers.iter().enumerate().filter(|(_, o)| rows.contains(o.x, o.y)) {
            let energy = taken[..3].iter().map(|taken| f64::from(taken[k])).sum::<f64>() / 3.0;
            for (node, share) in around(o.x, o.y - rows.y + y, self.columns) {
                let node = &mut self.nodes[node];
                node.witnesses[0] += share * energy;
                node.witnesses[1] += share * energy * energy;
                node.taken.resize(taken.len(), 0.0);
                node.taken.iter_mut().zip(taken).for_each(|(sum, e)| *sum += share * f64::from(e[k]));
            }
        }
    }

    /// Adds row `from` of the colour, the picture's row `y`. By itself, so that the sums do not depend on how
    /// many rows are added at once.
    fn add_light(&mut self, color: [&Plane; 3], from: usize, y: usize) {
        let mut row = vec![[Light::default(); 3]; self.columns];
        for (c, plane) in color.iter().enumerate() {
            for (x, light) in plane.row(from).iter().copied().map(Light::of).enumerate() {
                let (i, u) = between(x);
                row[i][c].add(1.0 - u, light);
                row[i + 1][c].add(u, light);
            }
        }
        let (j, v) = between(y);
        for (j, share) in [(j, 1.0 - v), (j + 1, v)] {
            for (node, row) in self.nodes[j * self.columns..].iter_mut().zip(&row) {
                node.light.iter_mut().zip(row).for_each(|(sum, light)| sum.add(share, *light));
            }
        }
    }

    /// How many pixels were added.
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// Nodes of a row.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The window of all nodes.
    pub fn whole(&self) -> Rect {
        Rect::whole((self.columns, self.nodes.len() / self.columns.max(1)))
    }

    /// What was taken out of each target, of the nodes where anything was.
    pub fn sources(&self) -> impl Iterator<Item = (usize, &[f64])> {
        let all = self.nodes.iter().map(|node| &*node.taken).enumerate();
        all.filter(|(_, taken)| !taken.is_empty())
    }

    fn nodes(&self, window: Rect) -> impl Iterator<Item = &Node> {
        window.pixels().map(|(i, j)| &self.nodes[j * self.columns + i])
    }

    /// Σ e and Σ e² in a window of nodes.
    pub fn witnesses(&self, window: Rect) -> [f64; 2] {
        self.nodes(window).fold([0.0; 2], |sum, node| std::array::from_fn(|i| sum[i] + node.witnesses[i]))
    }

    /// The light of the colour's channels in a window of nodes.
    pub fn light(&self, window: Rect) -> [Light; 3] {
        let mut light = [Light::default(); 3];
        for node in self.nodes(window) {
            light.iter_mut().zip(node.light).for_each(|(sum, light)| sum.add(1.0, light));
        }
        light
    }
}

#[cfg(test)]
pub mod tests {
    use super::super::outlier::Outlier;
    use super::*;
    use crate::image::Rgb;

    pub fn grey(plane: &Plane) -> Rgb {
        std::array::from_fn(|_| plane.clone())
    }

    /// Of a picture of three channels like `plane`.
    pub fn energy(plane: &Plane, outliers: &[Outlier], taken: &[f32]) -> Energy {
        let mut energy = Energy::default();
        let removed = Removed { outliers: outliers.to_vec(), taken: vec![taken.to_vec(); 3] };
        energy.add([plane; 3], &removed, Rect::whole(plane.size()), 0);
        energy
    }

    #[test]
    fn rows_added_in_any_portions_tell_the_same() {
        let plane = Plane::from_fn(70, 50, |x, y| 0.3 + ((x * 7 + y * 13) % 11) as f32);
        let outliers: Vec<Outlier> =
            (0..20).map(|k| Outlier { x: 3 * k, y: 2 * k + 5, from: (0, 0) }).collect();
        let taken = vec![(0..20).map(|k| 1.0 + k as f32).collect::<Vec<_>>(); 3];
        let whole = energy(&plane, &outliers, &taken[0]);
        for heights in [[1, 1, 48], [31, 2, 17], [33, 10, 7]] {
            let mut parts = Energy::default();
            let mut y = 0;
            for height in heights {
                // Planes that begin a few rows above, as those of a part do.
                let above = y.min(4);
                let cut = grey(&plane)
                    .map(|p| p.crop(Rect { x: 0, y: y - above, width: 70, height: height + above }));
                let here: Vec<(usize, Outlier)> = outliers
                    .iter()
                    .enumerate()
                    .filter(|(_, o)| (y - above..y + height).contains(&o.y))
                    .map(|(k, o)| (k, Outlier { y: o.y - (y - above), ..*o }))
                    .collect();
                let taken: Vec<Vec<f32>> =
                    taken.iter().map(|taken| here.iter().map(|(k, _)| taken[*k]).collect()).collect();
                let here: Vec<Outlier> = here.iter().map(|(_, o)| *o).collect();
                let removed = Removed { outliers: here, taken };
                parts.add(cut.each_ref(), &removed, Rect { x: 0, y: above, width: 70, height }, y);
                y += height;
            }
            assert_eq!(parts, whole, "{heights:?}");
        }
    }
}
