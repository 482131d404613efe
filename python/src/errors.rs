//! The library's errors as Python's exceptions; the message names file, part, channel and remedy.

use apr::error::{Error, ErrorKind};
use pyo3::PyErr;
use pyo3::exceptions::{PyFileNotFoundError, PyOSError, PyRuntimeError, PyValueError};

/// `Usage` and `Lacking` are `ValueError`, files that cannot be read, or written where they are to go, `OSError` (one that is not
/// there `FileNotFoundError`), defects `RuntimeError`.
pub fn raised(error: Error) -> PyErr {
    let message = error.to_string();
    match error.kind() {
        ErrorKind::Usage | ErrorKind::Lacking => PyValueError::new_err(message),
        ErrorKind::Unreadable if error.file().is_some_and(|file| !file.exists()) => {
            PyFileNotFoundError::new_err(message)
        }
        ErrorKind::Unreadable | ErrorKind::Misplaced | ErrorKind::Unwritable => PyOSError::new_err(message),
        ErrorKind::Internal => PyRuntimeError::new_err(message),
    }
}
