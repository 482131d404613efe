//! Warnings and notes: those of a sequence tend to be the same for every frame, and are told of the first.

use std::collections::BTreeMap;
use std::sync::Mutex;

use crate::frames::FrameSet;
use crate::progress::locked;

/// How bad it is what is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Remark {
    Warning,
    Note,
}

impl Remark {
    pub fn name(self) -> &'static str {
        match self {
            Self::Warning => "warning",
            Self::Note => "note",
        }
    }
}

/// All that was told, by its words without numbers: those differ from frame to frame.
#[derive(Debug, Default)]
pub struct Remarks(Mutex<BTreeMap<(Remark, String), Told>>);

#[derive(Debug, Default)]
struct Told {
    /// Those of the first frame: more than one where they differ in their numbers alone.
    words: Vec<String>,
    /// All that had it, the first one first.
    frames: Vec<Option<i32>>,
}

impl Remarks {
    /// Adds that a frame has this remark; whether no earlier one had it.
    pub fn is_new(&self, remark: Remark, frame: Option<i32>, words: &str) -> bool {
        let kind = words.replace(|c: char| c.is_ascii_digit(), "");
        let mut all = locked(&self.0);
        let told = all.entry((remark, kind)).or_default();
        if !told.frames.contains(&frame) {
            told.frames.push(frame);
        }
        let new = told.frames[0] == frame && told.words.iter().all(|known| known != words);
        if new {
            told.words.push(words.to_owned());
        }
        new
    }

    /// Which frames share the warnings of an earlier one: there may be something wrong with all of them.
    pub fn of_further_frames(&self) -> Vec<String> {
        let line = |((remark, _), told): (&(Remark, String), &Told)| {
            let others: FrameSet = told.frames[1..].iter().copied().flatten().collect();
            let first = told.frames[0].filter(|_| *remark == Remark::Warning && !others.is_empty())?;
            let frames = if others.iter().count() == 1 { "frame" } else { "frames" };
            Some(format!("{}: {frames} {others} too, as frame {first}: {}", remark.name(), told.words[0]))
        };
        locked(&self.0).iter().filter_map(line).collect()
    }
}
