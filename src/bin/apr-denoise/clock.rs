//! Seconds and memory of each stage: the library reads no clock, so the program does.

use std::sync::Mutex;
use std::time::Instant;

use apr::denoise::{Observer, Stage};
use serde::Serialize;

use crate::progress::FrameProgress;

/// What a stage cost.
#[derive(Debug, Clone, Serialize)]
pub struct Cost {
    /// Which one.
    pub stage: String,
    /// Wall clock.
    pub seconds: f64,
    /// Most memory that the process had resident during the stage, where the system tells and no other
    /// frame was worked on at the time.
    pub peak_memory_bytes: Option<u64>,
}

/// Measures a frame's stages and passes their progress on.
pub struct Clock<'a> {
    progress: FrameProgress<'a>,
    running: Mutex<Running>,
}

struct Running {
    /// No other frame is worked on, so that the process's memory is this frame's.
    alone: bool,
    done: Vec<Cost>,
    current: Option<(String, Instant)>,
}

impl<'a> Clock<'a> {
    /// Starts with no stage.
    pub fn new(progress: FrameProgress<'a>, alone: bool) -> Self {
        Self { progress, running: Mutex::new(Running { alone, done: Vec::new(), current: None }) }
    }

    /// The stage before ends here and `name` begins.
    pub fn begin(&self, name: &str) {
        {
            let mut running = self.running.lock().expect("no holder panics");
            running.end_current();
            running.current = Some((name.to_owned(), Instant::now()));
            if running.alone {
                memory::reset_peak();
            }
        }
        self.progress.stage(name);
    }

    /// The stage ends here, and the frame waits for its next.
    pub fn pause(&self) {
        self.running.lock().expect("no holder panics").end_current();
    }

    /// Ends the last stage and tells all.
    pub fn finish(self) -> Vec<Cost> {
        let mut running = self.running.into_inner().expect("no holder panics");
        running.end_current();
        self.progress.finish();
        running.done
    }
}

impl Running {
    fn end_current(&mut self) {
        if let Some((stage, start)) = self.current.take() {
            let seconds = start.elapsed().as_secs_f64();
            let peak_memory_bytes = self.alone.then(memory::peak).flatten();
            self.done.push(Cost { stage, seconds, peak_memory_bytes });
        }
    }
}

impl Observer for Clock<'_> {
    fn stage(&self, stage: Stage) {
        self.begin(&stage.to_string());
    }

    fn progress(&self, done: f32) {
        self.progress.share(done);
    }
}

/// Resident memory as Linux counts it; elsewhere nothing is known.
pub mod memory {
    /// The most since [`reset_peak`], in bytes.
    pub fn peak() -> Option<u64> {
        let status = std::fs::read_to_string("/proc/self/status").ok()?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
        let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
        Some(kilobytes * 1024)
    }

    /// Starts counting anew; without the right to do so the peak stays that of the whole run.
    pub fn reset_peak() {
        const RESET_PEAK: &str = "5"; // see proc_pid_clear_refs(5)
        let _ = std::fs::write("/proc/self/clear_refs", RESET_PEAK);
    }
}
