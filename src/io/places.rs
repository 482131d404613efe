//! Where paths lead: the files of a run are told apart by what they are, not by how they are written.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Error, ErrorKind, Result};

/// A file that a run reads or writes.
#[derive(Debug, Clone, Copy)]
pub struct RunFile<'a> {
    /// What messages call it, such as "the report".
    pub role: &'a str,
    /// Where it is.
    pub path: &'a Path,
}

/// Checks that no file of `targets` is one of `sources` or another target. Names of one file that differ as
/// text (`a.exr`, `./a.exr`, a symbolic link to it) are seen through.
///
/// # Errors
/// `Usage`, naming both files.
pub fn check_apart<'a>(
    sources: impl IntoIterator<Item = RunFile<'a>>,
    targets: impl IntoIterator<Item = RunFile<'a>>,
) -> Result<()> {
    let refuse = |what: &str, target: RunFile, other: RunFile| {
        let what = format!("{what}: {} and {} ({})", target.role, other.role, other.path.display());
        Err(Error::new(ErrorKind::Usage, what).in_file(target.path))
    };
    let mut written = HashMap::new();
    for target in targets {
        if let Some(other) = written.insert(place(target.path), target) {
            return refuse("several results would be written here", target, other);
        }
    }
    for source in sources {
        if let Some(target) = written.get(&place(source.path)) {
            return refuse("is an input as well as a result", *target, source);
        }
    }
    Ok(())
}

/// Checks that the name of a target that is to hold OpenEXR says so.
///
/// # Errors
/// `Usage` when it ends otherwise.
pub fn check_ending(target: impl AsRef<Path>) -> Result<()> {
    check_ending_of(target, "exr", "OpenEXR")
}

/// The same of a target that is to hold `format`, whose files end in `.ending`.
///
/// # Errors
/// As [`check_ending`].
pub fn check_ending_of(target: impl AsRef<Path>, ending: &str, format: &str) -> Result<()> {
    let target = target.as_ref();
    let says_so = target.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending));
    if says_so || target.is_dir() {
        return Ok(()); // a folder is told by whoever would write
    }
    Err(Error::new(ErrorKind::Usage, format!("does not end in .{ending}, and {format} is what is written"))
        .remedy(format!("name it .{ending}, and convert it to another format afterwards"))
        .in_file(target))
}

/// Whether both paths lead to one file, which need not be there yet.
pub fn is_same_file(a: impl AsRef<Path>, b: impl AsRef<Path>) -> bool {
    a.as_ref() == b.as_ref() || place(a.as_ref()) == place(b.as_ref())
}

/// The one path of the file that `path` leads to. A file that is not there has a place in its folder; where that is
/// not there either, nothing can be lost.
fn place(path: &Path) -> PathBuf {
    let path = followed(path);
    let in_folder = || Some(fs::canonicalize(folder(&path)).ok()?.join(path.file_name()?));
    fs::canonicalize(&path).ok().or_else(in_folder).unwrap_or(path)
}

/// What symbolic links make of `path`, also where the last one leads to no file yet.
pub(super) fn followed(path: &Path) -> PathBuf {
    steps(path).last().unwrap_or_default()
}

/// Whether `path` leads through an open descriptor (`/dev/stdout`, `/dev/fd/3`): what is behind it has been opened by
/// somebody, who would not see the file that replaces it.
pub(super) fn is_descriptor(path: &Path) -> bool {
    const FOLDERS: [&str; 2] = ["/proc", "/dev/fd"];
    steps(path).any(|step| {
        let folder = fs::canonicalize(folder(&step));
        folder.is_ok_and(|folder| FOLDERS.iter().any(|known| folder.starts_with(known)))
    })
}

/// The paths that symbolic links lead to, `path` itself first.
fn steps(path: &Path) -> impl Iterator<Item = PathBuf> {
    /// As many as Linux follows; a circle of links stays one, and opening it fails.
    const MOST_LINKS: usize = 40;
    let next = |path: &PathBuf| Some(folder(path).join(fs::read_link(path).ok()?));
    std::iter::successors(Some(path.to_owned()), next).take(1 + MOST_LINKS)
}

/// The folder that `path` is in.
pub(super) fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file<'a>(role: &'a str, path: &'a Path) -> RunFile<'a> {
        RunFile { role, path }
    }

    #[test]
    fn one_file_of_two_names_is_told_with_both() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a.exr", "b.exr"].map(|name| folder.path().join(name));
        let again = folder.path().join(".").join("..").join(folder.path().file_name().unwrap()).join("b.exr");
        fs::write(&a, "").unwrap();
        check_apart([file("the input", &a), file("the half", &a)], [file("the result", &b)]).unwrap();
        let twice = check_apart([], [file("the result", &b), file("the report", &again)]).unwrap_err();
        assert_eq!(twice.kind(), ErrorKind::Usage);
        let words = format!("the report and the result ({})", b.display());
        assert!(twice.to_string().contains(&words), "{twice}");
        fs::write(&b, "").unwrap();
        let lost = check_apart([file("the half", &b)], [file("the report", &again)]).unwrap_err();
        assert!(lost.to_string().contains("the report and the half"), "{lost}");
    }

    #[test]
    #[cfg(unix)]
    fn links_lead_to_their_files_be_they_there_or_not() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link, far, circle] = ["a.exr", "b.exr", "c.exr", "d.exr"].map(|n| folder.path().join(n));
        std::os::unix::fs::symlink("a.exr", &link).unwrap();
        std::os::unix::fs::symlink(&link, &far).unwrap();
        std::os::unix::fs::symlink("d.exr", &circle).unwrap();
        assert!(is_same_file(&far, &file), "no file yet");
        fs::write(&file, "").unwrap();
        assert!(is_same_file(&far, &file) && !is_same_file(&file, &circle));
        assert_eq!(followed(&far), file);
        assert!(followed(&circle).is_symlink() && !is_descriptor(&far));
        std::os::unix::fs::symlink("/dev/stdout", folder.path().join("out")).unwrap();
        assert!(!cfg!(target_os = "linux") || is_descriptor(&folder.path().join("out")));
    }
}
