//! The program `apr-compare`: what it prints, writes and refuses.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use apr::Frame;
use apr::image::{Plane, Rgb};

fn compare(arguments: &[&Path]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_apr-compare")).args(arguments).output().unwrap()
}

/// An empty folder of its own for one test.
fn folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("compare").join(test);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn picture(path: PathBuf, value: f32) -> PathBuf {
    let color: Rgb = std::array::from_fn(|_| Plane::from_fn(7, 5, |x, y| value * (1 + x + 7 * y) as f32));
    apr::io::write_frame(&path, &Frame::new(color).unwrap(), &Default::default()).unwrap();
    path
}

#[test]
fn json_table_and_pictures_of_two_results() {
    let folder = folder("two_results");
    let reference = picture(folder.join("ref.exr"), 1.0);
    let (a, b) = (picture(folder.join("a.exr"), 1.25), picture(folder.join("b.exr"), 1.0));
    let (heat, side) = (folder.join("heat.png"), folder.join("side.png"));
    let output = compare(&[
        &a,
        &reference,
        &b,
        Path::new("--json"),
        Path::new("--heatmap"),
        &heat,
        Path::new("--side-by-side"),
        &side,
    ]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["results"][0]["energy"], 0.25);
    assert_eq!(json["results"][1]["rmse"], 0.0);
    assert_eq!(image::open(heat).unwrap().to_rgb8().dimensions(), (7 + 4 + 7, 5));
    assert_eq!(image::open(side).unwrap().to_rgb8().dimensions(), (3 * 7 + 2 * 4, 5));

    let table = String::from_utf8(compare(&[&a, &reference]).stdout).unwrap();
    assert_eq!(table.lines().count(), 2);
    assert!(table.contains("+25.000%"), "{table}");
}

#[test]
fn exit_codes_tell_usage_missing_broken_and_unwritable_apart() {
    let folder = folder("exit_codes");
    let good = picture(folder.join("good.exr"), 1.0);
    let broken = picture(folder.join("broken.exr"), f32::INFINITY);
    let code = |arguments: &[&Path]| compare(arguments).status.code();
    assert_eq!(code(&[&good]), Some(2));
    assert_eq!(code(&[&good, &folder.join("missing.exr")]), Some(3));
    assert_eq!(code(&[&broken, &good]), Some(4));
    assert_eq!(code(&[&good, &good, Path::new("--heatmap"), &folder.join("no/such/folder.png")]), Some(5));
    let message = String::from_utf8(compare(&[&good, &broken]).stderr).unwrap();
    assert!(message.contains("broken.exr") && message.contains("pixel (0, 0)"), "{message}");
}

#[test]
fn pictures_that_would_replace_an_input_or_each_other_are_refused() {
    let folder = folder("replaced");
    let (a, b) = (picture(folder.join("a.exr"), 1.25), picture(folder.join("b.exr"), 1.0));
    let (heat, side) = (Path::new("--heatmap"), Path::new("--side-by-side"));
    let (again, new) = (folder.join(".").join("b.exr"), folder.join("new.png"));
    let before = std::fs::read(&b).unwrap();
    for (arguments, words) in [
        (&[&*a, &*b, heat, &*again][..], "the heat map and the reference"),
        (&[&a, &b, side, &a], "the picture of --side-by-side and a result"),
        (&[&a, &b, heat, &new, side, &new], "the picture of --side-by-side and the heat map"),
    ] {
        let output = compare(arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && said.contains(words), "{said}");
        assert!(std::fs::read(&b).unwrap() == before && !new.exists());
    }
}
