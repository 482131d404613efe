//! The one error type: what went wrong, where, and what to do about it.
//!
//! Every message a user can meet names the file, the part and the channel as far as they are
//! known, says what was expected, and ends in a remedy.

use std::fmt;
use std::path::{Path, PathBuf};

/// The library's result type.
pub type Result<T> = std::result::Result<T, Error>;

/// What sort of failure it is; the programs turn it into their exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ErrorKind {
    /// An option or argument makes no sense (exit code 2).
    Usage,
    /// A file cannot be read, is damaged, or uses a feature that is not supported (exit code 3).
    Unreadable,
    /// A file was read but lacks what is needed: no colour, sizes that differ, … (exit code 4).
    Lacking,
    /// The result cannot go where it is to go: there is no such folder, it is write-protected, no regular file
    /// (exit code 2).
    Misplaced,
    /// The result cannot be written: the disk is at fault (exit code 5).
    Unwritable,
    /// The caller told the run to stop, by its [observer](crate::Observer) (exit code 130, as after Ctrl-C).
    Stopped,
    /// A defect of this program (exit code 70).
    Internal,
}

impl ErrorKind {
    /// The exit code of a program that stops with this kind of error.
    pub fn exit_code(self) -> u8 {
        match self {
            ErrorKind::Usage | ErrorKind::Misplaced => 2,
            ErrorKind::Unreadable => 3,
            ErrorKind::Lacking => 4,
            ErrorKind::Unwritable => 5,
            ErrorKind::Stopped => 130,
            ErrorKind::Internal => 70,
        }
    }
}

/// The exit code of a program that is done, but whose estimated error is above the one that was asked for.
pub const TARGET_NOT_MET: u8 = 10;

/// An error with its place and its remedy. Build it with [`Error::new`] and the `in_…`, `remedy`
/// methods, outermost caller last: `Error::new(kind, "…").in_channel("R").in_file(path)`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error(Box<Inner>); // boxed: a Result that is nearly always Ok stays small

#[derive(Debug, Clone, PartialEq, Eq)]
struct Inner {
    kind: ErrorKind,
    what: String,
    file: Option<PathBuf>,
    part: Option<String>,
    channel: Option<String>,
    remedy: Option<String>,
    system: Option<i32>,
}

impl Error {
    /// An error of `kind`; `what` says what was got and what was expected, without a full stop.
    pub fn new(kind: ErrorKind, what: impl Into<String>) -> Self {
        let what = what.into();
        Self(Box::new(Inner {
            kind,
            what,
            file: None,
            part: None,
            channel: None,
            remedy: None,
            system: None,
        }))
    }

    /// Names the file, unless an inner caller already did.
    #[must_use]
    pub fn in_file(mut self, file: impl AsRef<Path>) -> Self {
        self.0.file.get_or_insert_with(|| file.as_ref().to_path_buf());
        self
    }

    /// Names the part (or layer) of the file, unless an inner caller already did.
    #[must_use]
    pub fn in_part(mut self, part: impl Into<String>) -> Self {
        self.0.part.get_or_insert_with(|| part.into());
        self
    }

    /// Names the channel (or feature, or JSON path), unless an inner caller already did.
    #[must_use]
    pub fn in_channel(mut self, channel: impl Into<String>) -> Self {
        self.0.channel.get_or_insert_with(|| channel.into());
        self
    }

    /// Says what to do about it, as an imperative sentence without a full stop.
    #[must_use]
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        self.0.remedy.get_or_insert_with(|| remedy.into());
        self
    }

    /// Keeps the number of the system's `error`, where it has one.
    #[must_use]
    pub(crate) fn of_system(mut self, error: &std::io::Error) -> Self {
        self.0.system = error.raw_os_error();
        self
    }

    /// What sort of failure it is.
    pub fn kind(&self) -> ErrorKind {
        self.0.kind
    }

    /// The file the error is about, where there is one.
    pub fn file(&self) -> Option<&Path> {
        self.0.file.as_deref()
    }

    /// The number of the system's error that is behind it (`errno`), where there is one.
    pub fn system(&self) -> Option<i32> {
        self.0.system
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.0.file {
            write!(f, "{}: ", file.display())?;
        }
        if let Some(part) = &self.0.part {
            write!(f, "part '{part}': ")?;
        }
        if let Some(channel) = &self.0.channel {
            write!(f, "channel '{channel}': ")?;
        }
        f.write_str(&self.0.what)?;
        if let Some(remedy) = &self.0.remedy {
            write!(f, "; {remedy}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Error {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_names_place_and_remedy_and_inner_place_wins() {
        let error = Error::new(ErrorKind::Lacking, "no colour was found")
            .in_channel("R")
            .remedy("name it with --map color=…")
            .in_channel("G")
            .in_file("a.exr");
        assert_eq!(error.to_string(), "a.exr: channel 'R': no colour was found; name it with --map color=…");
        assert_eq!(error.kind().exit_code(), 4);
    }
}
