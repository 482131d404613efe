//! The error of a picture, were it denoised, estimated for every pixel from other pixels alone.
//!
//! Whoever places samples by the samples that they will be averaged with biases the mean: a pixel hit by a rare
//! bright path looks noisy and is sampled until it fades, one that was not looks finished. So the pixels
//! are split like the squares of a checkerboard, and those of each colour are judged by those of the other:
//! what a pixel's samples were has no bearing on their number. (From the third round on there is a last trace of it: the
//! others' numbers depend on it. It does not show in any test.)
//!
//! Each colour's picture has half the resolution, two pixels of every 2×2, and is denoised just well enough to
//! tell where it is hard: with sparse centres, straight lines and no step that the ranking does without.
//! `[choice]` 5 ms of processor time for 160×120 pixels where the default takes 280, and it ranks pixels as well:
//! predicted error against uniform samples 0.68 from 8 samples per pixel, by the default's 0.69. The estimate is
//! 1.1 times the true error after 8 samples and 0.7 times after 32 (geometric mean over the 13 shipped scenes at 160×120),
//! within a factor of 2 (one deviation); least on fine texture, which half the resolution does not show (foliage 0.2).

use crate::denoise::denoise;
use crate::denoise::variance::{half_difference_squared, smooth};
use crate::error::Result;
use crate::frame::{Feature, FeatureKind, Frame};
use crate::image::{Plane, Rgb};
use crate::metrics::REL_MSE_EPSILON;
use crate::options::{Kernel, Options};
use crate::sampling::relative_error;

/// Pixels along a side of a block.
const BLOCK: usize = 2;

/// The share of the geometric mean that is the error.
const CALIBRATION: f32 = 0.45;

/// Radius over which the noise is averaged: a pixel's own is as noisy as the pixel.
const NOISE_RADIUS: usize = 2;

/// The features that the fit uses.
const KINDS: [FeatureKind; 3] = [FeatureKind::Albedo, FeatureKind::Normal, FeatureKind::Depth];

/// The estimated relative squared error (as in relMSE, ε = 0.01) of every pixel of `frame`, were it denoised; finite
/// and ≥ 0. Where the noise is known it is a share of the geometric mean of that and of the sparse fit's estimate. `[choice]`
/// relMSE after 32 samples in rounds against uniform ones, geometric mean over thirteen scenes: ×0.81 (worst 1.04) by this,
/// ×0.83 (1.08) by the error alone, ×0.83 (1.06) by error^¼ noise^¾.
///
/// # Errors
/// When the frame has no pixel.
pub fn crossed_error(frame: &Frame) -> Result<Plane> {
    let estimate = |colour: usize| -> Result<Plane> {
        let half = one_colour(frame, colour)?;
        let denoised = denoise(&half, &quick())?;
        let mut error = relative_error(&denoised).expect("the pipeline estimates its error");
        if let Some(variance) = half.color_var_of_mean() {
            let mut noise = relative(variance, &denoised.color);
            noise.change(|noise| if noise > 0.0 && noise.is_finite() { noise } else { 0.0 });
            error.combine(&smooth(&noise, NOISE_RADIUS), |error, noise| CALIBRATION * (error * noise).sqrt());
        }
        Ok(error)
    };
    let of = [estimate(0)?, estimate(1)?];
    Ok(Plane::par_from_fn(frame.width(), frame.height(), |x, y| {
        of[(x + y + 1) % 2].get(x / BLOCK, y / BLOCK)
    }))
}

/// The picture at half its resolution from the pixels of one `colour`, 0 or 1: those with an even or an odd
/// x + y. Blocks at an odd border take in their neighbour's pixels, so that each has both colours.
fn one_colour(frame: &Frame, colour: usize) -> Result<Frame> {
    let blocks = |value: &(dyn Fn(usize, usize) -> f32 + Sync), power: i32| {
        let (width, height) = (frame.width(), frame.height());
        let start = |block: usize, size: usize| (block * BLOCK).min(size.saturating_sub(BLOCK));
        Plane::par_from_fn(width.div_ceil(BLOCK), height.div_ceil(BLOCK), |bx, by| {
            let (x0, y0) = (start(bx, width), start(by, height));
            let (mut sum, mut pixels) = (0.0, 0.0f32);
            for y in y0..(y0 + BLOCK).min(height) {
                for x in (x0..(x0 + BLOCK).min(width)).filter(|x| (x + y) % 2 == colour) {
                    sum += value(x, y);
                    pixels += 1.0;
                }
            }
            sum / pixels.powi(power) // NaN where there is none: the denoiser repairs it
        })
    };
    let means = |planes: &Rgb| -> Rgb { std::array::from_fn(|c| blocks(&|x, y| planes[c].get(x, y), 1)) };
    let mut half = Frame::new(means(frame.color()))?;
    let noise = |c: usize| match (frame.color_var_of_mean(), frame.halves()) {
        (Some(variance), _) => Some(blocks(&|x, y| variance[c].get(x, y), 2)),
        (None, Some([a, b])) => {
            Some(blocks(&|x, y| half_difference_squared(a[c].get(x, y), b[c].get(x, y)), 2))
        }
        (None, None) => None,
    };
    if let [Some(r), Some(g), Some(b)] = [0, 1, 2].map(noise) {
        half = half.with_variance_of_mean([r, g, b])?;
    }
    for feature in frame.features().iter().filter(|feature| KINDS.contains(&feature.kind)) {
        let planes = feature.planes.iter().map(|plane| blocks(&|x, y| plane.get(x, y), 1));
        half = half.with_feature(Feature::new(&feature.name, feature.kind, planes.collect()))?;
    }
    Ok(match frame.spp() {
        Some(spp) => half.with_spp(spp),
        None => half,
    })
}

/// The denoiser that only has to tell where the picture is hard.
fn quick() -> Options {
    let mut options = Options {
        window_radius: 6,
        center_spacing: 8,
        min_coverage: 0.0,
        max_order: 1,
        stages: vec![vec![Kernel::by_color(1, 1.0)]; 2],
        coarse: false,
        restore: false,
        ..Options::default()
    };
    options.outliers.enabled = false;
    options.prefilter.enabled = false;
    options
}

/// The `squares` of a picture's channels, pixel by pixel, relative to its light as in relMSE: mean over the channels.
fn relative(squares: &Rgb, picture: &Rgb) -> Plane {
    let (width, height) = picture[0].size();
    Plane::par_from_fn(width, height, |x, y| {
        let light = |plane: &Plane| plane.get(x, y).powi(2) + REL_MSE_EPSILON as f32;
        let channels = squares.iter().zip(picture);
        channels.map(|(squares, plane)| squares.get(x, y) / light(plane)).sum::<f32>() / 3.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (23, 17);

    /// Uneven, with a feature; a pixel is as bright and as noisy as `spoilt` says.
    fn frame(spoilt: impl Fn(usize, usize) -> Option<f32>) -> Frame {
        let plane = |of: &dyn Fn(usize, usize) -> f32| Plane::from_fn(SIZE.0, SIZE.1, of);
        let grain = |x: usize, y: usize| ((x * 7919 + y * 104_729) % 13) as f32 / 13.0;
        let color = plane(&|x, y| spoilt(x, y).unwrap_or(0.5 + 0.02 * x as f32 + 0.2 * grain(x, y)));
        let noise = plane(&|x, y| spoilt(x, y).map_or(2e-3 + 1e-4 * y as f32, |v| v * v));
        let normal = plane(&|x, y| (x / 5 + y / 4) as f32);
        Frame::new(std::array::from_fn(|_| color.clone()))
            .and_then(|f| f.with_variance_of_mean(std::array::from_fn(|_| noise.clone())))
            .and_then(|f| f.with_feature(Feature::new("normal", FeatureKind::Normal, vec![normal])))
            .unwrap()
    }

    /// The cure of the bias: whatever became of the pixels of one colour, they are judged the same.
    #[test]
    fn no_pixel_has_a_say_in_its_own_error() {
        let plain = crossed_error(&frame(|_, _| None)).unwrap();
        for colour in [0, 1] {
            let spoilt = |x: usize, y: usize| {
                let mine = (x + y) % 2 == colour && (x * 5 + y).is_multiple_of(11);
                mine.then_some(if x.is_multiple_of(2) { 300.0 } else { f32::NAN })
            };
            let other = crossed_error(&frame(spoilt)).unwrap();
            let mut changed = 0;
            for (x, y) in (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))) {
                let (was, is) = (plain.get(x, y), other.get(x, y));
                assert!(is.is_finite() && is >= 0.0);
                if (x + y) % 2 == colour {
                    assert_eq!(was, is, "{x}, {y}");
                } else {
                    changed += usize::from(was != is);
                }
            }
            assert!(changed > SIZE.0 * SIZE.1 / 4, "the others see it: {changed}");
        }
    }

    #[test]
    fn the_smallest_pictures_pass() {
        for (width, height) in [(1, 1), (1, 2), (5, 1), (3, 3)] {
            let plane = Plane::from_fn(width, height, |x, y| 1.0 + (x + 2 * y) as f32);
            let frame = Frame::new(std::array::from_fn(|_| plane.clone())).unwrap();
            let error = crossed_error(&frame).unwrap();
            assert_eq!(error.size(), (width, height));
            assert!(error.data().iter().all(|e| e.is_finite() && *e >= 0.0));
        }
    }
}
