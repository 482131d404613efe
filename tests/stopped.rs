//! Runs that are stopped at any moment: the old result or the new one is there, and nothing else.

use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use crate::exr_files::{channels, float, layer, scan_lines, write_one};
use exr::prelude::Compression;

fn start(input: &Path, output: &Path) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_apr-denoise"));
    command.args([input, output]).arg("--quiet").stderr(Stdio::piped()).spawn().unwrap()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn send(signal: &str, child: &Child) {
    Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
}

/// A picture without noise, so that the run is mostly reading and writing, and with many channels, so
/// that the writing takes a while.
fn render(path: &Path) {
    let size = (96, 64);
    let names: Vec<String> = (0..40).map(|i| format!("other{i}.Y")).collect();
    let all: Vec<&str> = ["R", "G", "B"].into_iter().chain(names.iter().map(String::as_str)).collect();
    let mut all = channels(size, &all);
    all.extend(
        ["variance.R", "variance.G", "variance.B"].map(|name| float(name, vec![0.0; size.0 * size.1])),
    );
    write_one(path, layer(None, size, (0, 0), scan_lines(Compression::PIZ), all));
}

#[test]
fn killed_at_random_moments_it_never_leaves_a_broken_result() {
    const KILLS: u64 = 50;
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("in.exr"), folder.path().join("out.exr"));
    render(&input);
    let begun = std::time::Instant::now();
    assert!(start(&input, &output).wait().unwrap().success());
    let whole_run = begun.elapsed();
    let new = std::fs::read(&output).unwrap();
    let old = b"the old result".to_vec();
    for kill in 0..KILLS {
        std::fs::write(&output, &old).unwrap();
        let mut child = start(&input, &output);
        std::thread::sleep(whole_run.mul_f64(kill as f64 / KILLS as f64));
        let signal = ["-KILL", "-TERM", "-HUP"][kill as usize % 3];
        send(signal, &child);
        child.wait().unwrap();
        let left = std::fs::read(&output).unwrap();
        assert!(left == old || left == new, "kill {kill} left {} bytes", left.len());
        if signal != "-KILL" {
            assert_no_strays_but_of_killed(folder.path(), child.id());
        }
    }
    assert!(start(&input, &output).wait().unwrap().success());
    assert_eq!(std::fs::read(&output).unwrap(), new);
    assert_eq!(names(folder.path()), ["in.exr", "out.exr"], "the next run clears up");
}

/// A process that was told to stop has removed what it wrote.
fn assert_no_strays_but_of_killed(folder: &Path, id: u32) {
    let own = names(folder).into_iter().find(|name| name.contains(&format!(".{id}.")));
    assert_eq!(own, None);
}

/// A pipe that nobody writes to keeps the program waiting for its input.
#[test]
fn told_to_stop_it_dies_by_the_signal() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("pipe"), folder.path().join("out.exr"));
    assert!(Command::new("mkfifo").arg(&input).status().unwrap().success());
    for (signal, number) in [("-TERM", 15), ("-INT", 2), ("-HUP", 1)] {
        let mut child = start(&input, &output);
        let pipe = std::fs::OpenOptions::new().write(true).open(&input).unwrap(); // waits for the reader
        send(signal, &child);
        assert_eq!(child.wait().unwrap().signal(), Some(number), "{signal}");
        drop(pipe);
    }
    assert_eq!(names(folder.path()), ["pipe"]);
}

/// `nohup` keeps a run alive when its terminal goes.
#[test]
#[cfg(target_os = "linux")]
fn a_hangup_that_is_ignored_stays_so() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("pipe"), folder.path().join("out.exr"));
    assert!(Command::new("mkfifo").arg(&input).status().unwrap().success());
    let mut sh = Command::new("sh");
    sh.args(["-c", "trap '' HUP; exec \"$@\"", "sh", env!("CARGO_BIN_EXE_apr-denoise"), "--quiet"]);
    let mut child = sh.args([&input, &output]).stderr(Stdio::piped()).spawn().unwrap();
    let pipe = std::fs::OpenOptions::new().write(true).open(&input).unwrap(); // waits for the reader
    send("-HUP", &child);
    std::thread::sleep(std::time::Duration::from_millis(200));
    assert_eq!(child.try_wait().unwrap(), None);
    drop(pipe); // which ends the input before its beginning
    assert_eq!(child.wait().unwrap().code(), Some(3));
}

/// A sequence of `render`'s picture, and its command line.
fn sequence(folder: &Path, frames: u32) -> Vec<String> {
    render(&folder.join("shot.0001.exr"));
    for frame in 2..=frames {
        std::fs::copy(folder.join("shot.0001.exr"), folder.join(format!("shot.{frame:04}.exr"))).unwrap();
    }
    let name = |name: &str| folder.join(name).into_os_string().into_string().unwrap();
    vec![name("shot.####.exr"), name("den.####.exr"), "--quiet".to_owned(), "--skip-existing".to_owned()]
}

fn start_with(arguments: &[String]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_apr-denoise")).args(arguments).stderr(Stdio::piped()).spawn().unwrap()
}

#[test]
fn a_sequence_killed_again_and_again_goes_on_where_it_was() {
    const FRAMES: u32 = 5;
    const KILLS: u32 = 12;
    let folder = tempfile::tempdir().unwrap();
    let arguments = sequence(folder.path(), FRAMES);
    let whole = |frame: u32| folder.path().join(format!("den.{frame:04}.exr"));
    let begun = std::time::Instant::now();
    assert!(start_with(&arguments).wait().unwrap().success());
    let whole_run = begun.elapsed();
    let expected = std::fs::read(whole(1)).unwrap();
    (1..=FRAMES).for_each(|frame| std::fs::remove_file(whole(frame)).unwrap());
    for kill in 0..KILLS {
        let mut child = start_with(&arguments);
        std::thread::sleep(whole_run.mul_f64(f64::from(kill) / f64::from(KILLS)));
        let signal = if kill % 2 == 0 { "-KILL" } else { "-TERM" };
        send(signal, &child);
        child.wait().unwrap();
        for frame in 1..=FRAMES {
            let result = std::fs::read(whole(frame));
            assert!(result.is_err() || result.unwrap() == expected, "kill {kill} broke frame {frame}");
        }
        if signal == "-TERM" {
            assert_no_strays_but_of_killed(folder.path(), child.id());
        }
    }
    assert!(start_with(&arguments).wait().unwrap().success());
    for frame in 1..=FRAMES {
        assert!(std::fs::read(whole(frame)).unwrap() == expected, "frame {frame}");
    }
}

/// The third frame is a pipe that nobody writes to: the run stands in the middle of its sequence.
#[test]
fn told_to_stop_in_a_sequence_it_keeps_what_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let mut arguments = sequence(folder.path(), 2);
    arguments.extend(["--frames", "1-4"].map(str::to_owned)); // a pipe is no file to be found by itself
    std::fs::copy(folder.path().join("shot.0001.exr"), folder.path().join("shot.0004.exr")).unwrap();
    let report = folder.path().join("all.json");
    arguments.extend(["--sequence-report".to_owned(), report.to_str().unwrap().to_owned()]);
    let pipe = folder.path().join("shot.0003.exr");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut child = start_with(&arguments);
    let _pipe = std::fs::OpenOptions::new().write(true).open(&pipe).unwrap(); // waits for the reader
    while !folder.path().join("den.0002.exr").exists() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    send("-TERM", &child);
    assert_eq!(child.wait().unwrap().signal(), Some(15));
    let results = ["all.json", "den.0001.exr", "den.0002.exr"];
    let renders = ["shot.0001.exr", "shot.0002.exr", "shot.0003.exr", "shot.0004.exr"];
    assert_eq!(names(folder.path()), [&results[..], &renders].concat());
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
    // The second is done, but this may not have been noted yet.
    let states = [0, 2, 3].map(|index| report["frames"][index]["state"].clone());
    assert_eq!(states, ["done", "interrupted", "not_run"]);
}
