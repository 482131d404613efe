//! A film's picture with no more than the placing of samples asks for, at a fraction of the price.

use super::film::{Film, mean, variance_of_mean};
use crate::error::Result;
use crate::frame::{Feature, FeatureKind, Frame};

/// The features, with their place among the film's numbers.
const LAYERS: [(&str, FeatureKind, std::ops::Range<usize>); 3] = [
    ("albedo", FeatureKind::Albedo, 0..3),
    ("normal", FeatureKind::Normal, 3..6),
    ("depth", FeatureKind::Depth, 9..10),
];

impl Film {
    /// The picture so far without halves, and albedo, normal and depth without variances. A pixel of fewer
    /// than two samples has a variance of NaN.
    ///
    /// # Errors
    /// When the picture has no pixel.
    pub fn to_plain_frame(&self) -> Result<Frame> {
        let variance = self.rgb(&self.color, variance_of_mean);
        let mut frame = Frame::new(self.rgb(&self.color, mean))?.with_variance_of_mean(variance)?;
        for (name, kind, at) in LAYERS.into_iter().filter(|_| !self.features.is_empty()) {
            let planes = at.map(|i| self.plane(&self.features, i, mean));
            frame = frame.with_feature(Feature::new(name, kind, planes.collect()))?;
        }
        Ok(frame.with_spp((self.drawn() as f64 / self.counts.len() as f64) as f32))
    }
}
