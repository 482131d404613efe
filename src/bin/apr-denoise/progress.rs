//! How far the run is: a bar on a terminal, lines for programs otherwise.

use std::io::IsTerminal;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};

use crate::answer::print;

/// Steps of the plain lines, in per cent, and the least time between two of them: a log of many short frames would be
/// nothing else.
const STEP: u32 = 5;
const PAUSE: Duration = Duration::from_secs(1);
const DONE: u32 = 100;

/// What the fits of the picture at half its resolution take, in stages of the whole one.
pub const COARSE: f32 = 0.5;

/// How progress is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Style {
    /// A bar on a terminal, else lines.
    Auto,
    /// A bar, which only a terminal shows.
    Bar,
    /// Lines on the standard output.
    Lines,
    /// Not at all.
    None,
}

/// Where the progress of all frames is shown. It never goes back.
pub struct Progress {
    shown: Shown,
    /// How many stages of fits each frame has, in whole ones of the picture at its full resolution.
    fits: f32,
    state: Mutex<State>,
}

enum Shown {
    Nowhere,
    Bar(ProgressBar),
    Lines,
}

struct State {
    /// How far each frame is, in per cent.
    frames: Vec<f64>,
    /// Their sum.
    sum: f64,
    /// What was told last, and when.
    told: u32,
    at: Instant,
}

impl Progress {
    /// For so many frames with so many stages of fits; that of half the resolution counts [`COARSE`]. There are no
    /// lines where nobody `listens` to the standard output.
    pub fn new(style: Style, listens: bool, frames: usize, fits: f32) -> Self {
        let bar = || {
            let style = ProgressStyle::with_template("{msg:24} {bar:40} {percent:>3} % {elapsed}");
            Shown::Bar(ProgressBar::new(100).with_style(style.expect("the template is constant")))
        };
        let shown = match style {
            Style::Bar => bar(),
            Style::Auto if std::io::stderr().is_terminal() => bar(),
            Style::Auto | Style::Lines if listens => Shown::Lines,
            _ => Shown::Nowhere,
        };
        let state = Mutex::new(State { frames: vec![0.0; frames], sum: 0.0, told: 0, at: Instant::now() });
        Self { shown, fits, state }
    }

    /// The progress of the frame of this index; `label` is put before its stages on a terminal.
    pub fn of_frame(&self, index: usize, label: Option<String>) -> FrameProgress<'_> {
        let span = Mutex::new(Span { from: 0.0, to: 0.0 });
        FrameProgress { all: self, index, label, span }
    }

    /// Lets `speak` write lines where a bar may be.
    pub fn aside<T>(&self, speak: impl FnOnce() -> T) -> T {
        match &self.shown {
            Shown::Bar(bar) => bar.suspend(speak),
            _ => speak(),
        }
    }

    /// Nothing more is done for the frame of this index: it failed, and the run goes on.
    pub fn give_up(&self, index: usize) {
        self.set(index, DONE.into());
    }

    /// The run is over.
    pub fn finish(&self) {
        match &self.shown {
            Shown::Bar(bar) => bar.finish_and_clear(),
            Shown::Lines if locked(&self.state).frames.is_empty() => line(DONE), // nothing was left to do
            _ => {}
        }
    }

    fn set(&self, index: usize, percent: f64) {
        /// A hundred whole frames may sum to a little less.
        const ROUNDING: f64 = 1e-6;
        let mut state = locked(&self.state);
        state.sum += percent - std::mem::replace(&mut state.frames[index], percent);
        let percent = (state.sum / state.frames.len() as f64 + ROUNDING) as u32;
        match &self.shown {
            Shown::Nowhere => {}
            Shown::Bar(bar) => bar.set_position(u64::from(percent)),
            Shown::Lines
                if percent >= state.told + STEP && (percent == DONE || state.at.elapsed() >= PAUSE) =>
            {
                (state.told, state.at) = (percent / STEP * STEP, Instant::now());
                line(state.told);
            }
            Shown::Lines => {}
        }
    }
}

/// How far one frame is.
pub struct FrameProgress<'a> {
    all: &'a Progress,
    index: usize,
    label: Option<String>,
    span: Mutex<Span>,
}

/// The frame's part that the current stage covers, in per cent.
struct Span {
    from: f32,
    to: f32,
}

impl FrameProgress<'_> {
    /// A stage begins.
    pub fn stage(&self, name: &str) {
        if let Shown::Bar(bar) = &self.all.shown {
            let label = self.label.as_deref().map_or(String::new(), |label| format!("{label} "));
            bar.set_message(format!("{label}{name}"));
        }
        {
            let mut span = locked(&self.span);
            span.from = span.to;
            span.to = end_of(name, span.to, self.all.fits);
        }
        self.share(0.0);
    }

    /// The share of the current stage that is done.
    pub fn share(&self, done: f32) {
        let span = locked(&self.span);
        let percent = span.from + (span.to - span.from) * done.clamp(0.0, 1.0);
        self.all.set(self.index, percent.into());
    }

    /// The frame is done.
    pub fn finish(&self) {
        self.all.set(self.index, DONE.into());
    }
}

/// What `mutex` guards, which a panic cannot leave half-changed: each change is one step.
pub fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Where a stage ends, in per cent of the frame: by experience nearly all of it is fitting.
fn end_of(stage: &str, before: f32, fits: f32) -> f32 {
    const FITS_BEGIN: f32 = 8.0;
    const FITS_END: f32 = 96.0;
    const FITTING: f32 = FITS_END - FITS_BEGIN;
    let end = match stage {
        "read" => 2.0,
        "sanitize" | "outliers" => 3.0,
        "prefilter" => 6.0,
        "noise" => FITS_BEGIN,
        "energy" => 97.0,
        "write" => 100.0,
        "coarse" => (before + COARSE * FITTING / fits).min(FITS_END),
        other => match share_of_bands(other) {
            Some(done) => FITS_BEGIN + FITTING * done,
            None => (before + FITTING / fits).min(FITS_END),
        },
    };
    end.max(before)
}

/// The share that is done when the stage `band 2 of 5` ends; none of other stages.
fn share_of_bands(stage: &str) -> Option<f32> {
    let (band, bands) = stage.strip_prefix("band ")?.split_once(" of ")?;
    Some(band.parse::<f32>().ok()? / bands.parse::<f32>().ok()?)
}

/// The protocol of render farms: `progress NN` on the standard output. Nobody has to listen.
fn line(percent: u32) {
    let _ = print(&format!("progress {percent}"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_ascend_and_leave_room_for_the_rest() {
        let bands: Vec<String> = (1..=40).map(|n| format!("band {n} of 40")).collect();
        let fits: Vec<String> = (1..=9).map(|n| format!("fit {n}")).collect();
        for stages in [bands, fits] {
            let end = |before: f32, stage: &String| end_of(stage, before, 2.5);
            let ends = stages.iter().scan(end_of("read", 0.0, 2.5), |before, stage| {
                *before = end(*before, stage);
                Some(*before)
            });
            let ends: Vec<f32> = ends.collect();
            assert!(ends.is_sorted() && ends.iter().all(|&end| (2.0..=96.0).contains(&end)), "{ends:?}");
            assert_eq!(end_of("write", ends[ends.len() - 1], 2.5), 100.0);
        }
    }
}
