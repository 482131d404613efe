//! Files that appear whole or not at all.
//!
//! A result is written to a temporary file in the folder of its target and renamed over it, which
//! every file system does in one step. The temporary file is locked while its writer lives, so that
//! a later run can tell the rubbish of a killed run from the work of a live one.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::error::{Error, ErrorKind, Result};

/// Writes `target` by `write`, which gets the temporary file; `target` keeps its old content until
/// everything is written and on the disk.
///
/// # Errors
/// When `write` fails, or the folder takes no new file, or the disk is full. Then `target` is as it
/// was and the temporary file is gone.
pub(super) fn write_atomically(
    target: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> Result<()>,
) -> Result<()> {
    let temporary = temporary_name(target);
    let result = fill(&temporary, write).and_then(|()| {
        fs::rename(&temporary, target).map_err(|error| cannot_write(&error, "cannot take its place"))
    });
    if result.is_err() {
        let _ = fs::remove_file(&temporary); // the first error is the one to tell
    }
    result.map_err(|error| error.in_file(target))
}

fn fill(temporary: &Path, write: impl FnOnce(&mut BufWriter<&File>) -> Result<()>) -> Result<()> {
    let file = File::create(temporary).map_err(|error| cannot_write(&error, "cannot be created"))?;
    let mut buffered = BufWriter::with_capacity(1 << 20, &file);
    write(&mut buffered)?;
    buffered.flush().and_then(|()| file.sync_all()).map_err(|error| cannot_write(&error, "cannot be written"))
}

/// `.NAME.PROCESS.apr-tmp` beside the target.
fn temporary_name(target: &Path) -> PathBuf {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    target.with_file_name(format!(".{name}.{}.apr-tmp", std::process::id()))
}

pub(super) fn cannot_write(error: &std::io::Error, what: &str) -> Error {
    Error::new(ErrorKind::Unwritable, format!("{what}: {error}"))
        .remedy("check that the folder exists, may be written to, and has room")
}
