//! Sequences: the bits of single runs, what is left out and why, and how a run goes on.

use std::path::PathBuf;

use crate::exr_files::{channels, float, layer, scan_lines, values, write_one};
use assert_cmd::Command;
use exr::prelude::Compression;
use serde_json::Value;

const SIZE: (usize, usize) = (24, 18);

/// A folder with the renders `shot.0001.exr` and so on.
struct Shot(tempfile::TempDir);

impl Shot {
    fn new(frames: &[i32]) -> Self {
        let shot = Self(tempfile::tempdir().unwrap());
        frames.iter().for_each(|&frame| shot.render("shot", frame));
        shot
    }

    /// Every frame has a size of its own, so that no result can be taken for another's.
    fn render(&self, name: &str, frame: i32) {
        let names =
            ["R", "G", "B", "variance.R", "variance.G", "variance.B", "albedo.R", "albedo.G", "albedo.B"];
        let size = (SIZE.0 + frame as usize, SIZE.1 + name.len());
        // Another half has noise of its own.
        let seed = if name == "half" { names.len() } else { 0 };
        let plane = |(salt, name): (usize, &&str)| float(name, values(size.0 * size.1, seed + salt));
        let channels = names.iter().enumerate().map(plane).collect();
        let layer = layer(None, size, (0, 0), scan_lines(Compression::ZIP16), channels);
        write_one(&self.path(&format!("{name}.{frame:04}.exr")), layer);
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Runs in the folder; exit code, answers and complaints.
    fn run(&self, arguments: &[&str]) -> (i32, String, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_apr-denoise"));
        let output = command.current_dir(self.0.path()).args(arguments).output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
    }

    /// Runs and expects `code`.
    fn expect(&self, code: i32, arguments: &[&str]) -> (String, String) {
        let (ended, said, complaints) = self.run(arguments);
        assert_eq!(ended, code, "{arguments:?}: {said}{complaints}");
        (said, complaints)
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&self.bytes(name)).unwrap()
    }

    /// Frame and state of every frame in the sequence's report.
    fn states(&self, name: &str) -> Vec<(i64, String)> {
        let report = self.json(name);
        let state =
            |entry: &Value| (entry["frame"].as_i64().unwrap(), entry["state"].as_str().unwrap().to_owned());
        report["frames"].as_array().unwrap().iter().map(state).collect()
    }

    /// The names that begin with `start`.
    fn names(&self, start: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.filter(|name| name.starts_with(start)).collect();
        names.sort();
        names
    }
}

fn states(expected: &[(i64, &str)]) -> Vec<(i64, String)> {
    expected.iter().map(|(frame, state)| (*frame, (*state).to_owned())).collect()
}

#[test]
fn a_sequence_has_the_bits_of_single_runs_and_reports_of_all() {
    let shot = Shot::new(&[1, 2, 3, 5, 12]);
    let (said, complaints) = shot.expect(
        0,
        &[
            "shot.####.exr",
            "den.%03d.exr",
            "--report",
            "$F.json",
            "--sequence-report",
            "all.json",
            "--aux",
            "--frames",
            "1-5:2,2,12",
        ],
    );
    assert_eq!(complaints.lines().count(), 1, "of the first frame: {complaints}");
    assert!(
        complaints.contains("note: frame 1: albedo: ") && complaints.contains("cut to 1"),
        "{complaints}"
    );
    assert_eq!(
        shot.names("den"),
        ["den.001.exr", "den.002.exr", "den.003.exr", "den.005.exr", "den.012.exr"]
    );
    for frame in [1, 2, 3, 5, 12] {
        shot.expect(0, &[&format!("shot.{frame:04}.exr"), "one.exr", "--aux", "--quiet", "--threads", "1"]);
        assert!(shot.bytes("one.exr") == shot.bytes(&format!("den.{frame:03}.exr")), "frame {frame} differs");
        let report = shot.json(&format!("{frame}.json"));
        assert_eq!((&report["frame"], &report["stages"][0]["stage"]), (&frame.into(), &"read".into()));
    }
    let all = shot.json("all.json");
    assert_eq!(all["counts"]["done"], 5);
    let third = &all["frames"][2];
    assert_eq!((&third["frame"], &third["output"]), (&3.into(), &"den.003.exr".into()));
    assert_eq!(third["estimated_error"], shot.json("3.json")["estimated_error"]);
    assert!(third["seconds"].as_f64().unwrap() > 0.0);
    let percent: Vec<u32> =
        said.lines().filter_map(|line| line.strip_prefix("progress ")).map(|n| n.parse().unwrap()).collect();
    assert!(percent.is_sorted() && percent.last() == Some(&100), "{said}");
    assert!(said.lines().last().unwrap().starts_with("5 frames denoised in"), "{said}");
}

#[test]
fn without_frames_all_that_are_there_are_taken() {
    let shot = Shot::new(&[3, 7]);
    shot.expect(0, &["shot.<frame4>.exr", "den.@@@@.exr", "--quiet"]);
    assert_eq!(shot.names("den"), ["den.0003.exr", "den.0007.exr"]);
    let (_, complaint) = shot.expect(3, &["shot.###.exr", "den.####.exr"]);
    let words = "shot.###.exr: no file has a name of this pattern; there is 'shot.####.exr' with frames 3,7";
    assert!(complaint.contains(words), "{complaint}");
    let (_, complaint) = shot.expect(3, &["nothing.####.exr", "den.####.exr"]);
    assert!(complaint.contains("nothing.####.exr: no file") && complaint.contains("padding"), "{complaint}");
    let skip = ["shot.####.exr", "den.####.exr", "--frames", "20-30", "--missing", "skip", "--quiet"];
    let (_, complaint) = shot.expect(3, &skip);
    let words = "shot.0020.exr: is missing, and none of the frames 20-30 has a file";
    assert!(complaint.contains(words), "{complaint}");
}

#[test]
fn further_files_may_be_patterns_too() {
    let shot = Shot::new(&[1, 2]);
    for frame in [1, 2] {
        // Halves have the colour's size: the name's length decides it.
        shot.render("half", frame);
        shot.render("with", frame);
    }
    shot.expect(
        0,
        &["shot.####.exr", "den.####.exr", "--half", "half.####.exr", "--with", "with.####.exr", "--quiet"],
    );
    let single =
        ["shot.0002.exr", "one.exr", "--half", "half.0002.exr", "--with", "with.0002.exr", "--quiet"];
    shot.expect(0, &single);
    assert!(shot.bytes("one.exr") == shot.bytes("den.0002.exr"));
    std::fs::remove_file(shot.path("with.0001.exr")).unwrap();
    let (_, complaint) =
        shot.expect(3, &["shot.####.exr", "den.####.exr", "--with", "with.####.exr", "--frames", "1-2"]);
    assert!(complaint.contains("with.0001.exr: is missing"), "{complaint}");
}

/// One AOV a file is how OIDN's users and many farms keep them: no frame's number may get into a layer's name.
#[test]
fn files_of_one_aov_are_layers_of_the_same_name_in_every_frame() {
    let shot = Shot(tempfile::tempdir().unwrap());
    let render = |name: &str, frame: i32| {
        let of = if name == "beauty" { 1 } else { 2 };
        let planes =
            [("R", of), ("G", of + 1), ("B", of + 2)].map(|(c, salt)| float(c, values(24 * 18, salt)));
        let layer = layer(None, SIZE, (0, 0), scan_lines(Compression::ZIP16), planes.to_vec());
        write_one(&shot.path(&format!("{name}.{frame:04}.exr")), layer);
    };
    let names = ["beauty", "shot_010_albedo", "glow"];
    for frame in [1, 2] {
        names.iter().for_each(|name| render(name, frame));
        std::fs::copy(shot.path(&format!("glow.{frame:04}.exr")), shot.path(&format!("g{frame:03}.exr")))
            .unwrap();
    }
    let taken = |report: &str| {
        let roles = shot.json(report)["layout"]["roles"].clone();
        let role = |role: &Value| role["role"].as_str().unwrap().to_owned();
        roles.as_array().unwrap().iter().map(role).collect::<Vec<_>>()
    };
    let run = |more: &[&str]| {
        let common = ["beauty.####.exr", "den.####.exr", "--report", "r.####.json", "--quiet"];
        shot.expect(0, &[&common, more].concat());
        assert_eq!(taken("r.0001.json"), taken("r.0002.json"));
        taken("r.0002.json")
    };
    let albedo = ["--with", "shot_010_albedo.####.exr"];
    assert_eq!(run(&albedo), ["color", "albedo"]);
    assert_eq!(run(&[&albedo[..], &["--profile", "luxcore"]].concat()), ["color", "albedo"]);
    for map in ["albedo=albedo", "albedo=shot_010_albedo"] {
        assert_eq!(run(&[&albedo[..], &["--map", map]].concat()), ["color", "albedo"], "{map}");
    }
    assert_eq!(run(&["--with", "glow.####.exr", "--feature", "glow=glow"]), ["color", "glow"]);
    assert_eq!(run(&["--with", "g###.exr", "--feature", "glow=g"]), ["color", "glow"]);
    let single =
        ["beauty.0001.exr", "one.exr", "--with", "shot_010_albedo.0001.exr", "--quiet", "--report", "r.json"];
    shot.expect(0, &single);
    assert_eq!(taken("r.json"), ["color", "albedo"]);
}

#[test]
fn missing_frames_are_all_named_before_any_work() {
    let shot = Shot::new(&[1, 4]);
    let (_, complaint) = shot.expect(3, &["shot.####.exr", "den.####.exr", "--frames", "1-6"]);
    assert!(complaint.contains("shot.0002.exr"), "{complaint}");
    assert!(complaint.contains("4 frames have no input: 2,3,5,6"), "{complaint}");
    assert!(complaint.contains("--missing skip"), "{complaint}");
    assert_eq!(shot.names("den"), [""; 0]);
    let skip = ["shot.####.exr", "den.####.exr", "--frames", "3-4", "--missing", "skip"];
    shot.expect(0, &[&skip[..], &["--sequence-report", "all.json", "--quiet"]].concat());
    assert_eq!(shot.names("den"), ["den.0004.exr"]);
    assert_eq!(shot.states("all.json"), states(&[(3, "missing"), (4, "done")]));
    let (said, _) = shot.expect(0, &skip);
    assert!(said.trim_end().ends_with("1 has no input; left out: 3 (3 for want of shot.0003.exr)"), "{said}");
}

#[test]
fn what_is_done_is_skipped_unless_it_was_made_otherwise() {
    let shot = Shot::new(&[1, 2, 3]);
    let run = ["shot.####.exr", "den.####.exr", "--report", "rep.####.json", "--quiet"];
    let again = [&run[..], &["--skip-existing", "--sequence-report", "all.json"]].concat();
    shot.expect(0, &run);
    let second = shot.bytes("den.0002.exr");
    std::fs::remove_file(shot.path("den.0002.exr")).unwrap();
    std::fs::remove_file(shot.path("rep.0003.json")).unwrap();
    shot.expect(0, &again);
    assert_eq!(shot.states("all.json"), states(&[(1, "skipped"), (2, "done"), (3, "done")]));
    assert!(shot.bytes("den.0002.exr") == second);
    shot.expect(0, &again);
    assert_eq!(shot.states("all.json"), states(&[(1, "skipped"), (2, "skipped"), (3, "skipped")]));

    let (_, complaint) = shot.expect(2, &[&again[..], &["--set", "outliers.radius=3"]].concat());
    assert!(
        complaint.contains("den.0001.exr: was made otherwise: with another --set outliers.radius"),
        "{complaint}"
    );
    assert!(complaint.contains("frames 1-3") && complaint.contains("--overwrite"), "{complaint}");
    std::fs::copy(shot.path("shot.0003.exr"), shot.path("den.0003.exr")).unwrap();
    let (_, complaint) = shot.expect(2, &again);
    assert!(complaint.contains("den.0003.exr: was made otherwise: this program did not"), "{complaint}");
    assert!(!complaint.contains("and so for frames"), "{complaint}");
    shot.expect(0, &[&again[..], &["--overwrite"]].concat());
    assert_eq!(shot.states("all.json"), states(&[(1, "skipped"), (2, "skipped"), (3, "done")]));
}

/// Another shot's results under the same names, a render that was made again, a half or a further file of another
/// render: all is done again, and the bits are those of a run in one go, in whatever folder.
#[test]
fn results_of_what_has_changed_since_are_done_again() {
    let shot = Shot::new(&[1, 2]);
    for name in ["half", "with", "hold"] {
        [1, 2].iter().for_each(|&frame| shot.render(name, frame));
    }
    let files = ["--half", "half.####.exr", "--with", "with.####.exr"];
    let run = |more: &[&str]| {
        let common = ["shot.####.exr", "den.####.exr", "--skip-existing", "--sequence-report", "all.json"];
        let (_, told) = shot.expect(0, &[&common, &files[..], more].concat());
        let ended = shot.states("all.json").into_iter().map(|(_, state)| state).collect::<Vec<_>>();
        (ended, told)
    };
    assert_eq!(run(&[]).0, ["done", "done"]);
    // The content counts alone.
    let bytes = shot.bytes("shot.0001.exr");
    std::fs::rename(shot.path("shot.0001.exr"), shot.path("other.0001.exr")).unwrap();
    std::fs::write(shot.path("shot.0001.exr"), bytes).unwrap();
    assert_eq!(run(&[]).0, ["skipped", "skipped"]);
    for name in ["shot", "half", "with"] {
        let path = shot.path(&format!("{name}.0002.exr"));
        let seed = 40 + name.len() + usize::from(name == "half");
        let names = ["R", "G", "B", "variance.R", "variance.G", "variance.B"];
        let size = (SIZE.0 + 2, SIZE.1 + 4);
        let plane = |(n, name): (usize, &&str)| float(name, values(size.0 * size.1, seed + 7 * n));
        let planes = names.iter().enumerate().map(plane).collect();
        write_one(&path, layer(None, size, (0, 0), scan_lines(Compression::ZIP16), planes));
        let (ended, told) = run(&[]);
        assert_eq!(ended, ["skipped", "done"], "{name}");
        assert!(told.contains("note: den.0002.exr: is done again: its input, or"), "{told}");
        assert_eq!(run(&["--quiet"]).0, ["skipped", "skipped"], "{name}");
    }
    // In place the input is gone, so that it cannot have changed; a half can.
    let half = ["--half", "half.0001.exr", "--quiet"];
    let in_place = ["shot.0001.exr", "shot.0001.exr", "--skip-existing"];
    shot.expect(0, &[&in_place[..], &half].concat());
    let once = shot.bytes("shot.0001.exr");
    shot.expect(0, &[&in_place[..], &half].concat());
    assert!(shot.bytes("shot.0001.exr") == once);
    std::fs::copy(shot.path("hold.0001.exr"), shot.path("half.0001.exr")).unwrap();
    let (_, told) = shot.expect(2, &[&in_place[..], &half].concat());
    assert!(told.contains("a file of --half or --with has changed since"), "{told}");
}

/// What a copy that was broken off, a full disk or a scheduler's placeholder leaves counts as nothing.
#[test]
fn what_is_cut_off_or_no_picture_counts_as_not_done() {
    let shot = Shot::new(&[1, 2, 3, 4, 5]);
    let run =
        ["shot.####.exr", "den.####.exr", "--skip-existing", "--sequence-report", "all.json", "--quiet"];
    let results = || (1..=5).map(|frame| shot.bytes(&format!("den.{frame:04}.exr"))).collect::<Vec<_>>();
    shot.expect(0, &run);
    let whole = results();
    for (n, cut) in [whole[0].len() - 1, whole[1].len() * 4 / 5, 100, 0].into_iter().enumerate() {
        std::fs::write(shot.path(&format!("den.{:04}.exr", n + 1)), &whole[n][..cut]).unwrap();
    }
    shot.expect(0, &run);
    let ended = [(1, "done"), (2, "done"), (3, "done"), (4, "done"), (5, "skipped")];
    assert_eq!(shot.states("all.json"), states(&ended));
    assert!(results() == whole);
}

#[test]
fn progress_ends_at_a_hundred_whatever_becomes_of_the_frames() {
    let shot = Shot::new(&[1, 2, 3]);
    std::fs::write(shot.path("shot.0002.exr"), "no picture").unwrap();
    let percent = |said: &str| -> Vec<u32> {
        said.lines().filter_map(|line| line.strip_prefix("progress ")?.parse().ok()).collect()
    };
    let (said, _) = shot.expect(3, &["shot.####.exr", "den.####.exr", "--keep-going"]);
    assert!(percent(&said).is_sorted() && percent(&said).last() == Some(&100), "{said}");
    let skipped = ["shot.####.exr", "den.####.exr", "--frames", "1,3", "--skip-existing"];
    assert_eq!(percent(&shot.expect(0, &skipped).0), [100]);
    for (how, expected) in [("none", 0), ("bar", 0), ("lines", 1)] {
        let (said, _) = shot.expect(0, &[&skipped[..], &["--progress", how]].concat());
        assert_eq!(percent(&said).len(), expected, "{how}");
    }
}

#[test]
fn a_folder_that_looks_like_a_pattern_is_a_folder() {
    let shot = Shot::new(&[1, 2]);
    std::fs::create_dir(shot.path("take #1 %d")).unwrap();
    shot.expect(0, &["shot.####.exr", "take #1 %d/den.####.exr", "--quiet"]);
    shot.expect(0, &["take #1 %d/den.####.exr", "again.####.exr", "--quiet"]);
    shot.expect(0, &["take #1 %d/den.0001.exr", "once.exr", "--quiet"]);
    assert_eq!(shot.names("again"), ["again.0001.exr", "again.0002.exr"]);
    assert_eq!(shot.names("take"), ["take #1 %d"]);
}

/// `apr-denoise f.*.exr`, unquoted, names a second render as the result.
#[test]
fn a_picture_of_somebody_else_is_not_replaced_unasked() {
    let shot = Shot::new(&[1, 2, 3]);
    let second = shot.bytes("shot.0002.exr");
    let run = |code: i32, names: &[&str]| shot.expect(code, &[names, &["--quiet"]].concat()).1;
    let told = run(2, &["shot.0001.exr", "shot.0002.exr"]);
    assert!(told.contains("shot.0002.exr: is there already, and this program did not write it; "), "{told}");
    assert!(told.contains("--overwrite") && told.contains("'shot.####.exr', in quotes"), "{told}");
    let told = run(2, &["shot.0001.exr", "shot.0002.exr", "shot.0003.exr"]);
    assert!(told.contains("shot.0003.exr: is a third name") && told.contains("in quotes"), "{told}");
    let told =
        run(2, &["shot.####.exr", "den.####.exr", "--frames", "1-2", "--sampling-map", "shot.0003.exr"]);
    assert!(told.contains("several results"), "{told}");
    let told = run(2, &["shot.0001.exr", "den.exr", "--sampling-map", "shot.0002.exr"]);
    assert!(told.contains("shot.0002.exr: is there already"), "{told}");
    assert_eq!(shot.bytes("shot.0002.exr"), second);
    assert!(shot.names("den").is_empty());

    // Its own results and maps, what is no picture, and what it is told to.
    std::fs::write(shot.path("den.exr"), "taken by a scheduler").unwrap();
    for _ in 0..2 {
        run(0, &["shot.0001.exr", "den.exr", "--sampling-map", "map.exr"]);
    }
    run(0, &["shot.0001.exr", "part.exr", "--region", "0,0,25,22"]);
    let told = run(2, &["merge", "shot.0002.exr", "part.exr"]);
    assert!(told.contains("shot.0002.exr: is there already"), "{told}");
    run(0, &["merge", "--overwrite", "shot.0002.exr", "part.exr"]);
    run(0, &["shot.0001.exr", "shot.0003.exr", "--overwrite"]);
    assert!(shot.bytes("shot.0002.exr") == shot.bytes("shot.0003.exr"));

    for frame in [2, 3] {
        shot.render("shot", frame);
        shot.render("den", frame);
    }
    let told = run(2, &["shot.####.exr", "den.####.exr"]);
    assert!(told.contains("den.0002.exr: is there already") && told.contains("for frames 2,3"), "{told}");
    assert_eq!(shot.names("den."), ["den.0002.exr", "den.0003.exr", "den.exr"], "before any work");
}

#[test]
fn a_sequence_that_is_denoised_already_is_told_once() {
    let shot = Shot::new(&[1, 2, 3]);
    shot.expect(0, &["shot.####.exr", "den.####.exr"]);
    let (_, told) = shot.expect(0, &["den.####.exr", "again.####.exr"]);
    assert!(told.contains("warning: frame 1: den.0001.exr: is denoised already"), "{told}");
    let all = "warning: frames 2,3 too, as frame 1: den.0001.exr: is denoised already";
    assert!(told.contains(all) && told.matches("is denoised already").count() == 2, "{told}");
}

/// A job that was broken off and is started again must not denoise a frame twice without a word.
#[test]
fn a_sequence_in_place_is_denoised_once() {
    let shot = Shot::new(&[1, 2, 3]);
    shot.expect(0, &["shot.####.exr", "shot.####.exr", "--frames", "1-2", "--quiet"]);
    let begun = [1, 2, 3].map(|frame| shot.bytes(&format!("shot.{frame:04}.exr")));
    let again = ["shot.####.exr", "shot.####.exr", "--quiet"];
    let (_, told) = shot.expect(4, &again);
    assert!(told.contains("shot.0001.exr: is denoised already by this program"), "{told}");
    assert!(told.contains("(and so for frames 1,2); give --skip-existing"), "{told}");
    assert!(begun == [1, 2, 3].map(|frame| shot.bytes(&format!("shot.{frame:04}.exr"))), "before any work");
    shot.expect(0, &[&again[..], &["--skip-existing"]].concat());
    assert!(begun[..2] == [1, 2].map(|frame| shot.bytes(&format!("shot.{frame:04}.exr"))));
    assert!(begun[2] != shot.bytes("shot.0003.exr"));
    shot.expect(0, &[&again[..], &["--overwrite"]].concat());
}

#[test]
fn skipping_holds_for_one_picture_and_in_place() {
    let shot = Shot::new(&[1]);
    let one = ["shot.0001.exr", "den.exr", "--skip-existing", "--sequence-report", "all.json", "--quiet"];
    let state = || shot.json("all.json")["frames"][0]["state"].clone();
    shot.expect(0, &one);
    assert_eq!(state(), "done");
    shot.expect(0, &one);
    assert_eq!(state(), "skipped");
    let (said, _) = shot.expect(0, &one[..3]);
    assert_eq!(said, "progress 100\nden.exr: is there already, made by the same options\n");
    let (said, _) = shot.expect(0, &["shot.####.exr", "d.#.exr"]);
    assert!(said.contains("1 frame denoised in"), "{said}");
    let in_place = ["shot.####.exr", "shot.####.exr", "--skip-existing", "--quiet"];
    shot.expect(0, &in_place);
    assert!(shot.bytes("shot.0001.exr") == shot.bytes("den.exr"));
    shot.expect(0, &["shot.0001.exr", "./shot.0001.exr", "--skip-existing", "--quiet"]);
    assert!(shot.bytes("shot.0001.exr") == shot.bytes("den.exr"), "not denoised twice");
}

#[test]
fn skipping_minds_the_region_and_the_map() {
    let shot = Shot::new(&[1]);
    let run = |code: i32, output: &str, more: &[&str]| {
        shot.expect(code, &[&["shot.0001.exr", output, "--skip-existing", "--quiet"], more].concat()).1
    };
    run(0, "part.exr", &["--region", "0,0,9,9"]);
    let part = shot.bytes("part.exr");
    run(0, "part.exr", &["--region", "0,0,9,9"]);
    let complaint = run(2, "part.exr", &["--region", "9,0,9,9"]);
    assert!(complaint.contains("it holds the region 0,0,9,9 and not the region 9,0,9,9"), "{complaint}");
    let complaint = run(2, "part.exr", &[]);
    assert!(
        complaint.contains("part.exr: was made otherwise: it holds the region 0,0,9,9 and not"),
        "{complaint}"
    );
    assert!(shot.bytes("part.exr") == part);
    run(0, "den.exr", &[]);
    let complaint = run(2, "den.exr", &["--region", "0,0,9,9"]);
    assert!(complaint.contains("it holds the whole picture and not the region 0,0,9,9"), "{complaint}");

    run(0, "den.exr", &["--sampling-map", "map.exr"]);
    assert!(shot.path("map.exr").exists(), "a missing map is written");
    assert!(run(2, "den.exr", &["--target-error", "1e-9"]).contains("--target-error"));
    shot.expect(0, &["shot.0001.exr", "shot.0001.exr", "--quiet"]);
    let complaint = run(2, "shot.0001.exr", &["--sampling-map", "other.exr"]);
    assert!(
        complaint.contains("other.exr: the sampling map is missing, and its input was denoised"),
        "{complaint}"
    );
}

#[test]
fn a_frame_that_fails_loses_no_other() {
    let shot = Shot::new(&[1, 2, 4, 5]);
    std::fs::write(shot.path("shot.0003.exr"), "no picture").unwrap();
    let run = ["shot.####.exr", "den.####.exr", "--quiet", "--sequence-report", "all.json"];
    let (_, complaint) = shot.expect(3, &run);
    assert!(complaint.contains("frame 3: shot.0003.exr: is no OpenEXR file"), "{complaint}");
    assert!(complaint.contains("1 of 5 frames failed: 3"), "{complaint}");
    let ended = [(1, "done"), (2, "done"), (3, "failed"), (4, "not_run"), (5, "not_run")];
    assert_eq!(shot.states("all.json"), states(&ended));
    assert_eq!(shot.json("all.json")["frames"][2]["exit_code"], 3);

    shot.expect(3, &[&run[..], &["--keep-going", "--skip-existing"]].concat());
    let ended = [(1, "skipped"), (2, "skipped"), (3, "failed"), (4, "done"), (5, "done")];
    assert_eq!(shot.states("all.json"), states(&ended));

    shot.render("shot", 3);
    shot.expect(0, &[&run[..], &["--skip-existing"]].concat());
    assert_eq!(shot.states("all.json")[2], (3, "done".to_owned()));
}

#[test]
fn the_exit_code_is_that_of_the_first_frame_that_failed() {
    let shot = Shot::new(&[1, 4]);
    let depth = layer(None, SIZE, (0, 0), scan_lines(Compression::RLE), channels(SIZE, &["depth.Z"]));
    write_one(&shot.path("shot.0002.exr"), depth);
    std::fs::write(shot.path("shot.0003.exr"), "no picture").unwrap();
    let (_, complaint) = shot.expect(4, &["shot.####.exr", "den.####.exr", "--quiet", "--keep-going"]);
    assert!(complaint.contains("2 of 4 frames failed: 2,3"), "{complaint}");
    assert_eq!(shot.names("den"), ["den.0001.exr", "den.0004.exr"]);
}

#[test]
fn names_that_would_lose_something_are_refused() {
    let shot = Shot::new(&[1, 2]);
    shot.render("half", 1);
    let renders = [1, 2].map(|frame| shot.bytes(&format!("shot.{frame:04}.exr")));
    let cases: [(&[&str], &str); 18] = [
        (
            &["shot.####.exr", "den.exr"],
            "den.exr: several results would be written here: the name has no place",
        ),
        (&["shot.####.exr", "den.####.exr", "--report", "rep.json"], "--sequence-report"),
        (
            &["shot.####.exr", "den.####.exr", "--sequence-report", "all.####.json"],
            "all.####.json: has a place for the frame's number, and --sequence-report is one file",
        ),
        (&["shot.####.exr", "den.####.exr", "--report", "den.####.exr"], "several results"),
        (&["shot.####.exr", "den.####.exr", "--half", "half.0001.exr"], "one file for many"),
        (
            &["shot.####.exr", "half.####.exr", "--half", "half.####.exr", "--frames", "1"],
            "as well as a result",
        ),
        (&["shot.0001.exr", "den.exr", "--frames", "1"], "place for the frame's number"),
        (
            &["shot.0001.exr", "den.exr", "--report", "./shot.0001.exr"],
            "the report and the input (shot.0001.exr)",
        ),
        (
            &["shot.0001.exr", "den.exr", "--sampling-map", "den.exr"],
            "the sampling map and the result (den.exr)",
        ),
        (
            &["shot.0001.exr", "den.exr", "--sequence-report", "half.0001.exr", "--half", "half.0001.exr"],
            "the half",
        ),
        (
            &["shot.0001.exr", "den.exr", "--report", "half.0001.exr", "--with", "half.0001.exr"],
            "a file of --with",
        ),
        (
            &["shot.####.exr", "den.####.exr", "--sequence-report", "./den.0002.exr"],
            "the sequence report and the result",
        ),
        (&["shot.####.exr", "shot.####.exr", "--with", "shot.0001.exr"], "the result and a file of --with"),
        (&["shot.####.exr", "shot.0002.exr", "--frames", "1", "--temporal", "1"], "the result and the input"),
        (&["shot.0001.exr", "den.####.exr"], "den.####.exr: has a place for the frame's number"),
        (&["shot.0001.exr", "den.exr", "--report", "r.%04d.json"], "r.%04d.json: has a place"),
        (&["shot.####.exr", "den.####.png"], "den.####.png: does not end in .exr"),
        (&["shot.0001.exr", "./shot.0001.exr", "--region", "0,0,4,4"], "replace the whole picture"),
    ];
    for (arguments, words) in cases {
        let before = shot.names("");
        let (code, _, complaint) = shot.run(arguments);
        assert_eq!(code, 2, "{arguments:?}: {complaint}");
        assert!(complaint.contains(words), "{arguments:?}: {complaint}");
        assert_eq!(shot.names(""), before);
        assert_eq!([1, 2].map(|frame| shot.bytes(&format!("shot.{frame:04}.exr"))), renders, "{arguments:?}");
    }
    let (_, complaint) = shot.expect(2, &["shot.####.exr", "den.####.exr", "--frames", "9-1"]);
    assert!(complaint.contains("write 1-9"), "{complaint}");
}

#[test]
fn one_frame_of_a_sequence_may_have_plain_names() {
    let shot = Shot::new(&[1, 2]);
    shot.expect(0, &["shot.####.exr", "den.exr", "--frames", "2", "--report", "rep.json", "--quiet"]);
    assert_eq!(shot.json("rep.json")["frame"], 2);
}

#[test]
fn a_file_of_that_very_name_is_no_pattern() {
    let shot = Shot::new(&[1]);
    std::fs::rename(shot.path("shot.0001.exr"), shot.path("take #1.exr")).unwrap();
    shot.expect(0, &["take #1.exr", "den ##.exr", "--quiet"]);
    assert_eq!(shot.names("den"), ["den ##.exr"]);
}

#[test]
fn inspection_tells_the_frames_and_reads_the_first() {
    let shot = Shot::new(&[2, 3, 4, 8]);
    let inspect = ["--inspect", "shot.####.exr", "--frames", "1-4,8", "--missing", "skip"];
    let (said, _) = shot.expect(0, &inspect);
    assert!(said.starts_with("4 frames: 2-4,8; missing: 1\nshot.0002.exr"), "{said}");
    let (json, _) = shot.expect(0, &[&inspect[..], &["--json"]].concat());
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["sequence"]["frames"], "2-4,8");
    assert_eq!(json["size"][0], SIZE.0 + 2);
}

#[test]
fn a_folder_that_takes_nothing_is_told_before_the_work() {
    let shot = Shot::new(&[1, 2]);
    let (_, complaint) = shot.expect(2, &["shot.####.exr", "no/such/den.####.exr"]);
    assert!(complaint.contains("den.0001.exr: cannot be written"), "{complaint}");
    std::fs::create_dir(shot.path("den.0002.exr")).unwrap();
    let (_, complaint) = shot.expect(2, &["shot.####.exr", "den.####.exr"]);
    assert!(complaint.contains("den.0002.exr: is a folder"), "{complaint}");
    assert!(!shot.path("den.0001.exr").exists());
}
