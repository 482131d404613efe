//! What is no render: reports, pages, charts, PNG. Only those of this project may be replaced unasked.

use std::path::Path;

use apr::error::{Error, ErrorKind, Result};
use apr::report::is_own;

/// Whether something is at `path` that is none of this project's; an empty file is no loss.
pub fn is_foreign(path: &Path) -> bool {
    // A pipe would keep us waiting.
    path.is_file() && !std::fs::read(path).is_ok_and(|bytes| bytes.is_empty() || is_own(&bytes))
}

/// Checks that nothing at `path` is lost but what this project wrote.
///
/// # Errors
/// `Usage` when something else is there.
pub fn check(path: &Path) -> Result<()> {
    if !is_foreign(path) {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Usage, "is there already, and this program did not write it")
        .remedy("name what is written otherwise, or give --overwrite to lose what is there")
        .in_file(path))
}
