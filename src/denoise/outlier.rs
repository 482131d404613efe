//! Energy-preserving outlier removal (Moon et al. 2016).
//!
//! A pixel is an outlier when its intensity exceeds the mean of its neighbours by many of their
//! standard deviations. Its colour and its variance are replaced by those of the neighbour with the
//! median intensity; the energy taken out is remembered and given back after the reconstruction
//! (see [`super::gains`]).
//!
//! `[choice]` a pixel is replaced only if its excess is more than a share of all the light in a fit's window: what
//! the window averages out by itself stays where it was found, for energy that is given back comes back to other places.
//! A tenth against none: relMSE ×0.992 (five scenes at 16 to 256 spp) and ×0.962 (thirteen of the tracer), hard
//! indirect light ×0.8, fog ×0.7 at 16 spp, caustics ×0.7 at 64 and 256.
//!
//! `[choice]` the paper's "computed standard deviation" is read as the neighbours' *and* the pixel's
//! own must admit that the pixel is a chance event: by the neighbours alone a highlight that every
//! sample saw is flattened: fine foliage at 256 spp went from relMSE 0.0024, the input's, to 0.0070. With
//! half buffers, half their difference is a second witness of the pixel's own deviation: a firefly sits in one
//! half only. Without a variance of its own and without halves nothing vouches for a pixel, and its neighbours
//! differ by what they differ: relMSE ×0.96, ×0.96, ×1.01 (five scenes without variances at 16, 64, 256 spp) and
//! ×0.98, ×1.00, ×1.00 (thirteen others), and fireflies go at all.

use super::sanitize::Clean;
use super::variance::{around, smooth};
use crate::image::{Plane, Rect, Rgb, mean_of_channels};
use crate::options::{Options, OutlierOptions};
use rayon::prelude::*;

/// Deviations of its own within which an outlier's excess must lie (Moon et al. 2016 for the number).
const OWN_DEVIATIONS: f32 = 3.0;

/// Fireflies come in clusters: the brightest of the neighbours, one in this many, does not testify.
const DISTRUSTED_SHARE: usize = 8;

/// A pixel that was replaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outlier {
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
    /// Column and row of the neighbour whose colour it is given.
    pub from: (usize, usize),
}

/// What was taken out of a picture.
#[derive(Debug, Clone, Default)]
pub struct Removed {
    /// Where, row by row.
    pub outliers: Vec<Outlier>,
    /// How much at each of these, of each target.
    pub taken: Vec<Vec<f32>>,
}

impl Removed {
    /// How many of them are `within` these pixels, and the colour's energy that was taken out there.
    pub fn count(&self, within: Rect) -> (usize, [f64; 3]) {
        let (mut count, mut energy) = (0, [0.0; 3]);
        for (k, _) in self.outliers.iter().enumerate().filter(|(_, o)| within.contains(o.x, o.y)) {
            count += 1;
            energy.iter_mut().zip(&self.taken).for_each(|(sum, taken)| *sum += f64::from(taken[k]));
        }
        (count, energy)
    }
}

/// Takes the outliers out of all that belongs to the light of `clean`.
pub fn remove(clean: &mut Clean<'_>, options: &Options) -> Removed {
    if !options.outliers.enabled {
        return Removed { outliers: vec![], taken: clean.targets().map(|_| vec![]).collect() };
    }
    let outliers = find(&clean.color, clean.variance.as_ref(), clean.halves.as_ref(), options);
    // The halves too: what they know of an outlier would be the noise of the pixels around it.
    let witnesses = clean.variance.iter_mut().flatten().chain(clean.halves.iter_mut().flatten().flatten());
    witnesses.for_each(|plane| drop(replace(plane, &outliers)));
    let taken = clean.targets_mut().map(|plane| replace(plane, &outliers)).collect();
    Removed { outliers, taken }
}

/// Lists the outliers of `color`, row by row. The `variance` is every pixel's own, or none: one that was estimated
/// from the pixels around is, beside an outlier, the outlier's. Without any nothing vouches for a pixel.
pub fn find(
    color: &Rgb,
    variance: Option<&Rgb>,
    halves: Option<&[Rgb; 2]>,
    options: &Options,
) -> Vec<Outlier> {
    let (width, height) = color[0].size();
    let intensity = mean_of_channels(color);
    let radius = options.window_radius;
    let light = smooth(&intensity, radius);
    let deviation = Plane::par_from_fn(width, height, |x, y| {
        // The channels share their samples: their deviations add, not their variances.
        let own = variance.map_or(0.0, |v| v.iter().map(|v| v.get(x, y).sqrt()).sum::<f32>() / 3.0);
        let half = halves.map_or(0.0, |[a, b]| {
            a.iter().zip(b).map(|(a, b)| a.get(x, y) - b.get(x, y)).sum::<f32>().abs() / 6.0
        });
        own.max(half)
    });
    let vouched = variance.is_some() || halves.is_some();
    let rows: Vec<Vec<Outlier>> = (0..height)
        .into_par_iter()
        .map_init(Vec::new, |neighbours, y| {
            let judge = |x| {
                let pixels = (around(x, radius, width).len() * around(y, radius, height).len()) as f32;
                let least = options.outliers.share * pixels * light.get(x, y);
                let most = if vouched { OWN_DEVIATIONS * deviation.get(x, y) } else { f32::INFINITY };
                judge(&intensity, &deviation, (x, y), [least, most], neighbours, &options.outliers)
            };
            (0..width).filter_map(judge).collect()
        })
        .collect();
    rows.concat()
}

/// A neighbour's intensity, column and row, and its noise variance.
type Neighbour = (f32, usize, usize, f32);

/// The outlier at a pixel, whose excess must be more than `least` and, to be chance, less than `most`.
fn judge(
    intensity: &Plane,
    deviation: &Plane,
    (x, y): (usize, usize),
    [least, most]: [f32; 2],
    neighbours: &mut Vec<Neighbour>,
    options: &OutlierOptions,
) -> Option<Outlier> {
    let (width, height) = intensity.size();
    let own = intensity.get(x, y);
    let mut brighter = 0;
    neighbours.clear();
    for ny in around(y, options.radius, height) {
        for nx in around(x, options.radius, width) {
            if (nx, ny) != (x, y) {
                let other = intensity.get(nx, ny);
                brighter += usize::from(other >= own);
                neighbours.push((other, nx, ny, deviation.get(nx, ny).powi(2)));
            }
        }
    }
    if neighbours.len() < 3 {
        return None; // a picture of one row or column of pixels has no witnesses
    }
    let distrusted = neighbours.len().div_ceil(DISTRUSTED_SHARE);
    let n = (neighbours.len() - distrusted) as f32;
    // A value among n others lies at most √n of their deviations from their mean: most pixels need no sorting.
    if brighter > distrusted && options.deviations > 2.0 * n.sqrt() {
        return None;
    }
    neighbours.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.2, a.1).cmp(&(b.2, b.1))));
    let trusted = &neighbours[..neighbours.len() - distrusted];
    let mean = trusted.iter().map(|t| t.0).sum::<f32>() / n;
    // Few neighbours may agree by chance: they differ by their own noise at least.
    let spread = trusted.iter().map(|t| (t.0 - mean).powi(2)).sum::<f32>() / n;
    let spread = spread.max(trusted.iter().map(|t| t.3).sum::<f32>() / n).sqrt();
    let excess = own - mean;
    (excess < most && excess > least.max(options.deviations * spread)).then(|| {
        let median = neighbours[neighbours.len() / 2];
        Outlier { x, y, from: (median.1, median.2) }
    })
}

/// Gives every outlier of `plane` the value of its neighbour, all read before any is written, and
/// returns what was taken out of each.
pub fn replace(plane: &mut Plane, outliers: &[Outlier]) -> Vec<f32> {
    let width = plane.width();
    let values: Vec<f32> = outliers.iter().map(|o| plane.get(o.from.0, o.from.1)).collect();
    let taken = outliers.iter().zip(&values).map(|(o, value)| plane.get(o.x, o.y) - value).collect();
    for (o, value) in outliers.iter().zip(values) {
        plane.data_mut()[o.y * width + o.x] = value;
    }
    taken
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(f: impl Fn(usize, usize) -> f32) -> Rgb {
        std::array::from_fn(|c| Plane::from_fn(12, 9, |x, y| f(x, y) * (1.0 + c as f32)))
    }

    #[test]
    fn a_firefly_goes_and_what_is_taken_out_is_told() {
        let mut color =
            grey(|x, y| if (x, y) == (5, 4) { 900.0 } else { 1.0 + 0.01 * ((x * 5 + y * 3) % 7) as f32 });
        let variance = grey(|x, y| if (x, y) == (5, 4) { 900.0 * 900.0 * 2.0 } else { 1e-4 });
        let options = Options::default();
        let outliers = find(&color, Some(&variance), None, &options);
        assert_eq!(outliers.iter().map(|o| (o.x, o.y)).collect::<Vec<_>>(), [(5, 4)]);
        for plane in &mut color {
            let before: f64 = plane.data().iter().map(|&v| f64::from(v)).sum();
            let taken = replace(plane, &outliers);
            assert!(plane.get(5, 4) < 4.0);
            let after: f64 = plane.data().iter().map(|&v| f64::from(v)).sum();
            assert!(((after + f64::from(taken[0])) / before - 1.0).abs() < 1e-6, "{before} became {after}");
        }
    }

    #[test]
    fn what_a_window_averages_out_by_itself_stays() {
        let size = (31, 25);
        let outliers = |share: f32, bright: fn(usize, usize) -> bool| {
            let color = Plane::from_fn(size.0, size.1, |x, y| if bright(x, y) { 40.0 } else { 1.0 });
            let variance = Plane::from_fn(size.0, size.1, |x, y| color.get(x, y).powi(2) / 9.0);
            let [color, variance] = [color, variance].map(|plane| std::array::from_fn(|_| plane.clone()));
            let outliers = OutlierOptions { deviations: 5.0, share, ..OutlierOptions::default() };
            find(&color, Some(&variance), None, &Options { outliers, ..Options::default() })
        };
        // A bright pixel by itself has a seventh of the light of a window, one of every 31 a thirteenth.
        let lone = |x, y| (x, y) == (15, 12);
        assert_eq!([0.0, 0.1, 0.2].map(|share| outliers(share, lone).len()), [1, 1, 0]);
        let crowd = |x, y| (x * 5 + y * 7) % 31 == 3;
        let inside = |o: &Outlier| (7..24).contains(&o.x) && (7..18).contains(&o.y);
        assert_eq!([0.0, 0.1].map(|share| outliers(share, crowd).iter().any(inside)), [true, false]);
        // In a corner there are fewer pixels to average it out.
        assert_eq!(outliers(0.2, |x, y| (x, y) == (0, 0)).len(), 1);
    }

    #[test]
    fn a_highlight_that_its_own_small_variance_vouches_for_stays() {
        let color = grey(|x, y| if (x, y) == (5, 4) { 900.0 } else { 1.0 + 0.01 * ((x + y) % 3) as f32 });
        let variance = grey(|_, _| 1e-2);
        assert!(find(&color, Some(&variance), None, &Options::default()).is_empty());
        // Half buffers that disagree take the vouching back.
        let half = |v: f32| grey(move |x, y| if (x, y) == (5, 4) { v } else { 1.0 });
        let halves = [half(1800.0), half(0.0)];
        assert_eq!(find(&color, Some(&variance), Some(&halves), &Options::default()).len(), 1);
        assert_eq!(find(&color, None, Some(&halves), &Options::default()).len(), 1);
        assert_eq!(find(&color, None, Some(&[half(900.0), half(900.0)]), &Options::default()).len(), 0);
        assert_eq!(find(&color, None, None, &Options::default()).len(), 1, "nothing vouches for it");
    }
}
