//! The program: exit codes, messages, reports.

use std::path::{Path, PathBuf};

use crate::exr_files::{self, channels, layer, scan_lines, values, write_one};
use assert_cmd::Command;
use exr::prelude::{AttributeValue, Compression, Encoding, Text};
use serde_json::{Value, json};

const SIZE: (usize, usize) = (24, 18);

fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_apr-denoise"))
}

/// A render with variance and a feature, in a folder of its own.
fn render(folder: &Path) -> PathBuf {
    let names = ["R", "G", "B", "variance.R", "variance.G", "variance.B", "albedo.R", "albedo.G", "albedo.B"];
    let mut layer = layer(None, SIZE, (0, 0), scan_lines(Compression::ZIP16), channels(SIZE, &names));
    layer.attributes.other.insert(Text::from("samplesPerPixel"), AttributeValue::I32(16));
    let path = folder.join("a render.exr");
    write_one(&path, layer);
    path
}

/// Runs the program and returns its exit code, answers and complaints.
fn run(command: &mut Command) -> (i32, String, String) {
    let output = command.output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn a_run_answers_with_progress_and_writes_a_report() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output, report) =
        (render(folder.path()), folder.path().join("out.exr"), folder.path().join("r.json"));
    let begun = std::time::Instant::now();
    let (code, said, complaints) = run(program()
        .args([&input, &output])
        .args(["--aux", "--set", "coarse=false", "--report"])
        .arg(&report));
    assert_eq!(code, 0, "{complaints}");
    assert_eq!(complaints.lines().count(), 1, "{complaints}");
    assert!(complaints.starts_with("apr-denoise: note: albedo: ") && complaints.contains("cut to 1"));
    let percent: Vec<u32> =
        said.lines().filter_map(|line| line.strip_prefix("progress ")).map(|n| n.parse().unwrap()).collect();
    assert!(percent.is_sorted() && percent.last() == Some(&100), "{said}");
    assert!(percent.len() <= 1 + begun.elapsed().as_secs() as usize, "one a second at most: {said}");
    assert!(said.lines().last().unwrap().contains("estimated relMSE"), "{said}");

    let report: Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    assert_eq!(report["layout"]["roles"][1]["statistic"], "variance of the mean");
    assert_eq!(report["layout"]["samples_per_pixel"], 16.0);
    assert_eq!(report["layout"]["missing"], json!(["normal", "depth"]));
    let stages = report["stages"].as_array().unwrap();
    let named = |name: &str| stages.iter().find(|stage| stage["stage"] == name).unwrap();
    assert!(named("read")["seconds"].as_f64().unwrap() > 0.0);
    assert!(named("sanitize")["peak_memory_bytes"].is_u64() || !cfg!(target_os = "linux"));
    named("write");
    let expected = json!([
        { "stage": "prefilter", "reason": "no feature has a variance or halves" },
        { "stage": "coarse", "reason": "switched off by the options" },
    ]);
    assert_eq!(report["skipped"], expected);
    // The report's error before is the mean of the variances that were written.
    let count = SIZE.0 * SIZE.1;
    let sum: f64 = (3..6).flat_map(|salt| values(count, salt)).map(f64::from).sum();
    let before = report["estimated_error"]["mse_before"].as_f64().unwrap();
    assert!((before - sum / (3 * count) as f64).abs() < 1e-6, "{before}");
    let names = exr_files::read_all(&output).layer_data[0]
        .channel_data
        .list
        .iter()
        .map(|c| c.name.to_string())
        .collect::<Vec<_>>();
    assert!(names.contains(&"apr.mse.Y".to_owned()) && names.contains(&"apr.order.Y".to_owned()));
}

#[test]
fn quiet_means_quiet() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("bare.exr"); // lacks a variance, which is worth a warning
    write_one(
        &input,
        layer(None, SIZE, (0, 0), scan_lines(Compression::RLE), channels(SIZE, &["R", "G", "B"])),
    );
    let output = folder.path().join("out.exr");
    let (code, said, complaints) = run(program().args([&input, &output]));
    assert_eq!(code, 0);
    assert!(said.contains("progress 100") && complaints.contains("warning: no variance"), "{complaints}");
    let silent = run(program().args([&input, &output]).arg("--quiet"));
    assert_eq!(silent, (0, String::new(), String::new()));
}

/// What was done to the input, and what else it could have been, is told once.
#[test]
fn notes_are_told_once_and_so_is_what_was_repaired() {
    let folder = tempfile::tempdir().unwrap();
    let names =
        ["A.Combined.R", "A.Combined.G", "A.Combined.B", "B.Combined.R", "B.Combined.G", "B.Combined.B"];
    for frame in 1..=3 {
        let mut all = channels(SIZE, &names);
        if let exr::prelude::FlatSamples::F32(values) = &mut all[0].sample_data {
            (values[7], values[90 + frame], values[200]) = (f32::NAN, f32::INFINITY, -1.0);
        }
        let encoding = scan_lines(Compression::DWAA(None));
        // A codec that loses something would make NaN of whole blocks: only its name matters here.
        let mut part = layer(None, SIZE, (0, 0), scan_lines(Compression::ZIP1), all);
        if frame == 3 {
            part = layer(None, SIZE, (0, 0), encoding, channels(SIZE, &names));
        }
        write_one(&folder.path().join(format!("in.{frame}.exr")), part);
    }
    let [input, output] = ["in.#.exr", "out.#.exr"].map(|name| folder.path().join(name));
    let arguments = ["--set", "window_radius=2", "--set", "coarse=false"];
    let (code, _, told) = run(program().args([&input, &output]).args(arguments));
    assert_eq!(code, 0, "{told}");
    let counted =
        |words: &str| told.lines().filter(|line| line.contains("note: ") && line.contains(words)).count();
    assert_eq!(counted("'B.Combined' could be the colour as well"), 1, "{told}");
    assert_eq!(counted("written with ZIP, because dwaa"), 1, "{told}");
    let repaired = "2 of the colour (in the file 1 samples are NaN and 1 infinite); 1 pixel of the colour is";
    assert_eq!(counted(repaired), 1, "{told}");
    assert_eq!(counted("broken pixels"), 1, "only of the first frame that has some: {told}");
    let quiet = run(program().args([&input, &output]).args(arguments).arg("--quiet"));
    assert_eq!(quiet, (0, String::new(), String::new()));
}

#[test]
fn inspection_lists_the_channels_by_part_and_layer() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("parts.exr");
    let part = |name: &str, names: &[&str]| {
        layer(Some(name), SIZE, (0, 0), scan_lines(Compression::ZIP1), channels(SIZE, names))
    };
    let parts = vec![part("rgba", &["R", "G", "B", "H.R", "H.G", "H.B"]), part("albedo", &["R", "G", "B"])];
    exr_files::write(&path, exr::prelude::IntegerBounds::from_dimensions(SIZE), parts);
    let (code, text, _) = run(program().arg("--inspect").arg(&path));
    assert_eq!(code, 0);
    let lines: Vec<&str> = text.lines().collect();
    let at = lines.iter().position(|line| line.starts_with("  part 'rgba'")).unwrap();
    assert_eq!(lines[at + 1..at + 3], ["    B, G, R", "    H: B, G, R"], "{text}");
    assert!(lines[at + 3].starts_with("  part 'albedo'") && lines[at + 4] == "    B, G, R", "{text}");
    assert!(
        text.contains("rgba.R, rgba.G, rgba.B") && text.contains("albedo.R, albedo.G, albedo.B"),
        "{text}"
    );
}

#[test]
fn inspection_tells_roles_and_ranges_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let input = render(folder.path());
    let (code, text, _) = run(program().arg("--inspect").arg(&input));
    assert_eq!(code, 0);
    assert!(text.contains("variance of the mean") && text.contains("albedo.R, albedo.G, albedo.B"), "{text}");
    assert!(
        text.contains("regression on the pixel's position, albedo with the variance of the file"),
        "{text}"
    );
    // Only what would be used.
    let without = |more: &[&str]| {
        let (_, text, _) = run(program().arg("--inspect").arg(&input).args(more));
        text.lines()
            .find_map(|line| line.strip_prefix("done without: ").map(str::to_owned))
            .unwrap_or_default()
    };
    assert_eq!(without(&[]), "normal, depth");
    assert_eq!(without(&["--set", r#"features=["albedo","position"]"#]), "position");
    assert_eq!(without(&["--set", r#"features=["albedo"]"#]), "");
    assert_eq!(without(&["--method", "nlm"]), "halves");
    assert_eq!(without(&["--method", "nfor"]), "halves, normal, depth");
    assert_eq!(without(&["--method", "wavelet", "--map", "variance=none"]), "variance, halves");
    let (_, json, _) = run(program().args(["--inspect", "--json"]).arg(&input));
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["size"], serde_json::json!([SIZE.0, SIZE.1]));
    let green = values(SIZE.0 * SIZE.1, 1);
    let color = &json["layout"]["roles"][0];
    let least = [0, 1, 2].into_iter().flat_map(|salt| values(green.len(), salt)).fold(f32::MAX, f32::min);
    assert_eq!(color["min"].as_f64().unwrap() as f32, least);
    assert!(json["options"].is_object());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// Whether or not this run is to use them.
#[test]
fn inspection_tells_motion_vectors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let names = ["R", "G", "B", "motionPrevious.X", "motionPrevious.Y"];
    write_one(&path, layer(None, SIZE, (0, 0), scan_lines(Compression::ZIP16), channels(SIZE, &names)));
    let (code, text, said) = run(program().arg("--inspect").arg(&path));
    assert_eq!(code, 0, "{said}");
    let line = text.lines().find(|line| line.starts_with("  motionPrevious ")).expect(&text);
    assert!(line.contains("motionPrevious.X, motionPrevious.Y"), "{line}");
}

#[test]
fn the_same_bits_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let input = render(folder.path());
    // As many as a machine of that size has: here most of them would only wait.
    let outputs = ["1", "2", "8", "5000"].map(|threads| {
        let output = folder.path().join(format!("{threads}.exr"));
        program().args([&input, &output]).args(["--quiet", "--threads", threads]).assert().success();
        std::fs::read(output).unwrap()
    });
    assert!(outputs[0] == outputs[1] && outputs[1] == outputs[2], "the files differ");
}

#[test]
fn every_failure_has_its_exit_code_and_names_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let input = render(folder.path()).into_os_string().into_string().unwrap();
    let in_folder = |name: &str| folder.path().join(name).into_os_string().into_string().unwrap();
    let (out, no_color, text) = (in_folder("out.exr"), in_folder("no color.exr"), in_folder("text.exr"));
    let depth_only = layer(None, SIZE, (0, 0), scan_lines(Compression::RLE), channels(SIZE, &["depth.Z"]));
    write_one(Path::new(&no_color), depth_only);
    std::fs::write(&text, "no picture").unwrap();
    let (missing, nowhere) = (in_folder("missing.exr"), in_folder("no/such/folder/out.exr"));
    let here = folder.path().to_str().unwrap();
    let cases: [(i32, &[&str], &[&str]); 26] = [
        (2, &[], &["required"]),
        (2, &[&input], &["OUTPUT"]),
        (2, &[&input, &out, "--spp", "0"], &["above 0"]),
        (2, &[&input, &out, "--threads", "0"], &["--threads"]),
        (2, &[&input, &out, "--threads", "some"], &["--threads"]),
        (2, &[&input, &out, "--profile", "povray"], &["mitsuba", "tungsten"]),
        (2, &[&input, &out, "--map", "albedo"], &["ROLE=CHANNELS"]),
        (2, &[&input, &out, "--map", "gloss=R"], &["no role 'gloss'", "use color"]),
        (
            2,
            &[&input, &out, "--set", "no_such_option=1"],
            &["no_such_option", "the likest are", "--generate options"],
        ),
        (2, &[&input, &out, "--set", "window_radius=99"], &["window_radius", "give"]),
        (2, &[&input, &out, "--set", "stages.0.0.bandwidth=wide"], &["make no sense", "bandwidth=\"wide\""]),
        (2, &[&input, &out, "--set", "window_radius=7.5"], &["window_radius=7.5", "a whole number"]),
        (2, &[&input, &out, "--set", "outliers.enabld=true"], &["the likest are 'outliers.enabled'"]),
        (2, &[&input, &out, "--memory", "100"], &["--memory of 100 bytes"]),
        (2, &[&input, &out, "--region", "5,0,18446744073709551612,4"], &["not inside the picture"]),
        (2, &[&input, &out, "--preset", "quick"], &["balanced", "published"]),
        (2, &[&input, &out, "--json"], &["--inspect"]),
        (3, &[&missing, &out], &["missing.exr", "check the name"]),
        (3, &[&text, &out], &["text.exr", "no OpenEXR file"]),
        (3, &[here, &out], &["cannot be read"]),
        (4, &[&no_color, &out], &["no color.exr", "no colour", "--map color=LAYER"]),
        (4, &[&input, &out, "--map", "albedo=x.R"], &["'x.R'", "--inspect"]),
        (2, &[&input, &nowhere], &["out.exr: cannot be written", "make its folder"]),
        (2, &[&input, here], &["is a folder"]),
        (2, &["--quiet", "merge", &out, &input], &["before the command `merge`"]),
        (3, &[&input, &out, "--options", &missing], &["missing.exr", "--options takes"]),
    ];
    for (expected, arguments, words) in cases {
        let (code, _, complaint) = run(program().args(arguments));
        assert_eq!(code, expected, "{arguments:?}: {complaint}");
        for word in words {
            assert!(complaint.contains(word), "{arguments:?}: {complaint} lacks '{word}'");
        }
        assert!(!Path::new(&out).exists(), "a failed run wrote something");
    }
}

#[test]
fn options_come_from_files_and_settings_under_any_name() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (render(folder.path()), folder.path().join("out.exr"));
    let file = folder.path().join("options.json");
    std::fs::write(&file, serde_json::to_string(&apr::Options::default()).unwrap()).unwrap();
    program().args([&input, &output]).arg("--options").arg(&file).assert().success();
    let set = [
        "--inspect",
        "--json",
        "--preset",
        "published",
        "--set",
        "outliers.radius=3",
        "--set",
        "stages.0.0.bandwidth=0.25",
    ];
    let json: Value = serde_json::from_str(&run(program().arg(&input).args(set)).1).unwrap();
    let published = apr::Options::published();
    assert_eq!(json["options"]["outliers"]["radius"], 3);
    assert_eq!(json["options"]["stages"][0][0]["bandwidth"], 0.25);
    assert_eq!(json["options"]["stages"].as_array().unwrap().len(), published.stages.len());
    assert_eq!(json["options"]["restore"], published.restore);
    std::fs::write(&file, "{\"no such option\": 1}").unwrap();
    let (code, _, complaint) = run(program().args([&input, &output]).arg("--options").arg(&file));
    assert_eq!(code, 2);
    assert!(complaint.contains("options.json") && complaint.contains("no such option"), "{complaint}");
    std::fs::write(&file, "[1, 2").unwrap();
    assert_eq!(run(program().args([&input, &output]).arg("--options").arg(&file)).0, 2);
    assert_eq!(run(program().args([&input, &output]).arg("--options").arg(folder.path())).0, 3);
}

#[test]
fn help_states_the_exit_codes() {
    let (code, help, _) = run(program().arg("--help"));
    assert_eq!(code, 0);
    for line in [
        "0    done",
        "2    usage",
        "3    an input",
        "4    the input lacks",
        "5    the result",
        "70   a defect",
    ] {
        assert!(help.contains(line), "{help}");
    }
}

/// /dev/full takes nothing: the disk is full.
#[test]
#[cfg(target_os = "linux")]
fn an_answer_that_finds_the_disk_full_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let input = render(folder.path());
    let script = "\"$0\" --inspect \"$1\" > /dev/full";
    let program = env!("CARGO_BIN_EXE_apr-denoise");
    let output = std::process::Command::new("sh").args(["-c", script, program]).arg(&input).output().unwrap();
    assert_eq!(output.status.code(), Some(5));
}

/// Runs the program with its standard output in a file: its exit code, and what it says besides.
#[cfg(target_os = "linux")]
fn run_into(file: std::fs::File, arguments: &[&Path]) -> (Option<i32>, String) {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_apr-denoise"));
    let ended = command.args(arguments).stdout(file).output().unwrap();
    (ended.status.code(), String::from_utf8(ended.stderr).unwrap())
}

/// The frame is done all the same, and what is told at the end is the log's fault alone.
#[test]
#[cfg(target_os = "linux")]
fn a_log_that_takes_no_more_fails_no_frame() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output, all) =
        (render(folder.path()), folder.path().join("out.exr"), folder.path().join("all.json"));
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let (code, said) = run_into(full, &[&input, &output, Path::new("--sequence-report"), &all]);
    assert_eq!(code, Some(5), "{said}");
    assert_eq!(said.matches("the standard output cannot be written").count(), 1, "{said}");
    let report: Value = serde_json::from_slice(&std::fs::read(&all).unwrap()).unwrap();
    assert_eq!(report["counts"]["done"], 1);
}

#[test]
fn a_report_can_be_printed_and_replaces_reports_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (render(folder.path()), folder.path().join("out.exr"));
    let (code, said, _) = run(program().args([&input, &output]).args(["--report", "-"]));
    assert_eq!(code, 0);
    let report: Value = serde_json::from_str(&said).unwrap_or_else(|error| panic!("{error}: {said}"));
    assert_eq!(report["program"], "apr-denoise");
    let old = std::fs::read(&input).unwrap();
    for option in ["--report", "--sequence-report"] {
        let other = folder.path().join("another.exr");
        std::fs::write(&other, &old).unwrap();
        let refused =
            |more: &[&str]| run(program().args([&input, &output]).arg(option).arg(&other).args(more));
        let (code, _, told) = refused(&[]);
        assert!(code == 2 && told.contains("another.exr: is there already, and this program did"), "{told}");
        assert_eq!(std::fs::read(&other).unwrap(), old);
        assert_eq!(refused(&["--overwrite"]).0, 0);
        assert_eq!(refused(&[]).0, 0, "its own report");
    }
}

/// Whoever has opened the log would go on writing to a file that is gone.
#[test]
#[cfg(target_os = "linux")]
fn a_log_is_not_replaced_by_way_of_its_descriptor() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output, log) =
        (render(folder.path()), folder.path().join("out.exr"), folder.path().join("log"));
    let log = std::fs::File::create(&log).unwrap();
    let (code, told) = run_into(log, &[&input, &output, Path::new("--report"), Path::new("/dev/stdout")]);
    assert!(code == Some(2) && told.contains("/dev/stdout: is an open file"), "{told}");
    assert!(!output.exists());
}

/// Tiled, half, with spaces: nothing in the encoding keeps a file from going through twice.
#[test]
fn a_result_can_be_denoised_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("again.exr");
    let encoding = Encoding { compression: Compression::PIZ, ..Encoding::FAST_LOSSLESS };
    write_one(
        &path,
        layer(None, SIZE, (-4, 9), encoding, channels(SIZE, &["R", "G", "B", "A", "N.X", "N.Y", "N.Z"])),
    );
    program().args([&path, &path]).args(["--quiet", "--aux"]).assert().success();
    let once = std::fs::read(&path).unwrap();
    let (code, _, complaint) = run(program().args([&path, &path]).args(["--quiet", "--aux"]));
    assert_eq!(code, 4, "{complaint}");
    assert!(complaint.contains("again.exr: is denoised already by this program"), "{complaint}");
    assert!(complaint.contains("--skip-existing") && complaint.contains("--overwrite"), "{complaint}");
    assert!(std::fs::read(&path).unwrap() == once);
    program().args([&path, &path]).args(["--quiet", "--aux", "--overwrite"]).assert().success();
}

/// A file of results may hold noise besides: of the other eye, or beside what the renderer shows.
#[test]
fn what_a_file_of_results_still_has_of_noise_is_not_told_as_denoised() {
    let folder = tempfile::tempdir().unwrap();
    let [file, once, twice] = ["in.exr", "once.exr", "twice.exr"].map(|name| folder.path().join(name));
    let part = |name, layers: &[&str]| {
        let names: Vec<String> =
            layers.iter().flat_map(|layer| ["R", "G", "B"].map(|c| format!("{layer}{c}"))).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        layer(name, SIZE, (0, 0), scan_lines(Compression::ZIP16), channels(SIZE, &names))
    };
    let eye = |name| {
        let mut part = part(Some(name), &[""]);
        part.attributes.view_name = Some(Text::from(name));
        part
    };
    let parts = vec![eye("left"), eye("right")];
    let blender = vec![part(None, &["V.Combined.", "V.Noisy Image."])];
    let eyes = vec![part(None, &["left.", "right."])];
    for (parts, first, other, again) in [
        (parts, "color=left", "color=right", "color=left"),
        (eyes, "color=left", "color=right", "color=left"),
        (blender, "", "", "color=V.Combined"),
    ] {
        exr_files::write(&file, exr::prelude::IntegerBounds::from_dimensions(SIZE), parts);
        let told = |input: &Path, output: &Path, map: &str| {
            let map = ["--map", map].into_iter().filter(|_| !map.is_empty());
            let (code, _, said) = run(program().args([input, output]).args(map).args(["--preset", "fast"]));
            assert_eq!(code, 0, "{said}");
            said.contains("is denoised already")
        };
        assert!(!told(&file, &once, first) && !told(&once, &twice, other), "{first}");
        // Both are, by now.
        assert!(told(&twice, &once, again), "{again}");
        assert!(other.is_empty() || told(&twice, &once, other), "{other}");
    }
}

/// Each eye of a stereo file takes its own place once, and so does each with its components.
#[test]
fn every_eye_is_denoised_once_in_its_own_place() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("stereo.exr");
    let eye = |name| {
        let names = ["R", "G", "B", "lamp.R", "lamp.G", "lamp.B"];
        let mut part =
            layer(Some(name), SIZE, (0, 0), scan_lines(Compression::ZIP16), channels(SIZE, &names));
        part.attributes.view_name = Some(Text::from(name));
        part
    };
    let window = exr::prelude::IntegerBounds::from_dimensions(SIZE);
    exr_files::write(&file, window, vec![eye("left"), eye("right")]);
    let in_place = |options: &[&str]| {
        let (code, _, said) = run(program().args([&file, &file]).args(["--preset", "fast"]).args(options));
        (code, said)
    };
    for (eye, options) in
        [("left", &["--map", "color=left"][..]), ("right", &["--map", "color=right", "--aov", "lamp"])]
    {
        let (code, said) = in_place(options);
        assert_eq!(code, 0, "{eye}: {said}");
        let (code, said) = in_place(options);
        assert!(code == 4 && said.contains("is denoised already by this program"), "{eye}: {said}");
    }
    // By now both are, whatever is asked for besides.
    assert_eq!(in_place(&["--map", "color=left", "--aov", "lamp"]).0, 4);
}

/// A result that is denoised again is told, also where it is the other half; going on and merging read results as well
/// and are no such case.
#[test]
fn what_is_denoised_already_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (input, once, twice, report) = (render(folder.path()), at("once.exr"), at("twice.exr"), at("r.json"));
    let words = "once.exr: is denoised already, as its attribute apr.denoised tells";
    let complaints = |arguments: &[&Path], options: &[&str]| {
        let (code, _, complaints) = run(program().args(arguments).args(options));
        assert_eq!(code, 0, "{complaints}");
        complaints
    };
    assert!(!complaints(&[&input, &once], &[]).contains("denoised already"));
    assert!(!complaints(&[&input, &once], &["--skip-existing"]).contains("denoised already"));
    let told = complaints(&[&once, &twice, Path::new("--report"), &report], &[]);
    assert!(told.contains(&format!("{words}: ")) && told.contains("give the render itself"), "{told}");
    let warnings = serde_json::from_slice::<Value>(&std::fs::read(&report).unwrap()).unwrap();
    let warnings = warnings["layout"]["warnings"].as_array().unwrap().clone();
    assert!(warnings.iter().any(|warning| warning.as_str().unwrap().contains(words)), "{warnings:?}");
    assert_eq!(complaints(&[&once, &twice], &["--quiet"]), "");
    let told = complaints(&[&input, &twice, Path::new("--half"), &once], &[]);
    assert!(told.contains(words), "{told}");

    let (top, bottom) = (at("top.exr"), at("bottom.exr"));
    let height = SIZE.1 - 4;
    complaints(&[&input, &top], &["--region", &format!("0,0,{},4", SIZE.0)]);
    complaints(&[&input, &bottom], &["--region", &format!("0,4,{},{height}", SIZE.0)]);
    assert_eq!(complaints(&[Path::new("merge"), &at("whole.exr"), &top, &bottom], &[]), "");
    let merge = |more: &[&str]| {
        let mut command = program();
        run(command.arg("merge").args([&at("whole.exr"), &top, &bottom]).args(more)).1
    };
    assert!(merge(&[]).ends_with("whole.exr: put together from 2 regions\n") && merge(&["-q"]).is_empty());

    let refused = |names: &[&str]| {
        let (code, _, told) = run(program().arg("merge").args(names).current_dir(folder.path()));
        assert_ne!(code, 0);
        told
    };
    let (top, bytes) = (["top.exr", "bottom.exr"], std::fs::read(&top).unwrap());
    let told = refused(&["m.####.exr", "top.exr", "bottom.exr"]);
    assert!(told.contains("m.####.exr: has a place") && told.contains("frame by frame"), "{told}");
    let told = refused(&["top.exr", "bottom.exr", "whole.exr"]);
    assert!(told.contains("top.exr: is a region itself") && told.contains("picture first"), "{told}");
    assert!(std::fs::read(at("top.exr")).unwrap() == bytes);
    let told = refused(&["w.exr", top[0]]);
    assert!(told.contains("top.exr: ") && told.contains("in no region"), "{told}");
}

#[test]
fn a_target_that_is_not_met_ends_with_its_own_code_and_a_map() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (render(folder.path()), folder.path().join("out.exr"));
    let (map, report) = (folder.path().join("map.exr"), folder.path().join("r.json"));
    let target = |error: &str| {
        let mut command = program();
        command.args([&input, &output]).args(["--target-error", error, "--sampling-map"]).arg(&map);
        run(command.arg("--report").arg(&report))
    };
    let densities = || {
        let file = exr_files::read_all(&map);
        let channels = &file.layer_data[0].channel_data.list;
        assert_eq!((channels.len(), channels[0].name.to_string().as_str()), (1, "density.Y"));
        channels[0].sample_data.values_as_f32().map(f64::from).collect::<Vec<_>>()
    };
    let (code, said, _) = target("1e-9");
    assert_eq!(code, 10);
    assert!(said.contains("is not met") && said.contains("more samples per pixel on the average"), "{said}");
    // The error that is held against the target is the one that every run tells.
    let told = said.lines().find_map(|line| line.split(" -> ").nth(1)).expect("the run tells its error");
    assert!(said.contains(&format!("{told}, estimated; about ")), "{said}");
    assert!(output.exists(), "the result is written all the same");
    let mean = densities().iter().sum::<f64>() / (SIZE.0 * SIZE.1) as f64;
    assert!((mean - 1.0).abs() < 1e-5, "{mean}");
    let told: Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    let sampling = &told["sampling"];
    let [share, spp] = ["needed_share", "needed_per_pixel"].map(|key| sampling[key].as_f64().unwrap());
    assert!(sampling["target_met"] == false && (spp / share - 16.0).abs() < 1e-6, "{sampling}");

    assert_eq!(target("1e9").0, 0);
    assert!(densities().iter().all(|&density| density == 0.0));
    let (code, _, complaints) = target("-1");
    assert!(code == 2 && complaints.contains("above 0"), "{complaints}");
}

/// Wavelets ask for samples themselves and know no error; a target must not be taken for met.
#[test]
fn a_method_without_an_estimate_cannot_meet_a_target_but_has_its_own_map() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output, map) =
        (render(folder.path()), folder.path().join("out.exr"), folder.path().join("map.exr"));
    let mut command = program();
    command.args([&input, &output]).args(["--method", "wavelet", "--target-error", "0.1"]);
    let (code, _, complaints) = run(&mut command);
    assert!(code == 4 && complaints.contains("wavelet has no estimate"), "{complaints}");
    assert!(!output.exists());
    let report = folder.path().join("r.json");
    let (_, said, _) = run(program()
        .args([&input, &output, Path::new("--report"), &report])
        .args(["--method", "wavelet", "--aux"]));
    assert!(said.trim_end().ends_with(" -> unknown"), "{said}");
    let written = exr_files::read_all(&output);
    let names: Vec<String> =
        written.layer_data[0].channel_data.list.iter().map(|c| c.name.to_string()).collect();
    assert!(
        names.contains(&"apr.order.Y".to_owned()) && !names.contains(&"apr.mse.Y".to_owned()),
        "{names:?}"
    );
    let report: Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    let error = &report["estimated_error"];
    assert!(error["relative_before"].is_f64() && error["relative_after"].is_null(), "{error}");
    assert!(error["mse_after"].is_null(), "{error}");
    let mut command = program();
    command.args([&input, &output]).args(["--method", "wavelet", "--sampling-map"]).arg(&map);
    assert_eq!(run(&mut command).0, 0);
    let file = exr_files::read_all(&map);
    let densities: Vec<f32> = file.layer_data[0].channel_data.list[0].sample_data.values_as_f32().collect();
    let mean = densities.iter().sum::<f32>() / densities.len() as f32;
    assert!((mean - 1.0).abs() < 1e-4 && densities.iter().any(|&d| d != densities[0]), "{mean}");
}

#[test]
fn a_half_of_another_picture_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let size = (128, 20);
    let [picture, other] = [("picture.exr", 0.0), ("other.exr", 9.0)].map(|(name, slope)| {
        let bright = |(i, v): (usize, f32)| v + slope * (i % size.0) as f32 / size.0 as f32;
        let plane = |salt| values(size.0 * size.1, salt).into_iter().enumerate().map(bright).collect();
        let planes = [("R", 1), ("G", 2), ("B", 3)].map(|(name, salt)| exr_files::float(name, plane(salt)));
        let path = folder.path().join(name);
        write_one(&path, layer(None, size, (0, 0), scan_lines(Compression::ZIP16), planes.to_vec()));
        path
    });
    let told = |picture: &Path, half: &Path| {
        run(program().arg("--inspect").args([picture, Path::new("--half"), half])).1
    };
    assert!(
        told(&picture, &other).contains("other.exr: does not look like another render of the same frame")
    );
    let seeds = ["room_seed1.exr", "room_seed2.exr"];
    let [a, b] = seeds.map(|name| Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/blender").join(name));
    assert!(!told(&a, &b).contains("does not look like"));
}

/// A script's option stands before that of its user, who has the last word.
#[test]
fn the_last_of_two_options_counts() {
    let folder = tempfile::tempdir().unwrap();
    let twice =
        ["--skip-existing", "--threads", "1", "--skip-existing", "--threads", "2", "--quiet", "--quiet"];
    let output = folder.path().join("out.exr");
    let (code, _, told) = run(program().args([&render(folder.path()), &output]).args(twice));
    assert_eq!(code, 0, "{told}");
}

/// What is wrong with a number is told of it, not of an option that it would be.
#[test]
fn numbers_below_zero_are_refused_as_numbers() {
    for option in ["--spp", "--target-error"] {
        let output = program().args(["in.exr", "out.exr", option, "-4"]).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(2) && said.contains("expected a number above 0"), "{said}");
    }
}
