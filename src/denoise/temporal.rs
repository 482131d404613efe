//! Frames beside the one that is denoised: which of them can be used, and what their samples are.
//!
//! A frame beside is repaired and its features are filtered on its own pixels, as if it were denoised
//! itself; then all its planes are brought to this frame's pixels by [`super::warp`].

use super::facts::Facts;
use super::guides::{Guided, Guides};
use super::observer::{Log, Unheard};
use super::part::Part;
use super::prepare::{Prepared, prepare};
use super::signal::Signal;
use super::variance;
use super::warp::{Flow, Vectors, distrust_copies, distrust_surfaces, steadiness};
use crate::error;
use crate::frame::{Beside, FeatureKind, Frame, Motion, Outline};
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

/// A frame beside, brought to the pixels of the one that is denoised, with the same kinds of planes.
pub(super) struct Warped {
    /// R, G, B of the noisy colour, then of every AOV.
    pub targets: Vec<Plane>,
    /// Variance of the colour's mean, smoothed.
    pub variance: Rgb,
    /// The sum of its channels.
    pub noise: Plane,
    /// The planes of the design.
    pub features: Vec<Plane>,
    /// The albedo plus its floor.
    pub albedo: Option<Rgb>,
    /// What all kernels compare.
    pub guides: Guides,
    /// How far the light is the same in both frames, 0 to 1.
    pub steady: Plane,
    /// What every sample's weight is multiplied by, 0 to 1.
    pub trust: Plane,
    /// Share of the pixels that could be trusted but for their noise, which is this frame's.
    pub copied: f32,
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

/// The way from a frame to those on one side of it.
struct Way<'a> {
    side: Side,
    flow: Flow,
    /// Of the frame in which the flow ends, as the next is.
    motion: Option<&'a Motion>,
    origin: (i32, i32),
    /// Some frame on it has vectors: what has none is then not known to stand still.
    moves: bool,
}

impl<'a> Way<'a> {
    /// Ends where it begins, in a frame of this outline and motion.
    fn new(side: Side, outline: &Outline, motion: Option<&'a Motion>) -> Self {
        Self {
            side,
            flow: Flow::still(outline.size),
            motion,
            origin: outline.origin,
            moves: motion.is_some(),
        }
    }

    /// Goes on to the `next` frame.
    ///
    /// # Errors
    /// In words, why there is no way.
    fn further(&mut self, next: &'a Frame) -> Result<(), String> {
        let vectors = self.side.vectors(self.motion);
        self.moves |= next.motion().is_some();
        if vectors.is_none() && self.moves {
            return Err("there are motion vectors, but none that lead there".to_owned());
        }
        let ((x, y), (next_x, next_y)) = (self.origin, next.origin());
        let shift = [(x, next_x), (y, next_y)].map(|(from, to)| (i64::from(from) - i64::from(to)) as f32);
        self.flow.further(vectors, self.side.back().vectors(next.motion()), shift);
        (self.motion, self.origin) = (next.motion(), next.origin());
        Ok(())
    }
}

/// Brings all of `neighbours` that can be used to the pixels, the exposure and the columns of the frame of this `outline`
/// and these `facts`, of which `ready` was made, and tells which they are and why others are not.
///
/// # Errors
/// When the run is to stop.
pub(super) fn warped(
    outline: &Outline,
    ready: &Prepared<'_>,
    neighbours: &Neighbours<'_>,
    facts: &Facts,
    options: &Options,
    log: &mut Log<'_>,
) -> error::Result<Vec<Warped>> {
    let part = &Part::whole(outline.size);
    let mut found = vec![];
    for (side, frames, sign) in [(Side::Before, &neighbours.before, -1), (Side::After, &neighbours.after, 1)]
    {
        let mut way = Way::new(side, outline, ready.motion.as_deref());
        for (n, neighbour) in frames.iter().enumerate() {
            let offset = sign * (n as i32 + 1);
            let beyond = comparable(outline, &neighbour.outline()).and_then(|()| way.further(neighbour));
            if let Err(why) = beyond {
                log.note(format!("the frame at {offset:+} and those beyond it are not used: {why}"));
                break;
            }
            let own = Facts::of(neighbour);
            let unheard = Unheard(log.observer);
            let its_log = &mut Log::new(&unheard, options);
            let there = prepare((*neighbour).into(), &own, facts, part, options, its_log)?;
            let warped = warp(&ready.signal, &there.signal, &way.flow, options);
            let pixels = warped.trust.data().len() as f64;
            let trusted = warped.trust.data().iter().map(|t| f64::from(*t)).sum::<f64>() / pixels;
            log.summary.beside.push(Beside { offset, trusted: trusted as f32, copied: warped.copied });
            found.push(warped);
        }
    }
    Ok(found)
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

fn warp(here: &Signal, there: &Signal, flow: &Flow, options: &Options) -> Warped {
    let rgb = |planes: &Rgb| planes.each_ref().map(|plane| flow.warp(plane));
    let mut trust = flow.trust();
    let columns = here.design.planes.iter().zip(&here.design.kinds);
    let features = there.design.planes.iter().zip(columns).map(|(there, (here, kind))| {
        let warped = flow.warp(there);
        distrust_surfaces(&mut trust, *kind, here, &warped);
        seen_from_here(*kind, here, warped)
    });
    let features: Vec<Plane> = features.collect();
    let targets: Vec<Plane> = there.targets.iter().map(|plane| flow.warp(plane)).collect();
    let color: [&Plane; 3] = std::array::from_fn(|c| &targets[c]);
    let (noise, smoothed) = (rgb(&there.variance.each_ref().map(variance::trusted)), rgb(&there.smoothed));
    let colors = [here.color(), color];
    let steady = steadiness(&trust, colors, [&here.smoothed, &smoothed]);
    trust.data_mut().iter_mut().zip(steady.data()).for_each(|(trust, steady)| *trust *= steady);
    let copied = distrust_copies(&mut trust, colors, &here.smoothed);
    let albedo = there.design.albedo.as_ref().map(rgb);
    let guided = Guided {
        color,
        variance: &noise,
        trusted: Plane::clone, // it was trusted before it was warped
        albedo: albedo.as_ref(),
        features: &features,
        spreads: &here.design.spreads,
    };
    Warped {
        guides: Guides::default().turned_to(options.stages.iter().flatten(), guided, options, None),
        noise: sum_of_channels(&smoothed),
        variance: smoothed,
        targets,
        features,
        albedo,
        steady,
        trust,
        copied,
    }
}

/// Where a point lies depends on where it is seen from, and the light on it does not: a column of the
/// fit is to say the same of it in all frames.
fn seen_from_here(kind: FeatureKind, here: &Plane, warped: Plane) -> Plane {
    match kind {
        FeatureKind::Depth | FeatureKind::Position => here.clone(),
        _ => warped,
    }
}
