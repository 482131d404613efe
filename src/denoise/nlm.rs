//! Non-local means of whole planes, offset by offset.
//!
//! For one offset the patch distances of all pixels are a box filter of one difference picture, so a
//! patch costs a few additions instead of its area.

use super::vectors;
use super::weights::{self, Guide};
use crate::image::Plane;
use rayon::prelude::*;

/// Rows of one task; fixed, so that nothing depends on the number of threads.
const BAND: usize = 16;

/// Filters `planes` with the weights of `guide` (Rousselle, Knaus, Zwicker 2012).
pub fn filter(
    guide: &Guide,
    planes: &[&Plane],
    radius: usize,
    patch_radius: usize,
    bandwidth: f32,
) -> Vec<Plane> {
    let (width, height) = planes[0].size();
    let arch = vectors::widest();
    let bands: Vec<Vec<f32>> = (0..height.div_ceil(BAND))
        .into_par_iter()
        .map(|band| {
            let rows = band * BAND..((band + 1) * BAND).min(height);
            arch.dispatch(
                #[inline(always)]
                || filter_band(guide, planes, rows, [radius, patch_radius], bandwidth),
            )
        })
        .collect();
    (0..planes.len())
        .map(|c| {
            let mut data = Vec::with_capacity(width * height);
            for band in &bands {
                let size = band.len() / planes.len();
                data.extend_from_slice(&band[c * size..(c + 1) * size]);
            }
            Plane::from_vec(width, height, data).expect("the bands cover the picture")
        })
        .collect()
}

#[inline(always)]
fn filter_band(
    guide: &Guide,
    planes: &[&Plane],
    rows: std::ops::Range<usize>,
    [radius, patch_radius]: [usize; 2],
    bandwidth: f32,
) -> Vec<f32> {
    let (width, height) = planes[0].size();
    let size = rows.len() * width;
    let mut sums = vec![0.0; planes.len() * size];
    let mut total = vec![0.0; size];
    let patch = 2 * patch_radius + 1;
    let mut delta = vec![0.0; width + 2 * patch_radius];
    let mut boxed = vec![0.0; (rows.len() + 2 * patch_radius) * width];
    let (mut distance, mut weight) = (vec![0.0; width], vec![0.0; width]);
    let r = radius as isize;
    for dy in -r..=r {
        for dx in -r..=r {
            for (i, row) in boxed.chunks_exact_mut(width).enumerate() {
                let y = rows.start as isize + i as isize - patch_radius as isize;
                guide.delta_row(y, [dx, dy], patch_radius, &mut delta);
                row.copy_from_slice(&delta[..width]);
                for shift in 1..patch {
                    row.iter_mut().zip(&delta[shift..]).for_each(|(b, d)| *b += d);
                }
            }
            let inverse = 1.0 / (patch * patch) as f32;
            for (i, y) in rows.clone().enumerate() {
                let Some(qy) = y.checked_add_signed(dy).filter(|&q| q < height) else { continue };
                distance.fill(0.0);
                for row in boxed[i * width..].chunks_exact(width).take(patch) {
                    distance.iter_mut().zip(row).for_each(|(d, b)| *d += b);
                }
                distance.iter_mut().for_each(|d| *d *= inverse);
                weights::kernel(&distance, bandwidth, &mut weight);
                let x0 = (-dx).max(0) as usize;
                let x1 = (width as isize - dx.max(0)).max(0) as usize;
                if x0 >= x1 {
                    continue;
                }
                let (q0, q1) = ((x0 as isize + dx) as usize, (x1 as isize + dx) as usize);
                let weight = &weight[x0..x1];
                let at = i * width;
                total[at + x0..at + x1].iter_mut().zip(weight).for_each(|(t, w)| *t += w);
                for (plane, sums) in planes.iter().zip(sums.chunks_exact_mut(size)) {
                    let values = &plane.row(qy)[q0..q1];
                    for ((s, w), v) in sums[at + x0..at + x1].iter_mut().zip(weight).zip(values) {
                        *s += w * v;
                    }
                }
            }
        }
    }
    for sums in sums.chunks_exact_mut(size) {
        sums.iter_mut().zip(&total).for_each(|(s, t)| *s /= t);
    }
    sums
}
