//! How far the run is: a bar on a terminal, lines for programs otherwise.

use std::io::{IsTerminal, Write};
use std::sync::Mutex;

use indicatif::{ProgressBar, ProgressStyle};

/// Steps of the plain lines, in per cent.
const STEP: u32 = 5;

/// Where the progress is shown. It never goes back.
pub struct Progress {
    shown: Shown,
    /// How many stages of fits there will be.
    fits: usize,
    state: Mutex<State>,
}

enum Shown {
    Nowhere,
    Bar(ProgressBar),
    Lines,
}

/// The run's part that the current stage covers, in per cent, and what was told last.
struct State {
    from: f32,
    to: f32,
    told: u32,
}

impl Progress {
    /// For a run with so many stages of fits. Nothing is shown when `quiet`.
    pub fn new(quiet: bool, fits: usize) -> Self {
        let shown = match (quiet, std::io::stderr().is_terminal()) {
            (true, _) => Shown::Nowhere,
            (false, true) => {
                let style = ProgressStyle::with_template("{msg:12} {bar:40} {percent:>3} % {elapsed}");
                Shown::Bar(ProgressBar::new(100).with_style(style.expect("the template is constant")))
            }
            (false, false) => Shown::Lines,
        };
        Self { shown, fits, state: Mutex::new(State { from: 0.0, to: 0.0, told: 0 }) }
    }

    /// A stage begins.
    pub fn stage(&self, name: &str) {
        if let Shown::Bar(bar) = &self.shown {
            bar.set_message(name.to_owned());
        }
        {
            let mut state = self.state.lock().expect("no holder panics");
            state.from = state.to;
            state.to = end_of(name, state.to, self.fits);
        }
        self.share(0.0);
    }

    /// The share of the current stage that is done.
    pub fn share(&self, done: f32) {
        let mut state = self.state.lock().expect("no holder panics");
        let percent = (state.from + (state.to - state.from) * done.clamp(0.0, 1.0)) as u32;
        match &self.shown {
            Shown::Nowhere => {}
            Shown::Bar(bar) => bar.set_position(u64::from(percent)),
            Shown::Lines if percent >= state.told + STEP => {
                state.told = percent / STEP * STEP;
                line(state.told);
            }
            Shown::Lines => {}
        }
    }

    /// The run is over.
    pub fn finish(&self) {
        match &self.shown {
            Shown::Nowhere => {}
            Shown::Bar(bar) => bar.finish_and_clear(),
            Shown::Lines => line(100),
        }
    }
}

/// Where a stage ends, in per cent of the run: by experience nearly all of it is fitting.
fn end_of(stage: &str, before: f32, fits: usize) -> f32 {
    const FITS_BEGIN: f32 = 8.0;
    const FITS_END: f32 = 96.0;
    let end = match stage {
        "read" => 2.0,
        "sanitize" | "outliers" => 3.0,
        "prefilter" => FITS_BEGIN,
        "energy" => 97.0,
        "write" => 100.0,
        _ => before + (FITS_END - FITS_BEGIN) / fits as f32,
    };
    end.max(before)
}

/// The protocol of render farms: `progress NN` on the standard output. Nobody has to listen.
fn line(percent: u32) {
    let _ = writeln!(std::io::stdout(), "progress {percent}");
}
