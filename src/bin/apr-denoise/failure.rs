//! Errors and defects, told in one place, and the exit code that goes with them.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::{ExitCode, Termination};
use std::sync::Mutex;

use apr::error::{ErrorKind, Result};

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
    match catch_unwind(AssertUnwindSafe(program)) {
        Ok(Ok(done)) => done.report(),
        Ok(Err(error)) => complain(&error.to_string(), error.kind()),
        Err(_) => {
            let panic = LAST_PANIC.lock().map(|last| last.clone()).unwrap_or_default();
            complain(&format!("internal error, please report it: {panic}"), ErrorKind::Internal)
        }
    }
}

#[expect(clippy::print_stderr, reason = "where this program complains")]
fn complain(message: &str, kind: ErrorKind) -> ExitCode {
    eprintln!("{}: {message}", env!("CARGO_BIN_NAME"));
    ExitCode::from(kind.exit_code())
}
