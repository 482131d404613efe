//! How far a render is.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::answer::print;

/// The least time between two plain lines.
const PAUSE: Duration = Duration::from_secs(1);

/// A bar on a terminal, plain lines elsewhere.
pub struct Progress {
    bar: Option<ProgressBar>,
    quiet: bool,
    total: u32,
    told: u32,
    at: Instant,
}

impl Progress {
    /// Of `total` samples per pixel, `done` by an earlier run.
    pub fn new(quiet: bool, total: u32, done: u32) -> Self {
        let style = ProgressStyle::with_template("{bar:40} {pos}/{len} samples per pixel, {eta} left");
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| ProgressBar::new(total.into()));
        let bar = bar.and_then(|bar| Some(bar.with_style(style.ok()?)));
        if let Some(bar) = &bar {
            // The time left follows from what this run does: its clock starts after the earlier run's samples.
            bar.set_position(done.into());
            bar.tick();
            bar.reset_eta();
        }
        Self { bar, quiet, total, told: 0, at: Instant::now() }
    }

    /// `done` samples per pixel are there.
    pub fn set(&mut self, done: u32) {
        let percent = (100 * u64::from(done) / u64::from(self.total)) as u32;
        match &self.bar {
            Some(bar) => bar.set_position(done.into()),
            None if !self.quiet
                && percent >= self.told + 5
                && (percent == 100 || self.at.elapsed() >= PAUSE) =>
            {
                let _ = print(&format!("progress {percent}")); // nobody has to listen
                (self.told, self.at) = (percent, Instant::now());
            }
            None => {}
        }
    }
}
