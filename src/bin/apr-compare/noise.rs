//! What a reference's own noise adds to relMSE.

use apr::image::Rgb;
use apr::metrics::{self, REL_MSE_EPSILON};
use apr::{Frame, Result};

/// The relMSE between the truth and a reference, by its halves or else by its variance; none where it has neither.
/// A half A differs from the mean of both by (A − B) / 2, whose variance is that of the mean.
pub fn of(reference: &Frame) -> Result<Option<f64>> {
    let color = reference.color();
    let of_halves = |halves: &[Rgb; 2]| metrics::rel_mse(&halves[0], color).map(|measure| measure.value);
    let by_variance = || reference.color_var_of_mean().map(|variance| of_variance(variance, color));
    Ok(reference.halves().map(of_halves).transpose()?.or_else(by_variance).filter(|noise| noise.is_finite()))
}

fn of_variance(variance: &Rgb, color: &Rgb) -> f64 {
    let relative = |(&v, &r): (&f32, &f32)| f64::from(v) / (f64::from(r).powi(2) + REL_MSE_EPSILON);
    let channels = variance.iter().zip(color);
    let all = channels.flat_map(|(variance, color)| variance.data().iter().zip(color.data()).map(relative));
    all.sum::<f64>() / (3 * color[0].data().len()) as f64
}
