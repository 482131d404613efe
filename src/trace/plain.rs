//! A film's picture with no more than the placing of samples asks for, at a fraction of the price.

use super::film::{FIRST_LAYERS, Film, mean, variance_of_mean};
use crate::error::Result;
use crate::frame::{Feature, FeatureKind, Frame};

/// The features that it has.
const KINDS: [FeatureKind; 3] = [FeatureKind::Albedo, FeatureKind::Normal, FeatureKind::Depth];

impl Film {
    /// The picture so far without halves, and albedo, normal and depth without variances. A pixel of fewer
    /// than two samples has a variance of NaN.
    ///
    /// # Errors
    /// When the picture has no pixel.
    pub fn to_plain_frame(&self) -> Result<Frame> {
        let variance = self.rgb(&self.color, variance_of_mean);
        let mut frame = Frame::new(self.rgb(&self.color, mean))?.with_variance_of_mean(variance)?;
        let layers = FIRST_LAYERS.into_iter().filter(|(_, kind, _)| KINDS.contains(kind));
        for (name, kind, at) in layers.filter(|_| !self.features.is_empty()) {
            let planes = at.map(|i| self.plane(&self.features, i, mean));
            frame = frame.with_feature(Feature::new(name, kind, planes.collect()))?;
        }
        Ok(frame.with_spp((self.drawn() as f64 / self.counts.len() as f64) as f32))
    }
}
