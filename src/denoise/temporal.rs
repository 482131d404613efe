//! Frames beside the one that is denoised: which of them can be used, and what their samples are.
//!
//! A frame beside is repaired and its features are filtered on its own pixels, as if it were denoised
//! itself; then all its planes are brought to this frame's pixels by [`super::warp`].

use super::guides::{Guided, Guides};
use super::solver::Beside as Samples;
use super::warp::{Flow, Vectors, distrust_copies, distrust_surfaces, steadiness};
use super::{Design, Ready, targets, variance};
use crate::frame::{Beside, FeatureKind, Frame, Motion, Outline, Summary};
use crate::image::{Plane, Rgb, sum_of_channels};
use crate::options::Options;

/// The frames before and after one, each list beginning with the nearest and without gaps.
#[derive(Debug, Clone, Default)]
pub struct Neighbours<'a> {
    /// Those before, the nearest first.
    pub before: Vec<&'a Frame>,
    /// Those after, the nearest first.
    pub after: Vec<&'a Frame>,
}

/// A frame beside on the pixels of the one that is denoised.
pub(super) struct Warped {
    pub targets: Vec<Plane>,
    pub variance: Rgb,
    pub noise: Plane,
    pub features: Vec<Plane>,
    pub albedo: Option<Rgb>,
    pub guides: Guides,
    pub steady: Plane,
    pub trust: Plane,
}

impl Warped {
    /// As the fits read it.
    pub fn samples(&self) -> Samples<'_> {
        Samples {
            targets: self.targets.iter().collect(),
            variance: &self.variance,
            noise: &self.noise,
            features: &self.features,
            guides: &self.guides,
            albedo: self.albedo.as_ref(),
            steady: &self.steady,
            trust: &self.trust,
        }
    }
}

/// The direction in time.
#[derive(Clone, Copy)]
enum Side {
    Before,
    After,
}

impl Side {
    /// The vectors of `motion` that lead further to this side.
    fn vectors(self, motion: Option<&Motion>) -> Option<&Vectors> {
        match self {
            Side::Before => motion?.previous.as_ref(),
            Side::After => motion?.next.as_ref(),
        }
    }

    fn back(self) -> Self {
        match self {
            Side::Before => Side::After,
            Side::After => Side::Before,
        }
    }
}

/// Brings all of `neighbours` that can be used to the pixels of the frame of this `outline`, of which `ready` was made, and
/// says in `summary` which they are and why others are not.
pub(super) fn warped(
    outline: &Outline,
    ready: &Ready<'_>,
    neighbours: &Neighbours<'_>,
    options: &Options,
    prepare: impl Fn(&Frame) -> Ready<'_>,
    summary: &mut Summary,
) -> Vec<Warped> {
    let mut found = vec![];
    for (side, frames, sign) in [(Side::Before, &neighbours.before, -1), (Side::After, &neighbours.after, 1)]
    {
        let motion = ready.clean.motion.as_deref();
        let (mut flow, mut last) = (Flow::still(outline.size), motion);
        for (n, neighbour) in frames.iter().enumerate() {
            let offset = sign * (n as i32 + 1);
            if let Err(why) = comparable(outline, &neighbour.outline()) {
                summary
                    .notes
                    .push(format!("the frame at {offset:+} and those beyond it are not used: {why}"));
                break;
            }
            match (side.vectors(last), motion) {
                (Some(vectors), _) => {
                    flow = flow.further(vectors, side.back().vectors(neighbour.motion()));
                }
                (None, None) => {}
                (None, Some(_)) => {
                    let why = "there are motion vectors, but none that lead there";
                    summary.notes.push(format!("the frame at {offset:+} is not used: {why}"));
                    break;
                }
            }
            let warped = warp(ready, &prepare(neighbour), &flow, options);
            let pixels = warped.trust.data().len() as f64;
            let trusted = warped.trust.data().iter().map(|t| f64::from(*t)).sum::<f64>() / pixels;
            summary.beside.push(Beside { offset, trusted: trusted as f32 });
            found.push(warped);
            last = neighbour.motion();
        }
    }
    found
}

/// Whether two frames have the same kinds of planes.
fn comparable(frame: &Outline, other: &Outline) -> Result<(), String> {
    if frame.size != other.size {
        let ((w, h), (ow, oh)) = (frame.size, other.size);
        return Err(format!("it is {ow}×{oh} where this one is {w}×{h}"));
    }
    if frame.features != other.features {
        let list = |outline: &Outline| {
            let features = outline.features.iter();
            let told = features.map(|(name, kind, planes)| format!("{name} ({planes}) as {kind:?}"));
            told.collect::<Vec<_>>().join(", ")
        };
        let (has, wanted) = (list(other), list(frame));
        return Err(format!("its features are '{has}' where this one's are '{wanted}'"));
    }
    if frame.aovs != other.aovs {
        return Err("it has other components".to_owned());
    }
    Ok(())
}

fn warp(here: &Ready, there: &Ready, flow: &Flow, options: &Options) -> Warped {
    let rgb = |planes: &Rgb| planes.each_ref().map(|plane| flow.warp(plane));
    let mut trust = flow.trust();
    let features = there.design.iter().zip(&here.design).map(|(there, here)| {
        let warped = flow.warp(&there.plane);
        distrust_surfaces(&mut trust, here.kind, &here.plane, &warped);
        seen_from_here(here, warped)
    });
    let features: Vec<Plane> = features.collect();
    let (color, noise) = (rgb(&there.clean.color), rgb(&there.variance.each_ref().map(variance::trusted)));
    let smoothed = rgb(&there.smoothed);
    let colors = [&here.clean.color, &color];
    let steady = steadiness(&trust, colors, [&here.smoothed, &smoothed]);
    trust.data_mut().iter_mut().zip(steady.data()).for_each(|(trust, steady)| *trust *= steady);
    distrust_copies(&mut trust, colors, &here.smoothed);
    let albedo = there.albedo.as_ref().map(rgb);
    let guided = Guided {
        color: color.each_ref(),
        variance: &noise,
        trusted: Plane::clone, // it was trusted before it was warped
        albedo: albedo.as_ref(),
        features: &features,
        spreads: &here.spreads,
    };
    Warped {
        targets: targets(&there.clean).map(|plane| flow.warp(plane)).collect(),
        guides: Guides::default().turned_to(options.stages.iter().flatten(), guided, options),
        noise: sum_of_channels(&smoothed),
        variance: smoothed,
        features,
        albedo,
        steady,
        trust,
    }
}

/// Where a point lies depends on where it is seen from, and the light on it does not: a column of the
/// fit is to say the same of it in all frames.
fn seen_from_here(here: &Design, warped: Plane) -> Plane {
    match here.kind {
        FeatureKind::Depth | FeatureKind::Position => here.plane.clone(),
        _ => warped,
    }
}
