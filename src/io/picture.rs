//! A render on disk: read into a frame, and written again with a new beauty.

use std::path::{Path, PathBuf};

use super::channels::{Renderer, VarianceKind};
use super::layout::Layout;
use super::mapping::Mapping;
use super::sums::SumCheck;
use super::survey::Survey;
use crate::error::Result;
use crate::frame::{Denoised, Frame};
use crate::image::Plane;

/// How to understand a file.
#[derive(Debug, Clone, Default)]
pub struct ReadOptions {
    /// The renderer, where it is not to be guessed.
    pub profile: Option<Renderer>,
    /// Roles that the user assigns; they win over the channel map.
    pub map: Vec<Mapping>,
    /// Further features.
    pub features: Vec<Mapping>,
    /// What variance buffers hold, where the channel map does not know.
    pub variance_kind: Option<VarianceKind>,
    /// Samples per pixel, where the header lacks it.
    pub spp: Option<f32>,
    /// The same frame rendered with another seed.
    pub half: Option<PathBuf>,
    /// Files with further layers, whose bare channels form a layer of the file's name.
    pub with: Vec<PathBuf>,
    /// Components of the beauty that are to go through its operator: layers by name, with or without what
    /// is around them, `*` at the end for any end; `auto` for all sets of layers that are known to sum to
    /// the beauty.
    pub aovs: Vec<String>,
    /// Whether motion vectors are wanted: only sequences have a use for them.
    pub motion: bool,
}

/// A file as the denoiser sees it.
#[derive(Debug)]
pub struct Picture {
    survey: Survey,
    frame: Frame,
    /// Samples of each pixel, or shares of them.
    counts: Option<Plane>,
}

impl Picture {
    /// Reads the file at `path`.
    ///
    /// # Errors
    /// `Unreadable` when a file is missing, damaged, beyond the limits, or uses a feature that is not
    /// supported; `Lacking` when there is no colour or a mapped channel is not there; `Usage` when a
    /// mapping names no role.
    pub fn read(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let (survey, frame, counts) = Survey::open_whole(path.as_ref(), options)?;
        Ok(Self { survey, frame, counts })
    }

    /// What the denoiser gets.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// What the denoiser gets, and what it takes to write the result.
    pub fn into_frame(self) -> (Survey, Frame) {
        (self.survey, self.frame)
    }

    /// The samples of each pixel, where the file tells; in any unit (Cycles writes shares).
    pub fn sample_counts(&self) -> Option<&Plane> {
        self.counts.as_ref()
    }

    /// What was found.
    pub fn layout(&self) -> &Layout {
        self.survey.layout()
    }

    /// As [`Survey::sums`].
    ///
    /// # Errors
    /// `Usage` when `denoised` is of another picture: it has other AOVs.
    pub fn sums(&self, denoised: &Denoised) -> Result<Vec<SumCheck>> {
        self.survey.sums(denoised)
    }

    /// As [`Survey::sign`].
    pub fn sign(&self, signature: impl Into<String>) {
        self.survey.sign(signature);
    }

    /// As [`Survey::write`].
    ///
    /// # Errors
    /// `Usage` when `denoised` is of another picture; `Misplaced` or `Unwritable` when the folder or the disk does not
    /// take it: `target` is then as it was.
    pub fn write(&self, target: impl AsRef<Path>, denoised: &Denoised, aux: bool) -> Result<Vec<String>> {
        self.survey.write(target, denoised, aux)
    }
}
