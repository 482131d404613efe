//! How wrong the result is likely to be: its estimated squared error.
//!
//! The risk ξ of the fits is their own, and sure of itself where all of them are wrong alike: in light that few samples
//! have found it is a hundredth of the true error, beside lamps, whose fits speak for the dark pixels too, a hundred
//! times as large. What the last stage changed of the stage before, Δ² = |ŷ − μ̂|², is too little where stages agree.
//! Their geometric mean is better than either. Neither sees what the albedo passes on: its noise is the colour's own,
//! and a fit of texture takes it for detail. So
//!
//! E/l = √(Δ²/l · ξ/l) + ν,
//!
//! with the light l = ŷ² + ε and ν the variance that the prefilter has left in the albedo, over its square. Δ² and ξ are
//! means over the 5×5 pixels around, each as much as its light is like the middle's: by min/max of √l. What a lamp may be
//! wrong by is not the wall's beside it, nor is the wall's the lamp's. Nor are Δ² and ξ of any pixel more than l: fits in
//! the dark beside a lamp may have a risk that is a hundred times the light that is there.
//!
//! `[choice]` Estimated over true relMSE, its geometric mean and the factor that is one deviation over the scenes:
//!
//! | | spp | ξ^¼ Δ^(3/2) σ^½ over 5×5 | 1.3 √(Δ²ξ) | with ν | and no more than l |
//! |---|--:|--:|--:|--:|--:|
//! | five scenes | 16 | 3.20, ×3.5 | 0.96, ×1.9 | 1.13, ×1.6 | 0.85, ×1.4 |
//! | | 64 | 2.09, ×2.2 | 0.87, ×1.8 | 1.18, ×1.3 | 0.97, ×1.2 |
//! | | 256 | 1.67, ×2.2 | 0.82, ×1.6 | 1.11, ×1.2 | 0.99, ×1.1 |
//! | thirteen others | 16 | 4.30, ×3.9 | 1.33, ×2.1 | 1.36, ×1.8 | 1.09, ×1.5 |
//! | | 64 | 2.89, ×4.1 | 1.20, ×1.7 | 1.28, ×1.4 | 1.10, ×1.4 |
//! | | 256 | 1.60, ×3.4 | 1.04, ×1.6 | 1.11, ×1.4 | 0.98, ×1.4 |
//! | seventeen held out | 16 | | 1.15, ×2.2 | 1.13, ×1.9 | 0.91, ×1.5 |
//! | | 64 | | 1.15, ×1.9 | 1.15, ×1.7 | 0.98, ×1.4 |
//! | | 256 | | 1.11, ×1.9 | 1.08, ×1.8 | 0.94, ×1.5 |
//!
//! The first column is of an earlier version. The correlation of the logarithms over blocks of 8×8 pixels is 0.79 to
//! 0.90. Bounds of ½ or 2 for ξ alone, or of 0.1 for both: a deviation over all scenes and counts of 1.46 to 1.54 instead
//! of 1.44; exponents of Δ² of 0.4 and 0.6 instead of ½: 1.43 and 1.46. Least where a bump that no feature knows is
//! smoothed away, ×0.25 at 16 spp; most on moving things, ×2.3.

use super::reconstruction::Reconstruction;
use super::variance::around;
use crate::image::{Plane, mean_of_channels};

/// Relative squares are no larger than this.
const LARGEST: f32 = 1.0;

/// Radius over which all is averaged.
pub const RADIUS: usize = 2;

/// Fills in the estimated error of a result, all exposed, of which the albedo's relative variance may be known. A
/// result of a single stage has its fits' risk alone.
pub fn estimate(result: &mut Reconstruction, albedo_noise: Option<&Plane>, dark_level: f32) {
    let Some(change) = result.change.take() else { return };
    let mut light = mean_of_channels(&result.color());
    // Not by `hypot`, whose last bit is the machine's.
    light.change(|light| (f64::from(light).powi(2) + f64::from(dark_level).powi(2)).sqrt() as f32);
    let relative = |mut plane: Plane| {
        plane.combine(&light, |squares, light| (squares / (light * light)).min(LARGEST));
        plane
    };
    let risk = std::mem::replace(&mut result.mse, Plane::filled(0, 0, 0.0));
    let terms = [change, risk].map(relative);
    result.mse = Plane::par_from_fn(light.width(), light.height(), |x, y| {
        let [change, risk] = among_alike(&terms, &light, [x, y]);
        let passed_on = albedo_noise.map_or(0.0, |noise| noise.get(x, y));
        (light.get(x, y).powi(2) * ((change * risk).sqrt() + passed_on)).min(f32::MAX)
    });
}

/// The means of `planes` over the pixels around the one at column `x` and row `y`, each as much as its `light` is like
/// that one's.
fn among_alike(planes: &[Plane; 2], light: &Plane, [x, y]: [usize; 2]) -> [f32; 2] {
    let ((width, height), own) = (light.size(), light.get(x, y));
    let (mut sums, mut total) = ([0.0; 2], 0.0);
    for row in around(y, RADIUS, height) {
        for column in around(x, RADIUS, width) {
            let other = light.get(column, row);
            let alike = own.min(other) / own.max(other);
            sums.iter_mut().zip(planes).for_each(|(sum, plane)| *sum += alike * plane.get(column, row));
            total += alike;
        }
    }
    sums.map(|sum| sum / total)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (24, 9);

    fn estimated(light: impl Fn(usize) -> f32, change: impl Fn(usize) -> f32, scale: f32) -> Plane {
        let plane = |of: &dyn Fn(usize) -> f32| Plane::from_fn(SIZE.0, SIZE.1, |x, _| of(x));
        let mut result = Reconstruction::exact(vec![plane(&|x| light(x) * scale.sqrt()); 3]);
        result.mse = plane(&|x| 2.0 * change(x) * scale);
        result.change = Some(plane(&|x| change(x) * scale));
        estimate(&mut result, None, scale.sqrt());
        result.mse
    }

    #[test]
    fn the_estimate_is_the_formula_and_scales_with_the_light() {
        let expected = (0.01f32 * 0.02).sqrt();
        for scale in [1.0, 1024.0, 1e-6] {
            let mse = estimated(|_| 1.0, |_| 0.01, scale);
            assert!(mse.data().iter().all(|e| (e / (expected * scale) - 1.0).abs() < 1e-4), "{scale}");
        }
        assert!(estimated(|_| 1.0, |_| 0.0, 1.0).data().iter().all(|e| *e == 0.0));
    }

    #[test]
    fn what_a_lamp_is_wrong_by_is_not_the_walls_beside_it_nor_the_walls_the_lamps() {
        let lamp = |x: usize| if x < 12 { 0.1 } else { 1000.0 };
        let of = |wall: f32, lamps: f32| {
            let mse = estimated(lamp, |x| if x < 12 { wall } else { lamps * 1e6 }, 1.0);
            [mse.get(11, 4), mse.get(12, 4) / 1e6].map(|e| e / 2.0f32.sqrt())
        };
        let [wall, _] = of(1e-4, 1e-2); // of its square each: a lamp that is the more uncertain
        assert!((1e-4..3e-4).contains(&wall), "{wall}");
        let [_, lamp] = of(1.0, 1e-4); // a wall that is
        assert!((1e-4..1.2e-3).contains(&lamp), "{lamp}");
    }

    #[test]
    fn no_pixel_is_wrong_by_more_than_all_its_light() {
        let beyond = estimated(|_| 1.0, |_| 1e20, 1.0);
        let all = 1.0 + 1.0; // its square and the dark level's
        assert!(beyond.data().iter().all(|e| (e / all - 1.0).abs() < 1e-4), "{}", beyond.get(0, 0));
    }

    #[test]
    fn what_is_left_of_the_albedos_noise_is_the_results_too() {
        let mut result = Reconstruction::exact(vec![Plane::filled(4, 3, 3.0); 3]);
        result.change = Some(Plane::filled(4, 3, 0.0));
        estimate(&mut result, Some(&Plane::from_fn(4, 3, |x, _| 0.01 * x as f32)), 0.0);
        for x in 0..4 {
            assert!((result.mse.get(x, 1) - 0.09 * x as f32).abs() < 1e-5, "{}", result.mse.get(x, 1));
        }
    }

    #[test]
    fn a_single_stage_has_its_own_risk() {
        let mut result = Reconstruction::exact(vec![Plane::filled(4, 3, 1.0); 3]);
        result.mse = Plane::filled(4, 3, 0.25);
        estimate(&mut result, None, 0.4);
        assert!(result.mse.data().iter().all(|e| *e == 0.25));
    }
}
