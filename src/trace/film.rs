//! Where samples add up. A film can be added to in any number of passes, with any number of samples
//! per pixel, kept in a file in between, and turned into a [`Frame`] at any time.

use super::math::Vec3;
use super::sample::{FEATURES, SECOND_FEATURES, Sample};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{Aov, Feature, FeatureKind, Frame, Motion};
use crate::image::{Plane, Rgb, can_be_had};

/// Sums over the samples of one pixel, in `f64`: their differences are taken later.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments<const N: usize> {
    sum: [f64; N],
    squares: [f64; N],
    first_half: [f64; N], // the samples of even number
}

impl<const N: usize> Moments<N> {
    const ZERO: Self = Self { sum: [0.0; N], squares: [0.0; N], first_half: [0.0; N] };

    fn add(&mut self, values: &[f32], even: bool) {
        for (i, &value) in values.iter().enumerate() {
            let value = f64::from(value);
            self.sum[i] += value;
            self.squares[i] += value * value;
            if even {
                self.first_half[i] += value;
            }
        }
    }
}

/// Samples of one pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Count {
    /// Drawn so far: the number of the next one.
    pub drawn: u32,
    /// Of those, dropped because some number was not finite.
    pub dropped: u32,
    /// Of those kept, how many went into the first half.
    pub even: u32,
}

impl Count {
    fn kept(self) -> u32 {
        self.drawn - self.dropped
    }
}

/// All that is kept of a pixel's colour.
pub(super) type ColorMoments = Moments<3>;

/// The sums of all pixels. Buffers that the options do not ask for are empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    width: usize,
    height: usize,
    pub(super) counts: Vec<Count>,
    pub(super) color: Vec<ColorMoments>,
    pub(super) features: Vec<Moments<FEATURES>>,
    second: Vec<Moments<SECOND_FEATURES>>,
    motion: Vec<[f64; 4]>, // sums of the vectors to the frame before and to the next
    groups: Vec<f64>,      // RGB of every group of every pixel
    group_names: Vec<String>,
}

/// One row of a film, to be added to.
pub(super) struct Row<'a> {
    counts: &'a mut [Count],
    color: &'a mut [ColorMoments],
    features: &'a mut [Moments<FEATURES>],
    second: &'a mut [Moments<SECOND_FEATURES>],
    motion: &'a mut [[f64; 4]],
    groups: &'a mut [f64],
}

impl Row<'_> {
    /// Samples drawn so far in column `x`.
    pub fn drawn(&self, x: usize) -> u32 {
        self.counts[x].drawn
    }

    /// Adds a sample in column `x`, or counts it as dropped.
    pub fn add(&mut self, x: usize, sample: &Sample) {
        let count = &mut self.counts[x];
        let even = count.drawn.is_multiple_of(2);
        count.drawn += 1;
        if !sample.is_finite() {
            count.dropped += 1;
            return;
        }
        count.even += u32::from(even);
        self.color[x].add(sample.color.as_slice(), even);
        if let Some(moments) = self.features.get_mut(x) {
            moments.add(&sample.features, even);
        }
        if let Some(moments) = self.second.get_mut(x) {
            moments.add(&sample.second, even);
        }
        if let Some(sums) = self.motion.get_mut(x) {
            sums.iter_mut().zip(sample.motion).for_each(|(sum, value)| *sum += f64::from(value));
        }
        let start = x * 3 * sample.groups.len();
        let sums = self.groups.get_mut(start..).unwrap_or_default();
        for (sum, value) in sums.iter_mut().zip(flat(&sample.groups)) {
            *sum += f64::from(value);
        }
    }
}

fn flat(colors: &[Vec3]) -> impl Iterator<Item = f32> {
    colors.iter().flat_map(|c| [c.x, c.y, c.z])
}

/// Which buffers a film has.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Buffers {
    pub features: bool,
    pub second: bool,
    pub motion: bool,
    pub groups: Vec<String>,
}

impl Film {
    /// An empty film.
    ///
    /// # Errors
    /// When there is no memory for it and the picture that is made of it: told now, not after the render.
    pub(super) fn new(width: usize, height: usize, buffers: Buffers) -> Result<Self> {
        let pixels = width * height;
        check_memory(width, height, &buffers)?;
        let when = |wanted: bool| if wanted { pixels } else { 0 };
        Ok(Self {
            width,
            height,
            counts: vec![Count::default(); pixels],
            color: vec![Moments::ZERO; pixels],
            features: vec![Moments::ZERO; when(buffers.features)],
            second: vec![Moments::ZERO; when(buffers.second)],
            motion: vec![[0.0; 4]; when(buffers.motion)],
            groups: vec![0.0; 3 * buffers.groups.len() * pixels],
            group_names: buffers.groups,
        })
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The samples of every pixel, row by row.
    pub fn counts(&self) -> &[Count] {
        &self.counts
    }

    /// Samples drawn, over all pixels.
    pub fn drawn(&self) -> u64 {
        self.counts.iter().map(|count| u64::from(count.drawn)).sum()
    }

    /// Samples dropped because they were not finite, over all pixels.
    pub fn dropped(&self) -> u64 {
        self.counts.iter().map(|count| u64::from(count.dropped)).sum()
    }

    pub(super) fn group_count(&self) -> usize {
        self.group_names.len()
    }

    /// The rows, each on its own.
    pub(super) fn rows(&mut self) -> Vec<Row<'_>> {
        let width = self.width;
        let group_width = 3 * self.group_names.len() * width;
        let mut features = self.features.chunks_mut(width);
        let mut second = self.second.chunks_mut(width);
        let mut motion = self.motion.chunks_mut(width);
        let mut groups = self.groups.chunks_mut(group_width.max(1));
        let pixels = self.counts.chunks_mut(width).zip(self.color.chunks_mut(width));
        pixels
            .map(|(counts, color)| Row {
                counts,
                color,
                features: features.next().unwrap_or_default(),
                second: second.next().unwrap_or_default(),
                motion: motion.next().unwrap_or_default(),
                groups: groups.next().unwrap_or_default(),
            })
            .collect()
    }

    /// The picture so far, under the contract of [`Frame`]: means, variances of the mean, halves. Where a
    /// pixel has no sample its values are NaN; where it has one its variance is. Halves and variances
    /// are left out when no pixel has two samples.
    ///
    /// # Errors
    /// When the picture has no pixel.
    pub fn to_frame(&self) -> Result<Frame> {
        let several = self.counts.iter().any(|count| count.kept() > 1);
        let mut frame = Frame::new(self.rgb(&self.color, mean))?;
        if several {
            frame = frame
                .with_variance_of_mean(self.rgb(&self.color, variance_of_mean))?
                .with_halves([self.rgb(&self.color, first_half), self.rgb(&self.color, second_half)])?;
        }
        for layer in FIRST_LAYERS.iter().filter(|_| !self.features.is_empty()) {
            frame = frame.with_feature(self.feature(layer, &self.features, several))?;
        }
        for layer in SECOND_LAYERS.iter().filter(|_| !self.second.is_empty()) {
            frame = frame.with_feature(self.feature(layer, &self.second, several))?;
        }
        for (group, name) in self.group_names.iter().enumerate() {
            frame = frame.with_aov(Aov { name: name.clone(), color: self.group(group) })?;
        }
        if !self.motion.is_empty() {
            let to = |first: usize| Some([self.mean_motion(first), self.mean_motion(first + 1)]);
            frame = frame.with_motion(Motion { previous: to(0), next: to(2) })?;
        }
        let spp = self.drawn() as f64 / self.counts.len() as f64;
        Ok(frame.with_spp(spp as f32))
    }

    /// The number of samples that went into each pixel.
    pub fn sample_map(&self) -> Plane {
        Plane::from_fn(self.width, self.height, |x, y| self.counts[y * self.width + x].kept() as f32)
    }

    pub(super) fn plane<const N: usize>(
        &self,
        moments: &[Moments<N>],
        i: usize,
        value: Statistic<N>,
    ) -> Plane {
        Plane::from_fn(self.width, self.height, |x, y| {
            let pixel = y * self.width + x;
            value(&moments[pixel], self.counts[pixel], i) as f32
        })
    }

    fn mean_motion(&self, i: usize) -> Plane {
        Plane::from_fn(self.width, self.height, |x, y| {
            let pixel = y * self.width + x;
            (self.motion[pixel][i] / f64::from(self.counts[pixel].kept())) as f32
        })
    }

    pub(super) fn rgb(&self, moments: &[ColorMoments], value: Statistic<3>) -> Rgb {
        std::array::from_fn(|channel| self.plane(moments, channel, value))
    }

    fn feature<const N: usize>(
        &self,
        (name, kind, at): &Layer,
        moments: &[Moments<N>],
        several: bool,
    ) -> Feature {
        let planes =
            |value: Statistic<N>| at.clone().map(|i| self.plane(moments, i, value)).collect::<Vec<_>>();
        let mut feature = Feature::new(*name, *kind, planes(mean));
        if several {
            feature.var_of_mean = Some(planes(variance_of_mean));
            feature.halves = Some([planes(first_half), planes(second_half)]);
        }
        feature
    }

    fn group(&self, group: usize) -> Rgb {
        let stride = 3 * self.group_names.len();
        std::array::from_fn(|channel| {
            Plane::from_fn(self.width, self.height, |x, y| {
                let pixel = y * self.width + x;
                (self.groups[pixel * stride + 3 * group + channel] / f64::from(self.counts[pixel].kept()))
                    as f32
            })
        })
    }
}

/// Checks that a film and about as much again for its picture can be had.
fn check_memory(width: usize, height: usize, buffers: &Buffers) -> Result<()> {
    let of = |wanted: bool, bytes: usize| if wanted { bytes as u64 } else { 0 };
    let per_pixel = size_of::<Count>() as u64
        + size_of::<ColorMoments>() as u64
        + of(buffers.features, size_of::<Moments<FEATURES>>())
        + of(buffers.second, size_of::<Moments<SECOND_FEATURES>>())
        + of(buffers.motion, size_of::<[f64; 4]>())
        + buffers.groups.len() as u64 * size_of::<[f64; 3]>() as u64;
    let bytes = 2 * per_pixel * (width * height) as u64;
    if can_be_had(bytes) {
        return Ok(());
    }
    let gigabytes = bytes as f64 / 1e9;
    let what =
        format!("a picture of {width}×{height} pixels needs {gigabytes:.1} GB, which are not to be had");
    let error = Error::new(ErrorKind::Usage, what);
    Err(error
        .remedy("give the camera a lower 'resolution' or a 'crop', or leave out features and light groups"))
}

/// A feature's name and kind, and which of a pixel's numbers are its own.
type Layer = (&'static str, FeatureKind, std::ops::Range<usize>);

pub(super) const FIRST_LAYERS: [Layer; 5] = [
    ("albedo", FeatureKind::Albedo, 0..3),
    ("normal", FeatureKind::Normal, 3..6),
    ("position", FeatureKind::Position, 6..9),
    ("depth", FeatureKind::Depth, 9..10),
    ("visibility", FeatureKind::Visibility, 10..11),
];

const SECOND_LAYERS: [Layer; 3] = [
    ("albedo2", FeatureKind::Albedo, 0..3),
    ("normal2", FeatureKind::Normal, 3..6),
    ("depth2", FeatureKind::Depth, 6..7),
];

/// The names of all features that a picture may have.
pub(super) fn feature_names() -> impl Iterator<Item = &'static str> {
    FIRST_LAYERS.iter().chain(&SECOND_LAYERS).map(|(name, ..)| *name)
}

/// A number drawn from a pixel's sums.
type Statistic<const N: usize> = fn(&Moments<N>, Count, usize) -> f64;

pub(super) fn mean<const N: usize>(moments: &Moments<N>, count: Count, i: usize) -> f64 {
    moments.sum[i] / f64::from(count.kept())
}

pub(super) fn variance_of_mean<const N: usize>(moments: &Moments<N>, count: Count, i: usize) -> f64 {
    let n = f64::from(count.kept());
    let spread = (moments.squares[i] - moments.sum[i] * moments.sum[i] / n).max(0.0);
    if n < 2.0 { f64::NAN } else { spread / (n * (n - 1.0)) }
}

/// The mean ± half the difference of the halves' means, that difference stretched where the halves are
/// not equally large: so that their average is the mean, they are uncorrelated, and ((A − B)/2)²
/// is the variance of the mean, for any number of samples.
fn halves<const N: usize>(moments: &Moments<N>, count: Count, i: usize) -> [f64; 2] {
    let (n, even) = (f64::from(count.kept()), f64::from(count.even));
    let odd = n - even;
    let (a, b) = (moments.first_half[i] / even, (moments.sum[i] - moments.first_half[i]) / odd);
    if even == odd {
        return [a, b];
    }
    let (mean, half) = (moments.sum[i] / n, (a - b) * (even * odd).sqrt() / n);
    [mean + half, mean - half]
}

fn first_half<const N: usize>(moments: &Moments<N>, count: Count, i: usize) -> f64 {
    halves(moments, count, i)[0]
}

fn second_half<const N: usize>(moments: &Moments<N>, count: Count, i: usize) -> f64 {
    halves(moments, count, i)[1]
}

/// Keeping a film between runs: a fixed little-endian layout, checked by length.
impl Film {
    /// The film's numbers.
    pub fn to_bytes(&self) -> Vec<u8> {
        let counts = self.counts.iter().flat_map(|c| [c.drawn, c.dropped, c.even]).flat_map(u32::to_le_bytes);
        counts.chain(self.numbers().flat_map(f64::to_le_bytes)).collect()
    }

    /// Takes up the numbers of a film with the same buffers.
    ///
    /// # Errors
    /// When `bytes` are of another length than this film's.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<()> {
        let split = 12 * self.counts.len();
        let expected = split + 8 * self.numbers().count();
        if bytes.len() != expected {
            let what = format!("the film holds {} bytes where {expected} were expected", bytes.len());
            return Err(Error::new(ErrorKind::Unreadable, what));
        }
        let (counts, numbers) = bytes.split_at(split);
        for (count, bytes) in self.counts.iter_mut().zip(counts.chunks_exact(12)) {
            let word = |i: usize| u32::from_le_bytes(std::array::from_fn(|byte| bytes[4 * i + byte]));
            *count = Count { drawn: word(0), dropped: word(1), even: word(2) };
        }
        for (number, bytes) in self.numbers_mut().zip(numbers.chunks_exact(8)) {
            *number = f64::from_le_bytes(std::array::from_fn(|byte| bytes[byte]));
        }
        Ok(())
    }

    fn numbers(&self) -> impl Iterator<Item = f64> {
        let color = self.color.iter().flat_map(Moments::numbers);
        let features = self.features.iter().flat_map(Moments::numbers);
        let second = self.second.iter().flat_map(Moments::numbers);
        let rest = self.motion.as_flattened().iter().chain(&self.groups);
        color.chain(features).chain(second).chain(rest).copied()
    }

    fn numbers_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        let color = self.color.iter_mut().flat_map(Moments::numbers_mut);
        let features = self.features.iter_mut().flat_map(Moments::numbers_mut);
        let second = self.second.iter_mut().flat_map(Moments::numbers_mut);
        let rest = self.motion.as_flattened_mut().iter_mut().chain(&mut self.groups);
        color.chain(features).chain(second).chain(rest)
    }
}

impl<const N: usize> Moments<N> {
    fn numbers(&self) -> impl Iterator<Item = &f64> {
        self.sum.iter().chain(&self.squares).chain(&self.first_half)
    }

    fn numbers_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        self.sum.iter_mut().chain(&mut self.squares).chain(&mut self.first_half)
    }
}
