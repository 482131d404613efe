//! The threads of a call.

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

/// More take memory and time, and help nobody.
const MOST: i64 = 1024;

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

    /// Runs `work` on them.
    pub fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> PyResult<T> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.0).build();
        Ok(pool.map_err(|error| PyRuntimeError::new_err(error.to_string()))?.install(work))
    }
}

/// One per core, which is what 0 means to the pool.
impl Default for Threads {
    fn default() -> Self {
        Self(0)
    }
}
