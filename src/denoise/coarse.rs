//! The picture at half its resolution, through the same stages, and what it knows better.
//!
//! `[choice]` Fits of small windows leave noise of low frequency behind: blotches as large as a window. A
//! picture of the means of 2×2 pixels has a quarter of the variance and windows of twice the size. Where
//! δ = (coarse − means of the fine result), the share
//!
//! s = min(1, M/D) · r_f/(r_f + r_c)
//!
//! averaged over 3×3 blocks, of δ is added to the fine result, bilinear: M is the fine result's estimated squared
//! error and D = δ², so that no more comes back than the fine result may be wrong by; r_f and r_c are both results'
//! errors relative to their light, M/(L² + dark²). M, D, r_f and r_c are averaged over 3×3 blocks too. A pixel darker than the blocks around it gets proportionally
//! less, for a lamp's error is not the wall's beside it. relMSE ×0.975 (thirteen scenes of the tracer at 16
//! spp, hard indirect light ×0.83) and ×0.992 (five others at 16 and 64 spp) in 1.15 times the time. A second
//! coarser level gave ×0.997 more and twice the halo; merging after every stage ×0.998.

use super::reconstruction::Reconstruction;
use super::variance::smooth;
use crate::image::{Plane, Rgb, mean_of_channels};
use crate::options::Options;
use rayon::prelude::*;

/// How far around a pixel a merge looks in the fine result: two means of 3×3 blocks and the bilinear
/// neighbour, in pixels, and to the block's border.
pub const REACH: usize = 2 * 3 + 1;

/// Radius in blocks of the means that the shares are made of.
const RADIUS: usize = 1;

/// The share of the coverage that a block needs of what a pixel does. `[choice]` against 1: relMSE ×1.000 (18
/// scenes at 16 to 256 spp) in 0.85 of the time.
const COVERAGE: f32 = 0.25;

/// The options of the fits at half the resolution.
pub fn options(options: &Options) -> Options {
    Options { min_coverage: COVERAGE * options.min_coverage, ..options.clone() }
}

/// Means of 2×2 pixels; an odd last column or row counts twice.
pub fn halve(plane: &Plane) -> Plane {
    let (w, h) = plane.size();
    Plane::par_from_fn(w.div_ceil(2), h.div_ceil(2), |x, y| {
        let (x, y) = (2 * x, 2 * y);
        let (right, below) = ((x + 1).min(w - 1), (y + 1).min(h - 1));
        // In halves, so that the sum cannot leave the range.
        let (top, bottom) =
            (mean(plane.get(x, y), plane.get(right, y)), mean(plane.get(x, below), plane.get(right, below)));
        mean(top, bottom)
    })
}

fn mean(a: f32, b: f32) -> f32 {
    0.5 * a + 0.5 * b
}

/// The variance of [`halve`]'s means where that of the pixels is `variance`; a pixel that counts twice is still one.
pub fn halve_variance(variance: &Plane) -> Plane {
    let (w, h) = variance.size();
    let share = |at: usize, of: usize| if 2 * at + 1 < of { 0.5 } else { 1.0 };
    let mut halved = halve(variance);
    halved.rows_mut().enumerate().for_each(|(y, row)| {
        row.iter_mut().enumerate().for_each(|(x, v)| *v *= share(x, w) * share(y, h));
    });
    halved
}

/// A plane of blocks at the pixels of a picture of `size`, bilinear between the blocks' centres.
fn double(plane: &Plane, size: (usize, usize)) -> Plane {
    let between = |at: usize, blocks: usize| {
        let place = ((at as f32 - 0.5) / 2.0).clamp(0.0, (blocks - 1) as f32);
        let first = place as usize;
        (first, (first + 1).min(blocks - 1), place - first as f32)
    };
    Plane::par_from_fn(size.0, size.1, |x, y| {
        let (left, right, u) = between(x, plane.width());
        let (top, bottom, v) = between(y, plane.height());
        let across = |y: usize| (1.0 - u) * plane.get(left, y) + u * plane.get(right, y);
        (1.0 - v) * across(top) + v * across(bottom)
    })
}

/// Adds to the targets of `fine` what those of `coarse` know better; both are exposed.
pub fn merge(fine: &mut Reconstruction, coarse: &Reconstruction, dark_level: f32) {
    let deltas: Vec<Plane> =
        fine.targets.iter().zip(&coarse.targets).map(|(f, c)| difference(c, &halve(f))).collect();
    let light = mean_of_channels(&fine.color());
    let share = shares(fine, &light, coarse, &deltas, dark_level);
    let below = darker(&light);
    for (plane, delta) in fine.targets.iter_mut().zip(&deltas) {
        let mut added = double(&combine(delta, &share, |delta, share| delta * share), plane.size());
        added.combine(&below, |added, below| added * below);
        plane.combine(&added, |value, added| value + added);
    }
}

/// s of every block.
fn shares(
    fine: &Reconstruction,
    light: &Plane,
    coarse: &Reconstruction,
    deltas: &[Plane],
    dark_level: f32,
) -> Plane {
    let relative = |mse: &Plane, light: &Plane| {
        combine(mse, light, |mse, light| mse / (light.max(0.0).powi(2) + dark_level.powi(2)))
    };
    let around = |plane: &Plane| smooth(plane, RADIUS);
    let squares: Rgb = std::array::from_fn(|c| combine(&deltas[c], &deltas[c], |a, b| a * b));
    let (apart, error) = (around(&mean_of_channels(&squares)), around(&halve(&fine.mse)));
    let explained = combine(&error, &apart, |error, apart| if apart > error { error / apart } else { 1.0 });
    let own = around(&halve(&relative(&fine.mse, light)));
    let other = around(&relative(&coarse.mse, &mean_of_channels(&coarse.color())));
    let better = combine(&own, &other, |own, other| if own > 0.0 { own / (own + other) } else { 0.0 });
    around(&combine(&explained, &better, |explained, better| explained * better))
}

/// By how much every pixel is darker than the blocks around it, 0 to 1. `[choice]` blocks as bilinear as what they
/// add, against the pixel's own: relMSE ×0.996 and ×0.993 (five and thirteen scenes), and no dark rims around lamps.
fn darker(light: &Plane) -> Plane {
    let blocks = double(&halve(light), light.size());
    combine(
        light,
        &blocks,
        |own, blocks| if blocks > own { own.max(0.0) / blocks.max(f32::MIN_POSITIVE) } else { 1.0 },
    )
}

fn difference(a: &Plane, b: &Plane) -> Plane {
    combine(a, b, |a, b| a - b)
}

fn combine(a: &Plane, b: &Plane, with: impl Fn(f32, f32) -> f32 + Sync) -> Plane {
    Plane::par_from_fn(a.width(), a.height(), |x, y| with(a.get(x, y), b.get(x, y)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(value: impl Fn(usize, usize) -> f32, mse: f32, size: (usize, usize)) -> Reconstruction {
        let plane = Plane::from_fn(size.0, size.1, value);
        let mse = Plane::filled(size.0, size.1, mse);
        Reconstruction { mse, ..Reconstruction::exact(vec![plane.clone(), plane.clone(), plane]) }
    }

    #[test]
    fn a_plane_survives_halving_and_doubling() {
        let ramp = |x: usize, y: usize| 3.0 + x as f32 - 2.0 * y as f32;
        let plane = Plane::from_fn(12, 8, ramp);
        let again = double(&halve(&plane), (12, 8));
        for (x, y) in (1..11).flat_map(|x| (1..7).map(move |y| (x, y))) {
            assert!((again.get(x, y) - ramp(x, y)).abs() < 1e-5, "({x}, {y}): {}", again.get(x, y));
        }
        let odd = halve(&Plane::from_fn(3, 1, |x, _| x as f32));
        assert_eq!(odd.data(), [0.5, 2.0]);
    }

    #[test]
    fn means_of_fewer_pixels_have_more_variance() {
        let halved = halve_variance(&Plane::filled(3, 5, 8.0));
        assert_eq!(halved.data(), [2.0, 4.0, 2.0, 4.0, 4.0, 8.0]);
    }

    #[test]
    fn a_mirrored_picture_merges_to_the_mirrored_one() {
        let light = |x: usize, y: usize| ((x * 7 + y * 13) % 11) as f32;
        let blocks = |x: usize, y: usize| ((x * 5 + y * 3) % 7) as f32;
        let (mut plain, mut mirrored) =
            (stage(light, 2.0, (16, 10)), stage(|x, y| light(15 - x, y), 2.0, (16, 10)));
        merge(&mut plain, &stage(blocks, 1.0, (8, 5)), 0.4);
        merge(&mut mirrored, &stage(|x, y| blocks(7 - x, y), 1.0, (8, 5)), 0.4);
        for (x, y) in (0..16).flat_map(|x| (0..10).map(move |y| (x, y))) {
            let [a, b] = [plain.targets[0].get(x, y), mirrored.targets[0].get(15 - x, y)];
            assert!((a - b).abs() < 1e-5, "({x}, {y}): {a} and {b}");
        }
    }

    #[test]
    fn what_the_fine_error_explains_is_added_by_the_share_of_its_error() {
        let (size, half) = ((16, 12), (8, 6));
        // Errors of 1 and ¼, apart by 1: all is explained, four fifths belong to the fine result.
        let mut fine = stage(|_, _| 5.0, 1.0, size);
        merge(&mut fine, &stage(|_, _| 6.0, 0.25 * (36.16 / 25.16), half), 0.4);
        assert!(
            fine.targets[0].data().iter().all(|v| (v - 5.8).abs() < 1e-4),
            "{:?}",
            fine.targets[0].get(3, 3)
        );
        // Ten apart with the same errors: a hundredth of it is explained.
        let mut fine = stage(|_, _| 5.0, 1.0, size);
        merge(&mut fine, &stage(|_, _| 15.0, 0.0, half), 0.4);
        assert!(fine.targets[0].data().iter().all(|v| (v - 5.1).abs() < 1e-4));
    }

    #[test]
    fn what_a_lamp_is_wrong_by_does_not_darken_the_wall_beside_it() {
        // From column 8 on there is a lamp, which the coarse picture holds for darker; about the wall both agree.
        let (size, half) = ((16, 12), (8, 6));
        let lamp = |from: usize, light: f32| move |x: usize, _: usize| if x < from { 0.1 } else { light };
        let mut fine = stage(lamp(8, 20.0), 100.0, size);
        merge(&mut fine, &stage(lamp(4, 10.0), 100.0, half), 0.4);
        let row = fine.targets[0].row(5);
        assert!(row[12] < 19.0 && (row[7] - 0.1).abs() < 0.02, "{row:?}");
    }

    #[test]
    fn two_results_that_agree_or_are_certain_stay() {
        let (size, half) = ((9, 7), (5, 4));
        for (mse, value) in [(1.0, 2.0), (0.0, 3.0)] {
            let mut fine = stage(|_, _| 2.0, mse, size);
            merge(&mut fine, &stage(|_, _| value, 0.0, half), 0.4);
            assert!(fine.targets[1].data().iter().all(|&v| v == 2.0), "{mse} {value}");
        }
    }
}
