//! Whatever a renderer calls variance, as the variance of the mean.
//!
//! Nothing is repaired here: negative, infinite or NaN results (half floats make `m2 < m²`, PBRT's
//! overflow) are left for the denoiser's first stage to replace and count.

use super::channels::VarianceKind;
use super::statistics::{Statistics, Variation};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::Frame;
use crate::image::Plane;

/// How many samples a pixel has.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Samples {
    /// Nobody says.
    Unknown,
    /// All pixels the same.
    Uniform(f32),
    /// Each its own.
    PerPixel {
        counts: Plane,
        /// Over the whole picture.
        mean: f32,
    },
}

impl Samples {
    /// From the number in the header or of the user, and the plane of a sample count layer with what it
    /// comes to over the whole picture: it may hold numbers or, as in Cycles, shares of the number.
    pub(super) fn new(uniform: Option<f32>, layer: Option<(Plane, &Statistics)>) -> Self {
        let Some((mut counts, all)) = layer else { return uniform.map_or(Self::Unknown, Self::Uniform) };
        // What is no number of samples makes no variance either.
        let infinite = counts.data_mut().iter_mut().filter(|count| count.is_infinite());
        infinite.for_each(|count| *count = f32::NAN);
        let most = all.range().map_or(0.0, |(_, most)| most.max(0.0));
        match (most, uniform) {
            (0.0, _) => uniform.map_or(Self::Unknown, Self::Uniform),
            (..=1.0, Some(number)) => {
                counts.data_mut().iter_mut().for_each(|share| *share *= number);
                Self::PerPixel { counts, mean: all.mean() * number }
            }
            (..=1.0, None) => Self::Unknown,
            _ => Self::PerPixel { counts, mean: all.mean() },
        }
    }

    /// The mean over the whole picture.
    pub(super) fn mean(&self) -> Option<f32> {
        match self {
            Self::Unknown => None,
            Self::Uniform(n) => Some(*n),
            Self::PerPixel { mean, .. } => Some(*mean),
        }
    }

    fn at(&self, i: usize) -> Option<f32> {
        match self {
            Self::Unknown => None,
            Self::Uniform(n) => Some(*n),
            Self::PerPixel { counts, .. } => Some(counts.data()[i]),
        }
    }
}

/// Whether the variance of a varying colour, as it follows from what is stored, is above 0 anywhere. That of a
/// second moment nothing tells before it is made.
#[derive(Debug, Default)]
pub(super) struct Noise {
    there: bool,
    above_zero: bool,
    color: Variation,
}

impl Noise {
    /// Looks at the next rows.
    pub(super) fn add(&mut self, rows: &Frame) {
        let Some(variance) = rows.color_var_of_mean().filter(|_| !self.above_zero) else { return };
        self.there = true;
        self.above_zero = variance.iter().flat_map(Plane::data).any(|v| *v > 0.0);
        self.color.add(rows.color());
    }

    /// What is to be told of it.
    pub(super) fn warning(&self) -> Option<String> {
        (self.there && self.color.varies && !self.above_zero).then(|| {
            "variance: what is stored makes it above 0 at no pixel though the colour varies, so it says nothing; \
             check what it holds (--variance-kind), or do without it by --map variance=none"
                .to_owned()
        })
    }
}

/// Turns `stored` into the variance of `mean`, in place.
///
/// # Errors
/// `Lacking` when the number of samples is needed and not known, or is 1.
pub(super) fn to_variance_of_mean(
    kind: VarianceKind,
    stored: &mut Plane,
    mean: &Plane,
    samples: &Samples,
) -> Result<()> {
    let needs_more_than = match kind {
        VarianceKind::Mean | VarianceKind::Stddev | VarianceKind::Halves => None,
        VarianceKind::Sample => Some(0.0),
        VarianceKind::M2 => Some(1.0),
    };
    if let Some(least) = needs_more_than {
        match samples.mean() {
            None => {
                return Err(lacking("the number of samples is not in the file").remedy("give it by --spp N"));
            }
            Some(n) if n <= least => return Err(lacking("one sample per pixel has no variance")),
            Some(_) => {}
        }
    }
    for (i, value) in stored.data_mut().iter_mut().enumerate() {
        let n = samples.at(i).unwrap_or(1.0);
        *value = match kind {
            VarianceKind::Mean | VarianceKind::Halves => *value,
            VarianceKind::Stddev => *value * *value,
            VarianceKind::Sample => *value / n,
            VarianceKind::M2 => (*value - mean.data()[i] * mean.data()[i]) / (n - 1.0),
        };
    }
    Ok(())
}

fn lacking(what: &str) -> Error {
    Error::new(ErrorKind::Lacking, what)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn converted(kind: VarianceKind, stored: f32, mean: f32, samples: &Samples) -> Result<f32> {
        let mut plane = Plane::filled(2, 1, stored);
        to_variance_of_mean(kind, &mut plane, &Plane::filled(2, 1, mean), samples)?;
        Ok(plane.get(1, 0))
    }

    #[test]
    fn every_kind_becomes_the_variance_of_the_mean() {
        let five = Samples::Uniform(5.0);
        assert_eq!(converted(VarianceKind::Mean, 0.5, 3.0, &Samples::Unknown).unwrap(), 0.5);
        assert_eq!(converted(VarianceKind::Stddev, 0.5, 3.0, &Samples::Unknown).unwrap(), 0.25);
        assert_eq!(converted(VarianceKind::Sample, 0.5, 3.0, &five).unwrap(), 0.1);
        assert_eq!(converted(VarianceKind::M2, 11.0, 3.0, &five).unwrap(), 0.5);
        let counts = Plane::from_vec(2, 1, vec![1.0, 3.0]).unwrap();
        let per_pixel = Samples::PerPixel { counts, mean: 2.0 };
        assert_eq!(converted(VarianceKind::M2, 11.0, 3.0, &per_pixel).unwrap(), 1.0);
    }

    #[test]
    fn unknown_or_single_samples_are_an_error_where_they_matter() {
        for kind in [VarianceKind::Sample, VarianceKind::M2] {
            let error = converted(kind, 1.0, 1.0, &Samples::Unknown).unwrap_err();
            assert!(error.to_string().contains("--spp"), "{error}");
        }
        assert!(converted(VarianceKind::M2, 1.0, 1.0, &Samples::Uniform(1.0)).is_err());
    }

    #[test]
    fn sample_counts_may_be_shares_of_the_whole() {
        let shares = Plane::from_vec(2, 1, vec![0.25, 1.0]).unwrap();
        let samples =
            |uniform, plane: &Plane| Samples::new(uniform, Some((plane.clone(), &Statistics::of(plane))));
        let counts = Plane::from_vec(2, 1, vec![16.0, 64.0]).unwrap();
        assert_eq!(samples(Some(64.0), &shares), Samples::PerPixel { counts, mean: 40.0 });
        assert_eq!(samples(None, &shares), Samples::Unknown);
        let counts = Plane::from_vec(2, 1, vec![4.0, 8.0]).unwrap();
        assert_eq!(samples(Some(64.0), &counts), Samples::PerPixel { counts: counts.clone(), mean: 6.0 });
        let broken = Plane::from_vec(3, 1, vec![f32::NAN, 8.0, f32::INFINITY]).unwrap();
        assert_eq!(samples(None, &broken).mean(), Some(8.0));
        assert_eq!(samples(Some(4.0), &Plane::filled(2, 1, f32::NAN)), Samples::Uniform(4.0));
    }
}
