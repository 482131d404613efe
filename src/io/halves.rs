//! Two renders of one frame as the halves of one.

use rayon::prelude::*;

use super::assemble::rgb;
use super::statistics::Variation;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{Aov, Feature, Frame};
use crate::image::{Plane, Rgb};

/// Two frames of the same scene with independent seeds as one: means of both, with both as halves. The
/// variance is kept where both have one. A feature that only the first has is as it is there, one that only the second
/// has is left out. The motion is the first's.
///
/// # Errors
/// `Lacking` when they differ in size, or an AOV is only in the first.
pub(super) fn merge_halves(a: &Frame, b: &Frame) -> Result<Frame> {
    if (a.width(), a.height()) != (b.width(), b.height()) {
        return Err(Error::new(
            ErrorKind::Lacking,
            format!("is {}×{} where the first half is {}×{}", b.width(), b.height(), a.width(), a.height()),
        )
        .remedy("give two renders of the same frame with different seeds"));
    }
    let mut frame =
        Frame::new(rgb(means(a.color(), b.color()))?)?.with_halves([a.color().clone(), b.color().clone()])?;
    if let (Some(a), Some(b)) = (a.color_var_of_mean(), b.color_var_of_mean()) {
        frame = frame.with_variance_of_mean(rgb(variances(a, b))?)?;
    }
    for feature in a.features() {
        let alike =
            |other: &&Feature| other.name == feature.name && other.planes.len() == feature.planes.len();
        frame = frame.with_feature(match b.features().iter().find(alike) {
            None => feature.clone(),
            Some(other) => merge_feature(feature, other),
        })?;
    }
    for aov in a.aovs() {
        let other = b.aovs().iter().find(|other| other.name == aov.name).ok_or_else(|| {
            Error::new(ErrorKind::Lacking, "is not there, but in the first half it is")
                .in_channel(&aov.name)
                .remedy("leave it out of --aov, or render it in both halves")
        })?;
        frame =
            frame.with_aov(Aov { name: aov.name.clone(), color: rgb(means(&aov.color, &other.color))? })?;
    }
    if let Some(motion) = a.motion() {
        frame = frame.with_motion(motion.clone())?;
    }
    Ok(match (a.spp(), b.spp()) {
        (Some(a), Some(b)) => frame.with_spp(a + b),
        _ => frame,
    })
}

/// Pixels of a run along a row: so many that what differs stands out from the noise, and few enough for small pictures.
const RUN: usize = 64;

/// Whether two renders are one and the same, or not of one frame, as far as their rows were looked at.
#[derive(Debug, Default)]
pub(super) struct Twins {
    differ: bool,
    color: Variation,
    /// How far the halves are apart on every [`RUN`] where they are.
    apart: Vec<f32>,
}

impl Twins {
    /// Looks at the next rows of a frame with the two as its halves.
    pub(super) fn add(&mut self, rows: &Frame) {
        let Some([a, b]) = rows.halves() else { return };
        self.apart.par_extend((0..rows.height()).into_par_iter().flat_map_iter(|y| apart(a, b, y)));
        if self.differ {
            return;
        }
        let mut pairs = a.iter().zip(b).flat_map(|(a, b)| a.data().iter().zip(b.data()));
        self.differ = pairs.any(|(a, b)| a.to_bits() != b.to_bits());
        self.color.add(a);
    }

    /// Refuses the same noise twice: it would pass for no noise at all. Where the colour is the same at every
    /// pixel there may be none. Returns in words that the two are hardly of one frame, where they are not.
    ///
    /// # Errors
    /// `Lacking` when all values are equal.
    pub(super) fn check(&self) -> Result<Option<String>> {
        if self.differ || !self.color.varies {
            return Ok(self.strangers());
        }
        Err(Error::new(
            ErrorKind::Lacking,
            "holds the very noise of the first half: the colours are equal everywhere",
        )
        .remedy("render one of the two with another seed"))
    }

    fn strangers(&self) -> Option<String> {
        /// `[choice]` standard errors in the middle. Two seeds of one frame have 0.67 where pixels are independent, at most
        /// 0.8 on thirteen scenes of `apr-trace` and 1.2 with the wide pixel filter of Cycles; other scenes have 2.5
        /// and more.
        const MOST: f32 = 2.0;
        /// Fewer runs tell nothing.
        const LEAST_RUNS: usize = 16;
        let mut sorted = self.apart.clone();
        let middle = sorted.len() / 2;
        if sorted.len() < LEAST_RUNS {
            return None;
        }
        let (_, median, _) = sorted.select_nth_unstable_by(middle, f32::total_cmp);
        let words = format!(
            "does not look like another render of the same frame: on runs of {RUN} pixels the means of the two are \
             {median:.1} standard errors apart in the middle, where 0.7 was expected; give the same frame with another \
             seed, or the result is a mixture of both"
        );
        (*median > MOST).then_some(words)
    }
}

/// How far the means of two colours are apart on the runs of a row, in standard errors by what differs within them. Runs
/// without any difference tell nothing.
fn apart(a: &Rgb, b: &Rgb, y: usize) -> Vec<f32> {
    let mut differences = vec![0.0_f64; a[0].width()];
    for (a, b) in a.iter().zip(b) {
        let pixels = a.row(y).iter().zip(b.row(y));
        differences.iter_mut().zip(pixels).for_each(|(sum, (a, b))| *sum += f64::from(*a) - f64::from(*b));
    }
    let standard_errors = |run: &[f64]| {
        let n = run.len() as f64;
        let mean = run.iter().sum::<f64>() / n;
        let variance = run.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean.abs() / (variance / n).sqrt()) as f32
    };
    differences.chunks_exact(RUN).map(standard_errors).filter(|apart| !apart.is_nan()).collect()
}

fn merge_feature(a: &Feature, b: &Feature) -> Feature {
    let mut merged = Feature::new(&a.name, a.kind, means(&a.planes, &b.planes));
    merged.halves = Some([a.planes.clone(), b.planes.clone()]);
    let both = a.var_of_mean.as_ref().zip(b.var_of_mean.as_ref());
    merged.var_of_mean = both.map(|(a, b)| variances(a, b));
    merged
}

fn means(a: &[Plane], b: &[Plane]) -> Vec<Plane> {
    zip(a, b, |a, b| 0.5 * (a + b))
}

/// The variance of the mean of two independent means, from the variance of each.
fn variances(a: &[Plane], b: &[Plane]) -> Vec<Plane> {
    zip(a, b, |a, b| 0.25 * (a + b))
}

fn zip(a: &[Plane], b: &[Plane], f: impl Fn(f32, f32) -> f32 + Sync) -> Vec<Plane> {
    let one = |(a, b): (&Plane, &Plane)| {
        Plane::par_from_fn(a.width(), a.height(), |x, y| f(a.get(x, y), b.get(x, y)))
    };
    a.iter().zip(b).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::FeatureKind;

    #[test]
    fn another_frame_is_told_from_another_seed() {
        let noise = |x: usize, y: usize, seed: usize| {
            ((x * 7919 + y * 104_729 + seed * 1_299_709) % 997) as f32 / 997.0
        };
        let frame = |slope: f32, seed: usize| {
            let planes = [0, 1, 2].map(|c| {
                Plane::from_fn(130, 12, |x, y| slope * x as f32 / 130.0 + noise(x, y, 3 * seed + c))
            });
            Frame::new(planes).unwrap()
        };
        let told = |a: &Frame, b: &Frame| {
            let mut twins = Twins::default();
            twins.add(&merge_halves(a, b).unwrap());
            twins.check().unwrap()
        };
        assert_eq!(told(&frame(3.0, 1), &frame(3.0, 2)), None);
        assert!(told(&frame(3.0, 1), &frame(0.0, 2)).unwrap().contains("does not look like"));
    }

    #[test]
    fn halves_are_averaged_and_their_variances_quartered() {
        let planes = |v: f32| [v, v + 1.0, v + 2.0].map(|v| Plane::filled(3, 2, v));
        let frame = |v: f32| {
            let mut depth = Feature::new("depth", FeatureKind::Depth, vec![Plane::filled(3, 2, v)]);
            depth.var_of_mean = Some(vec![Plane::filled(3, 2, 2.0 * v)]);
            let frame = Frame::new(planes(v)).unwrap().with_variance_of_mean(planes(v)).unwrap();
            let motion =
                crate::frame::Motion { next: None, previous: Some([0.0, v].map(|v| Plane::filled(3, 2, v))) };
            frame.with_feature(depth).and_then(|frame| frame.with_motion(motion)).unwrap().with_spp(v)
        };
        let merged = merge_halves(&frame(2.0), &frame(4.0)).unwrap();
        assert_eq!(merged.color(), &planes(3.0));
        assert_eq!(merged.color_var_of_mean().unwrap()[1].get(0, 0), 0.25 * (3.0 + 5.0));
        assert_eq!(merged.halves(), Some(&[planes(2.0), planes(4.0)]));
        let depth = &merged.features()[0];
        assert_eq!((depth.planes[0].get(2, 1), depth.var_of_mean.as_ref().unwrap()[0].get(2, 1)), (3.0, 3.0));
        assert_eq!(merged.spp(), Some(6.0));
        assert_eq!(merged.motion(), frame(2.0).motion(), "both show the same motion");
        let small = Frame::new([0.0; 3].map(|v| Plane::filled(3, 1, v))).unwrap();
        assert_eq!(merge_halves(&frame(1.0), &small).unwrap_err().kind(), ErrorKind::Lacking);
    }
}
