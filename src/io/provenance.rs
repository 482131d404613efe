//! What a result's header tells of how it was made.

use std::path::Path;

use super::document::Document;
use super::region::Mark;
use super::rewrite::signature_in;
use crate::error::Result;

/// How a file was made, as far as it tells.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Provenance {
    /// What it was made by, if it was signed: see [`Picture::sign`](super::Picture::sign).
    pub signature: Option<String>,
    /// The region of a picture that it holds: x, y, width, height in the file's pixel coordinates; none where it is a
    /// whole one.
    pub region: Option<[i64; 4]>,
}

/// How the result at `path` was made. Reads no pixels.
///
/// # Errors
/// `Unreadable` when it is missing or no EXR file.
pub fn provenance(path: impl AsRef<Path>) -> Result<Provenance> {
    let document = Document::open(path.as_ref())?;
    let headers = document.headers();
    Ok(Provenance {
        signature: headers.iter().find_map(signature_in),
        region: headers.iter().find_map(Mark::of).map(|mark| mark.region),
    })
}
