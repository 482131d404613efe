//! Files that appear whole or not at all.
//!
//! A result is written to a temporary file in the folder of its target and renamed over it, which
//! every file system does in one step. The temporary file is locked while its writer lives, so that
//! a later run can tell what a killed run left from the work of a live one, and remove it. Its name is
//! nobody else's, whatever machine or container they run in: process numbers repeat there. Where locks
//! hold on one machine alone, another one may take a live file for a killed run's; then the rename fails
//! and says so, but nothing half-written is ever published.

use std::fs::{self, File, Metadata, TryLockError};
use std::hash::{BuildHasher, DefaultHasher, Hash, Hasher, RandomState};
use std::io::{BufWriter, ErrorKind as Cause, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::attributes;
use super::places::{folder, followed, is_descriptor};
use crate::error::{Error, ErrorKind, Result};

/// The ending of temporary files.
const ENDING: &str = ".apr-tmp";

/// Temporary files of this process, for [`abandon_temporaries`]. A rename happens under this lock.
static LIVE: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn live() -> MutexGuard<'static, Vec<PathBuf>> {
    LIVE.lock().unwrap_or_else(PoisonError::into_inner) // a list of names cannot be left half-changed
}

/// A temporary file, known to [`abandon_temporaries`] and gone when this is dropped.
struct Temporary {
    path: PathBuf,
    file: File,
}

impl Temporary {
    /// Makes `.STEM.PROCESS.CHANCE.apr-tmp` beside the target, which nobody had before, and locks it.
    fn beside(target: &Path) -> std::io::Result<Self> {
        /// More than one is needed only when somebody clears up at the same moment.
        const TRIES: usize = 16;
        for _ in 0..TRIES {
            if let Some(temporary) = Self::create(target)? {
                return Ok(temporary);
            }
        }
        Err(Cause::AlreadyExists.into())
    }

    /// None where the name is taken, or somebody who clears up has come between creation and lock.
    fn create(target: &Path) -> std::io::Result<Option<Self>> {
        let stem = stem(target);
        let chance = RandomState::new().build_hasher().finish(); // keys from the system's random numbers
        let path = target.with_file_name(format!(".{stem}.{}.{chance:016x}{ENDING}", std::process::id()));
        // To be read as well: the attributes of a picture's header are put in order when it is whole.
        let mut exclusively = File::options();
        exclusively.read(true).write(true).create_new(true);
        let mut names = live(); // a signal waits until the name is known
        let file = match exclusively.open(&path) {
            Err(error) if error.kind() == Cause::AlreadyExists => return Ok(None),
            opened => opened?,
        };
        names.push(path.clone());
        drop(names);
        let temporary = Self { path, file };
        // Some network file systems have no locks; then strays merely stay.
        let lost = matches!(temporary.file.try_lock(), Err(TryLockError::WouldBlock));
        Ok((!lost && temporary.path.exists()).then_some(temporary))
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path); // after a rename it is not there
        live().retain(|path| *path != self.path);
    }
}

/// Writes `target` by `write`, which gets the temporary file; `target` keeps its old content until
/// everything is written and on the disk. It keeps who may read and write it, and a symbolic link goes on leading
/// where it leads: that file is replaced.
///
/// # Errors
/// When `write` fails, or the folder takes no new file, or the disk is full. Then `target` is as it
/// was and the temporary file is gone.
fn write_atomically(target: &Path, write: impl FnOnce(&mut BufWriter<&File>) -> Result<()>) -> Result<()> {
    let old = replaced(target)?;
    let end = followed(target);
    remove_strays(&end);
    let renamed = Temporary::beside(&end).map_err(|error| cannot_begin(&error)).and_then(|temporary| {
        // Before the first byte: what was private stays so at every moment.
        old.map_or(Ok(()), |old| keep_access(&temporary.file, &old)).map_err(|error| cannot_write(&error))?;
        fill(&temporary.file, write)?;
        let names = live(); // from here on a signal must wait: the file is the result now
        let renamed = fs::rename(&temporary.path, &end);
        drop(names);
        renamed.map_err(|error| cannot_write(&error))
    });
    renamed.map_err(|error| error.in_file(target))
}

/// Writes `bytes` as the file at `path`, which appears whole or not at all.
///
/// # Errors
/// When the folder takes no new file or the disk is full; an old file is then unharmed.
pub fn write_bytes(path: impl AsRef<Path>, bytes: &[u8]) -> Result<()> {
    write_atomically(path.as_ref(), |file| file.write_all(bytes).map_err(|error| cannot_write(&error)))
}

/// Checks that a file can be written at `target`, before the work that is to fill it.
///
/// # Errors
/// `Misplaced` when it is anything but a regular file or write-protected, or its folder is missing or takes no new file;
/// `Unwritable` when the disk is at fault.
pub fn check_target(target: impl AsRef<Path>) -> Result<()> {
    let target = target.as_ref();
    check_old(target)?;
    let created = Temporary::beside(&followed(target));
    created.map(|_| ()).map_err(|error| cannot_begin(&error).in_file(target))
}

/// The part of [`check_target`] that is about what is there already, and leaves no trace in the folder.
///
/// # Errors
/// `Misplaced` when it is anything but a regular file or write-protected.
pub fn check_old(target: impl AsRef<Path>) -> Result<()> {
    replaced(target.as_ref()).map(|_| ())
}

/// The file that a result replaces; none where there is none yet.
///
/// # Errors
/// `Misplaced` when it is no regular file: a rename would destroy a device or a pipe, and write nothing to it. And when
/// it is protected, which a rename would not mind: it asks the folder alone.
fn replaced(target: &Path) -> Result<Option<Metadata>> {
    let refuse =
        |what: &str, remedy: &str| Err(Error::new(ErrorKind::Misplaced, what).remedy(remedy).in_file(target));
    if is_descriptor(target) {
        return refuse(
            "is an open file of a process: a result would replace what is behind it",
            "name the file itself",
        );
    }
    match fs::metadata(target) {
        // Root may write to all files; what nobody else may write to is protected from it as well.
        Ok(old) if old.is_file() && (old.permissions().readonly() || is_forbidden(target)) => {
            refuse("is write-protected", "name the result otherwise, or make the file writable (chmod u+w)")
        }
        Ok(old) if old.is_file() => Ok(Some(old)),
        Ok(old) if old.is_dir() => refuse("is a folder where a file was expected", "name a file in it"),
        Ok(_) => refuse(
            "is a device or a pipe where a file was expected",
            "name a regular file: results are written beside it and renamed",
        ),
        Err(error) if error.kind() == Cause::NotFound => Ok(None),
        Err(_) if followed(target).is_symlink() => {
            refuse("is a link that leads to itself", "remove the link, or name the file itself")
        }
        Err(error) => Err(cannot_begin(&error).in_file(target)),
    }
}

/// Whether this user may not write to the file at `path`, which is not changed.
fn is_forbidden(path: &Path) -> bool {
    File::options().write(true).open(path).is_err_and(|error| error.kind() == Cause::PermissionDenied)
}

/// Lets those read and write `file` who may do so with the `old` one.
#[cfg(unix)]
fn keep_access(file: &File, old: &Metadata) -> std::io::Result<()> {
    use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
    let own = file.metadata()?;
    // As far as it is allowed: only root gives files away, others to groups that they are in.
    if own.gid() != old.gid() {
        let _ = fchown(file, None, Some(old.gid()));
    }
    /// Reading, writing and executing; a new content has no claim to another user's rights (setuid).
    const ACCESS: u32 = 0o777;
    let bits = |metadata: &Metadata| metadata.permissions().mode() & ACCESS;
    if bits(&file.metadata()?) != bits(old) {
        // Some file systems without such bits take no change of them.
        file.set_permissions(fs::Permissions::from_mode(bits(old)))?;
    }
    // Last, since what belongs to others is theirs to change.
    if own.uid() != old.uid() {
        let _ = fchown(file, Some(old.uid()), None);
    }
    Ok(())
}

/// Other systems let a file inherit this from its folder.
#[cfg(not(unix))]
fn keep_access(_: &File, _: &Metadata) -> std::io::Result<()> {
    Ok(())
}

/// Removes the temporary files that this process is writing, and keeps it from renaming any: for a
/// program that is told to stop and exits at once. Blocks every later write for good.
pub fn abandon_temporaries() {
    let names = live();
    for name in names.iter() {
        let _ = fs::remove_file(name); // it may not exist yet
    }
    std::mem::forget(names);
}

fn fill(file: &File, write: impl FnOnce(&mut BufWriter<&File>) -> Result<()>) -> Result<()> {
    let mut buffered = BufWriter::with_capacity(1 << 20, file);
    write(&mut buffered)?;
    buffered.flush().and_then(|()| file.sync_all()).map_err(|error| cannot_write(&error))
}

/// What temporary files of this target are called: its name, or the begin of a long one with a number that stands for all
/// of it, because file systems take no more than 255 bytes.
fn stem(target: &Path) -> String {
    const MOST: usize = 160;
    const KEPT: usize = 32;
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    if name.len() <= MOST {
        return name.into_owned();
    }
    let mut hash = DefaultHasher::new();
    name.hash(&mut hash);
    format!("{}~{:016x}", name.chars().take(KEPT).collect::<String>(), hash.finish())
}

/// Removes what killed runs for the same target left: temporary files that nobody holds locked.
fn remove_strays(target: &Path) {
    let start = format!(".{}.", stem(target));
    for entry in fs::read_dir(folder(target)).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let writer = name.strip_prefix(&start).and_then(|rest| rest.strip_suffix(ENDING));
        if !writer.is_some_and(is_writer) {
            continue;
        }
        // Held until it is removed: a writer that has just made it finds the lock taken and makes another.
        if let Some(_held) = File::open(entry.path()).ok().filter(|file| file.try_lock().is_ok()) {
            let _ = fs::remove_file(entry.path()); // another run may have been faster
        }
    }
}

/// Whether this stands for a temporary file's writer in its name: a process's number, and mostly a number by chance.
fn is_writer(text: &str) -> bool {
    let (process, chance) = text.split_once('.').unwrap_or((text, "0"));
    let digits = |text: &str, radix| !text.is_empty() && text.chars().all(|digit| digit.is_digit(radix));
    digits(process, 10) && digits(chance, 16)
}

/// Writes an EXR file at `target` by `write`, like [`write_atomically`], with its attributes in order.
///
/// # Errors
/// As [`write_atomically`].
pub(super) fn write_picture_atomically(
    target: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> Result<()>,
) -> Result<()> {
    write_atomically(target, |file| {
        write(file)?;
        file.flush().and_then(|()| attributes::finish(file.get_ref())).map_err(|error| cannot_write(&error))
    })
}

/// The error of a file that cannot be made: by what no further try cures, or by the disk.
fn cannot_begin(error: &std::io::Error) -> Error {
    let remedy = match error.kind() {
        Cause::NotFound | Cause::NotADirectory => "make its folder, or name one that is there",
        Cause::PermissionDenied | Cause::ReadOnlyFilesystem => "name a folder that may be written to",
        Cause::InvalidFilename => "give it a shorter name",
        _ => return cannot_write(error),
    };
    let what = format!("cannot be written: {error}");
    Error::new(ErrorKind::Misplaced, what).of_system(error).remedy(remedy)
}

fn cannot_write(error: &std::io::Error) -> Error {
    Error::new(ErrorKind::Unwritable, format!("cannot be written: {error}"))
        .of_system(error)
        .remedy("check that the disk has room and that its server answers")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
        let mut names: Vec<_> = fs::read_dir(folder).unwrap().map(name).collect();
        names.sort();
        names
    }

    #[test]
    fn the_old_content_stays_until_the_new_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.exr");
        fs::write(&target, "old").unwrap();
        let failed = write_atomically(&target, |file| {
            file.write_all(b"half").unwrap();
            Err(Error::new(ErrorKind::Internal, "stopped"))
        });
        assert_eq!(failed.unwrap_err().file(), Some(target.as_path()));
        assert_eq!(fs::read(&target).unwrap(), b"old");
        write_bytes(&target, b"new").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["out.exr"]);
    }

    #[test]
    fn strays_of_killed_runs_go_and_live_ones_stay() {
        let folder = tempfile::tempdir().unwrap();
        let strays = [".out.exr.1.apr-tmp", ".out.exr.2.apr-tmp", ".out.exr.3.0f.apr-tmp"];
        let others = [".other.exr.1.apr-tmp", ".out.exr.1.2.3.apr-tmp", ".out.exr.x.apr-tmp"];
        for name in strays.iter().chain(&others) {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let live = File::create(folder.path().join(".out.exr.2.apr-tmp")).unwrap();
        live.lock().unwrap();
        write_atomically(&folder.path().join("out.exr"), |_| Ok(())).unwrap();
        let mut left = [&others[..], &[".out.exr.2.apr-tmp", "out.exr"]].concat();
        left.sort();
        assert_eq!(names(folder.path()), left);
    }

    #[test]
    fn two_writers_of_one_process_number_do_not_share_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.exr");
        write_atomically(&target, |outer| {
            outer.write_all(b"out").unwrap();
            write_bytes(&target, b"inner").unwrap();
            assert_eq!(fs::read(&target).unwrap(), b"inner");
            outer.write_all(b"er").unwrap();
            Ok(())
        })
        .unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"outer");
        assert_eq!(names(folder.path()), ["out.exr"]);
    }

    #[test]
    #[cfg(unix)]
    fn a_link_is_written_through_and_access_stays() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let [file, link, new] = ["a.exr", "b.exr", "c.exr"].map(|name| folder.path().join(name));
        fs::create_dir(folder.path().join("far")).unwrap();
        symlink("a.exr", &link).unwrap();
        symlink("far/c.exr", &new).unwrap();
        fs::write(&file, "old").unwrap();
        for mode in [0o600, 0o664, 0o200] {
            fs::set_permissions(&file, fs::Permissions::from_mode(mode)).unwrap();
            write_bytes(&link, format!("{mode}").as_bytes()).unwrap();
            assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, mode);
            fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
            assert_eq!(fs::read_to_string(&file).unwrap(), format!("{mode}"));
        }
        fs::set_permissions(&file, fs::Permissions::from_mode(0o444)).unwrap();
        for refused in [check_target(&link), write_bytes(&link, b"new")] {
            assert!(refused.unwrap_err().to_string().contains("is write-protected"));
        }
        check_target(&new).unwrap();
        write_bytes(&new, b"far").unwrap();
        assert_eq!(fs::read(folder.path().join("far/c.exr")).unwrap(), b"far");
        assert!([link, new].iter().all(|link| link.is_symlink()));
        assert_eq!(names(folder.path()), ["a.exr", "b.exr", "c.exr", "far"]);
    }

    #[test]
    #[cfg(unix)]
    fn what_is_no_file_is_refused_and_stays() {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("out.exr");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        for target in [&*socket, Path::new("/dev/null")] {
            for refused in [check_target(target), write_bytes(target, b"new")] {
                let error = refused.unwrap_err();
                assert_eq!(error.kind(), ErrorKind::Misplaced);
                assert!(error.to_string().contains("a device or a pipe"), "{error}");
            }
        }
        assert_eq!(names(folder.path()), ["out.exr"]);
    }

    #[test]
    fn what_no_further_try_cures_is_told_by_its_cause() {
        let folder = tempfile::tempdir().unwrap();
        let long = folder.path().join("n".repeat(256));
        for (target, words) in
            [(Path::new("/nonexistent/a.exr"), "make its folder"), (&long, "a shorter name")]
        {
            let error = write_atomically(target, |_| Ok(())).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Misplaced);
            let told = format!("{}: cannot be written", target.display());
            assert!(error.to_string().starts_with(&told) && error.to_string().contains(words), "{error}");
        }
    }

    #[test]
    fn long_names_are_written_and_cleared_up_like_others() {
        let folder = tempfile::tempdir().unwrap();
        let long = |end: &str| folder.path().join("n".repeat(234) + end);
        assert_ne!(stem(&long("a")), stem(&long("b")));
        let stray = folder.path().join(format!(".{}.1.0f{ENDING}", stem(&long("a"))));
        fs::write(&stray, "").unwrap();
        write_bytes(long("b"), b"b").unwrap();
        assert!(stray.exists());
        write_bytes(long("a"), b"a").unwrap();
        assert_eq!(names(folder.path()).len(), 2);
    }

    #[test]
    #[cfg(unix)]
    fn a_group_is_kept() {
        use std::os::unix::fs::{MetadataExt, chown};
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.exr");
        fs::write(&target, "old").unwrap();
        let other = fs::metadata(&target).unwrap().gid() + 1;
        if chown(&target, None, Some(other)).is_err() {
            return; // only root is in every group
        }
        write_bytes(&target, b"new").unwrap();
        assert_eq!(fs::metadata(&target).unwrap().gid(), other);
    }

    #[test]
    #[cfg(unix)]
    fn what_leads_through_a_descriptor_or_in_a_circle_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let [log, circle] = ["log", "circle"].map(|name| folder.path().join(name));
        std::os::unix::fs::symlink("circle", &circle).unwrap();
        assert!(write_bytes(&circle, b"new").unwrap_err().to_string().contains("leads to itself"));
        let open = File::create(&log).unwrap();
        let descriptor = format!("/dev/fd/{}", std::os::fd::AsRawFd::as_raw_fd(&open));
        let error = write_bytes(descriptor, b"new").unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Misplaced);
        assert!(error.to_string().contains("is an open file of a process"), "{error}");
        assert_eq!(fs::read(&log).unwrap(), b"");
    }
}
