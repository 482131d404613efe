//! Files: the only module that opens pictures, and the only one that knows OpenEXR.

mod atomic;
mod encode;
mod own;
mod rgb;

pub use own::{FrameHeader, write_frame};
pub use rgb::read_rgb;

use std::io::Write;
use std::path::Path;

use crate::error::Result;

/// Writes `bytes` as the file at `path`, which appears whole or not at all.
///
/// # Errors
/// When the folder takes no new file or the disk is full; an old file is then unharmed.
pub fn write_bytes(path: impl AsRef<Path>, bytes: &[u8]) -> Result<()> {
    atomic::write_atomically(path.as_ref(), |file| {
        file.write_all(bytes).map_err(|error| atomic::cannot_write(&error, "cannot be written"))
    })
}
