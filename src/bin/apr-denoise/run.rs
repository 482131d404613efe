//! The run: one frame or many, the next being read and the last being written while one is computed.
//!
//! Three frames are held at most: one that was read and waits, one that is denoised, one that is
//! written; with `--temporal N` also those beside them, 2N + 3 in all. By parts (`--region`, `--memory`) only
//! the results of two are. The order of the work changes no bit of any result.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use apr::baseline::Denoiser;
use apr::error::{Error, Result};
use apr::frame::Beside;
use apr::io::{self, Picture};

use crate::answer::{complain, print};
use crate::arguments::Arguments;
use crate::clock::{Clock, memory};
use crate::failure::caught;
use crate::made_of::{Fingerprints, MadeOf};
use crate::parts::{Input, Output, Used};
use crate::plan::{Job, Plan};
use crate::progress::{Progress, Style, locked};
use crate::remarks::{Remark, Remarks};
use crate::report::Report;
use crate::sampling::Sampling;
use crate::sequence_report::{Outcome, SequenceReport, failure};
use crate::shot::{Shelf, Shot};
use crate::{signals, signature};

/// Share of the pixels of a frame beside that may hold the same noise without a word.
const MOST_COPIED: f32 = 0.5;

/// What all frames share.
struct Run<'a> {
    plan: &'a Plan,
    arguments: &'a Arguments,
    denoiser: &'a Denoiser,
    signature: &'a str,
    progress: Progress,
    /// No frame after the one of this index is begun: it is the first that failed.
    last: AtomicUsize,
    /// Some frame's estimated error is above the target.
    target_missed: AtomicBool,
    /// As they are if the run ends now.
    outcomes: Arc<Mutex<Vec<Outcome>>>,
    errors: Mutex<Vec<(usize, Error)>>,
    /// Why the standard output took no more: no fault of the frames that are done.
    unsaid: Mutex<Option<Error>>,
    remarks: Remarks,
}

/// A frame on its way; the index is its job's.
struct Step<'a, T> {
    index: usize,
    clock: Clock<'a>,
    content: T,
}

/// Denoises the plan's frames and tells what became of them, and whether none is above the target error.
///
/// # Errors
/// Of the kind of the first frame that failed; those before it are done all the same.
pub fn run(plan: &Plan, arguments: &Arguments, denoiser: &Denoiser, signature: &str) -> Result<bool> {
    let begun = Instant::now();
    if let Some(note) = plan.note_of_stale().filter(|_| !arguments.quiet) {
        complain(&format!("{}: {note}", Remark::Note.name()));
    }
    let style = if arguments.quiet { Style::None } else { arguments.progress };
    let run = Run {
        plan,
        arguments,
        denoiser,
        signature,
        progress: Progress::new(style, arguments.answers(), plan.jobs.len()),
        last: AtomicUsize::new(usize::MAX),
        target_missed: AtomicBool::new(false),
        outcomes: report_when_stopped(plan, arguments, denoiser, begun),
        errors: Mutex::default(),
        unsaid: Mutex::default(),
        remarks: Remarks::default(),
    };
    std::thread::scope(|scope| {
        // No place in the channels: who is ahead keeps its frame until the next takes it.
        let (read, to_denoise) = sync_channel(0);
        let (denoised, to_write) = sync_channel(0);
        let run = &run;
        scope.spawn(move || run.read_all(&read));
        scope.spawn(move || run.write_all(&to_write));
        run.denoise_all(&to_denoise, &denoised);
        drop(denoised);
    });
    run.progress.finish();
    run.remarks.of_further_frames().iter().for_each(|remark| complain(remark));
    let mut outcomes = locked(&run.outcomes).clone();
    // Frames that were read ahead of one that failed, and given up.
    outcomes.iter_mut().filter(|it| matches!(it, Outcome::Interrupted)).for_each(|it| *it = Outcome::NotRun);
    let seconds = begun.elapsed().as_secs_f64();
    let report = SequenceReport::new(plan, &outcomes, denoiser, seconds, memory::peak());
    let reported = arguments.sequence_report.as_ref().map_or(Ok(()), |path| report.write(path));
    let sequence = plan.frames().any(|job| job.frame.is_some());
    if arguments.answers() && sequence {
        run.say(&report.line());
    }
    for job in plan.finished.iter().filter(|_| arguments.answers() && !sequence) {
        run.say(&format!("{}: is there already, made by the same options", job.output.display()));
    }
    failure(plan, std::mem::take(&mut locked(&run.errors)))?;
    reported?;
    locked(&run.unsaid).take().map_or(Ok(!run.target_missed.into_inner()), Err)
}

/// The outcomes of a run that begins, and the sequence's report of them should it be told to stop.
fn report_when_stopped(
    plan: &Plan,
    arguments: &Arguments,
    denoiser: &Denoiser,
    begun: Instant,
) -> Arc<Mutex<Vec<Outcome>>> {
    let outcomes = Arc::new(Mutex::new(vec![Outcome::NotRun; plan.jobs.len()]));
    if let Some(path) = arguments.sequence_report.clone() {
        let (plan, denoiser, outcomes) = (plan.clone(), denoiser.clone(), Arc::clone(&outcomes));
        signals::before_the_end(move || {
            let (outcomes, seconds) = (locked(&outcomes).clone(), begun.elapsed().as_secs_f64());
            let report = SequenceReport::new(&plan, &outcomes, &denoiser, seconds, memory::peak());
            if let Err(error) = report.write(&path) {
                complain(&error.to_string());
            }
        });
    }
    outcomes
}

impl<'a> Run<'a> {
    fn read_all(&'a self, next: &SyncSender<Step<'a, Input>>) {
        let (mut shelf, mut fingerprints) = (Shelf::default(), Fingerprints::default());
        for (index, job) in self.plan.jobs.iter().enumerate() {
            if index > self.last.load(Ordering::Relaxed) {
                return;
            }
            let progress = self.progress.of_frame(index, job.frame.map(|_| job.label()));
            let clock = Clock::new(progress, self.plan.jobs.len() == 1);
            locked(&self.outcomes)[index] = Outcome::Interrupted; // until something better becomes of it
            let input = self.tried(index, || {
                clock.begin("read");
                let (arguments, frames) = (self.arguments, self.plan.jobs.len());
                // Before anything is read: what changes meanwhile is found changed by the next run.
                let made_of = fingerprints.of(self.plan, job, arguments)?;
                let signature = signature::of_frame(self.signature, &made_of);
                let whole = || self.shot(&mut shelf, job, made_of);
                let input = Input::read(job, arguments, self.denoiser, &signature, frames, whole)?;
                clock.pause();
                self.warn_of(job, &input);
                Ok(input)
            });
            let Some(content) = input else { continue };
            if next.send(Step { index, clock, content }).is_err() {
                return;
            }
        }
    }

    fn denoise_all(
        &'a self,
        inputs: &Receiver<Step<'a, Input>>,
        next: &SyncSender<Step<'a, (Used, Output)>>,
    ) {
        for Step { index, clock, content: input } in inputs {
            if index > self.last.load(Ordering::Relaxed) {
                continue;
            }
            let output = self.tried(index, || {
                if self.denoiser.pipeline().is_none() {
                    clock.begin(self.denoiser.method().name()); // which tells of no stages
                }
                let sampled = Sampling::is_wanted(&self.plan.jobs[index], self.arguments.target_error);
                let output = input.denoise(self.denoiser, &clock, sampled);
                clock.pause();
                output
            });
            let Some(content) = output else { continue };
            if next.send(Step { index, clock, content }).is_err() {
                return;
            }
        }
    }

    fn write_all(&self, results: &Receiver<Step<'a, (Used, Output)>>) {
        for Step { index, clock, content: (used, output) } in results {
            let written = self.tried(index, || self.write(&self.plan.jobs[index], &used, &output, clock));
            if let Some(outcome) = written {
                locked(&self.outcomes)[index] = outcome;
            }
        }
    }

    /// A frame with those beside it, signed: only now it is known which of them can be had.
    fn shot(&self, shelf: &mut Shelf, job: &Job, made_of: MadeOf) -> Result<Shot> {
        let (arguments, reach) = (self.arguments, self.arguments.temporal);
        let read = |job: &Job| Picture::read(&job.input, &arguments.read_options(job));
        let shot = shelf.shot(self.plan, job, reach, arguments.keep_going, read)?;
        shot.picture.sign(signature::of_frame(self.signature, &made_of.cut(shot.beside())));
        Ok(shot)
    }

    fn write(&self, job: &Job, used: &Used, output: &Output, clock: Clock) -> Result<Outcome> {
        clock.begin("write");
        let sampling = match used {
            Used::Whole(shot) => {
                let (picture, target) = (&shot.picture, self.arguments.target_error);
                Sampling::new(picture, self.denoiser, &output.denoised, job, target)?
            }
            Used::Survey(..) => None,
        };
        let notes = used.write(job, &output.denoised, self.arguments.aux)?;
        let stages = clock.finish();
        if sampling.as_ref().is_some_and(|sampling| sampling.target_met == Some(false)) {
            self.target_missed.store(true, Ordering::Relaxed);
        }
        let report = Report::new(used, self.denoiser, output, stages, notes, job, sampling.as_ref());
        if job.report.is_some() {
            let json = apr::report::json(&report)?;
            match job.report_file() {
                Some(path) => io::write_bytes(path, json.as_bytes())?,
                None => self.say(json.trim_end()),
            }
        }
        if !self.arguments.quiet {
            self.warn_of_copies(job, &output.denoised.summary.beside);
            report.notes().iter().for_each(|note| self.tell(job, Remark::Note, note));
        }
        if self.arguments.answers() {
            let needed = sampling.as_ref().and_then(Sampling::line);
            needed.iter().chain([&report.line()]).for_each(|line| self.say(line));
        }
        Ok(report.outcome())
    }

    /// Says something on the standard output. That it takes no more is told once, at the end.
    fn say(&self, words: &str) {
        if let Err(error) = self.progress.aside(|| print(words)) {
            locked(&self.unsaid).get_or_insert(error);
        }
    }

    /// Does a frame's `work`; a failure is told, remembered, and stops the run unless it is to go on.
    fn tried<T>(&self, index: usize, work: impl FnOnce() -> Result<T>) -> Option<T> {
        let error = match caught(work) {
            Ok(done) => return Some(done),
            Err(error) => error,
        };
        if self.arguments.keep_going {
            self.progress.give_up(index);
        } else {
            self.last.fetch_min(index, Ordering::Relaxed);
        }
        let job = &self.plan.jobs[index];
        if job.frame.is_some() {
            // A single picture's is told at the end.
            self.progress.aside(|| complain(&format!("{}: {error}", job.label())));
        }
        locked(&self.outcomes)[index] =
            Outcome::Failed { exit_code: error.kind().exit_code(), error: error.to_string() };
        locked(&self.errors).push((index, error));
        None
    }

    fn warn_of(&self, job: &Job, input: &Input) {
        if !self.arguments.quiet {
            let layout = input.layout();
            layout.warnings.iter().for_each(|warning| self.tell(job, Remark::Warning, warning));
            layout.notes.iter().for_each(|note| self.tell(job, Remark::Note, note));
        }
    }

    /// Warns of frames beside that tell nothing new.
    fn warn_of_copies(&self, job: &Job, beside: &[Beside]) {
        if beside.iter().any(|beside| beside.copied > MOST_COPIED) {
            self.tell(
                job,
                Remark::Warning,
                "--temporal: frames beside hold the same noise and are of no use: render every frame with a seed of its own",
            );
        }
    }

    /// Tells a remark, unless an earlier frame had it.
    fn tell(&self, job: &Job, remark: Remark, words: &str) {
        if self.remarks.is_new(remark, job.frame, words) {
            let place = job.frame.map_or(String::new(), |_| format!("{}: ", job.label()));
            self.progress.aside(|| complain(&format!("{}: {place}{words}", remark.name())));
        }
    }
}
