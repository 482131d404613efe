//! Regions of a picture, denoised apart and merged, and a picture denoised in bands: the very file, to the
//! byte, of the picture denoised as a whole.

use std::path::{Path, PathBuf};

use crate::exr_files::*;
use apr::denoise::{Facts, Part, Silent, denoise_part};
use apr::image::{Rect, black};
use apr::io::{Picture, ReadOptions, Survey, merge};
use apr::options::Kernel;
use apr::{Aov, ErrorKind, Frame, Options, denoise};
use assert_cmd::Command;
use exr::prelude::*;

/// Small windows and one stage: what is tested here is files.
fn quick() -> Options {
    let kernel = Kernel::by_color(0, 1.0);
    Options { window_radius: 1, max_order: 1, stages: vec![vec![kernel]], ..Options::default() }
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name)
}

/// A picture of `size` cut at these columns and rows.
fn cut((width, height): (usize, usize), columns: &[usize], rows: &[usize]) -> Vec<Rect> {
    let spans = |cuts: &[usize], length: usize| {
        let ends: Vec<usize> = [&[0], cuts, &[length]].concat();
        ends.windows(2).map(|pair| (pair[0], pair[1] - pair[0])).collect::<Vec<_>>()
    };
    let columns = spans(columns, width);
    let rows = spans(rows, height).into_iter();
    rows.flat_map(|(y, height)| columns.iter().map(move |&(x, width)| Rect { x, y, width, height })).collect()
}

/// Denoises the `regions` of `input` into files of their own.
fn write_regions(
    folder: &Path,
    input: &Path,
    read: &ReadOptions,
    regions: &[Rect],
    aux: bool,
) -> Vec<PathBuf> {
    let mut facts = Facts::default();
    let survey = Survey::open(input, read, 0, |rows| facts.add(rows)).unwrap();
    survey.sign("quick");
    let (width, height) = survey.size();
    let part = Part::of_outliers(Rect { x: 0, y: 0, width, height }, (width, height), &quick()).unwrap();
    facts.add_outliers(survey.read(part.read()).unwrap(), &part, &quick()).unwrap();
    let write = |(i, region): (usize, &Rect)| {
        let part = Part::new(*region, survey.size(), &quick(), &facts).unwrap();
        let frame = survey.read(part.read()).unwrap();
        let denoised = denoise_part(&frame, &part, &facts, &quick(), &Silent).unwrap();
        let path = folder.join(format!("region{i}.exr"));
        survey.write_region(&path, *region, &denoised, aux).unwrap();
        path
    };
    regions.iter().enumerate().map(write).collect()
}

/// Denoises `input` as a whole and in `regions` and holds the files against each other.
fn assert_merged(input: &Path, read: &ReadOptions, regions: impl Fn((usize, usize)) -> Vec<Rect>, aux: bool) {
    let folder = tempfile::tempdir().unwrap();
    let (whole, merged) = (folder.path().join("whole.exr"), folder.path().join("merged.exr"));
    let picture = Picture::read(input, read).unwrap();
    picture.sign("quick");
    let denoised = denoise(picture.frame(), &quick()).unwrap();
    picture.write(&whole, &denoised, aux).unwrap();
    let size = (picture.frame().width(), picture.frame().height());
    let mut paths = write_regions(folder.path(), input, read, &regions(size), aux);
    paths.rotate_left(1);
    merge(&merged, &paths).unwrap();
    let same = std::fs::read(&whole).unwrap() == std::fs::read(&merged).unwrap();
    assert!(same, "{} differs when it is merged", input.display());
}

#[test]
fn files_of_every_codec_in_lines_and_tiles_merge_to_the_byte() {
    let folder = tempfile::tempdir().unwrap();
    for (i, bytes) in of_every_codec((41, 37)).into_iter().enumerate() {
        let input = folder.path().join(format!("{i}.exr"));
        std::fs::write(&input, bytes).unwrap();
        assert_merged(&input, &ReadOptions::default(), |size| cut(size, &[9, 30], &[5, 21]), i % 2 == 0);
    }
}

#[test]
fn files_of_renderers_merge_to_the_byte() {
    let halves = ReadOptions {
        half: Some(fixture("blender/room_seed2.exr")),
        aovs: vec!["auto".to_owned()],
        ..ReadOptions::default()
    };
    assert_merged(&fixture("blender/room_seed1.exr"), &halves, |size| cut(size, &[31], &[]), false);
    for name in ["mitsuba/gallery_aov.exr", "mitsuba/gallery_moment.exr", "trace/foliage.exr"] {
        assert_merged(
            &fixture(name),
            &ReadOptions::default(),
            |size| cut(size, &[], &[size.1 / 3, size.1 / 2]),
            true,
        );
    }
}

#[test]
fn parts_of_other_windows_and_other_line_orders_merge_to_the_byte() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.exr");
    let size = (40, 33);
    let encoding = |blocks, line_order| Encoding { compression: Compression::ZIP16, blocks, line_order };
    let tiles = Blocks::Tiles(Vec2(7, 5));
    let part = |name, size, position, encoding, names: &[&str]| {
        layer(Some(name), size, position, encoding, channels(size, names))
    };
    let decreasing = encoding(Blocks::ScanLines, LineOrder::Decreasing);
    let parts = vec![
        part("matte", (90, 80), (-20, -30), encoding(tiles, LineOrder::Increasing), &["id.R", "id.G"]),
        part("rgba", size, (3, -2), decreasing, &["R", "G", "B", "A"]),
        part("far", (9, 6), (500, 500), decreasing, &["far.R"]),
        part("depth", size, (3, -2), encoding(tiles, LineOrder::Unspecified), &["Z"]),
    ];
    write(&input, IntegerBounds::new((-10, -10), (64, 64)), parts);
    assert_merged(&input, &ReadOptions::default(), |size| cut(size, &[13], &[1, 20]), true);
    // A region is a file of its own: its window inside the display window, its pixels as they were.
    let region = Rect { x: 5, y: 7, width: 11, height: 9 };
    let path = &write_regions(folder.path(), &input, &ReadOptions::default(), &[region], false)[0];
    let (before, after) = (read_all(&input), read_all(path));
    assert_eq!(after.attributes.display_window, before.attributes.display_window);
    let beauty = &after.layer_data[1];
    assert_eq!((beauty.size, beauty.attributes.layer_position), (Vec2(11, 9), Vec2(8, 5)));
    let alpha = |image: &FlatImage| bits(&image.layer_data[1].channel_data.list[0].sample_data);
    let expected: Vec<u32> = region.pixels().map(|(x, y)| alpha(&before)[y * size.0 + x]).collect();
    assert_eq!(alpha(&after), expected);
}

#[test]
fn regions_that_do_not_fit_together_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (foliage, other) = (fixture("trace/foliage.exr"), fixture("trace/fog_shaft.exr"));
    let part = |x: usize, width: usize| Rect { x, y: 0, width, height: 15 };
    let read = ReadOptions::default();
    let size = Survey::open(&foliage, &read, 0, |_| {}).unwrap().size();
    let regions = [Rect { x: 0, y: 0, width: size.0, height: 10 }, part(0, 5), part(5, 9)];
    let paths = write_regions(folder.path(), &foliage, &read, &regions, false);
    let elsewhere = tempfile::tempdir().unwrap();
    let of_other = write_regions(elsewhere.path(), &other, &read, &regions[..1], false);
    let target = folder.path().join("merged.exr");
    let refusal = |paths: &[&PathBuf]| {
        let paths: Vec<PathBuf> = paths.iter().map(|path| (*path).clone()).collect();
        let error = merge(&target, &paths).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Lacking, "{error}");
        error.to_string()
    };
    assert!(refusal(&[&paths[0], &paths[1]]).contains("overlaps"));
    let hole = refusal(&[&paths[1], &paths[2]]);
    assert!(hole.contains("the first at 14,0"), "{hole}");
    assert!(refusal(&[&paths[0], &of_other[0]]).contains("another input"));
    assert!(refusal(&[&paths[0], &foliage]).contains("--region"));
    assert!(!target.exists());
}

/// What a region says of its picture is held against the limits and against the region, before room is made.
#[test]
fn regions_of_forged_pictures_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.exr");
    write_one(
        &input,
        layer(None, (24, 18), (0, 0), scan_lines(Compression::ZIP1), channels((24, 18), &["R", "G", "B"])),
    );
    let whole = [Rect::whole((24, 18))];
    let path = &write_regions(folder.path(), &input, &ReadOptions::default(), &whole, false)[0];
    let target = folder.path().join("merged.exr");
    let text = Text::from("apr.region");
    let size = "[0,0,24,18]";
    let keys = ["picture", "region", "window"];
    let forged = |keys: &[&str], with: &str| {
        let mut image = read_all(path);
        let attributes = &mut image.layer_data[0].attributes.other;
        let AttributeValue::Text(mark) = &attributes[&text] else { panic!("the mark is a text") };
        let mut mark = mark.to_string();
        for key in keys {
            let (old, new) = (format!("\"{key}\":{size}"), format!("\"{key}\":{with}"));
            assert!(mark.contains(&old), "{mark}");
            mark = mark.replace(&old, &new);
        }
        attributes.insert(text.clone(), AttributeValue::Text(Text::from(mark.as_str())));
        let forgery = folder.path().join("forged.exr");
        image.write().to_file(&forgery).unwrap();
        merge(&target, &[forgery]).map_err(|error| (error.kind(), error.to_string()))
    };
    assert!(forged(&[], "").is_ok());
    std::fs::remove_file(&target).unwrap();
    for with in ["[0,0,60000,20000]", "[0,0,16000,16000]", "[0,0,9223372036854775807,18]"] {
        for keys in [&keys[..], &keys[..1], &keys[1..2], &keys[2..]] {
            let (kind, told) = forged(keys, with).unwrap_err();
            assert_eq!(kind, ErrorKind::Unreadable, "{with} as {keys:?}: {told}");
            assert!(told.contains("forged.exr"), "{told}");
        }
    }
    assert!(!target.exists());
}

fn program(arguments: &[&str]) -> std::process::Output {
    Command::cargo_bin("apr-denoise").unwrap().args(arguments).output().unwrap()
}

const QUICK: [&str; 7] = ["--preset", "fast", "--set", "window_radius=1", "--set", "coarse=false", "--quiet"];

#[test]
fn the_program_merges_what_it_cut() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let input = fixture("trace/foliage.exr").to_str().unwrap().to_owned();
    let (width, height) = Survey::open(&input, &ReadOptions::default(), 0, |_| {}).unwrap().size();
    let run = |arguments: &[&str]| {
        let output = program(arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    let denoise = |more: &[&str]| run(&[&QUICK[..], more].concat());
    denoise(&[&input, &path("whole.exr")]);
    denoise(&[&input, &path("a.exr"), "--region", &format!("0,0,{width},11"), "--report", &path("a.json")]);
    denoise(&[&input, &path("b.exr"), "--region", &format!("0,11,{width},{}", height - 11)]);
    run(&["merge", &path("merged.exr"), &path("b.exr"), &path("a.exr")]);
    assert_eq!(std::fs::read(path("whole.exr")).unwrap(), std::fs::read(path("merged.exr")).unwrap());
    assert!(std::fs::read_to_string(path("a.json")).unwrap().contains("\"estimated_error\""));

    for (output, words) in [("b.exr", "the picture and a region"), ("merged.png", "does not end in .exr")] {
        let before = std::fs::read(path("b.exr")).unwrap();
        let refused = program(&["merge", &path(output), &path("b.exr"), &path("a.exr")]);
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(refused.status.code() == Some(2) && said.contains(words), "{said}");
        assert_eq!(std::fs::read(path("b.exr")).unwrap(), before);
    }
    let c = path("c.exr");
    let other = [&QUICK[..], &[&input, &c, "--region", "0,0,5,11", "--set", "max_order=1"]].concat();
    run(&other);
    let refused = program(&["merge", &path("merged.exr"), &path("b.exr"), &path("c.exr")]);
    assert_eq!(refused.status.code(), Some(4));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("other options"));
    for (region, word) in [("0,0,9999,1", "not inside"), ("1,2,3", "expected x,y,width,height")] {
        let refused = program(&[&input, &path("d.exr"), "--region", region]);
        assert_eq!(refused.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&refused.stderr).contains(word), "{refused:?}");
    }
}

#[test]
fn a_bound_of_memory_changes_no_bit_and_is_kept() {
    const SIZE: (usize, usize) = (96, 900);
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (input, whole, bands) = (path("in.exr"), path("whole.exr"), path("bands.exr"));
    let names = ["R", "G", "B", "variance.R", "variance.G", "variance.B", "depth.Z", "A"];
    let encoding = scan_lines(Compression::ZIP16);
    write_one(Path::new(&input), layer(None, SIZE, (0, 0), encoding, channels(SIZE, &names)));
    let run = |output: &str, more: &[&str]| {
        let files = [&input[..], output, "--aux", "--set", "outliers.witnesses=4", "--threads", "2"];
        program(&[&files, &QUICK[..], more].concat())
    };
    let report = path("report.json");
    let told = || -> serde_json::Value {
        serde_json::from_str(&std::fs::read_to_string(path("report.json")).unwrap()).unwrap()
    };
    assert!(run(&whole, &["--report", &report]).status.success());
    let told_whole = told();
    let refused = run(&bands, &["--memory", "1M"]);
    assert_eq!(refused.status.code(), Some(2));
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    let least = message.trim().rsplit_once("at least ").expect(&message).1.to_owned();

    let bounded = run(&bands, &["--memory", &least, "--report", &report]);
    assert!(bounded.status.success(), "{}", String::from_utf8_lossy(&bounded.stderr));
    assert_eq!(std::fs::read(whole).unwrap(), std::fs::read(bands).unwrap());
    let report = told();
    assert!(report["bands"].as_u64().unwrap() > 2, "{}", report["bands"]);
    assert_eq!(report["skipped"], told_whole["skipped"], "the same is skipped in bands");
    assert_eq!(report["skipped"][0]["stage"], "prefilter", "the depth has no variance");
    let bound: u64 = least.trim_end_matches('M').parse().unwrap();
    assert!(bound < 150, "two threads and so few pixels take little: {bound}");
    for stage in report["stages"].as_array().unwrap() {
        let peak = stage["peak_memory_bytes"].as_u64().unwrap_or(0);
        assert!(peak <= bound << 20, "{stage}");
    }
}

/// Bytes that a run reads, as a multiple of its input's.
#[cfg(target_os = "linux")]
fn times_read(input: &str, arguments: &[&str]) -> f64 {
    let mut run = std::process::Command::new(env!("CARGO_BIN_EXE_apr-denoise"));
    let mut child = run.args(QUICK).arg(input).args(arguments).spawn().unwrap();
    let tells = |file: &str| std::fs::read_to_string(format!("/proc/{}/{file}", child.id())).unwrap();
    while !tells("stat").contains(") Z ") {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let io = tells("io"); // of one that has ended too, until it is waited for
    let read: f64 = io.lines().find_map(|line| line.strip_prefix("rchar: ")).unwrap().parse().unwrap();
    assert!(child.wait().unwrap().success());
    read / std::fs::metadata(input).unwrap().len() as f64
}

#[cfg(target_os = "linux")]
#[test]
fn a_file_is_read_once_where_the_memory_holds_it() {
    const SIZE: (usize, usize) = (96, 900);
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (input, output) = (path("in.exr"), path("out.exr"));
    let names = ["R", "G", "B", "variance.R", "variance.G", "variance.B", "depth.Z", "A"];
    let encoding = scan_lines(Compression::Uncompressed);
    write_one(Path::new(&input), layer(None, SIZE, (0, 0), encoding, channels(SIZE, &names)));
    let half = "0,450,96,450";
    // A region is read once more for what passes through.
    for (more, most) in [
        (&[][..], 1.2),
        (&["--memory", "4G"], 1.2),
        (&["--memory", "4G", "--region", half], 1.2),
        (&["--region", half], 1.7),
    ] {
        let times = times_read(&input, &[&[&output[..]], more].concat());
        assert!(times < most, "{more:?}: {times}");
    }
}

/// A part with a denoised channel may have hundreds of others.
#[test]
fn what_passes_through_a_region_is_not_held() {
    const SIZE: (usize, usize) = (96, 1800);
    const OTHERS: usize = 500;
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (input, report) = (path("in.exr"), path("report.json"));
    let mut all = channels(SIZE, &["R", "G", "B"]);
    let flat = |n: usize| float(&format!("other{n:03}.Y"), vec![0.5; SIZE.0 * SIZE.1]);
    all.extend((0..OTHERS).map(flat));
    write_one(Path::new(&input), layer(None, SIZE, (0, 0), scan_lines(Compression::RLE), all));
    let mut arguments = QUICK.to_vec();
    let output = path("out.exr");
    arguments.extend([&input[..], &output, "--region", "0,0,96,1800", "--threads", "2", "--report", &report]);
    assert!(program(&arguments).status.success());
    let told: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&report).unwrap()).unwrap();
    let others = (OTHERS * SIZE.0 * SIZE.1 * size_of::<f32>()) as u64;
    for stage in told["stages"].as_array().unwrap() {
        let peak = stage["peak_memory_bytes"].as_u64().unwrap_or(0);
        assert!(peak < others, "{stage}: {others} bytes pass through");
    }
}

#[test]
fn the_result_of_another_picture_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let input = fixture("trace/foliage.exr");
    let survey = Survey::open(&input, &ReadOptions::default(), 0, |_| {}).unwrap();
    let (width, height) = survey.size();
    let result = |width, height| denoise(Frame::new(black(width, height)).unwrap(), &quick()).unwrap();
    let (small, mut more, mut torn) = (result(8, 6), result(width, height), result(width, height));
    more.aovs.push(Aov { name: "key".into(), color: more.color.clone() });
    torn.mse = small.mse.clone();
    let path = folder.path().join("out.exr");
    let here = Rect { x: 0, y: 0, width, height };
    let beyond = Rect { x: 1, ..here };
    let whole = result(width, height);
    let refused = [
        survey.write(&path, &small, true).err(),
        survey.write(&path, &more, true).err(),
        survey.write(&path, &torn, true).err(),
        survey.write_region(&path, here, &small, false).err(),
        survey.write_region(&path, beyond, &whole, false).err(),
        survey.sums(&more).err(),
        survey.sums(&torn).err(),
    ];
    for (i, error) in refused.into_iter().enumerate() {
        assert_eq!(error.map(|error| error.kind()), Some(ErrorKind::Usage), "case {i}");
    }
    assert!(!path.exists());
}
