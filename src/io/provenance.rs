//! What a result's header tells of how it was made.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::document::{Document, ends_in_headers, headers_of};
use super::own;
use super::picture::ReadOptions;
use super::region::Mark;
use super::rewrite::signature_in;
use super::source::open_all;
use crate::error::{Error, ErrorKind, Result};

/// How a file was made, as far as it tells.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Provenance {
    /// What it was made by, if it was signed: see [`Picture::sign`](super::Picture::sign).
    pub signature: Option<String>,
    /// The region of a picture that it holds: x, y, width, height in the file's pixel coordinates; none where it is a
    /// whole one.
    pub region: Option<[i64; 4]>,
    /// The names of its channels, part by part.
    pub channels: Vec<String>,
    /// Whether nothing of it is cut off, as far as its table of blocks and the last of them tell.
    pub whole: bool,
    /// It was written by [`write_frame`](super::write_frame) with a seed, as renders of the tracer are, and not denoised
    /// since.
    pub is_traced: bool,
}

/// Whether the file at `path` says of itself that it is OpenEXR, and does not end before there can be a pixel in it.
pub fn is_exr(path: impl AsRef<Path>) -> bool {
    const BEGIN: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
    let mut begin = [0; BEGIN.len()];
    let path = path.as_ref();
    let mut open = || File::open(path).and_then(|mut file| file.read_exact(&mut begin));
    let begun = path.is_file() && open().is_ok(); // a pipe would keep us waiting
    begun && begin == BEGIN && !ends_in_headers(path)
}

/// How the result at `path` was made, which may be cut off behind its headers. Reads one block at most.
///
/// # Errors
/// `Unreadable` when it is missing or no EXR file.
pub fn provenance(path: impl AsRef<Path>) -> Result<Provenance> {
    let headers = &headers_of(path.as_ref())?;
    let channels = headers.iter().flat_map(|header| &header.channels.list);
    let signature = signature_in(headers);
    Ok(Provenance {
        is_traced: signature.is_none() && own::is_seeded(&headers[0]),
        signature,
        region: headers.iter().find_map(Mark::of).map(|mark| mark.region),
        channels: channels.map(|channel| channel.name.to_string()).collect(),
        whole: Document::open(path.as_ref()).is_ok_and(|document| document.is_whole()),
    })
}

/// Numbers that stand for the content of all files that [`Picture::read`](super::Picture::read) takes for the picture at
/// `path`, its own first: those of another render differ. Little of the files is read.
///
/// # Errors
/// `Unreadable` when one of them is missing or damaged.
pub fn fingerprints(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Vec<String>> {
    let files = std::iter::once(path.as_ref()).chain(options.half.as_deref());
    let documents = files.map(|path| open_all(path, options)).collect::<Result<Vec<_>>>()?;
    documents.iter().flatten().map(|document| Ok(format!("{:016x}", document.outline()?))).collect()
}

/// Checks that no picture at `target` is lost but one that is the caller's `own`. What is no picture at all, such as the
/// empty file by which some schedulers take a place, is no loss.
///
/// # Errors
/// `Usage`, without a remedy, when another picture is there.
pub fn check_replaced(target: impl AsRef<Path>, own: impl FnOnce(&Provenance) -> bool) -> Result<()> {
    let target = target.as_ref();
    if !is_exr(target) || provenance(target).is_ok_and(|found| own(&found)) {
        return Ok(());
    }
    let what = "is a picture that is there already, and this program did not write it";
    Err(Error::new(ErrorKind::Usage, what).in_file(target))
}
