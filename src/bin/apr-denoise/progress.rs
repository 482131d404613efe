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
    /// For so many frames. There are no lines where nobody `listens` to the standard output.
    pub fn new(style: Style, listens: bool, frames: usize) -> Self {
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
        Self { shown, state }
    }

    /// The progress of the frame of this index; `label` is put before its stages on a terminal.
    pub fn of_frame(&self, index: usize, label: Option<String>) -> FrameProgress<'_> {
        FrameProgress { all: self, index, label }
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
}

impl FrameProgress<'_> {
    /// A stage begins.
    pub fn stage(&self, name: &str) {
        if let Shown::Bar(bar) = &self.all.shown {
            let label = self.label.as_deref().map_or(String::new(), |label| format!("{label} "));
            bar.set_message(format!("{label}{name}"));
        }
        match name {
            "read" => self.all.set(self.index, 0.0),
            "write" => self.share(1.0),
            other => share_of_bands(other).into_iter().for_each(|done| self.share(done)),
        }
    }

    /// The share of the work between reading and writing that is done.
    pub fn share(&self, done: f32) {
        /// Where that begins and ends, in per cent of the frame: by experience.
        const WORK: [f32; 2] = [2.0, 97.0];
        self.all.set(self.index, (WORK[0] + (WORK[1] - WORK[0]) * done).into());
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

/// The share of all bands that is done when the stage `band 2 of 5` begins; none of other stages.
fn share_of_bands(stage: &str) -> Option<f32> {
    let (band, bands) = stage.strip_prefix("band ")?.split_once(" of ")?;
    Some((band.parse::<f32>().ok()? - 1.0) / bands.parse::<f32>().ok()?)
}

/// The protocol of render farms: `progress NN` on the standard output. Nobody has to listen.
fn line(percent: u32) {
    let _ = print(&format!("progress {percent}"));
}
