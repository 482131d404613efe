//! A part of a picture, and how far around it the stages look.
//!
//! Every stage looks a bounded distance around a pixel, whatever the picture shows. From the result back to
//! the file, with the window radius w, the patch radius p, tiles of side T and S stages:
//!
//! | what | looks | why |
//! |---|---|---|
//! | restored detail | 7 + 1 | two means, one of the other |
//! | the estimated error | 2 | means |
//! | the merge of the coarse picture | 7 | two means over 3×3 blocks, the block beside |
//! | each stage of fits | 3w + T − 1 | fits that reach the pixel, those that the coverage test sees with them (out to its tile's border), and their windows |
//! | each stage but the first | p + 3 | patches, and means of what the stage before missed |
//! | weights | p, 1 at least | patches, and slopes of features |
//! | features | search + patch + 1 | their filter, over variances that are smoothed |
//! | variance | smoothing + 3 + what outliers look | estimated over 7×7 pixels at most, outliers replaced |
//! | outliers | their radius, or w | neighbours, a window's light |
//! | where nothing tells it | 2 + a stage of fits | a mean of what those leave |
//! | what comes from blocks of 2×2 | twice, + 1 | fits, weights and smoothed variance of the coarse picture |
//! | repair | 16 | from the rim of what is broken |
//!
//! The first part of this file is that sum; a frame that holds so much around its part gives the
//! part's pixels the very bits that they have in the whole picture.

use super::{Facts, coarse, confidence, restore, sanitize, tiles, variance};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::Frame;
use crate::image::Rect;
use crate::options::Options;

/// How many pixels around a part must be known at most, of a picture of which `facts` are known.
pub fn halo(options: &Options, facts: &Facts) -> usize {
    reach(options, facts.noise_is_estimated()) + usize::from(options.coarse)
}

/// How far around a pixel the stages look, where the variance is known or `estimated`.
fn reach(options: &Options, estimated: bool) -> usize {
    let prefilter = &options.prefilter;
    let restored = if options.restore { restore::REACH } else { confidence::RADIUS };
    let fits_of = |stages: usize| {
        stages * tiles::reach(options.window_radius)
            + (stages - 1) * tiles::more_of_a_pilot(options)
            + options.largest_patch().max(1)
    };
    let fits = fits_of(options.stages.len());
    let feature = if prefilter.enabled { prefilter.window_radius + prefilter.patch_radius + 1 } else { 0 };
    let smoothing = options.variance_radius.max(variance::TRUSTED_RADIUS);
    let told = told(options);
    let noise =
        if estimated { variance::RESIDUAL_RADIUS + fits_of(1) + feature.max(smoothing + told) } else { told };
    let fine = fits + feature.max(smoothing + noise);
    let fitted = if options.coarse {
        // A block's border may lie a pixel beyond.
        coarse::REACH + fine.max(2 * (fits + smoothing) + 1 + feature.max(noise))
    } else {
        fine
    };
    restored + fitted + sanitize::REACH
}

/// How far around a pixel the outlier step looks, and the first estimate of the variance in what that leaves.
fn told(options: &Options) -> usize {
    let Options { outliers, window_radius, .. } = options;
    variance::REACH + if outliers.enabled { outliers.radius.max(*window_radius) } else { 0 }
}

/// A part of a picture that is denoised alone, and what must be read for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    pub(super) wanted: Rect,
    pub(super) read: Rect,
    /// Width and height of the picture.
    pub(super) picture: (usize, usize),
}

/// The rectangle, where it has pixels and all of them are in a picture of `size`.
fn inside(wanted: Rect, size: (usize, usize)) -> Result<Rect> {
    let Rect { x, y, width, height } = wanted;
    if width > 0 && height > 0 && Rect::whole(size).holds(wanted) {
        return Ok(wanted);
    }
    let what =
        format!("a part of {width}×{height} pixels from ({x}, {y}) of a picture of {}×{}", size.0, size.1);
    Err(Error::new(ErrorKind::Usage, what).remedy("give one inside the picture"))
}

impl Part {
    /// All of a picture.
    pub fn whole(size: (usize, usize)) -> Self {
        Self { wanted: Rect::whole(size), read: Rect::whole(size), picture: size }
    }

    /// The part `wanted` of a picture of `size`, of which `facts` are known.
    ///
    /// # Errors
    /// When it has no pixel or does not lie inside the picture.
    pub fn new(wanted: Rect, size: (usize, usize), options: &Options, facts: &Facts) -> Result<Self> {
        let read = inside(wanted, size)?.grown(reach(options, facts.noise_is_estimated()), size);
        let read = if options.coarse { read.in_whole_blocks(size) } else { read };
        Ok(Self { wanted, read, picture: size })
    }

    /// What must be read of a picture of `size` to find the outliers of its pixels `wanted` (see
    /// [`Facts::add_outliers`](super::Facts::add_outliers)).
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn of_outliers(wanted: Rect, size: (usize, usize), options: &Options) -> Result<Self> {
        let reach = sanitize::REACH + told(options);
        Ok(Self { wanted, read: inside(wanted, size)?.grown(reach, size), picture: size })
    }

    /// The pixels to denoise, in the picture's coordinates.
    pub fn wanted(&self) -> Rect {
        self.wanted
    }

    /// The pixels that the frame holds: those and the halo around them.
    pub fn read(&self) -> Rect {
        self.read
    }

    /// Whether nothing is read around it, as of a whole picture.
    pub fn is_whole(&self) -> bool {
        self.wanted == self.read
    }

    /// The column and row of the frame's first pixel.
    pub fn origin(&self) -> (usize, usize) {
        (self.read.x, self.read.y)
    }

    /// The pixels to denoise in the frame's own coordinates.
    pub fn within(&self) -> Rect {
        self.wanted.seen_from(self.origin())
    }

    pub(super) fn check(&self, frame: &Frame) -> Result<()> {
        let (got, expected) = ((frame.width(), frame.height()), self.read.size());
        if got == expected {
            return Ok(());
        }
        let what =
            format!("the frame is {}×{} where its part is {}×{}", got.0, got.1, expected.0, expected.1);
        Err(Error::new(ErrorKind::Usage, what).remedy("read the pixels that the part names"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_readme_tells_the_halo() {
        let told = format!("{} pixels by default", reach(&Options::default(), false) + 1);
        assert!(include_str!("../../README.md").contains(&told), "it is {told}");
    }
}
