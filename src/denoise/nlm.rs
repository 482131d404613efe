//! Non-local means of whole planes, offset by offset.
//!
//! For one offset the patch distances of all pixels are a box filter of one difference picture, so a
//! patch costs a few additions instead of its area. The baselines' [means](crate::baseline) are another algorithm: they
//! divide channel by channel and let the channels agree, where here the channels are summed before the one division, and
//! they keep the distances of whole rows for several bandwidths, where here a block of columns stays in the cache.

use super::observer::Observer;
use super::vectors;
use super::weights::{self, Guide};
use crate::error::Result;
use crate::image::{Plane, Rect};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

/// Rows of one task; fixed, so that nothing depends on the number of threads.
const BAND: usize = 16;

/// Columns that are filtered together: what they need stays in the cache.
const COLUMNS: usize = 256;

/// Planes that were filtered.
pub struct Filtered {
    /// Their values.
    pub planes: Vec<Plane>,
    /// The summed weights, of which the pixel's own is one: by so much less is the variance of what is left of the noise.
    pub weights: Plane,
}

/// Filters `planes` of any unit, whose noise has these `variances`, with weights by themselves (Rousselle, Knaus,
/// Zwicker 2012).
///
/// # Errors
/// When `observer` stops the run.
pub fn filter(
    planes: &[Plane],
    variances: &[Plane],
    radius: usize,
    patch_radius: usize,
    bandwidth: f32,
    observer: &dyn Observer,
) -> Result<Filtered> {
    let (width, height) = planes[0].size();
    let arch = vectors::widest();
    let empty = || Plane::filled(width, height, 0.0);
    let mut filtered = Filtered { planes: planes.iter().map(|_| empty()).collect(), weights: empty() };
    let mut bands: Vec<Vec<&mut [f32]>> = (0..height.div_ceil(BAND)).map(|_| vec![]).collect();
    for plane in filtered.planes.iter_mut().chain([&mut filtered.weights]) {
        let rows = plane.data_mut().chunks_mut(BAND * width);
        bands.iter_mut().zip(rows).for_each(|(band, rows)| band.push(rows));
    }
    bands.into_par_iter().enumerate().try_for_each_init(Scratch::default, |scratch, (band, mut out)| {
        observer.go_on()?;
        let rows = band * BAND..((band + 1) * BAND).min(height);
        for left in (0..width).step_by(COLUMNS) {
            let (rows, columns) = (rows.clone(), left..(left + COLUMNS).min(width));
            let rect = Rect { x: left, y: rows.start, width: columns.len(), height: rows.len() };
            let guide = &Guide::new(planes, variances, rect, [radius, patch_radius]).of_any_unit();
            arch.dispatch(Part {
                guide,
                planes,
                radius,
                patch_radius,
                bandwidth,
                rows,
                columns,
                scratch,
                out: &mut out,
            });
        }
        Ok(())
    })?;
    Ok(filtered)
}

/// What a task works with.
#[derive(Default)]
struct Scratch {
    /// Σ w·v of every plane, and Σ w.
    sums: Vec<Vec<f32>>,
    total: Vec<f32>,
    delta: Vec<f32>,
    /// The differences, summed along rows.
    boxed: Vec<f32>,
    distance: Vec<f32>,
    weight: Vec<f32>,
}

/// Pixels that are filtered together.
struct Part<'a, 'b> {
    /// Of these pixels.
    guide: &'a Guide,
    planes: &'a [Plane],
    radius: usize,
    patch_radius: usize,
    bandwidth: f32,
    rows: Range<usize>,
    columns: Range<usize>,
    scratch: &'a mut Scratch,
    /// All columns of the rows: the filtered planes, then the weights.
    out: &'a mut [&'b mut [f32]],
}

impl WithSimd for Part<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Part { guide, planes, radius, patch_radius, bandwidth, rows, columns, scratch, out } = self;
        let (picture_width, height) = planes[0].size();
        let (width, patch) = (columns.len(), 2 * patch_radius + 1);
        let Scratch { sums, total, delta, boxed, distance, weight } = scratch;
        let zeros = |buffer: &mut Vec<f32>, length: usize| {
            buffer.clear();
            buffer.resize(length, 0.0);
        };
        sums.resize_with(planes.len(), Vec::new);
        sums.iter_mut().chain([&mut *total]).for_each(|sums| zeros(sums, rows.len() * width));
        zeros(boxed, (rows.len() + 2 * patch_radius) * width);
        zeros(weight, width);
        zeros(distance, width);
        let (r, left) = (radius as isize, columns.start as isize);
        for dy in -r..=r {
            for dx in -r..=r {
                for (i, row) in boxed.chunks_exact_mut(width).enumerate() {
                    let y = i as isize - patch_radius as isize;
                    guide.patch_row([0, y], [dx, dy], patch_radius, delta, row);
                }
                let inverse = 1.0 / (patch * patch) as f32;
                // Of these columns, those whose neighbour is in the picture.
                let from = (-dx - left).clamp(0, width as isize) as usize;
                let to = (picture_width as isize - dx - left).clamp(0, width as isize) as usize;
                for (i, y) in rows.clone().enumerate() {
                    let Some(qy) = y.checked_add_signed(dy).filter(|&q| q < height) else { continue };
                    if from >= to {
                        continue;
                    }
                    distance.fill(0.0);
                    for row in boxed[i * width..].chunks_exact(width).take(patch) {
                        distance.iter_mut().zip(row).for_each(|(d, b)| *d += b);
                    }
                    distance.iter_mut().for_each(|d| *d *= inverse);
                    weights::kernel(distance, bandwidth, weight);
                    let weight = &weight[from..to];
                    let own = i * width + from..i * width + to;
                    let other = left + dx;
                    total[own.clone()].iter_mut().zip(weight).for_each(|(t, w)| *t += w);
                    for (plane, sums) in planes.iter().zip(&mut *sums) {
                        let values =
                            &plane.row(qy)[(other + from as isize) as usize..(other + to as isize) as usize];
                        for ((s, w), v) in sums[own.clone()].iter_mut().zip(weight).zip(values) {
                            *s += w * v;
                        }
                    }
                }
            }
        }
        let (weights, out) = out.split_last_mut().expect("there is always a plane for the weights");
        for (total, out) in total.chunks_exact(width).zip(weights.chunks_exact_mut(picture_width)) {
            out[columns.clone()].copy_from_slice(total);
        }
        for (sums, out) in sums.iter().zip(out) {
            let lines = sums.chunks_exact(width).zip(total.chunks_exact(width));
            for ((sums, total), out) in lines.zip(out.chunks_exact_mut(picture_width)) {
                let out = &mut out[columns.clone()];
                out.iter_mut().zip(sums).zip(total).for_each(|((out, sum), total)| *out = sum / total);
            }
        }
    }
}
