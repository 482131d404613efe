//! How far apart the surfaces at two pixels are, by the features.
//!
//! Where noise is heavy every colour resembles every other, and a window fits what lies on both sides of an
//! edge that the features show. The distance of the pixels p and q is Σ_f |f_p−f_q|² / max(d_f(p), d_f(q)), over
//! the features f, each of one plane or three, with d_f = max(τ σ_f², |∂_x f|² + |∂_y f|²), central differences per
//! pixel: where a feature slopes, a step of a few pixels is no difference. σ_f² is the feature's variance over the whole picture, of a
//! depth at most its square: mountains far behind do not blur what is near. `[choice]` three layers 2 apart with a
//! quarter of the picture at depth 8, 50 and 200: error 0.0225 each, 0.0225, 0.0277 and 0.0319 without; a quarter of
//! the square is relMSE ×1.005 on thirteen scenes. What weights are made of is the larger one of this and the
//! colour's, each over its own bandwidth squared.
//!
//! The idea is that of Rousselle, Manzi, Zwicker 2013, the tolerances are ours. `[choice]` against distances of
//! colour alone: relMSE ×0.98 on five scenes, ×0.99 on thirteen others, the most at 16 spp and along edges of
//! noisy or fine surfaces (foliage ×0.87, specular teapot ×0.89).

use super::weights::{distance_stride, padded, padded_stride, vectors};
use crate::image::{Plane, Rect};
use crate::options::MAX_WINDOW_RADIUS;
use pulp::Simd;

/// τ: differences of a tenth of a feature's deviation are none. `[choice]` 0.003 is relMSE ×1.00 on thirteen
/// scenes and ×0.99 on five others, 0.03 ×1.00 and ×1.01.
const TOLERANCE: f32 = 0.01;

/// Vectors of the widest window's row, where they are of one number.
const MOST_VECTORS: usize = distance_stride(MAX_WINDOW_RADIUS);

/// A feature of the design: how many of its planes are in it, and its variance over the whole picture.
#[derive(Debug, Clone, Copy)]
pub struct Spread {
    /// Planes.
    pub planes: usize,
    /// The sum of their variances.
    pub variance: f32,
    /// Whether it is a distance, of which what is near knows smaller differences than what is far.
    pub is_distance: bool,
}

/// Features to compare pixels by, padded by replication.
#[derive(Debug, Clone, Default)]
pub struct Surfaces {
    features: Vec<Surface>,
    stride: usize,
    pad: usize,
}

#[derive(Debug, Clone)]
struct Surface {
    planes: Vec<Vec<f32>>,
    /// 1/d.
    sharpness: Vec<f32>,
}

impl Surfaces {
    /// The design's `planes`, feature after feature of `spreads`, for windows of `window_radius`.
    pub fn new(planes: &[Plane], spreads: &[Spread], window_radius: usize) -> Self {
        let mut rest = planes;
        let padded = |plane: &Plane| {
            let (size, whole) = (plane.size(), Rect::whole(plane.size()));
            padded(size, whole, window_radius, [f32::MIN, f32::MAX], |at, out| plane.copy_row(at, out))
        };
        let features = spreads.iter().map(|spread| {
            let (planes, others) = rest.split_at(spread.planes);
            rest = others;
            let sharpness = padded(&sharpness(planes, *spread));
            Surface { planes: planes.iter().map(padded).collect(), sharpness }
        });
        let features = features.collect();
        let stride = planes.first().map_or(0, |plane| padded_stride(plane.width(), window_radius));
        Self { features, stride, pad: window_radius }
    }

    /// Whether there is no feature.
    pub fn is_empty(&self) -> bool {
        self.features.is_empty()
    }

    /// Writes the distances of the pixel at column `x` and row `y` and all pixels of the window around it in
    /// `other`: `2·radius + 1` rows of [`distance_stride`]; pixels outside the picture have a value as well.
    #[inline(always)]
    pub fn distances<S: Simd>(
        &self,
        simd: S,
        other: &Self,
        [x, y]: [usize; 2],
        radius: usize,
        out: &mut [f32],
    ) {
        let place = (y + self.pad) * self.stride + x + self.pad;
        let first = place - radius * self.stride - radius;
        let length = distance_stride(radius);
        out.fill(0.0);
        for (here, there) in self.features.iter().zip(&other.features) {
            let sharpness = simd.splat_f32s(here.sharpness[place]);
            for (n, out) in out.chunks_exact_mut(length).enumerate() {
                let row = first + n * self.stride;
                let out = S::as_mut_simd_f32s(out).0;
                let mut apart = [simd.splat_f32s(0.0); MOST_VECTORS];
                let apart = &mut apart[..out.len()];
                for (here, there) in here.planes.iter().zip(&there.planes) {
                    let own = simd.splat_f32s(here[place]);
                    for (apart, &other) in apart.iter_mut().zip(vectors::<S>(there, row, length)) {
                        let difference = simd.sub_f32s(own, other);
                        *apart = simd.add_f32s(*apart, simd.mul_f32s(difference, difference));
                    }
                }
                let apart = apart.iter().zip(vectors::<S>(&there.sharpness, row, length));
                for (out, (&apart, &other)) in out.iter_mut().zip(apart) {
                    *out = simd.add_f32s(*out, simd.mul_f32s(apart, simd.min_f32s(sharpness, other)));
                }
            }
        }
    }
}

/// 1/d of a feature's `planes` at every pixel.
fn sharpness(planes: &[Plane], spread: Spread) -> Plane {
    let (width, height) = planes[0].size();
    let variance = |x, y| {
        let most = if spread.is_distance { planes[0].get(x, y).powi(2) } else { f32::MAX };
        spread.variance.min(most)
    };
    Plane::par_from_fn(width, height, |x, y| {
        let columns = [x.saturating_sub(1), (x + 1).min(width - 1)];
        let rows = [y.saturating_sub(1), (y + 1).min(height - 1)];
        let slope = |values: [f32; 2], [from, to]: [usize; 2]| {
            ((values[1] - values[0]) / (to - from).max(1) as f32).powi(2) // a step of one at the border
        };
        let slopes = planes.iter().map(|plane| {
            let across = slope(columns.map(|x| plane.get(x, y)), columns);
            across + slope(rows.map(|y| plane.get(x, y)), rows)
        });
        slopes.sum::<f32>().max(TOLERANCE * variance(x, y)).max(f32::MIN_POSITIVE).recip()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (21, 9);

    /// Distances from the pixel to its window of radius 3 by every tier of vectors, which must agree.
    fn distances(surfaces: &Surfaces, centre: [usize; 2]) -> Vec<f32> {
        struct Run<'a>(&'a Surfaces, [usize; 2]);
        impl pulp::WithSimd for Run<'_> {
            type Output = Vec<f32>;
            fn with_simd<S: Simd>(self, simd: S) -> Vec<f32> {
                let mut out = vec![0.0; 7 * distance_stride(3)];
                self.0.distances(simd, self.0, self.1, 3, &mut out);
                out
            }
        }
        let scalar = pulp::WithSimd::with_simd(Run(surfaces, centre), pulp::Scalar);
        assert_eq!(crate::denoise::vectors::widest().dispatch(Run(surfaces, centre)), scalar);
        scalar
    }

    /// Of offset (dx, dy).
    fn at(distances: &[f32], dx: isize, dy: isize) -> f32 {
        distances[(3 + dy) as usize * distance_stride(3) + (3 + dx) as usize]
    }

    #[test]
    fn an_edge_is_far_and_a_slope_is_not() {
        let edge = Plane::from_fn(SIZE.0, SIZE.1, |x, _| if x < 10 { 0.0 } else { 1.0 });
        let slope = Plane::from_fn(SIZE.0, SIZE.1, |x, y| 0.3 * x as f32 - 0.1 * y as f32);
        let spread = Spread { planes: 1, variance: 0.25, is_distance: false };
        let of_edge = distances(&Surfaces::new(&[edge], &[spread], 3), [8, 4]);
        assert_eq!([at(&of_edge, -2, 1), at(&of_edge, 1, -1)], [0.0, 0.0]);
        // Beside the edge the slope is ½, two pixels from it only the tolerance forgives.
        assert!((at(&of_edge, 2, 0) - 4.0).abs() < 1e-5, "{}", at(&of_edge, 2, 0));
        assert!((at(&of_edge, 3, 0) - 1.0 / (TOLERANCE * 0.25)).abs() < 1e-2, "{}", at(&of_edge, 3, 0));
        let of_slope = distances(&Surfaces::new(&[slope], &[spread], 3), [10, 4]);
        for (dx, dy) in (-3isize..=3).flat_map(|x| (-3isize..=3).map(move |y| (x, y))) {
            let expected = (3.0 * dx as f32 - dy as f32).powi(2) / 10.0;
            assert!((at(&of_slope, dx, dy) - expected).abs() < 1e-4, "({dx}, {dy})");
        }
    }

    #[test]
    fn what_is_far_away_does_not_hide_a_step_of_what_is_near() {
        let depth = Plane::from_fn(SIZE.0, SIZE.1, |x, _| if x < 10 { 5.0 } else { 7.0 });
        let of = |is_distance| {
            let spread = Spread { planes: 1, variance: 1e6, is_distance };
            distances(&Surfaces::new(std::slice::from_ref(&depth), &[spread], 3), [8, 4])
        };
        let step = at(&of(true), 3, 0);
        assert!((step - 4.0 / (TOLERANCE * 49.0)).abs() < 1e-4, "{step}");
        assert!(at(&of(false), 3, 0) < 1e-3);
    }

    #[test]
    fn the_unit_of_a_feature_does_not_matter_and_features_add_up() {
        let plane = |shift: usize| {
            Plane::from_fn(SIZE.0, SIZE.1, |x, y| ((x * 7 + y * 13 + shift) % 11) as f32 * 0.25)
        };
        let scaled = |plane: &Plane| Plane::from_fn(SIZE.0, SIZE.1, |x, y| 1024.0 * plane.get(x, y));
        let spread = |planes, variance| Spread { planes, variance, is_distance: false };
        let own = distances(&Surfaces::new(&[plane(0), plane(3)], &[spread(2, 0.7)], 3), [0, 8]);
        let large = [scaled(&plane(0)), scaled(&plane(3))];
        let large = distances(&Surfaces::new(&large, &[spread(2, 0.7 * 1024.0f32.powi(2))], 3), [0, 8]);
        assert!(own.iter().zip(&large).all(|(a, b)| (a - b).abs() <= 1e-4 * a), "{own:?}\n{large:?}");
        let single = |shift| distances(&Surfaces::new(&[plane(shift)], &[spread(1, 0.7)], 3), [0, 8]);
        let both = Surfaces::new(&[plane(0), plane(3)], &[spread(1, 0.7), spread(1, 0.7)], 3);
        let sum = single(0).iter().zip(&single(3)).map(|(a, b)| a + b).collect::<Vec<_>>();
        assert_eq!(distances(&both, [0, 8]), sum);
    }

    #[test]
    fn the_largest_features_give_no_nan_and_none_give_nothing() {
        let wild = Plane::from_fn(SIZE.0, SIZE.1, |x, y| [1e15, -1e15, 0.0, 1e-30][(x + 3 * y) % 4]);
        let flat = Plane::filled(SIZE.0, SIZE.1, 2.0);
        for variance in [0.0, 1e30] {
            let spreads = [Spread { planes: 1, variance, is_distance: false }; 2];
            let found = distances(&Surfaces::new(&[wild.clone(), flat.clone()], &spreads, 3), [5, 4]);
            assert!(found.iter().all(|d| *d >= 0.0));
        }
        assert!(distances(&Surfaces::new(&[], &[], 3), [5, 4]).iter().all(|d| *d == 0.0));
    }
}
