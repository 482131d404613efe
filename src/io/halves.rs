//! Two renders of one frame as the halves of one.

use super::assemble::rgb;
use super::variance::from_halves;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{Feature, Frame};
use crate::image::Plane;

/// Two frames of the same scene with independent seeds as one: means of both, with both as halves.
///
/// # Errors
/// `Lacking` when they differ in size.
pub(super) fn merge_halves(a: &Frame, b: &Frame, from_halves_only: bool) -> Result<Frame> {
    let both = |a: &[Plane], b: &[Plane]| -> [Vec<Plane>; 2] { [a.to_vec(), b.to_vec()] };
    let mean = |a: &[Plane], b: &[Plane], f: fn(f32, f32) -> f32| -> Vec<Plane> {
        let one = |(a, b): (&Plane, &Plane)| {
            Plane::from_fn(a.width(), a.height(), |x, y| f(a.get(x, y), b.get(x, y)))
        };
        a.iter().zip(b).map(one).collect()
    };
    let average = |a, b| mean(a, b, |a, b| 0.5 * (a + b));
    // The variance of the mean of two independent means of one variance each.
    let variance = |a: Option<&[Plane]>, b: Option<&[Plane]>, halves: &[Vec<Plane>; 2]| match (a, b) {
        (Some(a), Some(b)) if !from_halves_only => mean(a, b, |a, b| 0.25 * (a + b)),
        _ => halves[0].iter().zip(&halves[1]).map(|(a, b)| from_halves(a, b)).collect(),
    };
    if (a.width(), a.height()) != (b.width(), b.height()) {
        return Err(Error::new(
            ErrorKind::Lacking,
            format!("is {}×{} where the first half is {}×{}", b.width(), b.height(), a.width(), a.height()),
        )
        .remedy("give two renders of the same frame with different seeds"));
    }
    let halves = both(a.color(), b.color());
    let color_variance = variance(
        a.color_var_of_mean().map(<[Plane; 3]>::as_slice),
        b.color_var_of_mean().map(<[Plane; 3]>::as_slice),
        &halves,
    );
    let [half_a, half_b] = halves;
    let mut frame = Frame::new(rgb(average(a.color(), b.color()))?)?
        .with_variance_of_mean(rgb(color_variance)?)?
        .with_halves([rgb(half_a)?, rgb(half_b)?])?;
    for feature in a.features() {
        let twin =
            |other: &&Feature| other.name == feature.name && other.planes.len() == feature.planes.len();
        let merged = match b.features().iter().find(twin) {
            None => feature.clone(),
            Some(other) => {
                let halves = both(&feature.planes, &other.planes);
                let mut merged =
                    Feature::new(&feature.name, feature.kind, average(&feature.planes, &other.planes));
                let of = |feature: &Feature| feature.var_of_mean.clone();
                merged.var_of_mean = Some(variance(of(feature).as_deref(), of(other).as_deref(), &halves));
                merged.halves = Some(halves);
                merged
            }
        };
        frame = frame.with_feature(merged)?;
    }
    Ok(match (a.spp(), b.spp()) {
        (Some(a), Some(b)) => frame.with_spp(a + b),
        _ => frame,
    })
}
