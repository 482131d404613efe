//! Wavelet shrinkage (Overbeck, Donner, Ramamoorthi: Adaptive Wavelet Rendering, SIGGRAPH Asia 2009).
//!
//! The picture is analysed by the 9/7 wavelets of Cohen, Daubechies and Feauveau; the variance goes through
//! the squares of the same filter taps; an estimate of the error, so many standard deviations, is subtracted
//! from the magnitude of every detail coefficient: the smoothest picture that the samples allow.
//!
//! `[choice]` one standard deviation is subtracted. From the second level on scale coefficients share
//! pixels; they are taken as independent, which they nearly are because the filters are nearly orthogonal.
//! `[choice]` the sampling priority of a block of pixels is the variance of its scale coefficient over
//! its squared mean radiance, a pixel's the highest of the blocks it lies in, coarse and fine at once.
//! AOVs go through the beauty's operator: the factors by which its coefficients were shrunk.
//! The publication estimates no error of the result, and none is given.

mod lifting;

use super::input::{Input, Output, relative_error};
use crate::error::Result;
use crate::frame::{Denoised, Frame};
use crate::image::{Plane, mean_of_channels};
use crate::options::within;
use lifting::Bank;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Constants of the method.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Levels of the transform, 1 to 12; fewer where the picture is too small.
    pub levels: usize,
    /// Standard deviations that are subtracted from a coefficient's magnitude, 0 to 100.
    pub deviations: f32,
}

impl Default for Options {
    fn default() -> Self {
        Self { levels: 5, deviations: 1.0 }
    }
}

impl Options {
    /// Checks every range.
    ///
    /// # Errors
    /// [`crate::ErrorKind::Usage`] names the option and what it may be.
    pub fn check(&self) -> Result<()> {
        within("levels", self.levels, 1..=12)?;
        within("deviations", self.deviations, 0.0..=100.0)
    }
}

/// Denoises `frame`.
///
/// # Errors
/// When an option is out of its range.
pub fn denoise(frame: &Frame, options: &Options) -> Result<Denoised> {
    options.check()?;
    let input = Input::new(frame, "wavelet");
    let transform = Transform::new(input.size(), options.levels);
    let variances: Vec<Vec<f64>> = input.variance.par_iter().map(|v| transform.variance(v)).collect();
    let planes: Vec<Vec<f64>> =
        input.targets().into_par_iter().map(|plane| transform.forward(plane)).collect();
    let factors: Vec<Vec<f64>> = (0..3)
        .into_par_iter()
        .map(|c| transform.factors(&planes[c], &variances[c], f64::from(options.deviations)))
        .collect();
    let targets: Vec<Plane> = planes
        .into_par_iter()
        .enumerate()
        .map(|(t, mut coefficients)| {
            coefficients.iter_mut().zip(&factors[t % 3]).for_each(|(c, factor)| *c *= factor);
            transform.inverse(coefficients)
        })
        .collect();
    let priority = sampling_priority(&input, options.levels);
    Ok(input.finish(Output { targets, mse: None, order: 0.0, sampling_priority: Some(priority) }))
}

/// The transform of pictures of one size. Coefficients lie where their pixels were: every level leaves its
/// scale coefficients in the top left quarter of what the level before left there.
struct Transform {
    size: (usize, usize),
    /// One bank for the rows and one for the columns of every level.
    levels: Vec<[Bank; 2]>,
}

impl Transform {
    fn new((width, height): (usize, usize), most: usize) -> Self {
        let (mut w, mut h) = (width, height);
        let mut levels = vec![];
        while levels.len() < most && w.max(h) > 1 {
            levels.push([Bank::new(w), Bank::new(h)]);
            (w, h) = (w.div_ceil(2), h.div_ceil(2));
        }
        Self { size: (width, height), levels }
    }

    fn forward(&self, plane: &Plane) -> Vec<f64> {
        self.analyse(plane, Bank::forward)
    }

    /// The variances of the coefficients of independent pixels with the variances `plane`.
    fn variance(&self, plane: &Plane) -> Vec<f64> {
        self.analyse(plane, Bank::variance)
    }

    fn analyse(&self, plane: &Plane, step: impl Fn(&Bank, &mut [f64])) -> Vec<f64> {
        let mut data: Vec<f64> = plane.data().iter().map(|&v| f64::from(v)).collect();
        for [rows, columns] in &self.levels {
            self.along_rows(&mut data, rows, columns.len(), &step);
            self.along_columns(&mut data, columns, rows.len(), &step);
        }
        data
    }

    fn inverse(&self, mut data: Vec<f64>) -> Plane {
        for [rows, columns] in self.levels.iter().rev() {
            self.along_columns(&mut data, columns, rows.len(), &Bank::inverse);
            self.along_rows(&mut data, rows, columns.len(), &Bank::inverse);
        }
        let data = data.into_iter().map(|v| v as f32).collect();
        Plane::from_vec(self.size.0, self.size.1, data).expect("the transform keeps the size")
    }

    fn along_rows(&self, data: &mut [f64], bank: &Bank, rows: usize, step: &impl Fn(&Bank, &mut [f64])) {
        data.chunks_exact_mut(self.size.0).take(rows).for_each(|row| step(bank, &mut row[..bank.len()]));
    }

    fn along_columns(
        &self,
        data: &mut [f64],
        bank: &Bank,
        columns: usize,
        step: &impl Fn(&Bank, &mut [f64]),
    ) {
        let width = self.size.0;
        let mut column = vec![0.0; bank.len()];
        for x in 0..columns {
            column.iter_mut().enumerate().for_each(|(y, v)| *v = data[y * width + x]);
            step(bank, &mut column);
            column.iter().enumerate().for_each(|(y, v)| data[y * width + x] = *v);
        }
    }

    /// The factor of every coefficient: what is left of its magnitude after the subtraction. Scale
    /// coefficients of the last level stay whole.
    fn factors(&self, coefficients: &[f64], variances: &[f64], deviations: f64) -> Vec<f64> {
        let mut factors: Vec<f64> = coefficients
            .iter()
            .zip(variances)
            .map(|(c, v)| {
                let error = deviations * v.max(0.0).sqrt();
                if c.abs() > error { 1.0 - error / c.abs() } else { 0.0 }
            })
            .collect();
        let shrunk = |n: usize| (0..self.levels.len()).fold(n, |n, _| n.div_ceil(2));
        for row in factors.chunks_exact_mut(self.size.0).take(shrunk(self.size.1)) {
            row[..shrunk(self.size.0)].fill(1.0);
        }
        factors
    }
}

/// The highest relative variance of the blocks of 1, 2, 4, … pixels' side that a pixel lies in.
fn sampling_priority(input: &Input<'_>, levels: usize) -> Plane {
    let (width, height) = input.size();
    let noise = mean_of_channels(&input.variance);
    let mut priority = Plane::filled(width, height, 0.0);
    for side in (0..=levels).map(|level| 1usize << level) {
        // The scale coefficient is the block's sum over its side: its variance is the mean variance.
        let noise = blocks(&noise, side);
        let color: Vec<Plane> = input.clean.color.iter().map(|plane| blocks(plane, side)).collect();
        let relative = relative_error(&noise, &color);
        for (i, value) in priority.data_mut().iter_mut().enumerate() {
            *value = value.max(relative.get(i % width / side, i / width / side));
        }
    }
    priority
}

/// The means of blocks of `side`, clipped at the border.
fn blocks(plane: &Plane, side: usize) -> Plane {
    let (width, height) = plane.size();
    Plane::from_fn(width.div_ceil(side), height.div_ceil(side), |x, y| {
        let rows = y * side..((y + 1) * side).min(height);
        let columns = x * side..((x + 1) * side).min(width);
        let count = (rows.len() * columns.len()) as f64;
        let sum: f64 = rows.flat_map(|y| &plane.row(y)[columns.clone()]).map(|&v| f64::from(v)).sum();
        (sum / count) as f32
    })
}
