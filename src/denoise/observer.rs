//! Who hears how a run goes on, and can stop it.

use crate::error::{Error, ErrorKind, Result};
use crate::frame::Summary;
use crate::options::Options;
use std::fmt;

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

impl Stage {
    /// Where it begins and ends in a run by `options`, as shares of the run: by experience nearly all of it is fitting.
    fn span(self, options: &Options) -> [f32; 2] {
        const FITS: [f32; 2] = [0.06, 0.99];
        /// What the fits of the picture at half its resolution take, in stages of the whole one.
        const COARSE: f32 = 0.5;
        let coarse = if options.coarse { COARSE } else { 0.0 };
        let after = |fits: f32| FITS[0] + (FITS[1] - FITS[0]) * fits / (coarse + options.stages.len() as f32);
        match self {
            Stage::Sanitize => [0.0, 0.005],
            Stage::Outliers => [0.005, 0.01],
            Stage::Prefilter => [0.01, 0.04],
            Stage::Noise => [0.04, FITS[0]],
            Stage::Coarse => [FITS[0], after(coarse)],
            Stage::Fit(n) => [coarse + n as f32 - 1.0, coarse + n as f32].map(after),
            Stage::Energy => [FITS[1], 1.0],
        }
    }
}

/// Its name in reports and on the progress bar.
impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Stage::Sanitize => f.write_str("sanitize"),
            Stage::Outliers => f.write_str("outliers"),
            Stage::Prefilter => f.write_str("prefilter"),
            Stage::Noise => f.write_str("noise"),
            Stage::Coarse => f.write_str("coarse"),
            Stage::Fit(n) => write!(f, "fit {n}"),
            Stage::Energy => f.write_str("energy"),
        }
    }
}

/// Hears how a run goes on, and can stop it. The library itself never prints and reads no clock.
pub trait Observer: Sync {
    /// A stage begins.
    fn stage(&self, _stage: Stage) {}
    /// The share of the run that is done, 0 to 1, as far as it can be foreseen. May be called from any thread, of two at
    /// once in any order.
    fn progress(&self, _done: f32) {}
    /// Whether the run is to stop: it then ends soon, with [`ErrorKind::Stopped`] and no result. Asked often, from any
    /// thread: at every stage, and within the long ones at every tile or band.
    fn is_stopped(&self) -> bool {
        false
    }
}

impl dyn Observer + '_ {
    /// An error where the run is to stop.
    pub(super) fn go_on(&self) -> Result<()> {
        if self.is_stopped() {
            return Err(Error::new(ErrorKind::Stopped, "the run was told to stop"));
        }
        Ok(())
    }
}

/// Hears nothing.
pub struct Silent;

impl Observer for Silent {}

/// What a run tells: as it goes on to an observer, at its end by its summary.
pub struct Log<'a> {
    pub observer: &'a dyn Observer,
    options: &'a Options,
    /// The current stage's.
    span: [f32; 2],
    pub summary: Summary,
}

impl<'a> Log<'a> {
    /// Of a run by `options` that `observer` hears.
    pub fn new(observer: &'a dyn Observer, options: &'a Options) -> Self {
        let summary = Summary { method: "apr", ..Summary::default() };
        Self { observer, options, span: [0.0, 1.0], summary }
    }

    /// Of work that nobody asks about.
    pub fn silent(options: &'a Options) -> Self {
        Self::new(&Silent, options)
    }

    /// A stage begins.
    ///
    /// # Errors
    /// When the run is to stop.
    pub fn begin(&mut self, stage: Stage) -> Result<()> {
        self.span = stage.span(self.options);
        self.observer.stage(stage);
        self.progress(0.0);
        self.observer.go_on()
    }

    /// The share of the current stage that is done.
    pub fn progress(&self, done: f32) {
        let [from, to] = self.span;
        self.observer.progress(from + (to - from) * done);
    }

    /// Something was done without or left out, and why.
    pub fn note(&mut self, note: impl Into<String>) {
        self.summary.notes.push(note.into());
    }
}

/// Hears a run of its own as the current stage of another.
pub struct AsStage<'a>(pub &'a Log<'a>);

impl Observer for AsStage<'_> {
    fn progress(&self, done: f32) {
        self.0.progress(done);
    }

    fn is_stopped(&self) -> bool {
        self.0.observer.is_stopped()
    }
}

/// Hears nothing of a run, but stops it with another.
pub struct Unheard<'a>(pub &'a dyn Observer);

impl Observer for Unheard<'_> {
    fn is_stopped(&self) -> bool {
        self.0.is_stopped()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stage_begins_where_the_one_before_ends() {
        for (name, options) in Options::PRESETS {
            let options = options();
            let fits = (1..=options.stages.len()).map(Stage::Fit);
            let coarse = options.coarse.then_some(Stage::Coarse);
            let stages = [Stage::Sanitize, Stage::Outliers, Stage::Prefilter, Stage::Noise].into_iter();
            let stages = stages.chain(coarse).chain(fits).chain([Stage::Energy]);
            let end = stages.fold(0.0, |end, stage| {
                let [from, to] = stage.span(&options);
                assert!((from - end).abs() < 1e-6 && from < to, "{name}: {stage:?} is {from} to {to}");
                to
            });
            assert_eq!(end, 1.0);
        }
    }
}
