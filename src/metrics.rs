//! How far a picture is from its reference.
//!
//! Each metric gives one value and a plane that shows where it comes from. A pixel that is NaN or
//! infinite, in either picture, is an error and never skipped: a metric that skips broken pixels
//! makes a broken picture score better.

mod calibration;

pub use calibration::{Calibration, calibration};

use crate::error::{Error, ErrorKind, Result};
use crate::image::{Plane, Rgb};
use crate::tone::{luminance, srgb};
use rayon::prelude::*;

/// Keeps relMSE finite in the dark: the customary value of the literature.
pub const REL_MSE_EPSILON: f64 = 0.01;
/// The share of pixels, the worst ones, that the trimmed relMSE leaves out.
pub const TRIMMED_SHARE: f64 = 0.001;

/// A metric's value and where it comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct Measure {
    /// The metric over the whole picture.
    pub value: f64,
    /// The metric's share of each pixel; each function says how the value follows from it.
    pub plane: Plane,
}

/// All metrics' values for one result.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Scores {
    /// See [`rmse`].
    pub rmse: f64,
    /// See [`rel_mse`].
    pub rel_mse: f64,
    /// See [`trimmed_rel_mse`].
    pub trimmed_rel_mse: f64,
    /// See [`smape`].
    pub smape: f64,
    /// See [`ssim`].
    pub ssim: f64,
    /// See [`energy`]. Infinite (`null` in JSON) when only the reference is black.
    pub energy: f64,
}

/// All metrics of `result` against `reference`.
///
/// # Errors
/// When the sizes differ or a pixel of either is NaN or infinite.
pub fn scores(result: &Rgb, reference: &Rgb) -> Result<Scores> {
    let relative = per_pixel(result, reference, relative_squared)?;
    Ok(Scores {
        rmse: rmse(result, reference)?.value,
        rel_mse: mean(&relative),
        trimmed_rel_mse: trimmed(relative, reference).value,
        smape: smape(result, reference)?.value,
        ssim: ssim(result, reference)?.value,
        energy: energy(result, reference)?.value,
    })
}

/// Root of the mean squared error over pixels and channels. The plane holds each pixel's own.
///
/// # Errors
/// When the sizes differ or a pixel of either is NaN or infinite.
pub fn rmse(result: &Rgb, reference: &Rgb) -> Result<Measure> {
    let squared = per_pixel(result, reference, |x, r| (x - r) * (x - r))?;
    let value = mean(&squared).sqrt();
    Ok(Measure { value, plane: to_plane(reference, squared.into_iter().map(f64::sqrt)) })
}

/// Mean of (x − r)² / (r² + 0.01) over pixels and channels. The value is the plane's mean.
///
/// # Errors
/// When the sizes differ or a pixel of either is NaN or infinite.
pub fn rel_mse(result: &Rgb, reference: &Rgb) -> Result<Measure> {
    let errors = per_pixel(result, reference, relative_squared)?;
    Ok(Measure { value: mean(&errors), plane: to_plane(reference, errors) })
}

/// [`rel_mse`] over all pixels but the worst 0.1 %, rounded down. Those are 0 in the plane; the
/// value is the mean over the others.
///
/// # Errors
/// When the sizes differ or a pixel of either is NaN or infinite.
pub fn trimmed_rel_mse(result: &Rgb, reference: &Rgb) -> Result<Measure> {
    Ok(trimmed(per_pixel(result, reference, relative_squared)?, reference))
}

/// The mean and the plane of relMSE's `errors` without the worst.
fn trimmed(mut errors: Vec<f64>, reference: &Rgb) -> Measure {
    let trimmed = (errors.len() as f64 * TRIMMED_SHARE) as usize;
    let mut worst_first: Vec<usize> = (0..errors.len()).collect();
    worst_first.sort_by(|&a, &b| errors[b].total_cmp(&errors[a]).then(a.cmp(&b)));
    for &i in &worst_first[..trimmed] {
        errors[i] = 0.0;
    }
    let value = errors.iter().sum::<f64>() / (errors.len() - trimmed) as f64;
    Measure { value, plane: to_plane(reference, errors) }
}

/// Symmetric mean absolute percentage error, as a fraction: mean of |x − r| / (|x| + |r|) over
/// pixels and channels, 0 where both are 0; from 0 to 1. The value is the plane's mean.
///
/// # Errors
/// When the sizes differ or a pixel of either is NaN or infinite.
pub fn smape(result: &Rgb, reference: &Rgb) -> Result<Measure> {
    let errors = per_pixel(result, reference, |x, r| {
        let scale = x.abs() + r.abs();
        if scale == 0.0 { 0.0 } else { (x - r).abs() / scale }
    })?;
    Ok(Measure { value: mean(&errors), plane: to_plane(reference, errors) })
}

/// Difference of the total energy as a fraction of the reference's: Σx / Σr − 1, signed. The plane
/// holds each pixel's signed share; the value is its mean. Two black pictures give 0; a black
/// reference under a result that is not gives an infinity.
///
/// # Errors
/// When the sizes differ or a pixel of either is NaN or infinite.
pub fn energy(result: &Rgb, reference: &Rgb) -> Result<Measure> {
    let differences = per_pixel(result, reference, |x, r| x - r)?;
    let scale = mean(&per_pixel(reference, reference, |_, r| r)?);
    let shares: Vec<f64> = differences.iter().map(|d| if *d == 0.0 { 0.0 } else { d / scale }).collect();
    let difference = mean(&differences);
    let value = if difference == 0.0 { 0.0 } else { difference / scale };
    Ok(Measure { value, plane: to_plane(reference, shares) })
}

/// Structural similarity (Wang et al. 2004) of the luminance of the tone-mapped pictures: Gaussian
/// window of 11×11 pixels and σ = 1.5, K₁ = 0.01, K₂ = 0.03; windows that reach over the border are
/// cut and renormalised. 1 is identity. The value is the plane's mean.
///
/// # Errors
/// When the sizes differ or a pixel of either is NaN or infinite.
pub fn ssim(result: &Rgb, reference: &Rgb) -> Result<Measure> {
    check(result, reference)?;
    let (width, height) = reference[0].size();
    let x = tone_mapped_luminance(result);
    let r = tone_mapped_luminance(reference);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<_>>();
    let [mean_x, mean_r, mean_xx, mean_rr, mean_xr] =
        [&x, &r, &product(&x, &x), &product(&r, &r), &product(&x, &r)].map(|p| gaussian(p, width, height));
    const C1: f64 = 0.01 * 0.01;
    const C2: f64 = 0.03 * 0.03;
    let similarity: Vec<f64> = (0..x.len())
        .map(|i| {
            let (a, b) = (mean_x[i], mean_r[i]);
            let (var_a, var_b, covariance) = (mean_xx[i] - a * a, mean_rr[i] - b * b, mean_xr[i] - a * b);
            (2.0 * a * b + C1) * (2.0 * covariance + C2) / ((a * a + b * b + C1) * (var_a + var_b + C2))
        })
        .collect();
    Ok(Measure { value: mean(&similarity), plane: to_plane(reference, similarity) })
}

fn relative_squared(x: f64, r: f64) -> f64 {
    (x - r) * (x - r) / (r * r + REL_MSE_EPSILON)
}

/// `squares`, a mean over the channels, relative to the `picture`'s light as in relMSE.
pub fn relative_mean(squares: &Plane, picture: &Rgb) -> Plane {
    Plane::par_from_fn(squares.width(), squares.height(), |x, y| {
        let light = picture.iter().map(|plane| plane.get(x, y).powi(2)).sum::<f32>() / 3.0;
        squares.get(x, y) / (light + REL_MSE_EPSILON as f32)
    })
}

/// Each pixel's `error(x, r)`, averaged over the channels.
fn per_pixel(result: &Rgb, reference: &Rgb, error: impl Fn(f64, f64) -> f64) -> Result<Vec<f64>> {
    check(result, reference)?;
    let of = |i: usize| {
        let sum: f64 = (0..3).map(|c| error(result[c].data()[i].into(), reference[c].data()[i].into())).sum();
        sum / 3.0
    };
    Ok((0..reference[0].data().len()).map(of).collect())
}

fn check(result: &Rgb, reference: &Rgb) -> Result<()> {
    let (got, expected) = (result[0].size(), reference[0].size());
    if got != expected {
        let what =
            format!("the result is {}×{} and its reference {}×{}", got.0, got.1, expected.0, expected.1);
        return Err(Error::new(ErrorKind::Lacking, what).remedy("compare pictures of one size"));
    }
    finite(result, "the result")?;
    finite(reference, "the reference")
}

/// Refuses the first pixel of `picture`, row by row, that is NaN or infinite.
///
/// # Errors
/// When there is one; the message names `who`, the channel and the pixel.
pub fn finite(picture: &Rgb, who: &str) -> Result<()> {
    for (plane, channel) in picture.iter().zip(["R", "G", "B"]) {
        if let Some(i) = plane.data().iter().position(|value| !value.is_finite()) {
            let (x, y, value) = (i % plane.width(), i / plane.width(), plane.data()[i]);
            let what = format!("{who} is {value} at pixel ({x}, {y}), where a finite value was expected");
            return Err(Error::new(ErrorKind::Lacking, what)
                .in_channel(channel)
                .remedy("repair the picture: broken pixels are never left out of a comparison"));
        }
    }
    Ok(())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn to_plane(like: &Rgb, values: impl IntoIterator<Item = f64>) -> Plane {
    let mut plane = like[0].clone();
    plane.data_mut().iter_mut().zip(values).for_each(|(to, value)| *to = value as f32);
    plane
}

fn tone_mapped_luminance(color: &Rgb) -> Vec<f64> {
    let mapped = color.each_ref().map(|plane| {
        let mut plane = plane.clone();
        plane.data_mut().iter_mut().for_each(|value| *value = srgb(*value));
        plane
    });
    (0..mapped[0].data().len()).map(|i| luminance(&mapped, i).into()).collect()
}

/// `plane` under a Gaussian window of σ = 1.5 and radius 5, renormalised at the border.
fn gaussian(plane: &[f64], width: usize, height: usize) -> Vec<f64> {
    const RADIUS: usize = 5;
    let weights: [f64; RADIUS + 1] = std::array::from_fn(|d| (-((d * d) as f64) / (2.0 * 1.5 * 1.5)).exp());
    let blur = |count: usize, at: usize, value: &dyn Fn(usize) -> f64| {
        let window = at.saturating_sub(RADIUS)..(at + RADIUS + 1).min(count);
        let (sum, total) = window.fold((0.0, 0.0), |(sum, total), i| {
            let w = weights[i.abs_diff(at)];
            (sum + w * value(i), total + w)
        });
        sum / total
    };
    let by_rows = |pixel: &(dyn Fn(usize, usize) -> f64 + Sync)| {
        let mut out = vec![0.0; plane.len()];
        out.par_chunks_exact_mut(width.max(1)).enumerate().for_each(|(y, row)| {
            row.iter_mut().enumerate().for_each(|(x, value)| *value = pixel(x, y));
        });
        out
    };
    let rows = by_rows(&|x, y| blur(width, x, &|x| plane[y * width + x]));
    by_rows(&|x, y| blur(height, y, &|y| rows[y * width + x]))
}

#[cfg(test)]
mod tests;
