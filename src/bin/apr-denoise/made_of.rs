//! What a frame is made of: numbers that stand for the content of its files, and of those beside it. They tell nothing
//! of names, times and machines, so that the same files give the same result to the byte.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use apr::error::Result;
use apr::io;

use crate::arguments::Arguments;
use crate::plan::{Job, Plan};

/// The numbers of one frame's files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MadeOf {
    pub inputs: Vec<String>,
    /// Of the frames before and after, the nearest first, in a run that lets them help.
    pub beside: Option<[Vec<Vec<String>>; 2]>,
}

impl MadeOf {
    /// With no more frames before and after than these: the others could not be had.
    pub fn cut(mut self, [before, after]: [usize; 2]) -> Self {
        if let Some(beside) = &mut self.beside {
            beside[0].truncate(before);
            beside[1].truncate(after);
        }
        self
    }
}

/// Those of all frames that were looked at, by their input: frames beside each other need the same.
#[derive(Debug, Default)]
pub struct Fingerprints {
    of_frames: BTreeMap<PathBuf, Vec<String>>,
    /// Whether nothing is cut off an input.
    whole: BTreeMap<PathBuf, bool>,
}

impl Fingerprints {
    /// What `job` is made of. Frames beside that cannot be read, or are cut off, count as gaps.
    ///
    /// # Errors
    /// `Unreadable` when a file of its own is missing or damaged.
    pub fn of(&mut self, plan: &Plan, job: &Job, arguments: &Arguments) -> Result<MadeOf> {
        let inputs = self.of_one(job, arguments)?;
        let reach = i32::from(arguments.temporal);
        let mut side = |sign: i32| {
            let beside = |offset| {
                let job = plan.beside(job, sign * offset)?;
                if self.is_whole(&job.input) { self.of_one(&job, arguments).ok() } else { None }
            };
            (1..=reach).map_while(beside).collect()
        };
        let beside = (reach > 0).then(|| [side(-1), side(1)]);
        Ok(MadeOf { inputs, beside })
    }

    fn of_one(&mut self, job: &Job, arguments: &Arguments) -> Result<Vec<String>> {
        if let Some(known) = self.of_frames.get(&job.input) {
            return Ok(known.clone());
        }
        let found = io::fingerprints(&job.input, &arguments.read_options(job))?;
        self.of_frames.insert(job.input.clone(), found.clone());
        Ok(found)
    }

    fn is_whole(&mut self, input: &Path) -> bool {
        let look = || io::provenance(input).is_ok_and(|found| found.whole);
        *self.whole.entry(input.to_owned()).or_insert_with(look)
    }
}
