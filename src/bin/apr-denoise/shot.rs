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
    /// Frames beside that have no file.
    absent: Vec<i32>,
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

    /// In words, what is not there.
    pub fn note(&self) -> Option<String> {
        let absent: Vec<String> = self.absent.iter().map(i32::to_string).collect();
        (!absent.is_empty())
            .then(|| format!("done without what is beside: frame {} has no file", absent.join(", frame ")))
    }
}

/// Frames around the last one that was asked for.
#[derive(Debug, Default)]
pub struct Shelf(BTreeMap<i32, Arc<Picture>>);

impl Shelf {
    /// The frame of `job` and up to `reach` on both sides, as far as there is no gap; what is not held is
    /// had by `read`.
    ///
    /// # Errors
    /// When one of them cannot be read.
    pub fn shot(
        &mut self,
        plan: &Plan,
        job: &Job,
        reach: i32,
        read: impl Fn(&Job) -> Result<Picture>,
    ) -> Result<Shot> {
        let Some(frame) = job.frame.filter(|_| reach > 0) else {
            let picture = Arc::new(read(job)?);
            return Ok(Shot { picture, before: vec![], after: vec![], absent: vec![] });
        };
        self.0.retain(|held, _| held.abs_diff(frame) <= reach.unsigned_abs());
        let mut absent = vec![];
        let mut side = |sign: i32| -> Result<Vec<Arc<Picture>>> {
            let mut found = vec![];
            for offset in 1..=reach {
                let Some(beside) = plan.beside(job, sign * offset) else {
                    absent.extend(frame.checked_add(sign * offset));
                    break;
                };
                found.push(self.get(&beside, &read)?);
            }
            Ok(found)
        };
        let (before, after) = (side(-1)?, side(1)?);
        Ok(Shot { picture: self.get(job, &read)?, before, after, absent })
    }

    fn get(&mut self, job: &Job, read: &impl Fn(&Job) -> Result<Picture>) -> Result<Arc<Picture>> {
        let frame = job.frame.expect("only sequences have frames beside");
        if let Some(held) = self.0.get(&frame) {
            return Ok(Arc::clone(held));
        }
        let picture = Arc::new(read(job)?);
        self.0.insert(frame, Arc::clone(&picture));
        Ok(picture)
    }
}
