//! A full disk, a folder that takes nothing: the old result stays as it was, and nothing beside it.
#![expect(clippy::print_stderr, reason = "a skipped test says so")]

use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::exr_files::{channels, float, layer, scan_lines, write_one};
use exr::prelude::Compression;

const PROGRAM: &str = env!("CARGO_BIN_EXE_apr-denoise");

const OLD: &[u8] = b"the old result";

/// Exit code of a result that cannot be written for want of room, and of one that cannot go where it is to go.
const UNWRITABLE: i32 = 5;
const USAGE: i32 = 2;

/// A picture without noise, so that the run is reading and writing. It is written in many pieces: the
/// writer's buffer holds one megabyte, the picture two.
fn render(folder: &Path) -> PathBuf {
    let size = (128, 96);
    let names: Vec<String> = (0..40).map(|i| format!("other{i}.Y")).collect();
    let all: Vec<&str> = ["R", "G", "B"].into_iter().chain(names.iter().map(String::as_str)).collect();
    let mut all = channels(size, &all);
    let variance = ["variance.R", "variance.G", "variance.B"];
    all.extend(variance.map(|name| float(name, vec![0.0; size.0 * size.1])));
    let path = folder.join("in.exr");
    write_one(&path, layer(None, size, (0, 0), scan_lines(Compression::Uncompressed), all));
    path
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The run said what is wrong with which file, and what to do.
fn assert_told(output: &Output, code: i32, words: &[&str]) {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{said}");
    for word in ["out.exr", "cannot be written"].iter().chain(words) {
        assert!(said.contains(word), "'{said}' lacks '{word}'");
    }
}

/// No file may grow beyond a limit (the signal that says so is ignored, so that the write fails as it
/// does on a full disk): at the first byte, in the header, in the middle, in the last block.
#[test]
fn a_disk_that_fills_up_while_the_result_is_written_leaves_the_old_one() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (render(folder.path()), folder.path().join("out.exr"));
    let run = |limit: u64| {
        std::fs::write(&output, OLD).unwrap();
        let script = "trap '' XFSZ; ulimit -f \"$3\"; exec \"$0\" --quiet \"$1\" \"$2\"";
        let mut sh = Command::new("sh");
        sh.args(["-c", script, PROGRAM]).args([&input, &output]).arg(limit.to_string());
        sh.output().unwrap()
    };
    // The shells' blocks are of 512 or 1024 bytes: the whole file in smaller ones is enough for any.
    let whole = std::fs::metadata(&input).unwrap().len().div_ceil(512);
    for limit in [0, 1, 8, whole / 16, whole / 4, whole / 2 - 1] {
        assert_told(&run(limit), UNWRITABLE, &["large", "room"]);
        assert_eq!(std::fs::read(&output).unwrap(), OLD, "limit {limit}");
        assert_eq!(names(folder.path()), ["in.exr", "out.exr"], "limit {limit}");
    }
    let enough = run(2 * whole);
    assert!(enough.status.success(), "the limit itself is no obstacle: {enough:?}");
    assert!(std::fs::metadata(&output).unwrap().len() > 1 << 20, "the result is too small to fill a disk");
    assert_eq!(names(folder.path()), ["in.exr", "out.exr"]);
}

/// A disk of its own, of one megabyte, where the system lets a test have one.
#[test]
#[cfg(target_os = "linux")]
fn a_real_full_disk_is_told_and_leaves_the_old_result() {
    let folder = tempfile::tempdir().unwrap();
    let (input, disk) = (render(folder.path()), folder.path().join("disk"));
    std::fs::create_dir(&disk).unwrap();
    let script = "mount -t tmpfs -o size=1m disk \"$2\" || exit 99
        printf '%s' \"$3\" > \"$2/out.exr\"
        \"$0\" --quiet \"$1\" \"$2/out.exr\"; code=$?
        ls -A \"$2\"; cat \"$2/out.exr\"; exit $code";
    let mut unshare = Command::new("unshare");
    unshare.args(["--user", "--map-root-user", "--mount", "sh", "-c", script, PROGRAM]);
    unshare.args([&input, &disk]).arg(std::str::from_utf8(OLD).unwrap());
    let output = unshare.output().ok().filter(|output| !matches!(output.status.code(), Some(1 | 99)));
    let Some(output) = output else {
        eprintln!("SKIPPED: this system lends no disk to a test");
        return;
    };
    assert_told(&output, UNWRITABLE, &["No space left", "room"]);
    let left = String::from_utf8(output.stdout).unwrap();
    assert_eq!(left, format!("out.exr\n{}", std::str::from_utf8(OLD).unwrap()));
}

/// A read-only folder is told of before the work, and the old result in it stays. Root may write
/// anywhere, so as root the program runs as somebody else.
#[test]
fn a_read_only_folder_keeps_its_old_result() {
    const NOBODY: u32 = 65534;
    let folder = tempfile::tempdir().unwrap();
    let allow = |path: &Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    let closed = folder.path().join("closed");
    std::fs::create_dir(&closed).unwrap();
    let (input, output) = (render(folder.path()), closed.join("out.exr"));
    std::fs::write(&output, OLD).unwrap();
    // Somebody else may not reach the place of this program, nor the folder.
    let program = folder.path().join("program");
    std::fs::copy(PROGRAM, &program).unwrap();
    allow(folder.path(), 0o755);
    allow(&input, 0o644);
    allow(&output, 0o666);
    allow(&closed, 0o555);
    let is_root = std::fs::write(closed.join("probe"), "").is_ok();
    if is_root {
        std::fs::remove_file(closed.join("probe")).unwrap();
    }
    let run = |input: &Path, output: &Path| {
        let mut command = Command::new(&program);
        command.args([input, output]).arg("--quiet");
        if is_root {
            command.uid(NOBODY).gid(NOBODY);
        }
        command.output().unwrap()
    };
    assert_told(&run(&input, &output), USAGE, &["Permission denied", "may be written to"]);
    // Before the work: an input that is not there has not been missed yet.
    assert_told(&run(Path::new("missing.exr"), &output), USAGE, &["Permission denied"]);
    assert_eq!(std::fs::read(&output).unwrap(), OLD);
    assert_eq!(names(&closed), ["out.exr"]);
    allow(&closed, 0o777);
    let opened = run(&input, &output);
    assert!(opened.status.success(), "the folder was the only obstacle: {opened:?}");
    assert_eq!(names(&closed), ["out.exr"]);
}

/// Studios lock what is published so; a rename would ask the folder alone.
#[test]
fn a_write_protected_file_is_told_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let (input, locked) = (render(folder.path()), folder.path().join("locked.exr"));
    std::fs::copy(&input, &locked).unwrap();
    std::fs::set_permissions(&locked, std::fs::Permissions::from_mode(0o444)).unwrap();
    let before = std::fs::read(&locked).unwrap();
    let report = folder.path().join("out.exr");
    for names in
        [&[&*input, &locked][..], &[&locked, &locked], &[&input, &report, Path::new("--report"), &locked]]
    {
        let output = Command::new(PROGRAM).args(names).args(["--quiet", "--overwrite"]).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(USAGE), "{said}");
        assert!(said.contains("locked.exr: is write-protected; ") && said.contains("chmod u+w"), "{said}");
    }
    assert_eq!(std::fs::read(&locked).unwrap(), before);
    assert_eq!(names(folder.path()), ["in.exr", "locked.exr"]);
}

/// A pipe as a target is refused before the work, and stays a pipe.
#[test]
fn a_pipe_in_a_files_place_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (input, pipe) = (render(folder.path()), folder.path().join("pipe.exr"));
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let report = folder.path().join("out.exr");
    for targets in [&[&*pipe][..], &[&report, Path::new("--report"), &pipe]] {
        let output = Command::new(PROGRAM).arg(&input).args(targets).arg("--quiet").output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(USAGE) && said.contains("pipe.exr: is a device or"), "{said}");
    }
    assert_eq!(names(folder.path()), ["in.exr", "pipe.exr"]);
}
