//! How wrong the result is likely to be: its estimated squared error.
//!
//! The risk ξ of the fits is their own, and sure of itself where all of them are wrong alike: in light that few samples
//! have found it is a hundredth of the true error, beside lamps, whose fits speak for the dark pixels too, a hundred
//! times as large. What the last stage changed of the stage before, Δ² = |ŷ − μ̂|², is too little where stages agree.
//! Their geometric mean is better than either.
//!
//! `[choice]` with both over the light l = ŷ² + ε, E/l = κ √(Δ²/l · ξ/l), means over the 5×5 pixels around, each as
//! much as its light is like the middle's: by min/max of √l. What a lamp may be wrong by is not the wall's beside it, nor is the
//! wall's the lamp's. Estimated over true relMSE, its geometric mean and the factor that is one deviation over the scenes:
//!
//! | | spp | ξ^¼ Δ^(3/2) σ^½ over 5×5 | E |
//! |---|--:|--:|--:|
//! | five scenes | 16 | 3.20, ×3.5 | 0.96, ×1.9 |
//! | | 64 | 2.09, ×2.2 | 0.87, ×1.8 |
//! | | 256 | 1.67, ×2.2 | 0.82, ×1.6 |
//! | thirteen others | 16 | 4.30, ×3.9 | 1.33, ×2.1 |
//! | | 64 | 2.89, ×4.1 | 1.20, ×1.7 |
//! | | 256 | 1.60, ×3.4 | 1.04, ×1.6 |
//!
//! The column before is of an earlier version. Least where both stages are wrong alike: ×0.3 to ×0.4 on noisy textures,
//! whose albedo passes its own noise on, which no stage sees; most among many lamps and out of focus at 16 spp, ×6 and ×4. Of squared errors as they are, which a few highlights are
//! the most of, it is half.

use super::reconstruction::Reconstruction;
use super::variance::around;
use crate::image::{Plane, mean_of_channels};

/// κ.
const SCALE: f32 = 1.3;

/// Relative squares are no larger than this, so that their products stay in `f32`.
const LARGEST: f32 = 1e12;

/// Radius over which all is averaged.
pub const RADIUS: usize = 2;

/// Fills in the estimated error of a result, all exposed. A result of a single stage has its fits' risk alone.
pub fn estimate(result: &mut Reconstruction, dark_level: f32) {
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
        (SCALE * light.get(x, y).powi(2) * (change * risk).sqrt()).min(f32::MAX)
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
        estimate(&mut result, scale.sqrt());
        result.mse
    }

    #[test]
    fn the_estimate_is_the_formula_and_scales_with_the_light() {
        let expected = SCALE * (0.01f32 * 0.02).sqrt();
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
            [mse.get(11, 4), mse.get(12, 4) / 1e6].map(|e| e / (SCALE * 2.0f32.sqrt()))
        };
        let [wall, _] = of(1e-4, 1e-2); // of its square each: a lamp that is the more uncertain
        assert!((1e-4..3e-4).contains(&wall), "{wall}");
        let [_, lamp] = of(1.0, 1e-4); // a wall that is
        assert!((1e-4..1.2e-3).contains(&lamp), "{lamp}");
    }

    #[test]
    fn a_single_stage_has_its_own_risk() {
        let mut result = Reconstruction::exact(vec![Plane::filled(4, 3, 1.0); 3]);
        result.mse = Plane::filled(4, 3, 0.25);
        estimate(&mut result, 0.4);
        assert!(result.mse.data().iter().all(|e| *e == 0.25));
    }
}
