//! Errors and defects, told in one place, and the exit code that goes with them.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::{ExitCode, Termination};
use std::sync::Mutex;

use apr::error::{Error, ErrorKind, Result};

use crate::answer::complain;

/// What the last panic said. Decoders may panic on damaged files, which the library turns into an
/// error; only what reaches [`told`] is a defect and is shown.
static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

/// Runs the program and tells what went wrong.
pub fn told<T: Termination>(program: impl FnOnce() -> Result<T>) -> ExitCode {
    std::panic::set_hook(Box::new(|panic| {
        if let Ok(mut last) = LAST_PANIC.lock() {
            *last = panic.to_string();
        }
    }));
    match caught(program) {
        Ok(done) => done.report(),
        Err(error) => {
            complain(&error.to_string());
            ExitCode::from(error.kind().exit_code())
        }
    }
}

/// Runs a piece of work whose defects must not end the others: a panic becomes an error.
///
/// # Errors
/// What `work` fails with; `Internal` when it panics.
pub fn caught<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| {
        let panic = LAST_PANIC.lock().map(|last| last.clone()).unwrap_or_default();
        Err(Error::new(ErrorKind::Internal, format!("internal error, please report it: {panic}")))
    })
}
