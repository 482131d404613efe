//! What a result's header tells of how it was made.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::document::Document;
use super::own;
use super::region::Mark;
use super::rewrite::signature_in;
use crate::error::{Error, ErrorKind, Result};

/// How a file was made, as far as it tells.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Provenance {
    /// What it was made by, if it was signed: see [`Picture::sign`](super::Picture::sign).
    pub signature: Option<String>,
    /// The region of a picture that it holds: x, y, width, height in the file's pixel coordinates; none where it is a
    /// whole one.
    pub region: Option<[i64; 4]>,
    /// The names of its channels, part by part.
    pub channels: Vec<String>,
    /// It was written by [`write_frame`](super::write_frame) with a seed, as renders of the tracer are, and not denoised
    /// since.
    pub is_traced: bool,
}

/// Whether the file at `path` says of itself that it is OpenEXR, whatever else is in it.
pub fn is_exr(path: impl AsRef<Path>) -> bool {
    const BEGIN: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
    let mut begin = [0; BEGIN.len()];
    File::open(path).and_then(|mut file| file.read_exact(&mut begin)).is_ok() && begin == BEGIN
}

/// How the result at `path` was made. Reads no pixels.
///
/// # Errors
/// `Unreadable` when it is missing or no EXR file.
pub fn provenance(path: impl AsRef<Path>) -> Result<Provenance> {
    let document = Document::open(path.as_ref())?;
    let headers = document.headers();
    let channels = headers.iter().flat_map(|header| &header.channels.list);
    let signature = signature_in(headers);
    Ok(Provenance {
        is_traced: signature.is_none() && own::is_seeded(&headers[0]),
        signature,
        region: headers.iter().find_map(Mark::of).map(|mark| mark.region),
        channels: channels.map(|channel| channel.name.to_string()).collect(),
    })
}

/// Checks that no picture at `target` is lost but one that is the caller's `own`. What is no picture at all, such as the
/// empty file by which some schedulers take a place, is no loss.
///
/// # Errors
/// `Usage`, without a remedy, when another picture is there.
pub fn check_replaced(target: impl AsRef<Path>, own: impl FnOnce(&Provenance) -> bool) -> Result<()> {
    let target = target.as_ref();
    if !target.is_file() || !is_exr(target) || provenance(target).is_ok_and(|found| own(&found)) {
        return Ok(());
    }
    let what = "is a picture that is there already, and this program did not write it";
    Err(Error::new(ErrorKind::Usage, what).in_file(target))
}
