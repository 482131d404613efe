//! Samples of the frames beside: what they gain, what they must not do, and the program's sequences.

use std::path::Path;

use crate::exr_files::{float, layer, scan_lines, values, write_one};
use apr::denoise::Silent;
use apr::image::{Plane, Rect, Rgb};
use apr::io::{FrameHeader, Picture, ReadOptions, Survey, write_frame};
use apr::{Denoised, Feature, FeatureKind, Frame, Motion, Neighbours, Options, denoise, denoise_in_sequence};
use assert_cmd::Command;
use exr::prelude::Compression;
use serde_json::Value;

const SIZE: (usize, usize) = (48, 36);
const SIGMA: f32 = 0.15;

/// Uniform numbers from −½ to ½.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32 - 0.5
    }
}

fn plane(f: impl FnMut(usize, usize) -> f32) -> Plane {
    Plane::from_fn(SIZE.0, SIZE.1, f)
}

/// Bumps of light that no feature knows, `shift` columns to the right.
fn texture(shift: i32) -> impl Fn(usize, usize) -> f32 {
    move |x, y| {
        let (x, y) = ((x as i32 - shift) as f32, y as f32);
        0.7 + 0.2 * (0.45 * x).sin() * (0.4 * y).cos() + 0.005 * x
    }
}

/// An edge at column `at`.
fn edge(at: usize) -> impl Fn(usize, usize) -> f32 {
    move |x, _| if x < at { 0.3 } else { 0.9 }
}

fn noisy(truth: impl Fn(usize, usize) -> f32, seed: u64) -> Frame {
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let color: Rgb =
        std::array::from_fn(|_| plane(|x, y| truth(x, y) + SIGMA * 12f32.sqrt() * random.next()));
    let variance = std::array::from_fn(|_| plane(|_, _| SIGMA * SIGMA));
    Frame::new(color).and_then(|frame| frame.with_variance_of_mean(variance)).unwrap()
}

fn moving(frame: Frame, way: f32) -> Frame {
    let to = |way: f32| Some([plane(|_, _| way), plane(|_, _| 0.0)]);
    frame.with_motion(Motion { previous: to(-way), next: to(way) }).unwrap()
}

fn with_neighbours(frames: &[Frame; 3]) -> Denoised {
    let [before, frame, after] = frames;
    let neighbours = Neighbours { before: vec![before], after: vec![after] };
    denoise_in_sequence(frame, &neighbours, &Options::default(), &Silent).unwrap()
}

fn error(result: &Denoised, truth: impl Fn(usize, usize) -> f32) -> f64 {
    let truth = plane(truth);
    let squares = result.color.iter().flat_map(|plane| plane.data().iter().zip(truth.data()));
    squares.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / (3 * SIZE.0 * SIZE.1) as f64
}

/// Summed errors over some seeds: alone, and with the frames beside.
fn errors(frames: impl Fn(u64) -> [Frame; 3], truth: impl Fn(usize, usize) -> f32) -> (f64, f64) {
    let (mut alone, mut together) = (0.0, 0.0);
    for seed in 0..4 {
        let frames = frames(10 * seed + 1);
        alone += error(&denoise(&frames[1], &Options::default()).unwrap(), &truth);
        together += error(&with_neighbours(&frames), &truth);
    }
    (alone, together)
}

#[test]
fn a_still_sequence_is_less_noisy_with_its_neighbours() {
    let frames = |seed| [seed, seed + 1, seed + 2].map(|seed| noisy(texture(0), seed));
    let (alone, together) = errors(frames, texture(0));
    assert!(together < 0.9 * alone, "{together} with neighbours, {alone} alone");
}

#[test]
fn what_moves_gains_along_its_vectors() {
    let frames = |seed| {
        [-5, 0, 5]
            .map(|way| moving(noisy(texture(way), seed + way.unsigned_abs() as u64 + (way > 0) as u64), 5.0))
    };
    let (alone, together) = errors(frames, texture(0));
    assert!(together < 0.9 * alone, "{together} with neighbours, {alone} alone");
}

#[test]
fn a_still_world_seen_through_a_window_that_moves_gains_too() {
    let window = |n: usize, seed: u64| {
        let (x0, y0) = (6 * n as i32, 3 * n);
        let seen = noisy(move |x, y| texture(-x0)(x, y + y0), seed + n as u64);
        seen.with_origin((x0 - 100, y0 as i32))
    };
    let frames = |seed| [0, 1, 2].map(|n| window(n, seed));
    let (alone, together) = errors(frames, |x, y| texture(-6)(x, y + 3));
    assert!(together < 0.95 * alone, "{together} with neighbours, {alone} alone");
}

#[test]
fn a_frame_knows_where_its_data_window_begins() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("window.exr");
    let channels = ["R", "G", "B"].map(|name| float(name, values(6 * 5, 1))).to_vec();
    write_one(&path, layer(None, (6, 5), (-3, 7), scan_lines(Compression::ZIP16), channels));
    let survey = Survey::open(&path, &ReadOptions::default(), 0, |_| {}).unwrap();
    let part = survey.read(Rect { x: 2, y: 1, width: 3, height: 2 }).unwrap();
    let whole = Picture::read(&path, &ReadOptions::default()).unwrap();
    assert_eq!((whole.frame().origin(), part.origin()), ((-3, 7), (-1, 8)));
}

#[test]
fn an_edge_that_moves_without_vectors_or_with_wrong_ones_does_no_harm() {
    // A single column that has changed is within the chance of three deviations: there it does some.
    for (way, wrong, most) in [(8, None, 1.0), (8, Some(-3.0), 1.0), (2, None, 1.0), (1, None, 1.35)] {
        let frames = |seed: u64| {
            let at = [24 - way, 24, 24 + way];
            let still = at.map(|at| noisy(edge(at), seed + at as u64));
            still.map(|frame| wrong.map_or(frame.clone(), |way| moving(frame, way)))
        };
        let (alone, together) = errors(frames, edge(24));
        assert!(together < most * alone, "{together} with neighbours, {alone} alone, {way} {wrong:?}");
    }
}

#[test]
fn a_frame_repeated_with_its_noise_is_no_news() {
    let frame = noisy(texture(0), 3);
    let result = with_neighbours(&[frame.clone(), frame.clone(), frame.clone()]);
    assert!(result.summary.beside.iter().all(|beside| beside.trusted == 0.0 && beside.copied == 1.0));
    let (alone, copied) = (denoise(&frame, &Options::default()).unwrap(), result);
    for (a, b) in alone.color.iter().flat_map(Plane::data).zip(copied.color.iter().flat_map(Plane::data)) {
        assert!((a - b).abs() < 1e-4, "{a} {b}");
    }
}

#[test]
fn frames_of_another_kind_are_left_out_with_a_reason() {
    let frame = noisy(texture(0), 3);
    let plain = denoise(&frame, &Options::default()).unwrap();
    let depth = Feature::new("depth", FeatureKind::Depth, vec![plane(|x, _| x as f32)]);
    let other = noisy(texture(0), 4).with_feature(depth).unwrap();
    let small = Frame::new(std::array::from_fn(|_| Plane::filled(5, 4, 1.0))).unwrap();
    let neighbours = Neighbours { before: vec![&small], after: vec![&other] };
    let result = denoise_in_sequence(&frame, &neighbours, &Options::default(), &Silent).unwrap();
    assert_eq!((result.color, result.summary.beside.len()), (plain.color, 0));
    let notes = result.summary.notes.join("; ");
    assert!(notes.contains("at -1") && notes.contains("5×4") && notes.contains("depth (1)"), "{notes}");
}

#[test]
fn where_some_frames_have_vectors_those_without_do_not_stand_still() {
    let still = |seed| noisy(texture(0), seed);
    let with = |seed| moving(still(seed), 0.0);
    let offsets = |frame: &Frame, before: [&Frame; 2]| {
        let neighbours = Neighbours { before: before.to_vec(), after: vec![] };
        let summary = denoise_in_sequence(frame, &neighbours, &Options::default(), &Silent).unwrap().summary;
        let notes = summary.notes.iter().filter(|note| note.contains("none that lead there"));
        (summary.beside.iter().map(|beside| beside.offset).collect::<Vec<_>>(), notes.count())
    };
    assert_eq!(offsets(&still(1), [&still(2), &still(3)]), (vec![-1, -2], 0));
    assert_eq!(offsets(&with(1), [&with(2), &still(3)]), (vec![-1, -2], 0), "the one before it leads there");
    assert_eq!(offsets(&still(1), [&with(2), &with(3)]), (vec![], 1));
    assert_eq!(offsets(&still(1), [&still(2), &with(3)]), (vec![-1], 1));
}

#[test]
fn a_feature_of_one_name_is_not_the_same_where_it_describes_something_else() {
    let of = |seed, kind, planes: usize| {
        let planes = (0..planes).map(|c| plane(|x, y| 0.2 + ((x + c + y * y) % 3) as f32 * 0.3));
        noisy(texture(0), seed).with_feature(Feature::new("x", kind, planes.collect())).unwrap()
    };
    use FeatureKind::{Albedo, Other, Visibility};
    for (here, there, planes) in [(Albedo, Other, 3), (Other, Albedo, 3), (Other, Visibility, 1)] {
        let (frame, other) = (of(3, here, planes), of(4, there, planes));
        let plain = denoise(&frame, &Options::default()).unwrap();
        let neighbours = Neighbours { before: vec![&other], after: vec![] };
        let result = denoise_in_sequence(&frame, &neighbours, &Options::default(), &Silent).unwrap();
        assert_eq!(
            (result.color, result.summary.beside.len()),
            (plain.color, 0),
            "{there:?} beside {here:?}"
        );
        let notes = result.summary.notes.join("; ");
        assert!(notes.contains(&format!("x ({planes}) as {there:?}")), "{notes}");
    }
}

#[test]
fn the_bits_do_not_depend_on_the_threads() {
    let frames = [1, 2, 3].map(|seed| moving(noisy(texture(0), seed), 0.3));
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| with_neighbours(&frames))
    };
    assert!(on(1) == on(3));
}

fn shot(folder: &Path, frames: std::ops::RangeInclusive<u64>) {
    for frame in frames {
        let picture = moving(noisy(texture(2 * frame as i32), frame), 2.0);
        write_frame(folder.join(format!("shot.{frame:04}.exr")), &picture, &FrameHeader::default()).unwrap();
    }
}

fn run(folder: &Path, code: i32, arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_apr-denoise"));
    let output = command.current_dir(folder).args(arguments).output().unwrap();
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {complaint}");
    complaint
}

#[test]
fn any_split_of_a_sequence_gives_the_same_bits_and_the_report_tells_who_helped() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    shot(folder, 1..=4);
    let bytes = |name: String| std::fs::read(folder.join(name)).unwrap();
    let together = ["shot.####.exr", "all.####.exr", "--temporal", "2", "--report", "$F.json", "--quiet"];
    run(folder, 0, &together);
    for frame in 1..=4 {
        let number = frame.to_string();
        let one = ["shot.####.exr", "one.####.exr", "--temporal", "2", "--frames", &number, "--threads", "1"];
        run(folder, 0, &one);
        assert!(
            bytes(format!("all.{frame:04}.exr")) == bytes(format!("one.{frame:04}.exr")),
            "frame {frame}"
        );
    }
    let report: Value = serde_json::from_slice(&bytes("2.json".into())).unwrap();
    let offsets: Vec<i64> = report["summary"]["beside"]
        .as_array()
        .unwrap()
        .iter()
        .map(|b| b["offset"].as_i64().unwrap())
        .collect();
    assert_eq!(offsets, [-1, 1, 2]);
    assert!(report["summary"]["beside"][0]["trusted"].as_f64().unwrap() > 0.5);
    assert!(report["notes"].to_string().contains("frame 0 has no file"), "{}", report["notes"]);

    // Settings are signed: a run with others does not go on.
    let complaint = run(folder, 2, &["shot.####.exr", "all.####.exr", "--skip-existing"]);
    assert!(complaint.contains("with another --temporal"), "{complaint}");
}

#[test]
fn a_run_that_goes_on_does_those_again_that_have_got_neighbours() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let bytes = |name: String| std::fs::read(folder.join(name)).unwrap();
    let states = || -> Vec<String> {
        let report: Value = serde_json::from_slice(&bytes("all.json".into())).unwrap();
        let frames = report["frames"].as_array().unwrap().iter();
        frames.map(|frame| frame["state"].as_str().unwrap().to_owned()).collect()
    };
    let report = ["--sequence-report", "all.json", "--quiet"];
    let go_on = ["shot.####.exr", "den.####.exr", "--temporal", "1", "--skip-existing"];
    let go_on = [&go_on[..], &report].concat();
    shot(folder, 1..=3);
    run(folder, 0, &go_on);
    run(folder, 0, &go_on);
    assert_eq!(states(), ["skipped"; 3]);
    shot(folder, 4..=5);
    run(folder, 0, &go_on);
    assert_eq!(
        states(),
        ["skipped", "skipped", "done", "done", "done"],
        "frame 3 was an end and is none now"
    );
    run(folder, 0, &["shot.####.exr", "once.####.exr", "--temporal", "1", "--quiet"]);
    for frame in 1..=5 {
        assert!(
            bytes(format!("den.{frame:04}.exr")) == bytes(format!("once.{frame:04}.exr")),
            "frame {frame} is not as in one run"
        );
    }
    let complaint = run(folder, 2, &[&go_on[..], &["--set", "outliers.radius=3"]].concat());
    assert!(complaint.contains("with another --set outliers.radius"), "{complaint}");
}

#[test]
fn a_damaged_frame_costs_those_beside_it_no_result() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    shot(folder, 1..=3);
    let bytes = |name: &str| std::fs::read(folder.join(name)).unwrap();
    let whole = bytes("shot.0003.exr");
    std::fs::write(folder.join("shot.0003.exr"), &whole[..whole.len() / 2]).unwrap();
    let arguments = ["shot.####.exr", "den.####.exr", "--temporal", "1", "--skip-existing"];
    let keep_going = [&arguments[..], &["--keep-going"]].concat();
    let complaint = run(folder, 3, &keep_going);
    assert!(complaint.contains("frame 3 cannot be read"), "{complaint}");
    assert!(!folder.join("den.0003.exr").exists());
    let without = bytes("den.0002.exr");

    // It is done again as soon as the frame beside it is whole.
    std::fs::write(folder.join("shot.0003.exr"), &whole).unwrap();
    run(folder, 0, &arguments);
    run(folder, 0, &["shot.####.exr", "once.####.exr", "--temporal", "1"]);
    assert!(bytes("den.0002.exr") == bytes("once.0002.exr") && without != bytes("once.0002.exr"));

    std::fs::write(folder.join("shot.0003.exr"), &whole[..whole.len() / 2]).unwrap();
    run(folder, 3, &["shot.####.exr", "other.####.exr", "--temporal", "1", "--frames", "2"]);
}

#[test]
fn frames_of_one_seed_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    shot(folder, 1..=2);
    let warned = |count: usize| {
        let complaint = run(folder, 0, &["shot.####.exr", "den.####.exr", "--temporal", "1"]);
        assert_eq!(complaint.matches("a seed of its own").count(), count, "{complaint}");
    };
    warned(0);
    for frame in 1..=2 {
        let picture = moving(noisy(texture(0), 1), 0.0);
        write_frame(folder.join(format!("shot.{frame:04}.exr")), &picture, &FrameHeader::default()).unwrap();
    }
    warned(2); // of the first, and that the second is as it
}

#[test]
fn what_makes_no_sense_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    shot(folder, 1..=2);
    let refused = |arguments: &[&str], why: &str| {
        let complaint = run(folder, 2, &[arguments, &["--temporal", "1"]].concat());
        assert!(complaint.contains(why), "{complaint}");
    };
    refused(&["shot.####.exr", "shot.####.exr"], "names of their own");
    refused(&["shot.0001.exr", "den.exr"], "wants a sequence");
    refused(&["shot.####.exr", "den.####.exr", "--method", "nlm"], "not for the method nlm");
    assert_eq!(std::fs::read_dir(folder).unwrap().count(), 2);
}
