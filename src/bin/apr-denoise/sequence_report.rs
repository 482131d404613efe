//! What became of every frame, for `--sequence-report`.

use apr::baseline::Denoiser;
use apr::error::{Error, Result};
use apr::io;
use serde::Serialize;

use crate::frames::{FrameSet, counted};
use crate::plan::{Job, Plan};
use crate::report::EstimatedError;

/// The report's JSON.
#[derive(Serialize)]
pub struct SequenceReport<'a> {
    program: &'static str,
    version: &'static str,
    options: &'a Denoiser,
    /// Of the whole run, wall clock. Frames overlap, so it is less than theirs together.
    seconds: f64,
    /// Most memory that the process had resident, where the system tells.
    peak_memory_bytes: Option<u64>,
    /// How many frames ended in which way.
    counts: Counts,
    frames: Vec<Entry>,
}

/// How many frames ended in which way.
#[derive(Debug, Default, Serialize)]
struct Counts {
    done: usize,
    skipped: usize,
    missing: usize,
    failed: usize,
    interrupted: usize,
    not_run: usize,
}

#[derive(Serialize)]
struct Entry {
    frame: Option<i32>,
    input: String,
    output: String,
    #[serde(flatten)]
    outcome: Outcome,
}

/// What became of a frame.
#[derive(Clone, Serialize)]
#[serde(tag = "state", rename_all = "snake_case")]
pub enum Outcome {
    /// It is denoised and written.
    Done {
        /// Of its stages, wall clock.
        seconds: f64,
        estimated_error: EstimatedError,
        outliers: usize,
        warnings: Vec<String>,
    },
    /// Its result was there already.
    Skipped,
    /// It has no input.
    Missing { file: String },
    /// It could not be read, denoised or written.
    Failed { exit_code: u8, error: String },
    /// The run was told to stop while it was at work on it.
    Interrupted,
    /// The run ended before its turn.
    NotRun,
}

impl<'a> SequenceReport<'a> {
    /// Everything that is known after a run; `outcomes` are those of the plan's jobs.
    pub fn new(
        plan: &Plan,
        outcomes: &[Outcome],
        options: &'a Denoiser,
        seconds: f64,
        peak_memory_bytes: Option<u64>,
    ) -> Self {
        let entry = |job: &Job, outcome: Outcome| Entry {
            frame: job.frame,
            input: job.input.display().to_string(),
            output: job.output.display().to_string(),
            outcome,
        };
        let run = plan.jobs.iter().zip(outcomes).map(|(job, outcome)| entry(job, outcome.clone()));
        let finished = plan.finished.iter().map(|job| entry(job, Outcome::Skipped));
        let missing = plan
            .missing
            .iter()
            .map(|(job, file)| entry(job, Outcome::Missing { file: file.display().to_string() }));
        let mut frames: Vec<Entry> = run.chain(finished).chain(missing).collect();
        frames.sort_by_key(|entry| entry.frame);
        let count = |is: fn(&Outcome) -> bool| frames.iter().filter(|entry| is(&entry.outcome)).count();
        let counts = Counts {
            done: count(|outcome| matches!(outcome, Outcome::Done { .. })),
            skipped: count(|outcome| matches!(outcome, Outcome::Skipped)),
            missing: count(|outcome| matches!(outcome, Outcome::Missing { .. })),
            failed: count(|outcome| matches!(outcome, Outcome::Failed { .. })),
            interrupted: count(|outcome| matches!(outcome, Outcome::Interrupted)),
            not_run: count(|outcome| matches!(outcome, Outcome::NotRun)),
        };
        Self {
            program: env!("CARGO_PKG_NAME"),
            version: env!("CARGO_PKG_VERSION"),
            options,
            seconds,
            peak_memory_bytes,
            counts,
            frames,
        }
    }

    /// Writes it to `path`.
    ///
    /// # Errors
    /// `Misplaced` or `Unwritable` when the folder or the disk does not take it.
    pub fn write(&self, path: &std::path::Path) -> Result<()> {
        io::write_bytes(path, apr::report::json(self)?.as_bytes())
    }

    /// In one line, for people.
    pub fn line(&self) -> String {
        let counts = &self.counts;
        let others = [
            (counts.skipped, ["was there already", "were there already"]),
            (counts.missing, ["has no input", "have no input"]),
            (counts.failed, ["failed"; 2]),
            (counts.not_run, ["was not run", "were not run"]),
        ];
        let others: String = others
            .iter()
            .filter(|(n, _)| *n > 0)
            .map(|(n, [one, many])| format!(", {n} {}", if *n == 1 { one } else { many }))
            .collect();
        let missing = self.missing().map_or_else(String::new, |missing| format!("; {missing}"));
        format!("{} denoised in {:.1} s{others}{missing}", counted(counts.done, "frame"), self.seconds)
    }

    /// In words, the frames that have no input, and the file that the first one lacks.
    fn missing(&self) -> Option<String> {
        let lacks = |entry: &'_ Entry| match &entry.outcome {
            Outcome::Missing { file } => Some((entry.frame?, file.clone())),
            _ => None,
        };
        let all: Vec<(i32, String)> = self.frames.iter().filter_map(lacks).collect();
        let (first, file) = all.first()?;
        let frames: FrameSet = all.iter().map(|(frame, _)| *frame).collect();
        Some(format!("left out: {frames} ({first} for want of {file})"))
    }
}

/// The error of a run some of whose frames failed: the kind is that of the first.
pub fn failure(plan: &Plan, errors: Vec<(usize, Error)>) -> Result<()> {
    let total = plan.jobs.len();
    let frames: FrameSet = errors.iter().filter_map(|(index, _)| plan.jobs[*index].frame).collect();
    let failed = errors.len();
    match errors.into_iter().min_by_key(|(index, _)| *index) {
        None => Ok(()),
        Some((_, only)) if plan.jobs[0].frame.is_none() => Err(only),
        Some((_, first)) => {
            let what = format!("{failed} of {} failed: {frames}", counted(total, "frame"));
            Err(Error::new(first.kind(), what)
                .remedy("see to the causes told above, then run again with --skip-existing to go on"))
        }
    }
}
