//! The program `apr-compare`: what it prints, writes and refuses.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use apr::Frame;
use apr::image::{Plane, Rgb};
use exr::prelude::{Compression, IntegerBounds};
use serde_json::json;

use crate::exr_files::{float, layer, scan_lines, write};

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
    assert_eq!(code(&[&good, &good, Path::new("--heatmap"), &folder.join("no/such/folder.png")]), Some(2));
    let named = picture(folder.join("picture.png"), 1.0);
    for option in ["--heatmap", "--side-by-side"] {
        assert_eq!(code(&[&good, &good, Path::new(option), &named]), Some(2), "it is an EXR");
        let output = compare(&[&good, &good, Path::new(option), &folder.join("h.jpg")]);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(
            message.contains("h.jpg: does not end in .png") && !folder.join("h.jpg").exists(),
            "{message}"
        );
    }
    let message = String::from_utf8(compare(&[&good, &broken]).stderr).unwrap();
    assert!(message.contains("broken.exr") && message.contains("pixel (0, 0)"), "{message}");
}

#[test]
fn the_threads_may_be_few() {
    let folder = folder("threads");
    let [a, b] = ["a.exr", "b.exr"].map(|name| picture(folder.join(name), 0.5));
    let four = |command: &[&str]| {
        let mut program = Command::new(env!("CARGO_BIN_EXE_apr-compare"));
        program
            .args(command)
            .args(["--threads", "4000"])
            .args(command.is_empty().then_some(&a))
            .arg(&b)
            .output()
            .unwrap()
    };
    assert!(four(&[]).status.success(), "{:?}", four(&[]));
    let told = String::from_utf8(four(&["sweep"]).stderr).unwrap();
    assert!(told.contains("--reference") && !told.contains("unexpected argument"), "{told}");
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

#[test]
fn what_others_wrote_is_replaced_only_when_told_to() {
    let folder = folder("foreign");
    let (a, b) = (picture(folder.join("a.exr"), 1.25), picture(folder.join("b.exr"), 1.0));
    let target = folder.join("there.png");
    for option in ["--heatmap", "--side-by-side"] {
        image::RgbImage::new(3, 2).save(&target).unwrap();
        let before = std::fs::read(&target).unwrap();
        let run = |more: &[&str]| {
            let more = more.iter().map(Path::new);
            let output = compare(
                &[a.as_path(), &b, Path::new(option), &target].into_iter().chain(more).collect::<Vec<_>>(),
            );
            (output.status.code(), String::from_utf8(output.stderr).unwrap())
        };
        let (code, said) = run(&[]);
        assert!(code == Some(2) && said.contains("there.png: is there already"), "{said}");
        assert!(said.contains("--overwrite") && std::fs::read(&target).unwrap() == before, "{said}");
        assert_eq!(run(&["--overwrite"]).0, Some(0));
        assert!(std::fs::read(&target).unwrap() != before);
        assert_eq!(run(&[]), (Some(0), String::new()), "its own");
    }
}

/// A picture of these layers whose data window is x, y, width, height in a display window of that size at 0, 0. Every
/// pixel is `value` times a number of its own place in the display window.
fn windowed(path: PathBuf, window: [usize; 4], display: (usize, usize), layers: &[(&str, f32)]) -> PathBuf {
    let [x, y, width, height] = window;
    let pixel = |i: usize| (1 + x + i % width + 7 * (y + i / width)) as f32;
    let plane = |value: f32| (0..width * height).map(|i| value * pixel(i)).collect::<Vec<_>>();
    let channels = layers.iter().flat_map(|(layer, value)| {
        ["R", "G", "B"].map(|c| {
            let name = if layer.is_empty() { c.to_owned() } else { format!("{layer}.{c}") };
            float(&name, plane(*value))
        })
    });
    let position = (x as i32, y as i32);
    let part = layer(None, (width, height), position, scan_lines(Compression::ZIP16), channels.collect());
    write(&path, IntegerBounds::from_dimensions(display), vec![part]);
    path
}

const DISPLAY: (usize, usize) = (7, 5);

fn told(output: &Output) -> (Option<i32>, String, serde_json::Value) {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), said, serde_json::from_slice(&output.stdout).unwrap_or_default())
}

#[test]
fn the_pixels_that_all_files_have_are_compared() {
    let folder = folder("windows");
    let file = |name: &str, window, value| windowed(folder.join(name), window, DISPLAY, &[("", value)]);
    let (whole, region) = (file("ref.exr", [0, 0, 7, 5], 1.0), file("region.exr", [2, 1, 4, 3], 1.0));
    let (as_json, heat) = (Path::new("--json"), folder.join("heat.png"));
    let (code, said, answer) = told(&compare(&[&region, &whole, as_json, Path::new("--heatmap"), &heat]));
    assert_eq!(code, Some(0), "{said}");
    assert_eq!((&answer["window"], &answer["results"][0]["rmse"]), (&json!([2, 1, 4, 3]), &0.0.into()));
    assert_eq!(image::image_dimensions(heat).unwrap(), (4, 3));
    assert!(said.contains("note: only the pixels that all have are compared, 2,1,4,3: "), "{said}");
    assert!(said.contains("ref.exr has 0,0,7,5") && !said.contains("region.exr has"), "{said}");
    assert!(said.lines().count() == 1, "{said}");

    // Several results are compared in one window, so that their figures are of the same pixels.
    let other = file("other.exr", [4, 0, 3, 3], 2.0);
    let (_, said, answer) = told(&compare(&[&region, &whole, &other, as_json]));
    assert_eq!(answer["window"], json!([4, 1, 2, 2]), "{said}");
    assert_eq!((&answer["results"][0]["rmse"], &answer["results"][1]["energy"]), (&0.0.into(), &1.0.into()));
    let (_, said, answer) = told(&compare(&[&whole, &whole, as_json]));
    assert_eq!((said.as_str(), &answer["window"]), ("", &json!([0, 0, 7, 5])));
}

#[test]
fn pictures_without_a_pixel_in_common_are_refused_with_their_windows() {
    let folder = folder("apart");
    let file = |name: &str, window, display| windowed(folder.join(name), window, display, &[("", 1.0)]);
    let (left, right) = (file("left.exr", [0, 0, 3, 5], DISPLAY), file("right.exr", [3, 0, 4, 5], DISPLAY));
    let (code, said, _) = told(&compare(&[&left, &right]));
    assert_eq!(code, Some(4), "{said}");
    assert!(said.contains("left.exr: its data window 0,0,3,5 has no pixel of 3,0,4,5, which "), "{said}");
    let crop = file("crop.exr", [0, 0, 3, 3], (3, 3));
    let (code, said, _) = told(&compare(&[&crop, &left]));
    assert_eq!(code, Some(4), "{said}");
    for words in ["crop.exr: its display window is 0,0,3,3", "are 0,0,7,5 and 0,0,3,5", "; give "] {
        assert!(said.contains(words), "{said}");
    }
    // Of the same pixels it does not matter what is shown of them.
    let (code, said, _) = told(&compare(&[&file("tight.exr", [0, 0, 3, 5], (3, 5)), &left]));
    assert_eq!((code, said.as_str()), (Some(0), ""));
}

#[test]
fn channels_are_mapped_as_where_they_are_denoised() {
    let folder = folder("mapped");
    let file = |name: &str, layers| windowed(folder.join(name), [0, 0, 7, 5], DISPLAY, layers);
    let result = file("result.exr", &[("", 1.0), ("albedo", 3.0)]);
    let reference = file("ref.exr", &[("", 1.5), ("albedo", 2.0), ("truth", 4.0)]);
    let energy = |maps: &[&str]| {
        let options = maps.iter().flat_map(|map| ["--map", map]).chain(["--json"]).map(Path::new);
        let files = [result.as_path(), &reference].into_iter();
        told(&compare(&files.chain(options).collect::<Vec<_>>()))
    };
    let (_, said, answer) = energy(&["color=albedo"]);
    assert_eq!(answer["results"][0]["energy"], 0.5, "{said}");
    assert_eq!(answer["channels"], json!(["albedo.R", "albedo.G", "albedo.B"]));
    let (_, _, answer) = energy(&["color=R,G,B", "reference=truth"]);
    assert_eq!(answer["results"][0]["energy"], -0.75);
    let (_, _, answer) = energy(&["reference=truth"]);
    assert_eq!(
        (&answer["channels"][0], &answer["results"][0]["channels"][0]),
        (&"truth.R".into(), &"R".into())
    );
    let (_, said, answer) = energy(&["color=albedo.G"]);
    assert_eq!(answer["results"][0]["energy"], 0.5, "one channel: {said}");

    let (code, said, _) = energy(&["color=truth"]);
    assert!(code == Some(4) && said.contains("result.exr: channel 'truth': is not there"), "{said}");
    for (maps, words) in [
        (&["normal=albedo"][..], "'normal' is nothing that is compared"),
        (&["albedo"], "is no mapping"),
        (&["reference=truth", "Reference=albedo"], "'Reference' is mapped twice"),
    ] {
        let (code, said, _) = energy(maps);
        assert!(code == Some(2) && said.contains(words), "{said}");
    }
    let (_, said, _) = energy(&["color=albedo", "reference=albedo.R,albedo.G"]);
    assert!(said.contains("ref.exr: ") && said.contains("by --map reference=R,G,B"), "{said}");
    let (_, said, _) = energy(&["reference=none"]);
    assert!(said.contains("ref.exr: ") && said.contains("by --map reference=LAYER"), "{said}");
}

/// By its halves, or by its variance.
#[test]
fn the_references_own_noise_is_taken_off() {
    let folder = folder("noise");
    let flat = |value: f32| -> Rgb { std::array::from_fn(|_| Plane::filled(7, 5, value)) };
    let write = |name: &str, frame: Frame| {
        let path = folder.join(name);
        apr::io::write_frame(&path, &frame, &Default::default()).unwrap();
        path
    };
    let result = write("result.exr", Frame::new(flat(1.5)).unwrap());
    let halves = Frame::new(flat(1.0)).unwrap().with_halves([flat(1.25), flat(0.75)]).unwrap();
    let variance = Frame::new(flat(1.0)).unwrap().with_variance_of_mean(flat(0.0625)).unwrap();
    for reference in [write("halves.exr", halves), write("variance.exr", variance)] {
        let (_, said, answer) = told(&compare(&[&result, &reference, Path::new("--json")]));
        let noise = answer["reference_noise"].as_f64().unwrap();
        assert!((noise - 0.0625 / 1.01).abs() < 1e-12, "{said}{answer}");
        let table = String::from_utf8(compare(&[&result, &reference]).stdout).unwrap();
        assert!(table.lines().nth(1).unwrap().ends_with("  0.185644"), "(0.25 - 0.0625) / 1.01: {table}");
        let regions = [&result, &reference, Path::new("--map"), Path::new("color=G"), Path::new("--json")];
        assert!(told(&compare(&regions)).2["reference_noise"].is_null(), "of other channels nothing is told");
    }
}

/// Also where its halves tell its noise, and where all of a channel is broken.
#[test]
fn a_broken_reference_is_refused_with_its_noise_too() {
    let folder = folder("broken_reference");
    let flat = |value: f32| -> Rgb { std::array::from_fn(|_| Plane::filled(7, 5, value)) };
    let write = |name: &str, frame: Frame| {
        let path = folder.join(name);
        apr::io::write_frame(&path, &frame, &Default::default()).unwrap();
        path
    };
    let result = write("result.exr", Frame::new(flat(1.0)).unwrap());
    let [red, _, blue] = flat(1.0);
    let color = [red, Plane::filled(7, 5, f32::NAN), blue];
    let reference =
        write("ref.exr", Frame::new(color).unwrap().with_halves([flat(1.25), flat(0.75)]).unwrap());
    let (code, said, _) = told(&compare(&[&result, &reference]));
    assert_eq!(code, Some(4), "{said}");
    assert!(said.contains("ref.exr: channel 'G': the reference is NaN at pixel (0, 0)"), "{said}");
}

/// Of a file with several view layers one is compared, and which could have been is told.
#[test]
fn other_pictures_of_a_file_are_told() {
    let folder = folder("layers");
    let layers = [("Fore.Combined", 1.0), ("Rear.Combined", 2.0)];
    let (file, again) = ("both.exr", "again.exr");
    let [file, again] = [file, again].map(|name| windowed(folder.join(name), [0, 0, 7, 5], DISPLAY, &layers));
    let (code, said, answer) = told(&compare(&[&file, &again, Path::new("--json")]));
    assert_eq!((code, &answer["channels"][0]), (Some(0), &"Fore.Combined.R".into()), "{said}");
    assert!(
        said.contains("both.exr: Fore.Combined.R, Fore.Combined.G, Fore.Combined.B are compared"),
        "{said}"
    );
    assert!(said.contains("'Rear.Combined' could be the colour as well: choose by --map color="), "{said}");
    let (code, said, answer) = told(&compare(&[
        &file,
        &again,
        Path::new("--map"),
        Path::new("color=Rear.Combined"),
        Path::new("--json"),
    ]));
    assert_eq!((code, said.as_str(), &answer["channels"][0]), (Some(0), "", &"Rear.Combined.R".into()));
}

/// Blender's denoised picture would pass for the noise.
#[test]
fn what_the_renderer_may_have_denoised_itself_is_told() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/blender");
    let (render, reference) = (fixtures.join("room_seed1.exr"), fixtures.join("room_ref.exr"));
    let ours = folder("denoised_by_the_renderer").join("ours.exr");
    let denoise = Command::new(env!("CARGO_BIN_EXE_apr-denoise"))
        .args([&render, &ours])
        .args(["--preset", "fast", "--quiet"])
        .status();
    assert!(denoise.unwrap().success());
    let output = compare(&[&ours, &reference, &render]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && said.matches("may have denoised").count() == 1, "{said}");
    let noisy = ["R", "G", "B"].map(|channel| format!("ViewLayer.Noisy Image.{channel}")).join(",");
    assert!(said.contains("room_seed1.exr: ") && said.contains(&format!("--map color='{noisy}'")), "{said}");

    let map = |map: String| ["--map".to_owned(), map];
    let maps = [map(format!("color={noisy}")), map("reference=ViewLayer.Combined".to_owned())].concat();
    let maps: Vec<&Path> = maps.iter().map(Path::new).collect();
    let output = compare(&[&[render.as_path(), &reference][..], &maps].concat());
    assert!(output.status.success() && output.stderr.is_empty());
}
