//! A film at half its resolution: enough to see where the picture is noisy, at a fraction of the price.

use super::film::{Film, mean, variance_of_mean};
use crate::error::Result;
use crate::frame::{Feature, FeatureKind, Frame};
use crate::image::Plane;

/// Pixels along a side of a block.
const BLOCK: usize = 2;

/// The features that a fit uses, with their place among the film's numbers.
const LAYERS: [(&str, FeatureKind, std::ops::Range<usize>); 3] = [
    ("albedo", FeatureKind::Albedo, 0..3),
    ("normal", FeatureKind::Normal, 3..6),
    ("depth", FeatureKind::Depth, 9..10),
];

impl Film {
    /// The picture so far with every 2×2 pixels averaged (fewer at odd borders): colour, variance of its
    /// mean, and the features without theirs. A block with a pixel of fewer than two samples has a
    /// variance of NaN.
    ///
    /// # Errors
    /// When the picture has no pixel.
    pub fn to_coarse_frame(&self) -> Result<Frame> {
        let color = |c: usize| self.blocks(1, |pixel| mean(&self.color[pixel], self.counts[pixel], c));
        let variance =
            |c: usize| self.blocks(2, |pixel| variance_of_mean(&self.color[pixel], self.counts[pixel], c));
        let mut frame =
            Frame::new(std::array::from_fn(color))?.with_variance_of_mean(std::array::from_fn(variance))?;
        for (name, kind, at) in LAYERS.into_iter().filter(|_| !self.features.is_empty()) {
            let planes =
                at.map(|i| self.blocks(1, |pixel| mean(&self.features[pixel], self.counts[pixel], i)));
            frame = frame.with_feature(Feature::new(name, kind, planes.collect()))?;
        }
        Ok(frame.with_spp((self.drawn() as f64 / self.counts.len() as f64) as f32))
    }

    /// Σ over the block / pixelsᵖᵒʷᵉʳ.
    fn blocks(&self, power: i32, value: impl Fn(usize) -> f64) -> Plane {
        let (width, height) = (self.width(), self.height());
        Plane::from_fn(width.div_ceil(BLOCK), height.div_ceil(BLOCK), |bx, by| {
            let (mut sum, mut pixels) = (0.0, 0.0);
            for y in by * BLOCK..(by * BLOCK + BLOCK).min(height) {
                for x in bx * BLOCK..(bx * BLOCK + BLOCK).min(width) {
                    sum += value(y * width + x);
                    pixels += 1.0;
                }
            }
            (sum / f64::powi(pixels, power)) as f32
        })
    }
}
