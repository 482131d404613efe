//! Answers that nobody listens to, and answers that a full disk does not take, of all three programs.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name)
}

/// Each program with something to say, and a file that it writes before it says so.
fn commands(folder: &Path) -> Vec<(Command, Option<PathBuf>)> {
    let (render, scene) = (fixture("trace/foliage.exr"), fixture("scenes/cornell_box.json"));
    let (traced, heat_map) = (folder.join("traced.exr"), folder.join("heat.png"));
    let command = |program: &str, arguments: &[&Path]| {
        let mut command = Command::new(program);
        command.args(arguments);
        command
    };
    let [denoise, compare, trace] = [
        env!("CARGO_BIN_EXE_apr-denoise"),
        env!("CARGO_BIN_EXE_apr-compare"),
        env!("CARGO_BIN_EXE_apr-trace"),
    ];
    let option = Path::new;
    vec![
        (command(denoise, &[option("--inspect"), &render]), None),
        (command(denoise, &[option("--generate"), option("man")]), None),
        (command(compare, &[&render, &render, option("--heatmap"), &heat_map]), Some(heat_map)),
        (command(trace, &[&scene, option("--plan")]), None),
        (command(trace, &[&scene, &traced, option("--spp"), option("1")]), Some(traced)),
    ]
}

fn code_and_words(output: &Output) -> (Option<i32>, String) {
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let folder = tempfile::tempdir().unwrap();
    for (mut command, written) in commands(folder.path()) {
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take()); // long before the answer
        let ended = code_and_words(&child.wait_with_output().unwrap());
        assert_eq!(ended, (Some(0), String::new()), "{command:?}");
        assert!(written.is_none_or(|path| path.exists()), "{command:?}");
    }
}

/// /dev/full takes nothing: the disk is full.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_told() {
    let folder = tempfile::tempdir().unwrap();
    for (mut command, written) in commands(folder.path()) {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let (code, said) = code_and_words(&command.stdout(full).output().unwrap());
        assert_eq!(code, Some(5), "{command:?}: {said}");
        assert!(said.contains("the standard output cannot be written: No space left"), "{command:?}: {said}");
        assert!(written.is_none_or(|path| path.exists()), "{command:?}");
    }
}
