//! The program itself: its output, its plan, and a long render that is killed and goes on.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use apr::io::{Picture, ReadOptions};

use super::{scenes, shipped};

fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_apr-trace"))
}

fn write_scene(folder: &Path, resolution: [usize; 2]) -> std::path::PathBuf {
    let path = folder.join("scene.json");
    std::fs::write(&path, shipped("cornell_box", resolution).to_string()).unwrap();
    path
}

fn frame(path: &Path) -> apr::Frame {
    Picture::read(path, &ReadOptions::default()).unwrap().frame().clone()
}

#[test]
fn the_plan_gives_a_reason_for_every_effect() {
    let output = program().arg(scenes().join("fog_shaft.json")).arg("--plan").output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success());
    assert!(
        text.lines().any(|line| line.starts_with("medium") && line.contains("yes  a medium fills a box"))
    );
    assert!(text.lines().any(|line| line.starts_with("motion blur") && line.contains("no ")));
}

#[test]
fn a_killed_reference_goes_on_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (write_scene(folder.path(), [48, 36]), folder.path().join("out.exr"));
    let checkpoint = folder.path().join("out.exr.checkpoint");
    let reference = |seed: &str| {
        let mut command = program();
        command.arg(&scene).arg(&out).args(["--reference", "400", "--checkpoint-every", "0", "--seed", seed]);
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        command
    };
    let mut killed = reference("7").spawn().unwrap();
    let start = Instant::now();
    while !checkpoint.exists() && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(checkpoint.exists(), "it was killed before its end");

    let other = reference("8").output().unwrap();
    assert_eq!(other.status.code(), Some(3), "a checkpoint of another seed is refused");
    assert!(String::from_utf8_lossy(&other.stderr).contains("remove it"));

    assert!(reference("7").status().unwrap().success());
    assert!(!checkpoint.exists());
    let whole = folder.path().join("whole.exr");
    assert!(
        program()
            .arg(&scene)
            .arg(&whole)
            .args(["--spp", "400", "--seed", "7", "--quiet"])
            .status()
            .unwrap()
            .success()
    );
    assert_eq!(frame(&out), frame(&whole));
}

#[test]
fn a_map_of_samples_and_a_report() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, map) = (write_scene(folder.path(), [12, 10]), folder.path().join("map.exr"));
    let counts = apr::image::Plane::from_fn(12, 10, |x, _| 2.0 + (x % 3) as f32);
    let plane = [counts.clone(), counts.clone(), counts.clone()];
    apr::io::write_frame(&map, &apr::Frame::new(plane).unwrap(), &Default::default()).unwrap();
    let (out, report) = (folder.path().join("out.exr"), folder.path().join("report.json"));
    let status =
        program().arg(&scene).arg(&out).arg("--spp-map").arg(&map).arg("--report").arg(&report).status();
    assert!(status.unwrap().success());
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
    assert_eq!(report["samples"], 12 * 10 * 3);
    assert_eq!(report["plan"]["effects"].as_array().unwrap().len(), 9);
    assert_eq!(frame(&out).spp(), Some(3.0));
}

#[test]
fn a_render_in_rounds_writes_its_counts_and_reports_every_round() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write_scene(folder.path(), [20, 14]);
    let (out, report) = (folder.path().join("out.exr"), folder.path().join("report.json"));
    let adaptive = |more: &[&str]| {
        let mut command = program();
        command.arg(&scene).arg(&out).arg("--adaptive").args(more).arg("--report").arg(&report);
        command.output().unwrap()
    };
    assert!(adaptive(&["--spp", "9", "--rounds", "3"]).status.success());
    let told: serde_json::Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    let rounds = told["adaptive"]["rounds"].as_array().unwrap();
    assert_eq!((rounds.len(), &told["samples"]), (3, &(9 * 20 * 14).into()));
    assert!(rounds[0]["estimated_error"].as_f64().unwrap() > 0.0 && rounds[2]["trace_seconds"].is_f64());
    let picture = Picture::read(&out, &ReadOptions::default()).unwrap();
    let counts = picture.sample_counts().unwrap().data();
    assert_eq!(counts.iter().sum::<f32>(), 9.0 * 20.0 * 14.0);
    assert!(counts.iter().any(|&n| n != 9.0));
    assert_eq!(picture.frame().spp(), Some(9.0));

    let met = adaptive(&["--spp", "9", "--rounds", "3", "--target-error", "1000"]);
    assert!(met.status.success());
    let told: serde_json::Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    assert_eq!((&told["adaptive"]["target_met"], &told["samples"]), (&true.into(), &(3 * 20 * 14).into()));

    for (refused, why) in [
        (&["--spp", "3"][..], "give --spp 5 or more"),
        (&["--reference", "100"], "cannot be used with"),
        (&["--spp", "9", "--rounds", "1"], "--rounds 2"),
    ] {
        let output = adaptive(refused);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && said.contains(why), "{said}");
    }
}
