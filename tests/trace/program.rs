//! The program itself: its output, its plan, and a long render that is killed and goes on.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use apr::Frame;
use apr::image::Plane;
use apr::io::{DENSITY, FrameHeader, Picture, ReadOptions, write_frame, write_plane};

use super::{scenes, shipped};

fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_apr-trace"))
}

fn write_scene(folder: &Path, resolution: [usize; 2]) -> std::path::PathBuf {
    let path = folder.join("scene.json");
    std::fs::write(&path, shipped("cornell_box", resolution).to_string()).unwrap();
    path
}

fn frame(path: &Path) -> Frame {
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

/// What a run that begins may take until it has something to show, on a machine that others use.
const PATIENCE: Duration = Duration::from_secs(60);

/// Waits for a checkpoint; its bytes, none where it did not come.
fn first_checkpoint(path: &Path) -> Vec<u8> {
    let start = Instant::now();
    loop {
        match std::fs::read(path) {
            Err(_) if start.elapsed() < PATIENCE => std::thread::sleep(Duration::from_millis(2)),
            bytes => return bytes.unwrap_or_default(),
        }
    }
}

/// However many samples are asked for: a fiftieth of these would take hours.
#[test]
fn checkpoints_are_kept_at_their_times() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (write_scene(folder.path(), [16, 12]), folder.path().join("out.exr"));
    let mut reference = program();
    reference.arg(&scene).arg(&out).args([
        "--reference",
        "2000000000",
        "--checkpoint-every",
        "0.2",
        "--quiet",
    ]);
    let mut running = reference.spawn().unwrap();
    let bytes = first_checkpoint(&folder.path().join("out.exr.checkpoint"));
    running.kill().unwrap();
    running.wait().unwrap();
    assert!(!bytes.is_empty());
}

#[test]
fn a_frames_number_takes_its_place_in_the_names() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path(), [8, 6]);
    let run = |more: &[&str]| {
        let mut command = program();
        command.current_dir(folder.path()).args(["scene.json", "c.####.exr", "--spp", "1", "--quiet"]);
        let output = command.args(more).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, complaint) = run(&[]);
    assert_eq!(code, Some(2), "{complaint}");
    assert!(
        complaint.contains("c.####.exr: has a place for the frame's number")
            && complaint.contains("--frame K/M")
    );
    assert_eq!(run(&["--frame", "2/3", "--report", "c.$F2.json"]), (Some(0), String::new()));
    assert!(folder.path().join("c.0002.exr").exists() && folder.path().join("c.02.json").exists());
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
    let first = first_checkpoint(&checkpoint);
    let start = Instant::now();
    // One that replaced it holds more than one sample.
    while std::fs::read(&checkpoint).is_ok_and(|now| now == first) && start.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(2));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(checkpoint.exists(), "it was killed before its end");

    let other = reference("8").output().unwrap();
    assert_eq!(other.status.code(), Some(3), "a checkpoint of another seed is refused");
    assert!(String::from_utf8_lossy(&other.stderr).contains("remove it"));

    let fewer = ["--reference", "1", "--seed", "7"];
    let fewer = program().arg(&scene).arg(&out).args(fewer).output().unwrap();
    assert!(String::from_utf8_lossy(&fewer.stderr).contains("samples per pixel already"));

    let report = folder.path().join("report.json");
    let resumed = reference("7").arg("--report").arg(&report).stdout(Stdio::piped()).output().unwrap();
    assert!(resumed.status.success() && !checkpoint.exists());
    let told: serde_json::Value = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
    let (all, now) = (48 * 36 * 400, told["samplesOfThisRun"].as_u64().unwrap());
    assert!(told["samples"] == all && now < all, "{told}");
    let said = String::from_utf8_lossy(&resumed.stdout).into_owned();
    let before = all - now;
    assert!(said.contains(&format!("{now} samples in ")) && said.contains(&format!("after {before} of an")));
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

/// The picture cannot be written: nothing is lost, the next run draws no sample.
#[test]
fn a_reference_that_cannot_be_written_keeps_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (write_scene(folder.path(), [48, 36]), folder.path().join("out.exr"));
    let checkpoint = folder.path().join("out.exr.checkpoint");
    let mut reference = program();
    reference.arg(&scene).arg(&out).args(["--reference", "400", "--checkpoint-every", "0", "--quiet"]);
    reference.stderr(Stdio::piped());
    let running = reference.spawn().unwrap();
    first_checkpoint(&checkpoint);
    std::fs::create_dir(&out).expect("it has not come to its end");
    let failed = running.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&failed.stderr).into_owned();
    assert!(failed.status.code() == Some(2) && said.contains("out.exr: is a folder"), "{said}");
    std::fs::remove_dir(&out).unwrap();
    let report = folder.path().join("report.json");
    assert!(reference.arg("--report").arg(&report).status().unwrap().success());
    let told: serde_json::Value = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
    assert_eq!((&told["samples"], &told["samplesOfThisRun"]), (&(48 * 36 * 400).into(), &0.into()));
    assert!(out.exists() && !checkpoint.exists());
}

#[test]
fn a_map_of_samples_and_a_report() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, map) = (write_scene(folder.path(), [12, 10]), folder.path().join("map.exr"));
    let (out, report) = (folder.path().join("out.exr"), folder.path().join("report.json"));
    // A pixel's samples do not depend on those of others: each is that of a render with its number.
    let uniform = |spp: u32| {
        let path = folder.path().join(format!("{spp}.exr"));
        let spp = spp.to_string();
        assert!(program().arg(&scene).arg(&path).args(["--spp", &spp]).status().unwrap().success());
        frame(&path)
    };
    let (two, five) = (uniform(2), uniform(5));
    // A lone channel, the red of a picture, our own layer beside a picture.
    let counts = Plane::from_fn(12, 10, |x, _| [0.2, 1.8, 5.0][x % 3]);
    let zero = || Plane::filled(12, 10, 0.0);
    let red = Frame::new([counts.clone(), zero(), zero()]).unwrap();
    let black = Frame::new([zero(), zero(), zero()]).unwrap();
    let own = FrameHeader { further: &[("sampleCount.Y", &counts)], ..FrameHeader::default() };
    let maps: [&dyn Fn(); 3] = [
        &|| write_plane(&map, "passes", &counts).unwrap(),
        &|| write_frame(&map, &red, &FrameHeader::default()).unwrap(),
        &|| write_frame(&map, &black, &own).unwrap(),
    ];
    for (layout, write) in maps.iter().enumerate() {
        write();
        let mut command = program();
        command.arg(&scene).arg(&out).arg("--spp-map").arg(&map).arg("--report").arg(&report);
        assert!(command.status().unwrap().success(), "layout {layout}");
        let report: serde_json::Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
        assert_eq!(report["samples"], 12 * 10 / 3 * 7);
        assert_eq!(report["plan"]["effects"].as_array().unwrap().len(), 9);
        let picture = Picture::read(&out, &ReadOptions::default()).unwrap();
        let (mapped, counts) = (picture.frame(), picture.sample_counts().unwrap());
        assert_eq!(mapped.spp(), Some(7.0 / 3.0));
        let values = |frame: &Frame, x: usize, y: usize| {
            [frame.color(), frame.color_var_of_mean().unwrap()].map(|rgb| [0, 1, 2].map(|c| rgb[c].get(x, y)))
        };
        for (x, y) in (0..10).flat_map(|y| (0..12).map(move |x| (x, y))) {
            assert_eq!(counts.get(x, y), [0.0, 2.0, 5.0][x % 3]);
            match x % 3 {
                0 => assert!(values(mapped, x, y).as_flattened().iter().all(|v| v.is_nan())),
                1 => assert_eq!(values(mapped, x, y), values(&two, x, y)),
                _ => assert_eq!(values(mapped, x, y), values(&five, x, y)),
            }
        }
    }
}

#[test]
fn a_map_of_samples_that_makes_no_sense_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, map) = (write_scene(folder.path(), [12, 10]), folder.path().join("map.exr"));
    let out = folder.path().join("out.exr");
    let refused = |why: &str| {
        let output = program().arg(&scene).arg(&out).arg("--spp-map").arg(&map).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(4), "{said}");
        assert!(said.contains(why) && said.contains("map.exr"), "{said}");
    };
    let cases = [
        ([1.0, f32::NAN], "channel 'n.Y': NaN samples in column 7 of row 4"),
        ([1.0, -1.0], "channel 'n.Y': -1 samples"),
        ([1.0, f32::INFINITY], "inf samples"),
        ([1.0, 3e7], "from 0 to 16777216"),
        ([0.0, 0.0], "gives no pixel a sample"),
    ];
    for ([most, one], why) in cases {
        let counts = Plane::from_fn(12, 10, |x, y| if (x, y) == (7, 4) { one } else { most });
        write_plane(&map, "n.Y", &counts).unwrap();
        refused(why);
    }
    let turned = Plane::filled(10, 12, 1.0);
    write_plane(&map, "n.Y", &turned).unwrap();
    refused("the map is 10×12 where the picture is 12×10");
}

/// As `apr-denoise --sampling-map` writes it.
#[test]
fn a_density_is_multiplied_by_the_samples_per_pixel_that_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, map) = (write_scene(folder.path(), [12, 10]), folder.path().join("map.exr"));
    let out = folder.path().join("out.exr");
    let render = |channel: &str, mean: f32, spp: &[&str]| {
        write_plane(&map, channel, &Plane::from_fn(12, 10, |x, _| [0.0, 0.5, 2.5][x % 3] * mean)).unwrap();
        let output = program().arg(&scene).arg(&out).arg("--spp-map").arg(&map).args(spp).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, said) = render(DENSITY, 1.0, &["--spp", "6"]);
    assert_eq!(code, Some(0), "{said}");
    let picture = Picture::read(&out, &ReadOptions::default()).unwrap();
    let counts = picture.sample_counts().unwrap();
    assert_eq!(counts, &Plane::from_fn(12, 10, |x, _| [0.0, 3.0, 15.0][x % 3]));
    for (channel, mean, spp, code, words) in [
        (DENSITY, 1.0, &[][..], 2, "give the samples per pixel of this pass by --spp N"),
        (DENSITY, 0.0, &["--spp", "6"], 4, "the target is met"),
        ("n.Y", 2.0, &["--spp", "6"], 2, "leave --spp out"),
    ] {
        let (found, said) = render(channel, mean, spp);
        assert!(found == Some(code) && said.contains(words) && said.contains("map.exr"), "{said}");
    }
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

    let missed = adaptive(&["--spp", "5", "--rounds", "2", "--target-error", "1e-9", "-q"]);
    assert!(missed.status.code() == Some(10) && missed.stdout.is_empty());
    let met = adaptive(&["--spp", "9", "--rounds", "3", "--target-error", "1000"]);
    assert!(met.status.success());
    let told: serde_json::Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    assert_eq!((&told["adaptive"]["target_met"], &told["samples"]), (&true.into(), &(3 * 20 * 14).into()));

    for (refused, why) in [
        (&["--spp", "3"][..], "give an spp of 5 or more"),
        (&["--reference", "100"], "cannot be used with"),
        (&["--spp", "9", "--rounds", "1"], "give 2 rounds or more"),
    ] {
        let output = adaptive(refused);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && said.contains(why), "{said}");
    }
}

#[test]
fn a_picture_of_another_ending_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (write_scene(folder.path(), [12, 10]), folder.path().join("out.png"));
    let output = program().arg(&scene).arg(&out).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && said.contains("out.png: does not end in .exr"), "{said}");
}

#[test]
fn files_that_would_replace_each_other_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (folder.path().join("scene.json"), folder.path().join("out.exr"));
    let checkpoint = folder.path().join("out.exr.checkpoint");
    let painting = folder.path().join("painting.png");
    std::fs::copy(scenes().join("painting.png"), &painting).unwrap();
    let mut document = shipped("cornell_box", [12, 10]);
    document["materials"]["white"]["reflectance"] =
        serde_json::json!({"type": "bitmap", "file": "painting.png"});
    std::fs::write(&scene, document.to_string()).unwrap();
    let before = std::fs::read(&scene).unwrap();
    for (report, words) in [
        (&scene, "the report and the scene"),
        (&painting, "the report and a file of the scene"),
        (&out, "the report and the picture"),
        (&checkpoint, "the checkpoint and the report"),
    ] {
        let mut command = program();
        command.arg(&scene).arg(&out).args(["--reference", "2", "--report"]).arg(report);
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && said.contains(words), "{said}");
        assert!(std::fs::read(&scene).unwrap() == before && !out.exists());
    }
}

#[test]
fn no_picture_is_replaced_that_the_tracer_did_not_write() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (write_scene(folder.path(), [12, 10]), folder.path().join("out.exr"));
    let report = folder.path().join("report.json");
    let run = |further: &[&str]| {
        let mut command = program();
        command.arg(&scene).arg(&out).arg("--report").arg(&report).args(["-q", "--spp", "2"]).args(further);
        let output = command.output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    for _ in 0..2 {
        assert_eq!(run(&[]), (Some(0), String::new()), "its own render may be replaced");
    }
    let foreign = scenes().join("../blender/room_seed1.exr");
    for place in [&out, &report] {
        let before = std::fs::read(place).unwrap();
        std::fs::copy(&foreign, place).unwrap();
        let (code, said) = run(&[]);
        assert!(
            code == Some(2) && said.contains("did not write it") && said.contains("--overwrite"),
            "{said}"
        );
        assert_eq!(std::fs::read(place).unwrap(), std::fs::read(&foreign).unwrap());
        std::fs::write(place, before).unwrap();
    }
    std::fs::copy(&foreign, &out).unwrap();
    assert_eq!(run(&["--overwrite"]).0, Some(0));
}

#[test]
fn an_empty_checkpoint_is_called_so() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (write_scene(folder.path(), [12, 10]), folder.path().join("out.exr"));
    std::fs::write(folder.path().join("out.exr.checkpoint"), "").unwrap();
    let output = program().arg(&scene).arg(&out).args(["--reference", "2"]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(3) && said.contains("is empty or damaged"), "{said}");
}

#[test]
fn a_checkpoint_that_cannot_be_written_ends_no_render() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (write_scene(folder.path(), [48, 36]), folder.path().join("out.exr"));
    let checkpoint = folder.path().join("out.exr.checkpoint");
    let mut reference = program();
    reference.arg(&scene).arg(&out).args(["--reference", "400", "--checkpoint-every", "0"]);
    let running = reference.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    first_checkpoint(&checkpoint);
    while std::fs::create_dir(&checkpoint).is_err() {
        let _ = std::fs::remove_file(&checkpoint); // it may be written anew in between
    }
    let done = running.wait_with_output().unwrap();
    let said = String::from_utf8(done.stderr).unwrap();
    assert!(done.status.success() && out.exists(), "{said}");
    assert_eq!(said.matches("warning: ").count(), 1, "{said}");
}

/// The checkpoints of its own accord are far away when the first one is taken from it.
#[cfg(unix)]
#[test]
fn a_reference_that_is_told_to_stop_keeps_its_samples() {
    use std::os::unix::process::ExitStatusExt;
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (write_scene(folder.path(), [16, 12]), folder.path().join("out.exr"));
    let checkpoint = folder.path().join("out.exr.checkpoint");
    for (signal, number) in [("-TERM", 15), ("-INT", 2)] {
        let mut reference = program();
        reference.arg(&scene).arg(&out).args(["--reference", "2000000000", "--checkpoint-every", "2", "-q"]);
        let mut running = reference.spawn().unwrap();
        first_checkpoint(&checkpoint);
        std::fs::remove_file(&checkpoint).unwrap();
        Command::new("kill").args([signal, &running.id().to_string()]).status().unwrap();
        assert_eq!(running.wait().unwrap().signal(), Some(number));
        assert!(std::fs::metadata(&checkpoint).unwrap().len() > 0);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "the scene and the checkpoint");
        std::fs::remove_file(&checkpoint).unwrap();
    }
}

#[cfg(target_os = "linux")]
#[test]
fn names_of_any_bytes_are_reported() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let (scene, report) = (write_scene(folder.path(), [12, 10]), folder.path().join("report.json"));
    let out = folder.path().join(std::ffi::OsStr::from_bytes(b"out\xff.exr"));
    let mut command = program();
    command.arg(&scene).arg(&out).args(["-q", "--spp", "1", "--report"]).arg(&report);
    assert!(command.status().unwrap().success());
    let told: serde_json::Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    assert!(told["output"].as_str().unwrap().ends_with("out\u{fffd}.exr"));
}

#[cfg(target_os = "linux")]
#[test]
fn more_than_the_machine_can_hold_is_told_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.exr");
    let mut command = Command::new("sh");
    let limited = "ulimit -v 6000000; exec \"$@\"";
    command.args(["-c", limited, "sh", env!("CARGO_BIN_EXE_apr-trace")]);
    let output = command.arg(write_scene(folder.path(), [32768, 32768])).arg(&out).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && said.contains("32768×32768"), "{said}");
    assert!(said.contains("'crop'"), "{said}");
}
