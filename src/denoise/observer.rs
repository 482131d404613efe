//! Who hears how a run goes on.

use crate::frame::Summary;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The stages of a run, in order, for progress and timing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// NaN, infinities and negative values.
    Sanitize,
    /// Fireflies are taken out.
    Outliers,
    /// Noisy features are filtered.
    Prefilter,
    /// The variance is estimated from a first fit, where nothing tells it.
    Noise,
    /// All fits of the picture at half its resolution.
    Coarse,
    /// Fits of stage `n`, counted from 1.
    Fit(usize),
    /// What the fit lost is restored and the outliers' energy is given back.
    Energy,
}

/// Hears how a run goes on. The library itself never prints and reads no clock.
pub trait Observer: Sync {
    /// A stage begins.
    fn stage(&self, _stage: Stage) {}
    /// The share of the current stage that is done, 0 to 1; may be called from any thread.
    fn progress(&self, _done: f32) {}
}

/// Hears nothing.
pub struct Silent;

impl Observer for Silent {}

/// What a run tells: as it goes on to an observer, at its end by its summary.
pub struct Log<'a> {
    pub observer: &'a dyn Observer,
    pub summary: Summary,
}

impl<'a> Log<'a> {
    /// Of a run that `observer` hears.
    pub fn new(observer: &'a dyn Observer) -> Self {
        Self { observer, summary: Summary { method: "apr", ..Summary::default() } }
    }

    /// Of work that nobody asks about.
    pub fn silent() -> Self {
        Self::new(&Silent)
    }

    /// A stage begins.
    pub fn begin(&self, stage: Stage) {
        self.observer.stage(stage);
    }

    /// Something was done without or left out, and why.
    pub fn note(&mut self, note: impl Into<String>) {
        self.summary.notes.push(note.into());
    }
}

/// Reports a multi-stage reconstruction to an observer as its current stage.
pub struct AsOne<'a> {
    observer: &'a dyn Observer,
    stages: usize,
    begun: AtomicUsize,
}

impl<'a> AsOne<'a> {
    /// For `stages` stages of fits.
    pub fn new(observer: &'a dyn Observer, stages: usize) -> Self {
        Self { observer, stages, begun: AtomicUsize::new(0) }
    }
}

impl Observer for AsOne<'_> {
    fn stage(&self, _stage: Stage) {
        self.begun.fetch_add(1, Ordering::Relaxed);
    }

    fn progress(&self, done: f32) {
        let before = self.begun.load(Ordering::Relaxed).saturating_sub(1);
        self.observer.progress((before as f32 + done) / self.stages as f32);
    }
}
