//! Random numbers and the mappings from the unit square to what a path needs.

use std::f32::consts::{FRAC_PI_4, PI};

use rand_pcg::Lcg64Xsh32;
use rand_pcg::rand_core::Rng as _;

use super::math::Vec3;

/// Which decisions a generator serves. Effects that a scene may lack have a stream of their own, so
/// that switching one on leaves the random numbers of all others as they were.
#[derive(Debug, Clone, Copy)]
pub enum Stream {
    /// Position in the pixel, light and material choices, roulette.
    Path = 1,
    /// Position on the lens.
    Lens = 2,
    /// Moment in the shutter interval.
    Time = 3,
    /// Free flight and scattering in a medium.
    Medium = 4,
}

/// The random numbers of one stream of one sample of one pixel (PCG-XSH-RR, O'Neill 2014). They
/// depend on nothing else, so any split of the work over threads or runs gives the same picture.
#[derive(Debug, Clone)]
pub struct Random(Lcg64Xsh32);

/// The finaliser of SplitMix64 (Steele et al. 2014): every input bit reaches every output bit.
fn scramble(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Random {
    /// The generator of `stream` of sample `sample` of pixel `pixel` in a render with `seed`. Its start is
    /// hashed from all four: streams of PCG that start alike differ by a constant for ever, and their
    /// numbers with them.
    pub fn new(seed: u64, pixel: u32, sample: u32, stream: Stream) -> Self {
        const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15; // 2⁶⁴ / golden ratio: keeps seed 0 from the hash's fixed point
        let place = u64::from(pixel) << 32 | u64::from(sample);
        let place = scramble(scramble(seed.wrapping_add(GOLDEN)) ^ place);
        let stream = stream as u64;
        Self(Lcg64Xsh32::new(scramble(place.wrapping_add(stream.wrapping_mul(GOLDEN))), stream))
    }

    /// A number in [0, 1).
    #[inline]
    pub fn next(&mut self) -> f32 {
        (self.0.next_u32() >> 8) as f32 * (1.0 / (1u32 << 24) as f32)
    }

    /// A point in [0, 1)².
    #[inline]
    pub fn next_2d(&mut self) -> [f32; 2] {
        [self.next(), self.next()]
    }
}

/// A point of the unit disk, uniform, by Shirley and Chiu's concentric map.
#[inline]
pub fn concentric_disk(u: [f32; 2]) -> [f32; 2] {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if a == 0.0 && b == 0.0 {
        return [0.0, 0.0];
    }
    let (r, phi) =
        if a * a > b * b { (a, FRAC_PI_4 * (b / a)) } else { (b, 2.0 * FRAC_PI_4 - FRAC_PI_4 * (a / b)) };
    let (sin, cos) = phi.sin_cos();
    [r * cos, r * sin]
}

/// A direction of the upper hemisphere with density cos θ / π.
#[inline]
pub fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let [x, y] = concentric_disk(u);
    Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

/// A direction of the sphere, uniform.
pub fn uniform_sphere(u: [f32; 2]) -> Vec3 {
    direction(1.0 - 2.0 * u[0], 2.0 * PI * u[1])
}

/// The direction with cosine `cos` to the z axis and azimuth `phi`.
#[inline]
pub fn direction(cos: f32, phi: f32) -> Vec3 {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (sin_phi, cos_phi) = phi.sin_cos();
    Vec3::new(sin * cos_phi, sin * sin_phi, cos)
}

/// Barycentric coordinates of the second and third vertex, uniform over the triangle.
#[inline]
pub fn triangle(u: [f32; 2]) -> [f32; 2] {
    let root = (1.0 - u[0]).max(0.0).sqrt();
    [1.0 - root, u[1] * root]
}

/// A discrete distribution, sampled by bisection of its cumulative sums.
#[derive(Debug, Clone)]
pub struct Distribution {
    cumulative: Vec<f32>, // n + 1 entries, the first 0 and the last 1
    total: f32,
}

impl Distribution {
    /// A distribution in proportion to `weights`; uniform when they sum to 0.
    pub fn new(weights: &[f32]) -> Self {
        let total: f64 = weights.iter().map(|&w| f64::from(w)).sum();
        let mut sum = 0.0;
        let mut cumulative = Vec::with_capacity(weights.len() + 1);
        cumulative.push(0.0);
        for (i, &w) in weights.iter().enumerate() {
            sum += f64::from(w);
            cumulative
                .push(if total > 0.0 { sum / total } else { (i + 1) as f64 / weights.len() as f64 } as f32);
        }
        Self { cumulative, total: total as f32 }
    }

    /// The sum of the weights.
    pub fn total(&self) -> f32 {
        self.total
    }

    /// The probability of entry `i`.
    #[inline]
    pub fn probability(&self, i: usize) -> f32 {
        self.cumulative[i + 1] - self.cumulative[i]
    }

    /// An entry, and `u` stretched to [0, 1) inside it for further use.
    #[inline]
    pub fn sample(&self, u: f32) -> (usize, f32) {
        let last = self.cumulative.len() - 2;
        let i = self.cumulative[1..].partition_point(|&c| c <= u).min(last);
        let rest = (u - self.cumulative[i]) / self.probability(i);
        (i, rest.clamp(0.0, 1.0 - f32::EPSILON / 2.0))
    }
}

/// The power heuristic's weight for a strategy of density `a` beside one of density `b`.
#[inline]
pub fn power_heuristic(a: f32, b: f32) -> f32 {
    let ratio = b / a; // the quotient first: squares of large densities would overflow
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that a pixel's samples draw from any two streams fill the unit square evenly: χ² over
    /// 16 × 16 bins, with neighbouring samples as a control.
    #[test]
    fn streams_are_independent() {
        const BINS: usize = 16;
        const SAMPLES: u32 = 1 << 16;
        let number = |sample, stream, at| {
            let mut random = Random::new(0, 7, sample, stream);
            (0..at).for_each(|_| _ = random.next());
            random.next()
        };
        let streams = [Stream::Path, Stream::Lens, Stream::Time, Stream::Medium];
        let pairs = (0..4).flat_map(|a| (a..4).map(move |b| (streams[a], streams[b], u32::from(a == b))));
        for ((a, b, apart), at) in pairs.flat_map(|pair| [0, 1, 21].map(|at| (pair, at))) {
            let mut bins = [[0u32; BINS]; BINS];
            for sample in 0..SAMPLES {
                let place = [number(sample, a, at), number(sample + apart, b, at)];
                let [x, y] = place.map(|u| (u * BINS as f32) as usize);
                bins[y][x] += 1;
            }
            let expected = f64::from(SAMPLES) / (BINS * BINS) as f64;
            let squares = bins.as_flattened().iter().map(|&n| (f64::from(n) - expected).powi(2));
            let (chi2, freedom) = (squares.sum::<f64>() / expected, (BINS * BINS - 1) as f64);
            let z = (chi2 - freedom) / (2.0 * freedom).sqrt();
            assert!(
                z.abs() < 4.0,
                "{a:?} and {b:?}, number {at}: χ² of {chi2:.0} where {freedom} are expected"
            );
        }
    }
}
