//! How wrong the result is likely to be: its estimated squared error.
//!
//! The risk ξ of the fits is their own, and sure of itself where all of them are wrong alike: in light that few samples
//! have found it is a hundredth of the true error, beside lamps, whose fits speak for the dark pixels too, a hundred
//! times as large. What the last stage changed of the stage before, Δ² = |ŷ − μ̂|², knows better.
//!
//! `[choice]` with every term over the light l = ŷ² + ε, E/l = κ (Δ²/l)^¾ (ξ/l)^¼ (σ²/l)^¼, means over 5×5 pixels. The
//! exponents and κ are of a search over thirteen scenes at 16, 64 and 256 spp. Estimated over true relMSE, its geometric
//! mean and the factor that is one deviation over the scenes, against ξ alone:
//!
//! | | spp | ξ | E |
//! |---|--:|--:|--:|
//! | the thirteen | 16 | 0.49, ×5.8 | 1.30, ×2.2 |
//! | | 64 | 1.24, ×3.2 | 1.28, ×1.9 |
//! | | 256 | 1.50, ×4.6 | 0.89, ×2.1 |
//! | five others | 16 | 0.55, ×2.8 | 0.75, ×1.3 |
//! | | 64 | 1.25, ×4.2 | 0.70, ×1.4 |
//! | | 256 | 2.57, ×6.5 | 0.91, ×1.3 |
//!
//! Too sure of itself it is where both stages keep pixels as they are: ×0.2 on fine foliage at 256 spp.

use super::reconstruct::Reconstruction;
use super::variance::smooth;
use crate::image::{Plane, Rgb, mean_of_channels};

/// κ.
const SCALE: f32 = 4.5;

/// Relative squares are no larger than this, so that their products stay in `f32`.
const LARGEST: f32 = 1e12;

/// Radius over which all is averaged.
pub const RADIUS: usize = 2;

/// Fills in the estimated error of a result whose noise was `variance`, all exposed. A result of a single stage has its
/// fits' risk alone.
pub fn estimate(result: &mut Reconstruction, variance: &Rgb, dark_level: f32) {
    let Some(change) = result.change.take() else { return };
    let mut light = mean_of_channels(&result.color());
    light.change(|light| light.powi(2) + dark_level.powi(2));
    let relative = |mut plane: Plane| {
        plane.combine(&light, |squares, light| (squares / light).min(LARGEST));
        smooth(&plane, RADIUS) // what a lamp may be wrong by is not the wall's beside it
    };
    let risk = std::mem::replace(&mut result.mse, Plane::filled(0, 0, 0.0));
    let [change, risk, noise] = [change, risk, mean_of_channels(variance)].map(relative);
    result.mse = Plane::par_from_fn(light.width(), light.height(), |x, y| {
        let [change, risk, noise] = [&change, &risk, &noise].map(|plane| plane.get(x, y));
        let error = (change * (change * risk * noise).sqrt()).sqrt(); // the same on all machines, which powers are not
        (SCALE * light.get(x, y) * error).min(f32::MAX)
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (24, 9);

    fn estimated(light: impl Fn(usize) -> f32, change: impl Fn(usize) -> f32, scale: f32) -> Plane {
        let plane = |of: &dyn Fn(usize) -> f32| Plane::from_fn(SIZE.0, SIZE.1, |x, _| of(x));
        let mut result = Reconstruction::exact(vec![plane(&|x| light(x) * scale.sqrt()); 3]);
        result.mse = plane(&|_| 0.02 * scale);
        result.change = Some(plane(&|x| change(x) * scale));
        estimate(&mut result, &std::array::from_fn(|_| plane(&|_| 0.5 * scale)), scale.sqrt());
        result.mse
    }

    #[test]
    fn the_estimate_is_the_formula_and_scales_with_the_light() {
        let expected = SCALE * 2.0 * (0.005f32.powi(3) * 0.01 * 0.25).powf(0.25); // l = 1² + 1²
        for scale in [1.0, 1024.0, 1e-6] {
            let mse = estimated(|_| 1.0, |_| 0.01, scale);
            assert!(mse.data().iter().all(|e| (e / (expected * scale) - 1.0).abs() < 1e-4), "{scale}");
        }
        assert!(estimated(|_| 1.0, |_| 0.0, 1.0).data().iter().all(|e| *e == 0.0));
    }

    #[test]
    fn what_a_lamp_changed_by_is_not_what_the_wall_beside_it_is_wrong_by() {
        let lamp = |x: usize| if x < 12 { 0.1 } else { 1000.0 };
        let mse = estimated(lamp, |x| 1e-4 * lamp(x).powi(2), 1.0);
        assert!(mse.get(11, 4) < 1e-2 && mse.get(12, 4) > 1.0, "{} {}", mse.get(11, 4), mse.get(12, 4));
    }

    #[test]
    fn a_single_stage_has_its_own_risk() {
        let mut result = Reconstruction::exact(vec![Plane::filled(4, 3, 1.0); 3]);
        result.mse = Plane::filled(4, 3, 0.25);
        estimate(&mut result, &std::array::from_fn(|_| Plane::filled(4, 3, 9.0)), 0.4);
        assert!(result.mse.data().iter().all(|e| *e == 0.25));
    }
}
