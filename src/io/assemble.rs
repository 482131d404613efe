//! A frame from the planes that play a role.

use std::collections::BTreeMap;

use super::bounds;
use super::channels::{Flow, Role, Statistic, VarianceKind};
use super::layers::Channel;
use super::mapping::Target;
use super::roles::Choice;
use super::statistics::Statistics;
use super::variance::{Samples, to_variance_of_mean};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{Aov, Feature, Frame, Motion};
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

    /// Everything that `choices` have for a role.
    fn group(&mut self, choices: &[Choice], role: Role, feature: &str) -> Group {
        let mut take = |wanted: fn(Statistic) -> bool| {
            let choice = choices.iter().find(|choice| {
                let target = &choice.target;
                target.role == role && target.feature == feature && wanted(target.statistic)
            })?;
            Some((choice.target.statistic, self.take(choice)))
        };
        let mean = take(|s| s == Statistic::Mean).map(|(_, planes)| planes).unwrap_or_default();
        let variance = take(|s| matches!(s, Statistic::Variance(_)));
        let halves = [take(|s| s == Statistic::HalfA), take(|s| s == Statistic::HalfB)];
        Group { mean, variance, halves: halves.map(|half| half.map(|(_, planes)| planes)) }
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

/// Builds the frame of a picture, or of a part of one whose channels have these `statistics` as a whole.
/// `choices` begin with the colour, each feature's mean stands before its companions.
///
/// # Errors
/// `Lacking` when the colour does not have one or three channels, or a statistic another number than its mean.
pub(super) fn assemble(
    choices: &[Choice],
    mut planes: Planes,
    statistics: &BTreeMap<Channel, Statistics>,
    given: Given,
    remarks: &mut Remarks,
) -> Result<Frame> {
    let counts = choices.iter().find(|choice| choice.target.role == Role::SampleCount);
    let counts = counts.and_then(|choice| {
        Some((planes.take(choice).into_iter().next()?, &statistics[choice.channels.first()?]))
    });
    let samples = Samples::new(given.spp, counts);

    let color = planes.group(choices, Role::Color, "").settle("color", given.kind, &samples, remarks)?;
    let mut frame = Frame::new(rgb(color.mean)?)?;
    if let Some(variance) = color.variance {
        frame = frame.with_variance_of_mean(rgb(variance)?)?;
    }
    if let Some([a, b]) = color.halves {
        frame = frame.with_halves([rgb(a)?, rgb(b)?])?;
    }
    for Choice { target: Target { role, feature: name, statistic }, channels } in choices {
        let (Role::Feature(kind), Statistic::Mean) = (*role, statistic) else { continue };
        let settled = planes.group(choices, *role, name).settle(name, given.kind, &samples, remarks)?;
        let mut feature = Feature::new(name.clone(), kind, settled.mean);
        feature.var_of_mean = settled.variance;
        feature.halves = settled.halves;
        let statistics: Vec<Statistics> = channels.iter().map(|channel| statistics[channel]).collect();
        bounds::bound(&mut feature, &statistics);
        frame = frame.with_feature(feature)?;
    }
    for choice in choices.iter().filter(|choice| choice.target.role == Role::Aov) {
        let color = rgb(planes.take(choice))?;
        frame = frame.with_aov(Aov { name: choice.target.feature.clone(), color })?;
    }
    if let Some(motion) = motion(choices, &mut planes)? {
        frame = frame.with_motion(motion)?;
    }
    Ok(match samples.mean() {
        Some(spp) => frame.with_spp(spp),
        None => frame,
    })
}

/// The motion vectors, all to the right and down from here.
fn motion(choices: &[Choice], planes: &mut Planes) -> Result<Option<Motion>> {
    let mut motion = Motion::default();
    for choice in choices {
        let Role::Motion(flow) = choice.target.role else { continue };
        let mut vectors = planes.take(choice);
        let expected = if flow == Flow::Cycles { 4 } else { 2 };
        if vectors.len() != expected {
            let what = format!("the motion has {} channels where {expected} were expected", vectors.len());
            return Err(Error::new(ErrorKind::Lacking, what).remedy("name them by --map motionPrevious=X,Y"));
        }
        let mut turned = |signs: [f32; 2]| -> [Plane; 2] {
            let mut turn = |sign: f32| {
                let mut plane = vectors.remove(0);
                plane.data_mut().iter_mut().for_each(|v| *v *= sign);
                plane
            };
            signs.map(&mut turn)
        };
        match flow {
            Flow::Previous => motion.previous = Some(turned([1.0, 1.0])),
            Flow::Next => motion.next = Some(turned([1.0, 1.0])),
            Flow::Cycles => {
                motion.previous = Some(turned([1.0, -1.0]));
                motion.next = Some(turned([-1.0, 1.0]));
            }
        }
    }
    Ok((motion != Motion::default()).then_some(motion))
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

impl Group {
    /// # Errors
    /// `Lacking` when a statistic does not have the mean's number of channels.
    fn settle(
        self,
        name: &str,
        given: Option<VarianceKind>,
        samples: &Samples,
        remarks: &mut Remarks,
    ) -> Result<Settled> {
        let Group { mean, variance, halves } = self;
        let planes = variance.iter().map(|(_, planes)| planes).chain(halves.iter().flatten());
        for planes in planes {
            check_count(name, planes.len(), mean.len())?;
        }
        let halves = match halves {
            [Some(a), Some(b)] => Some([a, b]),
            [Some(a), None] => {
                let b = other_half(&mean, &a);
                Some([a, b])
            }
            [None, Some(b)] => Some([other_half(&mean, &b), b]),
            [None, None] => None,
        };
        let stored = variance.filter(|_| given != Some(VarianceKind::Halves));
        let variance = stored.and_then(|(statistic, mut planes)| {
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
        Ok(Settled { mean, variance, halves })
    }
}

/// Refuses statistics of `name` that have another number of channels than its mean.
fn check_count(name: &str, got: usize, expected: usize) -> Result<()> {
    if got == expected {
        return Ok(());
    }
    let or_one = if expected > 1 { " (or 1)" } else { "" };
    let what = format!("a statistic of {name} has {got} channels where {expected}{or_one} were expected");
    Err(Error::new(ErrorKind::Lacking, what).remedy("map it to the channels that its mean has, or to none"))
}

/// `2·mean − half`.
fn other_half(mean: &[Plane], half: &[Plane]) -> Vec<Plane> {
    let other = |(mean, half): (&Plane, &Plane)| {
        Plane::par_from_fn(mean.width(), mean.height(), |x, y| 2.0 * mean.get(x, y) - half.get(x, y))
    };
    mean.iter().zip(half).map(other).collect()
}

/// Three planes as they are, or one for all three channels.
pub(super) fn rgb(planes: Vec<Plane>) -> Result<Rgb> {
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
