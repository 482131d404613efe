//! Where differences may pass for noise: not where the stage before has missed detail.
//!
//! The tolerance lets weights take for alike what differs by a share τ of the radiance, where noise is less: a fit
//! knows the gradients of light and of features. It does not know bumps, dents and prints that no feature tells of;
//! there its window blurs what the noise would have let it see. The stage before tells where: around a pixel its
//! residual holds more energy than the noise, by e² = max(0, Σ (y − μ̂)² − κ Σ σ²). Of τ² Σ μ̂² that leaves the share
//! max(0, 1 − e²/(c τ² Σ μ̂²)), for the frame's own samples and those of the frames beside it.
//!
//! `[choice]` relMSE and MSE against the whole tolerance everywhere, at 16, 64 and 256 spp (on bumps alone relMSE
//! ×0.89, ×0.81, ×0.84), on the five and the thirteen scenes and on ten new ones and seven rendered anew, on which
//! nothing else had been tuned of late:
//!
//! | radius, κ, c | five scenes | thirteen | seventeen |
//! |---|--:|--:|--:|
//! | 3, 0.85, 0.06 | ×0.984, ×1.002 | ×0.997, ×0.999 | ×0.958, ×0.974 |
//! | 2, 1, 0.06 | ×0.986, ×1.002 | ×0.996, ×0.998 | ×0.964, ×0.978 |
//! | 3, 1, 0.03, τ of 0.17 | ×0.983, ×0.987 | ×0.992, ×0.984 | ×0.977, ×0.979 |
//! | no tolerance at all | ×1.062, ×1.070 | ×1.113, ×1.106 | ×1.010, ×1.045 |

use super::signal::Signal;
use super::variance::smooth;
use crate::image::{Plane, Rgb, squared_difference};
use crate::options::Options;

/// Radius of the sums.
pub const RADIUS: usize = 3;

/// κ: the stage before was fitted to the noise, so that its residual holds less of it.
const NOISE: f32 = 0.85;

/// c: detail of a quarter of what is tolerated takes all tolerance away.
const MISSED: f32 = 0.06;

/// The share of the squared tolerance that is left at every pixel, 0 to 1, after a stage that has found `pilot`;
/// `noise` is the sum of the signal's smoothed variances.
pub fn after(pilot: &Rgb, signal: &Signal, noise: &Plane, options: &Options) -> Plane {
    let (width, height) = noise.size();
    let light = Plane::par_from_fn(width, height, |x, y| {
        pilot.iter().map(|plane| plane.get(x, y).powi(2)).sum::<f32>().min(f32::MAX)
    });
    let residual = squared_difference(signal.color(), pilot);
    let [residual, noise, light] = [&residual, noise, &light].map(|plane| smooth(plane, RADIUS));
    Plane::par_from_fn(width, height, |x, y| {
        let missed = (residual.get(x, y) - NOISE * noise.get(x, y)).max(0.0);
        let tolerated = MISSED * options.tolerance.powi(2) * light.get(x, y);
        if missed < tolerated { 1.0 - missed / tolerated } else { 0.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::denoise::design::Design;
    use crate::image::sum_of_channels;

    /// What is left in either half of a picture of which a pilot of constant light has missed the left one by `detail`
    /// and the right one by noise of the `variance`, both shares of the light.
    fn left(detail: f32, variance: f32, light: f32) -> [f32; 2] {
        let sign = |x: usize, y: usize| if (x * 7 + y * 3).is_multiple_of(2) { 1.0 } else { -1.0 };
        let noisy = Plane::from_fn(40, 20, |x, y| {
            light * (1.0 + sign(x, y) * if x < 20 { detail } else { variance.sqrt() })
        });
        let flat = |value: f32| std::array::from_fn(|_| Plane::filled(40, 20, value));
        let noise = flat(variance * light * light);
        let options = Options { tolerance: 0.12, ..Options::default() };
        let signal = Signal::new(vec![noisy; 3], noise, Design::default(), &options);
        let noise = sum_of_channels(&signal.smoothed);
        let forgiven = after(&flat(light), &signal, &noise, &options);
        [forgiven.get(8, 10), forgiven.get(32, 10)]
    }

    #[test]
    fn missed_detail_is_not_forgiven_and_what_is_less_than_noise_is() {
        for light in [1.0, 1e-12, 1e12] {
            let [detail, noise] = left(0.05, 1e-6, light);
            assert_eq!(detail, 0.0, "{light}");
            assert!(noise > 0.99, "{light}: {noise}");
            // e² = 0.01² of c τ² = 0.06 · 0.12².
            let [some, _] = left(0.01, 0.0, light);
            assert!((some - (1.0 - 1e-4 / (0.06 * 0.0144))).abs() < 1e-3, "{light}: {some}");
            let [hidden, _] = left(0.05, 0.01, light);
            assert_eq!(hidden, 1.0, "{light}: noise hides it");
        }
    }

    #[test]
    fn a_black_picture_has_none() {
        assert_eq!(left(0.0, 0.0, 0.0), [0.0; 2]);
    }
}
