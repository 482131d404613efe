//! A frame from the planes that play a role.

use std::collections::BTreeMap;

use super::channels::{Role, Statistic, VarianceKind};
use super::layers::Channel;
use super::misses;
use super::roles::Choice;
use super::variance::{Samples, from_halves, to_variance_of_mean};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{Feature, FeatureKind, Frame};
use crate::image::{Plane, Rgb};

/// The planes that were read, handed out without a copy where possible.
pub(super) struct Planes {
    read: BTreeMap<Channel, Plane>,
    uses: BTreeMap<Channel, usize>,
}

impl Planes {
    /// `read` holds every channel that `choices` name; the others are dropped.
    pub(super) fn new(mut read: BTreeMap<Channel, Plane>, choices: &[Choice]) -> Self {
        let mut uses = BTreeMap::new();
        for channel in choices.iter().flat_map(|choice| &choice.channels) {
            *uses.entry(*channel).or_insert(0) += 1;
        }
        read.retain(|channel, _| uses.contains_key(channel));
        Self { read, uses }
    }

    fn take(&mut self, choice: &Choice) -> Vec<Plane> {
        choice.channels.iter().map(|channel| self.take_one(*channel)).collect()
    }

    fn take_one(&mut self, channel: Channel) -> Plane {
        let uses = self.uses.get_mut(&channel).expect("every choice was counted");
        *uses -= 1;
        let plane = if *uses == 0 { self.read.remove(&channel) } else { self.read.get(&channel).cloned() };
        plane.expect("every choice was read")
    }
}

/// What the assembly has to tell.
#[derive(Debug, Default)]
pub(super) struct Remarks {
    pub(super) notes: Vec<String>,
    pub(super) warnings: Vec<String>,
}

impl Remarks {
    /// The variance of `name` is not used; those that fail alike are told together.
    fn cannot_convert(&mut self, name: &str, error: &Error) {
        let end = format!(": the variance is not used: {error}");
        match self.warnings.iter_mut().find(|warning| warning.ends_with(&end)) {
            Some(warning) => warning.insert_str(warning.len() - end.len(), &format!(", {name}")),
            None => self.warnings.push(format!("{name}{end}")),
        }
    }
}

/// What the user says about statistics.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Given {
    pub(super) kind: Option<VarianceKind>,
    pub(super) spp: Option<f32>,
}

/// Builds the frame. `choices` begin with the colour, each feature's mean stands before its statistics.
///
/// # Errors
/// `Lacking` when the colour does not have one or three channels.
pub(super) fn assemble(
    choices: &[Choice],
    mut planes: Planes,
    given: Given,
    remarks: &mut Remarks,
) -> Result<Frame> {
    let find = |role: Role, feature: &str, wanted: fn(Statistic) -> bool| {
        choices.iter().find(|choice| {
            let target = &choice.target;
            target.role == role && target.feature == feature && wanted(target.statistic)
        })
    };
    let counts =
        find(Role::SampleCount, "", |_| true).and_then(|choice| planes.take(choice).into_iter().next());
    let samples = Samples::new(given.spp, counts);
    let mut group = |role: Role, feature: &str, kind: Option<FeatureKind>| {
        let mut take =
            |wanted| find(role, feature, wanted).map(|choice| (choice.target.statistic, planes.take(choice)));
        let group = Group {
            mean: take(|s| s == Statistic::Mean).map(|(_, planes)| planes).unwrap_or_default(),
            variance: take(|s| matches!(s, Statistic::Variance(_))),
            halves: [take(|s| s == Statistic::HalfA), take(|s| s == Statistic::HalfB)]
                .map(|half| half.map(|(_, p)| p)),
        };
        let mut settled =
            group.settle(if feature.is_empty() { "color" } else { feature }, given.kind, &samples, remarks);
        if matches!(kind, Some(FeatureKind::Depth | FeatureKind::Position)) {
            settled.bound_misses(feature, remarks);
        }
        settled
    };

    let color = group(Role::Color, "", None);
    let mut frame = Frame::new(rgb(color.mean)?)?;
    if let Some(variance) = color.variance {
        frame = frame.with_variance_of_mean(rgb(variance)?)?;
    }
    if let Some([a, b]) = color.halves {
        frame = frame.with_halves([rgb(a)?, rgb(b)?])?;
    }
    for choice in choices {
        let Role::Feature(kind) = choice.target.role else { continue };
        if choice.target.statistic == Statistic::Mean {
            let name = &choice.target.feature;
            let Settled { mean, variance, halves } = group(choice.target.role, name, Some(kind));
            let mut feature = Feature::new(name.clone(), kind, mean);
            feature.var_of_mean = variance;
            feature.halves = halves;
            frame = frame.with_feature(feature)?;
        }
    }
    Ok(match samples.mean() {
        Some(spp) => frame.with_spp(spp),
        None => frame,
    })
}

/// The planes of one role.
struct Group {
    mean: Vec<Plane>,
    variance: Option<(Statistic, Vec<Plane>)>,
    halves: [Option<Vec<Plane>>; 2],
}

/// The same as the frame wants them.
struct Settled {
    mean: Vec<Plane>,
    variance: Option<Vec<Plane>>,
    halves: Option<[Vec<Plane>; 2]>,
}

impl Settled {
    /// Depth and position of what is not there are brought into range.
    fn bound_misses(&mut self, name: &str, remarks: &mut Remarks) {
        let mut misses = 0;
        for (c, plane) in self.mean.iter_mut().enumerate() {
            misses += misses::bound(plane, self.variance.as_mut().map(|variance| &mut variance[c]));
        }
        for plane in self.halves.iter_mut().flatten().flatten() {
            misses::bound(plane, None);
        }
        if misses > 0 {
            remarks.notes.push(format!(
                "{name}: {misses} values beyond any surface (misses) were moved to the end of the range"
            ));
        }
    }
}

impl Group {
    fn settle(
        self,
        name: &str,
        given: Option<VarianceKind>,
        samples: &Samples,
        remarks: &mut Remarks,
    ) -> Settled {
        let Group { mean, variance, halves } = self;
        let same_count = |planes: &Vec<Plane>| planes.len() == mean.len();
        let halves = match halves {
            [Some(a), b] if same_count(&a) => {
                let b = b.filter(same_count).unwrap_or_else(|| other_half(&mean, &a));
                Some([a, b])
            }
            _ => None,
        };
        let stored = variance.filter(|(_, planes)| same_count(planes) && given != Some(VarianceKind::Halves));
        let converted = stored.and_then(|(statistic, mut planes)| {
            let Statistic::Variance(by_name) = statistic else { return None };
            let kind = given.unwrap_or(by_name);
            let convert = |(stored, mean)| to_variance_of_mean(kind, stored, mean, samples);
            match planes.iter_mut().zip(&mean).try_for_each(convert) {
                Ok(()) => Some(planes),
                Err(error) => {
                    remarks.cannot_convert(name, &error);
                    None
                }
            }
        });
        let variance = converted.or_else(|| {
            let [a, b] = halves.as_ref()?;
            remarks
                .notes
                .push(format!("{name}: its variance is estimated from the difference of its halves"));
            Some(a.iter().zip(b).map(|(a, b)| from_halves(a, b)).collect())
        });
        Settled { mean, variance, halves }
    }
}

/// `2·mean − A`.
fn other_half(mean: &[Plane], a: &[Plane]) -> Vec<Plane> {
    let other = |(mean, a): (&Plane, &Plane)| {
        Plane::from_fn(mean.width(), mean.height(), |x, y| 2.0 * mean.get(x, y) - a.get(x, y))
    };
    mean.iter().zip(a).map(other).collect()
}

/// Three planes as they are, or one for all three channels.
fn rgb(planes: Vec<Plane>) -> Result<Rgb> {
    let count = planes.len();
    match planes.try_into() {
        Ok(rgb) => Ok(rgb),
        Err(planes) => match <[Plane; 1]>::try_from(planes) {
            Ok([gray]) => Ok([gray.clone(), gray.clone(), gray]),
            Err(_) => Err(Error::new(
                ErrorKind::Lacking,
                format!(
                    "the colour or one of its statistics has {count} channels where 3 (or 1) were expected"
                ),
            )
            .remedy("name them by --map color=R,G,B")),
        },
    }
}

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
