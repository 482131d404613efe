//! A frame beside, brought to this frame's pixels, and how far it can be trusted there.
//!
//! Every pixel takes the one pixel of the other frame that shows the same: no interpolation, so that
//! noise stays that of single pixels and independent between them. What differs by a part of a pixel the
//! other frame's own features explain to the fit.

use super::variance::{around, smooth};
use super::weights::exp_negative;
use crate::frame::FeatureKind;
use crate::image::{Plane, Rgb};
use rayon::prelude::*;

/// What the ways there and back may differ by, in pixels: both are rounded, and means over a pixel.
const LARGEST_GAP: f32 = 1.5;

/// How far normals and albedos may lie beyond what this frame shows within a pixel's distance.
const FEATURE_SLACK: f32 = 0.1;

/// The same of depths, relative to the depth: a camera or an object may come nearer from frame to frame.
const DEPTH_SLACK: f32 = 0.1;

/// Radius of the neighbourhood over which a change of the light is looked for.
const LIGHT_RADIUS: usize = 3;

/// Squared deviations that a change of the light may have by chance. `[choice]` docs/TEMPORAL.md: fewer distrust
/// much that has not changed.
const LIGHT_CHANCE: f32 = 9.0;

/// Motion vectors: columns to the right and rows down.
pub type Vectors = [Plane; 2];

/// For every pixel the place in another frame that shows the same.
#[derive(Debug, Clone)]
pub struct Flow {
    size: (usize, usize),
    /// Column and row there. Not rounded: what is rounded at every step drifts from frame to frame.
    at: Vec<[f32; 2]>,
    /// Index of the nearest pixel there.
    places: Vec<usize>,
    /// Whether the place is known and inside the picture.
    inside: Vec<bool>,
}

impl Flow {
    /// Nothing moves.
    pub fn still(size: (usize, usize)) -> Self {
        let pixels = size.0 * size.1;
        let at = (0..pixels).map(|i| [(i % size.0) as f32, (i / size.0) as f32]).collect();
        Self { size, at, places: (0..pixels).collect(), inside: vec![true; pixels] }
    }

    /// Goes one frame further, along `vectors` of the frame in which this flow ends, or to the same place where there
    /// are none. `back` are the vectors of the frame beyond towards this side: where they do not lead back, something
    /// is in front. Its first pixel lies `shift` columns and rows before the one of the frame in which this flow ends.
    pub fn further(&mut self, vectors: Option<&Vectors>, back: Option<&Vectors>, shift: [f32; 2]) {
        let (width, height) = self.size;
        let places = self.places.iter_mut().zip(&mut self.at).zip(&mut self.inside);
        for ((place, at), inside) in places.filter(|(_, inside)| **inside) {
            let read = |vectors: &Vectors, place: usize| vectors.each_ref().map(|plane| plane.data()[place]);
            let [dx, dy] = vectors.map_or([0.0; 2], |vectors| read(vectors, *place));
            *at = [at[0] + dx + shift[0], at[1] + dy + shift[1]];
            let [x, y] = at.map(f32::round);
            // Written so that NaN is outside.
            *inside = x >= 0.0 && x < width as f32 && y >= 0.0 && y < height as f32;
            if !*inside {
                continue;
            }
            *place = y as usize * width + x as usize;
            if let Some(back) = back {
                let [bx, by] = read(back, *place);
                *inside = (dx + bx).powi(2) + (dy + by).powi(2) <= LARGEST_GAP.powi(2);
            }
        }
    }

    /// `plane` of the other frame at this frame's pixels; where the place is not known, of some pixel near.
    pub fn warp(&self, plane: &Plane) -> Plane {
        let (width, height) = self.size;
        Plane::par_from_fn(width, height, |x, y| plane.data()[self.places[y * width + x]])
    }

    /// 1 where the place is known, 0 elsewhere; a share of 1 where several pixels have the same place, as where
    /// something comes nearer: together they know one sample.
    pub fn trust(&self) -> Plane {
        let (width, height) = self.size;
        let known = || self.places.iter().zip(&self.inside).filter(|(_, inside)| **inside);
        let mut pixels = vec![0u32; width * height];
        known().for_each(|(place, _)| pixels[*place] += 1);
        Plane::par_from_fn(width, height, |x, y| {
            let i = y * width + x;
            if self.inside[i] { 1.0 / pixels[self.places[i]] as f32 } else { 0.0 }
        })
    }
}

/// Takes `trust` away where a feature, warped to `there`, is none that `here` shows within a pixel's
/// distance: what is seen is not the same surface.
pub fn distrust_surfaces(trust: &mut Plane, kind: FeatureKind, here: &Plane, there: &Plane) {
    let slack = |value: f32| match kind {
        FeatureKind::Normal | FeatureKind::Albedo => FEATURE_SLACK,
        FeatureKind::Depth => DEPTH_SLACK * value.abs(),
        // They may differ with the light or the frame.
        FeatureKind::Visibility | FeatureKind::Position | FeatureKind::Other => f32::INFINITY,
    };
    let (width, height) = here.size();
    trust.rows_mut().enumerate().for_each(|(y, trust)| {
        for (x, trust) in trust.iter_mut().enumerate() {
            let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
            for ny in y.saturating_sub(1)..(y + 2).min(height) {
                let row = &here.row(ny)[x.saturating_sub(1)..(x + 2).min(width)];
                row.iter().for_each(|v| (low, high) = (low.min(*v), high.max(*v)));
            }
            let (value, slack) = (there.get(x, y), slack(here.get(x, y)));
            if value < low - slack || value > high + slack {
                *trust = 0.0;
            }
        }
    });
}

/// How far the light on every pixel is the same in both frames, 0 to 1, against what its noise lets expect: a
/// shadow or a reflection that moved over a surface which did not. The mean difference over 7×7 pixels tells it
/// that single patches are too noisy to see. Pixels without `trust` are not compared and get 1.
#[must_use]
pub fn steadiness(trust: &Plane, [here, there]: [[&Plane; 3]; 2], [noise, its_noise]: [&Rgb; 2]) -> Plane {
    let (width, height) = trust.size();
    let seen = |x: usize, y: usize| if trust.get(x, y) > 0.0 { 1.0 } else { 0.0 };
    // The channels share their samples: their deviations add, not their variances.
    let deviation =
        |noise: &Rgb, x: usize, y: usize| noise.iter().map(|v| v.get(x, y).sqrt()).sum::<f32>().powi(2);
    let difference = Plane::par_from_fn(width, height, |x, y| {
        let sum = |rgb: [&Plane; 3]| rgb.iter().map(|plane| plane.get(x, y)).sum::<f32>();
        seen(x, y) * (sum(there) - sum(here))
    });
    let variance = Plane::par_from_fn(width, height, |x, y| {
        seen(x, y) * (deviation(noise, x, y) + deviation(its_noise, x, y))
    });
    let (difference, variance) = (smooth(&difference, LIGHT_RADIUS), smooth(&variance, LIGHT_RADIUS));
    let pixels = |at: usize, limit: usize| around(at, LIGHT_RADIUS, limit).len();
    Plane::par_from_fn(width, height, |x, y| {
        // With sums over the trusted pixels z² = (Σ d)²/Σ σ², whose means over n pixels these are.
        let count = (pixels(x, width) * pixels(y, height)) as f32;
        let excess = difference.get(x, y).powi(2) * count - LIGHT_CHANCE * variance.get(x, y);
        let changed = excess > 0.0 && seen(x, y) > 0.0;
        // Nearly 0 without any noise.
        if changed { exp_negative(0.5 * excess / variance.get(x, y)) } else { 1.0 }
    })
}

/// Takes `trust` away where most pixels around are the very same in spite of their `noise`: a copy, from a repeated
/// frame or seed, tells nothing new. Not by single pixels: light that comes in few sizes is often the same by
/// chance, and without those pairs the others' mean is too bright. What is black in both tells neither.
/// Returns the share of the trusted pixels that were copies.
pub fn distrust_copies(trust: &mut Plane, [here, there]: [[&Plane; 3]; 2], noise: &Rgb) -> f32 {
    let (width, height) = trust.size();
    let any = |rgb: [&Plane; 3], x: usize, y: usize| rgb.iter().any(|plane| plane.get(x, y) != 0.0);
    let tells = |x, y| any(noise.each_ref(), x, y) && (any(here, x, y) || any(there, x, y));
    let same = |x, y| here.iter().zip(there).all(|(here, there)| here.get(x, y) == there.get(x, y));
    let share = |holds: &(dyn Fn(usize, usize) -> bool + Sync)| {
        smooth(&Plane::par_from_fn(width, height, |x, y| f32::from(holds(x, y))), LIGHT_RADIUS)
    };
    let (all, copies) = (share(&tells), share(&|x, y| tells(x, y) && same(x, y)));
    let (mut trusted, mut taken) = (0usize, 0usize);
    let pixels = trust.data_mut().iter_mut().zip(copies.data()).zip(all.data());
    for ((trust, copies), all) in pixels.filter(|((trust, _), _)| **trust > 0.0) {
        trusted += 1;
        if *copies > 0.5 * all {
            *trust = 0.0;
            taken += 1;
        }
    }
    taken as f32 / trusted.max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (16, 12);

    fn plane(f: impl Fn(usize, usize) -> f32) -> Plane {
        Plane::from_fn(SIZE.0, SIZE.1, f)
    }

    fn constant(vector: [f32; 2]) -> Vectors {
        vector.map(|v| plane(|_, _| v))
    }

    fn shifted(vectors: Option<&Vectors>, back: Option<&Vectors>, shift: [f32; 2]) -> Flow {
        let mut flow = Flow::still(SIZE);
        flow.further(vectors, back, shift);
        flow
    }

    fn along(vectors: &Vectors, back: Option<&Vectors>) -> Flow {
        shifted(Some(vectors), back, [0.0; 2])
    }

    fn grey(f: impl Fn(usize, usize) -> f32) -> Rgb {
        std::array::from_fn(|_| plane(&f))
    }

    #[test]
    fn a_picture_that_moved_comes_back_to_its_place() {
        let texture = |x: i32, y: i32| ((x * 7 + y * 13).rem_euclid(31)) as f32;
        let here = plane(|x, y| texture(x as i32, y as i32));
        let there = plane(|x, y| texture(x as i32 - 3, y as i32 + 2));
        let flow = along(&constant([3.2, -1.9]), Some(&constant([-3.0, 2.0])));
        let (warped, trust) = (flow.warp(&there), flow.trust());
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                let inside = x + 3 < SIZE.0 && y >= 2;
                assert_eq!(trust.get(x, y) > 0.0, inside, "{x}, {y}");
                assert!(!inside || warped.get(x, y) == here.get(x, y), "{x}, {y}");
            }
        }
        // Two steps of a half are one of a whole, and NaN leads nowhere.
        let half = constant([0.5, 0.0]);
        let mut two = along(&half, None);
        two.further(Some(&half), None, [0.0; 2]);
        assert_eq!(two.warp(&here).get(4, 5), here.get(5, 5));
        assert_eq!(along(&constant([f32::NAN, 0.0]), None).trust(), plane(|_, _| 0.0));
        // Twice as near: every pixel there is four here, which count for one.
        let half = |at: usize| (at / 2) as f32 - at as f32;
        let trust = along(&[plane(|x, _| half(x)), plane(|_, y| half(y))], None).trust();
        assert_eq!(trust, plane(|_, _| 0.25));
    }

    #[test]
    fn windows_that_move_are_laid_over_one_another_where_they_overlap() {
        let world = |x: usize, y: usize| (x * 7 + y * 13) as f32;
        let [here, there] = [[0, 3], [2, 0]].map(|[x0, y0]| plane(|x, y| world(x + x0, y + y0)));
        // What stands still moves in the window, and leads back: vectors count in the whole picture.
        let still = constant([0.0; 2]);
        let flow = shifted(Some(&still), Some(&still), [-2.0, 3.0]);
        assert_eq!(shifted(None, None, [-2.0, 3.0]).trust(), flow.trust());
        let (warped, trust) = (flow.warp(&there), flow.trust());
        for (x, y) in (0..SIZE.0).flat_map(|x| (0..SIZE.1).map(move |y| (x, y))) {
            let inside = x >= 2 && y + 3 < SIZE.1;
            assert_eq!(trust.get(x, y) > 0.0, inside, "{x}, {y}");
            assert!(!inside || warped.get(x, y) == here.get(x, y), "{x}, {y}");
        }
    }

    #[test]
    fn what_hides_something_does_not_stand_in_for_it() {
        // An object covers columns 6 to 9 here and has come from 4 columns to the left, over a still wall.
        let object = |x: usize, first: usize| (first..first + 4).contains(&x);
        let way = [plane(|x, _| if object(x, 6) { -4.0 } else { 0.0 }), plane(|_, _| 0.0)];
        let back = [plane(|x, _| if object(x, 2) { 4.0 } else { 0.0 }), plane(|_, _| 0.0)];
        let trust = along(&way, Some(&back)).trust();
        for x in 0..SIZE.0 {
            assert_eq!(
                trust.get(x, 5) > 0.0,
                !object(x, 2),
                "the wall at {x} was hidden where the object was"
            );
        }
    }

    #[test]
    fn another_surface_is_told_by_its_features() {
        let here = plane(|x, _| if x < 8 { 0.2 } else { 0.8 });
        let there = plane(|x, y| if (x, y) == (3, 3) { 0.8 } else { here.get(x, y) });
        let distrusted = |kind: FeatureKind, there: &Plane| {
            let mut trust = plane(|_, _| 1.0);
            distrust_surfaces(&mut trust, kind, &here, there);
            (0..SIZE.0 * SIZE.1).filter(|&i| trust.data()[i] == 0.0).collect::<Vec<_>>()
        };
        assert_eq!(distrusted(FeatureKind::Albedo, &there), [3 * SIZE.0 + 3]);
        // An edge that lies a pixel further is the same edge.
        assert!(distrusted(FeatureKind::Albedo, &plane(|x, _| if x < 9 { 0.2 } else { 0.8 })).is_empty());
        assert!(distrusted(FeatureKind::Depth, &plane(|x, y| 1.05 * here.get(x, y))).is_empty());
        assert!(distrusted(FeatureKind::Visibility, &there).is_empty());
    }

    #[test]
    fn light_that_changed_is_told_from_noise_and_copies_tell_nothing() {
        let noise = |x: usize, y: usize| 0.1 * (((x * 7 + y * 3) % 5) as f32 - 2.0);
        let variance = grey(|_, _| 0.02);
        let all = plane(|_, _| 1.0);
        let steady = |here: &Rgb, there: &Rgb| {
            steadiness(&all, [here.each_ref(), there.each_ref()], [&variance, &variance])
        };
        let here = grey(|x, y| 1.0 + noise(x, y));
        let other = |x: usize, y: usize| 0.001 + noise(y + 1, x); // nowhere the very same
        assert!(steady(&here, &grey(|x, y| 1.0 + other(x, y))).data().iter().all(|&t| t > 0.9));
        let darker = grey(|x, y| if x < 8 { 0.7 } else { 1.0 } + other(x, y));
        let shadow = steady(&here, &darker);
        assert!(
            shadow.get(2, 6) < 0.01 && shadow.get(13, 6) > 0.9,
            "{} {}",
            shadow.get(2, 6),
            shadow.get(13, 6)
        );
        assert_eq!(
            steadiness(&plane(|_, _| 0.0), [here.each_ref(), darker.each_ref()], [&variance, &variance]),
            all,
            "not seen"
        );
        let mut trust = all.clone();
        assert_eq!(distrust_copies(&mut trust, [here.each_ref(), darker.each_ref()], &variance), 0.0);
        assert_eq!(trust, all);
        assert_eq!(distrust_copies(&mut trust, [here.each_ref(); 2], &variance), 1.0);
        assert_eq!(trust, plane(|_, _| 0.0));
    }

    #[test]
    fn sparse_light_of_one_size_is_no_copy() {
        let hit = |x: usize, y: usize, seed: usize| {
            if (x * 31 + y * 17 + seed * 7).is_multiple_of(4) { 1.0 } else { 0.0 }
        };
        let (here, there) = (grey(|x, y| hit(x, y, 1)), grey(|x, y| hit(x * x, y + 3 * x, 2)));
        let same = (0..SIZE.0 * SIZE.1).filter(|&i| here[0].data()[i] == there[0].data()[i]);
        assert!(same.count() > 90, "most are black in both");
        let all = plane(|_, _| 1.0);
        let mut trust = all.clone();
        distrust_copies(&mut trust, [here.each_ref(), there.each_ref()], &grey(|_, _| 0.1));
        assert_eq!(trust, all);
    }
}
