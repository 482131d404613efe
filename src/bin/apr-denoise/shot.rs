//! The frames that are in memory: each is read once, though those beside it need it too.

use std::collections::BTreeMap;
use std::sync::Arc;

use apr::error::Result;
use apr::io::Picture;
use apr::{Frame, Neighbours};

use crate::plan::{Job, Plan};

/// A frame with those beside it, the nearest first.
#[derive(Debug, Clone)]
pub struct Shot {
    pub picture: Arc<Picture>,
    before: Vec<Arc<Picture>>,
    after: Vec<Arc<Picture>>,
    /// In words, the frames beside that could not be had.
    absent: Vec<String>,
}

impl Shot {
    /// What the denoiser gets beside the frame.
    pub fn neighbours(&self) -> Neighbours<'_> {
        fn frames(pictures: &[Arc<Picture>]) -> Vec<&Frame> {
            pictures.iter().map(|picture| picture.frame()).collect()
        }
        Neighbours { before: frames(&self.before), after: frames(&self.after) }
    }

    /// The frame, where nothing else has a use for it: there are no frames beside.
    pub fn into_picture(self) -> std::result::Result<Picture, Self> {
        if self.before.is_empty() && self.after.is_empty() && self.absent.is_empty() {
            return Arc::try_unwrap(self.picture).map_err(|picture| Self { picture, ..self });
        }
        Err(self)
    }

    /// Without the frames beside, which are of no use any more.
    pub fn alone(self) -> Self {
        Self { before: vec![], after: vec![], ..self }
    }

    /// How many frames before and after it help.
    pub fn beside(&self) -> [usize; 2] {
        [self.before.len(), self.after.len()]
    }

    /// In words, what is not there.
    pub fn note(&self) -> Option<String> {
        let absent = &self.absent;
        (!absent.is_empty()).then(|| format!("done without what is beside: {}", absent.join(", ")))
    }
}

/// Frames around the last one that was asked for, and what kept those from being read that could not be.
#[derive(Debug, Default)]
pub struct Shelf(BTreeMap<i32, Result<Arc<Picture>>>);

impl Shelf {
    /// The frame of `job` and up to `reach` on both sides, as far as there is no gap; what is not held is
    /// had by `read`. A frame beside that cannot be read counts as a gap where the run is to `keep_going`.
    ///
    /// # Errors
    /// When one of them cannot be read.
    pub fn shot(
        &mut self,
        plan: &Plan,
        job: &Job,
        reach: u8,
        keep_going: bool,
        read: impl Fn(&Job) -> Result<Picture>,
    ) -> Result<Shot> {
        let Some(frame) = job.frame.filter(|_| reach > 0) else {
            let picture = Arc::new(read(job)?);
            return Ok(Shot { picture, before: vec![], after: vec![], absent: vec![] });
        };
        self.0.retain(|held, _| held.abs_diff(frame) <= reach.into());
        let mut absent = vec![];
        let mut side = |sign: i32| -> Result<Vec<Arc<Picture>>> {
            let mut found = vec![];
            for offset in (1..=i32::from(reach)).map(|n| sign * n) {
                let number = i64::from(frame) + i64::from(offset);
                match plan.beside(job, offset).map(|beside| self.get(&beside, &read)) {
                    Some(Err(error)) if keep_going => {
                        absent.push(format!("frame {number} cannot be read ({error})"));
                        break;
                    }
                    Some(picture) => found.push(picture?),
                    None => {
                        absent.push(format!("frame {number} has no file"));
                        break;
                    }
                }
            }
            Ok(found)
        };
        let (before, after) = (side(-1)?, side(1)?);
        Ok(Shot { picture: self.get(job, &read)?, before, after, absent })
    }

    fn get(&mut self, job: &Job, read: &impl Fn(&Job) -> Result<Picture>) -> Result<Arc<Picture>> {
        let frame = job.frame.expect("only sequences have frames beside");
        self.0.entry(frame).or_insert_with(|| read(job).map(Arc::new)).clone()
    }
}
