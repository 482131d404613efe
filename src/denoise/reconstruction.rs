//! What a stage gives, and what the next one knows of the picture by it.

use super::exposure;
use crate::image::{Plane, Rgb, mean_of_channels};

/// Estimated deviations of the pilot by which a pixel is certainly brighter.
const CERTAINTY: f32 = 2.0;

/// What a stage gives, exposed.
pub struct Reconstruction {
    /// Reconstruction of every target.
    pub targets: Vec<Plane>,
    /// Estimated mean squared error, averaged over the channels: the fits' risk.
    pub mse: Plane,
    /// The squared difference from the stage before, averaged over the channels, where there was one.
    pub change: Option<Plane>,
    /// Order, averaged over the fits that cover the pixel.
    pub order: Plane,
    /// Fits.
    pub fits: usize,
    /// Of those, fits of centres that the coverage test added.
    pub coverage_fits: usize,
    /// How often each order had the least risk.
    pub orders: [usize; 4],
}

impl Reconstruction {
    /// What needed no fits: `targets` are right as they are.
    pub fn exact(targets: Vec<Plane>) -> Self {
        let (width, height) = targets[0].size();
        let [mse, order] = [0.0; 2].map(|none| Plane::filled(width, height, none));
        Self { targets, mse, change: None, order, fits: 0, coverage_fits: 0, orders: [0; 4] }
    }

    /// Brings what was multiplied by `exposure` back.
    pub fn unexpose(&mut self, exposure: f32) {
        self.targets.iter_mut().for_each(|plane| exposure::expose(plane, exposure.recip()));
        exposure::unexpose_error(&mut self.mse, exposure);
    }

    /// The colour: the first three targets.
    pub fn color(&self) -> Rgb {
        std::array::from_fn(|c| self.targets[c].clone())
    }

    /// What the next stage makes use of, the rest given up.
    pub fn into_pilot(self) -> Pilot {
        let mut targets = self.targets.into_iter();
        let color: Rgb = std::array::from_fn(|_| targets.next().expect("the colour is always a target"));
        let mut certain = mean_of_channels(&color);
        certain.combine(&self.mse, |light, mse| (light - CERTAINTY * mse.sqrt()).max(0.0));
        Pilot { color, certain }
    }
}

/// What a stage has found, exposed.
pub struct Pilot {
    /// Its reconstruction of the colour.
    pub color: Rgb,
    /// Lower confidence bound of its mean radiance over the channels: max(0, L̂ − 2√mse).
    pub certain: Plane,
}

impl Pilot {
    /// The radiance of a pixel, mean over the channels.
    pub fn light(&self, x: usize, y: usize) -> f32 {
        self.color.iter().map(|plane| plane.get(x, y)).sum::<f32>() / 3.0
    }
}
