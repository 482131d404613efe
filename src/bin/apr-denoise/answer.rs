//! What a program says. Nobody has to listen: who closed the pipe got what he wanted. But an answer that a full disk
//! did not take is told.

use std::io::{ErrorKind as Cause, Write};

use apr::error::{Error, ErrorKind, Result};

/// Answers with `text`, and a new line, on the standard output.
///
/// # Errors
/// `Unwritable` when it takes no more and is not just closed.
pub fn print(text: &str) -> Result<()> {
    write(format!("{text}\n").as_bytes())
}

/// Answers with `bytes` on the standard output.
///
/// # Errors
/// As [`print()`].
pub fn write(bytes: &[u8]) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() != Cause::BrokenPipe => {
            let what = format!("the standard output cannot be written: {error}");
            Err(Error::new(ErrorKind::Unwritable, what).remedy("see that there is room where it leads"))
        }
        _ => Ok(()),
    }
}

/// Tells something on the way that is no answer.
pub fn complain(words: &str) {
    let _ = writeln!(std::io::stderr(), "{}: {words}", env!("CARGO_BIN_NAME"));
}
