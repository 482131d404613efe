//! The threads of a call, and what its caller may do meanwhile: see how far it is, and stop it.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use apr::Observer;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use crate::errors::raised;

/// More take memory and time, and help nobody.
const MOST: i64 = 1024;

/// How often the caller's thread looks after signals and tells how far the work is.
const LOOK: Duration = Duration::from_millis(50);

/// So many threads, or one per core. A call has threads of its own: those of an earlier one do not live on in a
/// forked process (`multiprocessing`), where work would wait for them for ever.
pub struct Threads(usize);

impl Threads {
    /// As the keyword `threads` says.
    pub fn new(given: Option<i64>) -> PyResult<Self> {
        match given {
            None => Ok(Self::default()),
            Some(n @ 1..=MOST) => Ok(Self(n as usize)),
            Some(n) => Err(PyValueError::new_err(format!(
                "threads is {n} where 1 to {MOST}, or None for one per core, was expected"
            ))),
        }
    }

    /// Runs `work` on them, without the GIL. Meanwhile the caller's own thread, the only one that Python's signals
    /// reach, hears Ctrl-C and tells `progress` the share that is done; what either raises stops the work, and is raised
    /// when it has ended.
    pub fn run<T: Send>(
        &self,
        py: Python<'_>,
        progress: Option<&Bound<'_, PyAny>>,
        work: impl FnOnce(&Watch) -> apr::Result<T> + Send,
    ) -> PyResult<T> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.0).build();
        let pool = pool.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        let watch = &Watch::default();
        let mut told = None;
        let mut tell = |share: f32| match progress {
            Some(progress) if told.replace(share) != Some(share) => progress.call1((share,)).map(drop),
            _ => Ok(()),
        };
        let (end, mut ended) = channel();
        let mut stopped_by = None;
        let done = pool.in_place_scope(|scope| {
            scope.spawn(move |_| end.send(work(watch)).expect("the caller waits for it"));
            loop {
                let ended = &mut ended; // which may go to where there is no GIL, as a shared one may not
                match py.detach(move || ended.recv_timeout(LOOK)) {
                    Ok(done) => return Some(done),
                    Err(RecvTimeoutError::Disconnected) => return None,
                    Err(RecvTimeoutError::Timeout) if stopped_by.is_some() => {}
                    Err(RecvTimeoutError::Timeout) => {
                        if let Err(error) = py.check_signals().and_then(|()| tell(watch.share())) {
                            watch.stopped.store(true, Ordering::Relaxed);
                            stopped_by = Some(error);
                        }
                    }
                }
            }
        });
        if let Some(error) = stopped_by {
            return Err(error);
        }
        let done = done.expect("the scope passes panics on").map_err(raised)?;
        tell(1.0)?;
        Ok(done)
    }
}

/// One per core, which is what 0 means to the pool.
impl Default for Threads {
    fn default() -> Self {
        Self(0)
    }
}

/// What the work and the caller's thread tell one another.
#[derive(Default)]
pub struct Watch {
    /// The bits of the share that is done: those of numbers from 0 on are in the numbers' order.
    share: AtomicU32,
    stopped: AtomicBool,
}

impl Watch {
    /// 1 is kept for the end, when the result is there.
    fn share(&self) -> f32 {
        f32::from_bits(self.share.load(Ordering::Relaxed)).min(0.99)
    }
}

impl Observer for Watch {
    fn progress(&self, done: f32) {
        self.share.fetch_max(done.to_bits(), Ordering::Relaxed);
    }

    fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }
}
