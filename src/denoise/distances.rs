//! Patch distances of windows; what neighbouring centres share is computed once.
//!
//! The distance of two patches is the mean of their pixels' differences, and the difference of p and
//! p + offset is part of it for every centre whose patch holds p: nine of them where patches are 3×3. So the
//! differences of a pixel and all of its window are kept until the centres have moved on.

use super::surfaces::Surfaces;
use super::weights::{Guide, distance_stride};
use crate::options::MAX_PATCH_RADIUS;
use pulp::Simd;

/// Pixels of a row whose differences are kept: a tile of centres and the largest patches around it.
const COLUMNS: usize = 40;

/// Pixels of the largest patch.
const LARGEST_PATCH: usize = (2 * MAX_PATCH_RADIUS + 1).pow(2);

/// What is compared: how large patches, and of which of the guides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kind {
    /// Radius of the patches.
    pub patch_radius: usize,
    /// Colour over albedo instead of colour.
    pub demodulated: bool,
}

/// What the pixels of a frame are compared by.
#[derive(Debug, Clone, Copy)]
pub struct Compared<'a> {
    /// Colour, or colour over albedo.
    pub color: &'a Guide,
    /// Features.
    pub surfaces: &'a Surfaces,
}

/// The distances of one window at a time, in one frame and those beside it; buffers of one thread, for
/// guides that stay the same.
#[derive(Debug, Clone)]
pub struct Distances {
    radius: usize,
    frames: usize,
    kept: Vec<Kept>,
    /// What `distances` are of.
    held: Option<(Kind, [usize; 2])>,
    distances: Vec<f32>,
    /// The centre that `surfaces` are of.
    seen: Option<[usize; 2]>,
    surfaces: Vec<f32>,
    /// The larger ones of both.
    joined: Vec<f32>,
}

/// The differences of some pixels and those of the windows around them, for one kind of patches.
#[derive(Debug, Clone)]
struct Kept {
    kind: Kind,
    /// Whose differences each place holds.
    pixels: Vec<Option<[isize; 2]>>,
    /// Those of one pixel behind those of another.
    differences: Vec<f32>,
}

impl Distances {
    /// For windows of `radius` in `frames` frames.
    pub fn new(radius: usize, frames: usize) -> Self {
        let none = vec![0.0; frames * square(radius)];
        let (surfaces, joined) = (none.clone(), none.clone());
        Self { radius, frames, kept: vec![], held: None, distances: none, seen: None, surfaces, joined }
    }

    /// The distances from the patch at `centre`, column and row, in the first of the `guides` to the patches at
    /// all offsets of the window in each of them: frame by frame, 2·radius + 1 rows of [`distance_stride`].
    /// Offsets outside the picture have a value as well. With `surfaces`, those of the features by this factor
    /// where they are larger.
    #[inline(always)]
    pub fn of<'g, S: Simd>(
        &mut self,
        simd: S,
        kind: Kind,
        centre: [usize; 2],
        guides: impl Iterator<Item = Compared<'g>> + Clone,
        surfaces: Option<f32>,
    ) -> &[f32] {
        if self.held != Some((kind, centre)) {
            let colors = guides.clone().map(|guides| guides.color);
            self.compare(simd, kind, centre.map(|at| at as isize), colors);
            self.held = Some((kind, centre));
        }
        let Some(factor) = surfaces else { return &self.distances };
        if let Some(here) = guides.clone().next().filter(|_| self.seen != Some(centre)) {
            for (there, out) in guides.zip(self.surfaces.chunks_exact_mut(square(self.radius))) {
                here.surfaces.distances(simd, there.surfaces, centre, self.radius, out);
            }
            self.seen = Some(centre);
        }
        let factor = simd.splat_f32s(factor);
        let both = S::as_simd_f32s(&self.distances).0.iter().zip(S::as_simd_f32s(&self.surfaces).0);
        for (out, (&color, &surface)) in S::as_mut_simd_f32s(&mut self.joined).0.iter_mut().zip(both) {
            *out = simd.max_f32s(color, simd.mul_f32s(factor, surface));
        }
        &self.joined
    }

    #[inline(always)]
    fn compare<'g, S: Simd>(
        &mut self,
        simd: S,
        kind: Kind,
        [x, y]: [isize; 2],
        guides: impl Iterator<Item = &'g Guide> + Clone,
    ) {
        let place = self.kept.iter().position(|kept| kept.kind == kind).unwrap_or_else(|| {
            self.kept.push(Kept::new(kind, self.frames * square(self.radius)));
            self.kept.len() - 1
        });
        let kept = &mut self.kept[place];
        let reach = kind.patch_radius as isize;
        let distances = S::as_mut_simd_f32s(&mut self.distances).0;
        let (mut patch, mut pixels) = ([0; LARGEST_PATCH], 0);
        for py in -reach..=reach {
            for px in -reach..=reach {
                let place = kept.see(simd, [x + px, y + py], self.radius, guides.clone());
                patch[pixels] = place * distances.len();
                pixels += 1;
            }
        }
        let (patch, inverse) = (&patch[..pixels], 1.0 / pixels as f32);
        let differences = S::as_simd_f32s(&kept.differences).0;
        for (n, out) in distances.iter_mut().enumerate() {
            let mut sum = simd.splat_f32s(0.0);
            for from in patch {
                sum = simd.add_f32s(sum, differences[from + n]);
            }
            *out = simd.mul_f32s(sum, simd.splat_f32s(inverse));
        }
    }
}

impl Kept {
    fn new(kind: Kind, length: usize) -> Self {
        let places = (2 * kind.patch_radius + 1) * COLUMNS;
        Self { kind, pixels: vec![None; places], differences: vec![0.0; places * length] }
    }

    /// Where the differences of a pixel belong: those of another row or tile give way.
    #[inline(always)]
    fn place(&self, [x, y]: [isize; 2]) -> usize {
        let rows = 2 * self.kind.patch_radius + 1;
        // Outside the picture by no more than the patch's radius, so that this is not negative.
        let [column, row] = [x, y].map(|at| (at + self.kind.patch_radius as isize) as usize);
        row % rows * COLUMNS + column % COLUMNS
    }

    /// Sees to it that the differences of `pixel` are there, and tells at which place.
    #[inline(always)]
    fn see<'g, S: Simd>(
        &mut self,
        simd: S,
        pixel: [isize; 2],
        radius: usize,
        guides: impl Iterator<Item = &'g Guide> + Clone,
    ) -> usize {
        let place = self.place(pixel);
        let Some(here) = guides.clone().next().filter(|_| self.pixels[place] != Some(pixel)) else {
            return place;
        };
        let length = self.differences.len() / self.pixels.len();
        let out = &mut self.differences[place * length..(place + 1) * length];
        for (guide, out) in guides.zip(out.chunks_exact_mut(square(radius))) {
            here.differences(simd, guide, pixel, radius, out);
        }
        self.pixels[place] = Some(pixel);
        place
    }
}

/// Numbers of one frame's window.
pub fn square(radius: usize) -> usize {
    (2 * radius + 1) * distance_stride(radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::denoise::surfaces::Spread;
    use crate::image::{Plane, Rect};

    const COLOR: Kind = Kind { patch_radius: 1, demodulated: false };

    /// A guide of three equal channels.
    fn colour(u: &Plane, v: &Plane) -> Guide {
        Guide::new(&[u; 3], &[v; 3], Rect::whole(u.size()), [2, 1])
    }

    fn steps(shift: usize) -> Plane {
        Plane::from_fn(57, 9, |x, y| ((x * 7 + y * 13 + shift) % 11) as f32)
    }

    fn guide(shift: usize) -> Guide {
        colour(&steps(shift), &Plane::from_fn(57, 9, |x, _| 0.5 + x as f32))
    }

    fn surfaces(shift: usize) -> Surfaces {
        Surfaces::new(&[steps(shift)], &[Spread { planes: 1, variance: 10.0, is_distance: false }], 2)
    }

    #[test]
    fn the_distance_is_that_of_the_formula_and_forgives_noise() {
        let u = Plane::from_fn(7, 5, |x, y| (x * x + 3 * y) as f32);
        let v = Plane::from_fn(7, 5, |x, _| 0.5 + x as f32);
        let (color, surfaces) = (&colour(&u, &v), &Surfaces::default());
        let row = distance_stride(2);
        let mut distances = Distances::new(2, 1);
        let guides = std::iter::once(Compared { color, surfaces });
        let out = distances.of(pulp::Scalar, COLOR, [3, 2], guides, None);
        assert!(out[2 * row + 2] < 0.0, "a patch is nearer to itself than its noise lets expect");
        let mut expected = 0.0;
        for (py, px) in (0..3).flat_map(|y| (0..3).map(move |x| (y, x))) {
            let (p, q) = ((2 + px, 1 + py), (1 + px, 2 + py)); // offset (−1, +1)
            let (up, uq, vp, vq) = (u.get(p.0, p.1), u.get(q.0, q.1), v.get(p.0, p.1), v.get(q.0, q.1));
            expected += ((up - uq).powi(2) - (vp + vp.min(vq))) / (1e-10 + vp + vq) / 9.0;
        }
        assert!((out[3 * row + 1] - expected).abs() < 1e-5 * expected.abs());
    }

    #[test]
    fn what_is_kept_changes_nothing() {
        let (here, beside, surfaces) = (guide(0), guide(5), [surfaces(0), surfaces(3)]);
        let [mine, theirs] = &surfaces;
        let guides =
            [Compared { color: &here, surfaces: mine }, Compared { color: &beside, surfaces: theirs }];
        let guides = || guides.into_iter();
        let other = Kind { patch_radius: 0, demodulated: true };
        let mut kept = Distances::new(2, 2);
        // Along rows, farther than what is kept, to and fro, kinds in turn.
        let centres = (0..9).flat_map(|y| (0..57).map(move |x| [x, y])).filter(|[x, y]| (x + y) % 5 < 3);
        for centre in centres.chain([[0, 0], [40, 0], [0, 0], [0, 3], [56, 8]]) {
            for (kind, factor) in [(COLOR, None), (other, Some(0.5)), (other, None), (COLOR, Some(2.0))] {
                let fresh = Distances::new(2, 2).of(pulp::Scalar, kind, centre, guides(), factor).to_vec();
                assert_eq!(kept.of(pulp::Scalar, kind, centre, guides(), factor), fresh, "{centre:?}");
            }
        }
    }

    #[test]
    fn what_is_farther_apart_counts() {
        let (color, surfaces) = (&colour(&steps(0), &Plane::filled(57, 9, 0.5)), &surfaces(0));
        let guides = || std::iter::once(Compared { color, surfaces });
        let mut distances = Distances::new(2, 1);
        let mut of = |factor| distances.of(pulp::Scalar, COLOR, [20, 4], guides(), factor).to_vec();
        let (color, both) = (of(None), of(Some(0.01)));
        let mut own = vec![0.0; color.len()];
        surfaces.distances(pulp::Scalar, surfaces, [20, 4], 2, &mut own);
        let farther = |(color, surface): (&f32, &f32)| color.max(0.01 * surface);
        assert_eq!(both, color.iter().zip(&own).map(farther).collect::<Vec<f32>>());
        assert!(both != color && own.iter().zip(&both).any(|(own, both)| 0.01 * own != *both));
    }
}
