//! Components of the beauty go through its operator: what summed before sums after, in the file too.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::exr_files::*;
use apr::error::ErrorKind;
use apr::io::{FrameHeader, Picture, ReadOptions, Renderer, write_frame};
use apr::trace::{RenderOptions, Scene, render};
use apr::{Frame, Options, denoise};
use exr::prelude::*;

/// Largest relative rounding of an f32 sum and of a half float: half a unit in the last place.
const HALF_ROUNDING: f32 = 1.0 / 2048.0;
/// What a half float cannot be nearer to, where it is subnormal.
const HALF_LEAST: f32 = 1.0 / (1 << 25) as f32;
/// [choice] Some dozen roundings of f32 (fits, averages, factors), relative to the picture.
const FLOAT_ROUNDING: f64 = 3e-6;

fn auto() -> ReadOptions {
    named(&["auto"])
}

fn named(names: &[&str]) -> ReadOptions {
    ReadOptions { aovs: names.iter().map(|name| (*name).to_owned()).collect(), ..ReadOptions::default() }
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name)
}

fn samples(image: &FlatImage, name: &str) -> Vec<f32> {
    let channels = image.layer_data.iter().flat_map(|layer| &layer.channel_data.list);
    channels.into_iter().find(|channel| channel.name == *name).unwrap().sample_data.values_as_f32().collect()
}

/// The names of the channels whose bits differ.
fn changed(before: &FlatImage, after: &FlatImage) -> Vec<String> {
    let channels = |image: &FlatImage| -> Vec<_> {
        let layers = image.layer_data.iter();
        layers
            .flat_map(|l| l.channel_data.list.iter().map(|c| (c.name.to_string(), bits(&c.sample_data))))
            .collect()
    };
    let (before, after) = (channels(before), channels(after));
    assert_eq!(before.len(), after.len());
    let pairs = before.into_iter().zip(after);
    pairs
        .filter(|(a, b)| a.1 != b.1)
        .map(|(a, b)| {
            assert_eq!(a.0, b.0);
            a.0
        })
        .collect()
}

#[test]
fn the_light_groups_of_a_cycles_file_sum_before_and_after() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (fixture("blender/room_seed1.exr"), folder.path().join("out.exr"));
    let options = ReadOptions { half: Some(fixture("blender/room_seed2.exr")), ..auto() };
    assert_eq!(
        promised(&input, ReadOptions::default()),
        ["ViewLayer.Combined_key", "ViewLayer.Combined_rim"]
    );
    let picture = Picture::read(&input, &options).unwrap();
    let [check] = &picture.layout().sums[..] else { panic!("{:?}", picture.layout().sums) };
    assert_eq!(check.layers, ["ViewLayer.Combined_key", "ViewLayer.Combined_rim"]);
    assert!(picture.layout().warnings.iter().all(|warning| !warning.contains("sum")));
    let denoised = denoise(picture.frame(), &Options::default()).unwrap();
    let check = picture.sums(&denoised).unwrap().remove(0);
    // The file's halves sum to their rounding; the operator averages that and adds f32's.
    assert!(check.before.relative_rms < f64::from(HALF_ROUNDING), "{check:?}");
    assert!(check.after.unwrap().relative_rms < check.before.relative_rms, "{check:?}");

    picture.write(&output, &denoised, false).unwrap();
    let (before, after) = (read_all(&input), read_all(&output));
    let layers = ["ViewLayer.Combined", "ViewLayer.Combined_key", "ViewLayer.Combined_rim"];
    let expected: Vec<String> =
        layers.iter().flat_map(|layer| ["B", "G", "R"].map(|c| format!("{layer}.{c}"))).collect();
    assert_eq!(changed(&before, &after), expected, "everything else passes through");
    let slack = check.after.unwrap().largest as f32;
    for c in ["R", "G", "B"] {
        let [beauty, key, rim] = layers.map(|layer| samples(&after, &format!("{layer}.{c}")));
        for ((b, k), r) in beauty.iter().zip(&key).zip(&rim) {
            let rounding = HALF_ROUNDING * (b.abs() + k.abs() + r.abs()) + 3.0 * HALF_LEAST;
            assert!((k + r - b).abs() <= rounding + slack, "{k} + {r} against {b}");
        }
    }
    // They are denoised: nearer to being smooth than before.
    let roughness = |values: Vec<f32>| -> f32 { values.windows(2).map(|p| (p[0] - p[1]).abs()).sum() };
    let rim = |image: &FlatImage| roughness(samples(image, "ViewLayer.Combined_rim.R"));
    assert!(rim(&after) < 0.7 * rim(&before), "{} {}", rim(&after), rim(&before));
}

/// Where the noisy components sum exactly, the denoised ones do to the rounding of f32.
#[test]
fn an_exact_sum_stays_exact_to_the_rounding_of_floats() {
    let picture = Picture::read(fixture("blender/room_seed1.exr"), &auto()).unwrap();
    let [key, rim] = picture.frame().aovs() else { panic!("two light groups") };
    let mut color = key.color.clone();
    for (plane, other) in color.iter_mut().zip(&rim.color) {
        plane.data_mut().iter_mut().zip(other.data()).for_each(|(v, w)| *v += w);
    }
    let mut frame = Frame::new(color).unwrap();
    for feature in picture.frame().features() {
        frame = frame.with_feature(feature.clone()).unwrap();
    }
    for aov in [key, rim] {
        frame = frame.with_aov(aov.clone()).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sum.exr");
    write_frame(&path, &frame, &FrameHeader::default()).unwrap();
    let exact = Picture::read(&path, &auto()).unwrap();
    let check = exact.sums(&denoise(exact.frame(), &Options::default()).unwrap()).unwrap().remove(0);
    assert!(check.before.relative_rms < 1e-7, "{check:?}");
    assert!(check.after.unwrap().relative_rms < FLOAT_ROUNDING, "{check:?}");
}

#[test]
fn the_tracers_light_groups_are_found_by_their_numbers_and_sum_to_rounding() {
    let text = std::fs::read_to_string(fixture("scenes/glossy_gallery.json")).unwrap();
    let mut scene: serde_json::Value = serde_json::from_str(&text).unwrap();
    scene["camera"]["resolution"] = serde_json::json!([40, 30]);
    let shapes = scene["shapes"].as_array_mut().unwrap().iter_mut();
    for (n, shape) in shapes.filter(|shape| shape.get("emission").is_some()).enumerate() {
        shape["group"] = format!("lamp {n}").into();
    }
    let scene = Scene::parse(&scene.to_string(), &fixture("scenes")).unwrap();
    let options = RenderOptions { spp: 16, light_groups: true, second_hit: true, ..RenderOptions::default() };
    let rendered = render(&scene, &options).unwrap().frame;
    let folder = tempfile::tempdir().unwrap();
    let (path, output) = (folder.path().join("traced.exr"), folder.path().join("out.exr"));
    write_frame(&path, &rendered, &FrameHeader::default()).unwrap();

    let picture = Picture::read(&path, &auto()).unwrap();
    let denoised = denoise(picture.frame(), &Options::default()).unwrap();
    let [check] = &picture.sums(&denoised).unwrap()[..] else { panic!("{:?}", picture.layout()) };
    assert_eq!(check.layers, ["lamp 0", "lamp 1"]);
    assert!(check.before.relative_rms < 1e-6, "{check:?}");
    assert!(check.after.unwrap().relative_rms < FLOAT_ROUNDING, "{check:?}");
    // In the file too: 32-bit floats are stored as they are.
    picture.write(&output, &denoised, false).unwrap();
    let written = Picture::read(&output, &auto()).unwrap();
    assert_eq!(Some(written.layout().sums[0].before), check.after);
    let unasked = Picture::read(&path, &ReadOptions::default()).unwrap();
    assert!(unasked.frame().aovs().is_empty());
    // A library that denoises what it has rendered sees what a file tells.
    let told = |frame: &Frame| {
        let features = frame.features().iter();
        features.map(|f| (f.name.clone(), (f.kind, f.planes.clone()))).collect::<BTreeMap<_, _>>()
    };
    assert!(told(unasked.frame()) == told(&rendered), "of the second hit too");
}

/// A file of a beauty and components in parts of their own, `rest` beside them with another window.
fn in_parts(path: &Path) {
    const SIZE: (usize, usize) = (24, 17);
    let sum = |c: usize| -> Vec<f32> {
        let (a, b) = (values(SIZE.0 * SIZE.1, c), values(SIZE.0 * SIZE.1, c + 3));
        a.iter().zip(b).map(|(a, b)| a + b).collect()
    };
    let beauty = ["R", "G", "B"].iter().enumerate().map(|(c, name)| float(name, sum(c))).collect();
    let component = |salt: usize| {
        let names = ["R", "G", "B"].iter().enumerate();
        names.map(|(c, name)| float(name, values(SIZE.0 * SIZE.1, salt + c))).collect::<Vec<_>>()
    };
    let part =
        |name, size, channels| layer(Some(name), size, (2, 3), scan_lines(Compression::ZIP16), channels);
    let parts = vec![
        part("C_key", SIZE, component(0)),
        part("rgba", SIZE, beauty),
        part("C_fill", SIZE, component(3)),
        part("C_other", (5, 4), channels((5, 4), &["R", "G", "B"])),
    ];
    write(path, IntegerBounds::new((0, 0), (32, 32)), parts);
}

#[test]
fn components_in_parts_of_their_own_are_written_back_there() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("in.exr"), folder.path().join("out.exr"));
    in_parts(&input);
    let picture = Picture::read(&input, &auto()).unwrap();
    assert_eq!(picture.layout().sums[0].layers, ["C_key", "C_fill"], "the small part has other pixels");
    let denoised = denoise(picture.frame(), &Options::default()).unwrap();
    picture.write(&output, &denoised, true).unwrap();
    let after = read_all(&output);
    for (part, aov) in [(0, 0), (2, 1)] {
        for (c, name) in ["R", "G", "B"].iter().enumerate() {
            let list = &after.layer_data[part].channel_data.list;
            let channel = list.iter().find(|channel| channel.name == **name).unwrap();
            let stored: Vec<f32> = channel.sample_data.values_as_f32().collect();
            assert_eq!(stored, denoised.aovs[aov].color[c].data(), "part {part}, {name}");
        }
    }
    assert_eq!(after.layer_data[3].channel_data, read_all(&input).layer_data[3].channel_data);
    assert_eq!(after.layer_data[1].channel_data.list.len(), 5, "the estimated error lies by the beauty");

    let wrong_size = apr::Denoised { aovs: vec![], ..denoised };
    assert_eq!(picture.write(&output, &wrong_size, false).unwrap_err().kind(), ErrorKind::Usage);
    for (name, kind, word) in [
        ("C_other", ErrorKind::Lacking, "data window"),
        ("C_rim", ErrorKind::Lacking, "--inspect"),
        ("rgba", ErrorKind::Lacking, "rgba"),
    ] {
        let error = Picture::read(&input, &named(&[name])).unwrap_err();
        assert_eq!(error.kind(), kind, "{error}");
        assert!(error.to_string().contains(word), "{error}");
    }
}

#[test]
fn what_does_not_sum_is_denoised_all_the_same_and_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let names = ["R", "G", "B", "RGBA_key.R", "RGBA_key.G", "RGBA_key.B", "matte.R", "matte.G", "matte.B"];
    write_one(&path, layer(None, (9, 8), (0, 0), scan_lines(Compression::ZIP16), channels((9, 8), &names)));
    let picture = Picture::read(&path, &auto()).unwrap();
    assert_eq!(picture.frame().aovs().iter().map(|aov| aov.name.as_str()).collect::<Vec<_>>(), ["RGBA_key"]);
    assert!(picture.layout().warnings.iter().any(|warning| warning.contains("do not sum to the beauty")));
    // What is named is taken without complaint, its deviation told.
    let picture = Picture::read(&path, &named(&["matte"])).unwrap();
    assert_eq!(picture.frame().aovs()[0].name, "matte");
    assert_eq!(picture.layout().sums[0].set, "named");
    assert!(picture.layout().warnings.iter().all(|warning| !warning.contains("do not sum")));
    // Unasked nothing is touched, but the reader is told.
    let picture = Picture::read(&path, &ReadOptions::default()).unwrap();
    assert!(picture.frame().aovs().is_empty());
    assert_eq!(promised(&path, ReadOptions::default()), ["RGBA_key"]);
}

/// What `--aov auto` would take, as the notes of a reading by `options`, which ask for no component, tell it; no more and
/// no less is taken.
fn promised(path: &Path, options: ReadOptions) -> Vec<String> {
    let auto = ReadOptions { aovs: auto().aovs, ..options.clone() };
    let notes = Picture::read(path, &options).unwrap().layout().notes.clone();
    let promise = notes.iter().find_map(|note| note.strip_prefix("passing through as they are: '"));
    let (names, _) = promise.expect("a promise").split_once("'; --aov auto denoises them").unwrap();
    let names: Vec<String> = names.split("', '").map(str::to_owned).collect();
    let picture = Picture::read(path, &auto).unwrap();
    assert_eq!(
        picture.frame().aovs().iter().map(|aov| &aov.name).collect::<Vec<_>>(),
        names.iter().collect::<Vec<_>>()
    );
    names
}

#[test]
fn what_plays_another_role_is_no_component() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let names = ["", "light_a.", "light_b.", "light_c."];
    let names: Vec<String> =
        names.iter().flat_map(|layer| ["R", "G", "B"].map(|c| format!("{layer}{c}"))).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    write_one(&path, layer(None, (9, 8), (0, 0), scan_lines(Compression::ZIP16), channels((9, 8), &names)));
    assert_eq!(promised(&path, ReadOptions::default()), ["light_a", "light_b", "light_c"]);
    let albedo = ReadOptions { map: vec!["albedo=light_b".parse().unwrap()], ..ReadOptions::default() };
    assert_eq!(promised(&path, albedo), ["light_a", "light_c"]);
}

#[test]
fn that_nothing_was_found_is_told_and_a_variance_is_no_component() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let names = ["R", "G", "B", "variance.R", "variance.G", "variance.B"];
    write_one(&path, layer(None, (9, 8), (0, 0), scan_lines(Compression::ZIP16), channels((9, 8), &names)));
    let told = |options: &ReadOptions| {
        let notes = Picture::read(&path, options).unwrap().layout().notes.clone();
        notes.iter().any(|note| note.contains("--aov auto: no components") && note.contains("--aov NAMES"))
    };
    assert!(told(&auto()) && !told(&ReadOptions::default()));
    let error = Picture::read(&path, &named(&["variance"])).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Usage, "{error}");
    assert!(error.to_string().contains("'variance': is a variance or a half, and no component"), "{error}");
}

/// V-Ray's elements hold lobes that look like a set of their own, and its `diffuse` is the albedo.
#[test]
fn a_renderers_own_set_is_the_only_one_and_its_features_are_no_components() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let names = ["lighting", "GI", "specular", "SSS", "diffuse"];
    let addend = |salt: usize| values(72, salt).into_iter().map(|v| v.abs() + 1.0).collect::<Vec<f32>>();
    let mut all = Vec::new();
    for (c, component) in ["R", "G", "B"].into_iter().enumerate() {
        let (layers, albedo) = ([0, 1, 2, 3].map(|layer| addend(3 * layer + c)), vec![0.5; 72]);
        all.push(float(component, (0..72).map(|i| layers.iter().map(|layer| layer[i]).sum()).collect()));
        let named = names.iter().zip(layers.iter().chain([&albedo]));
        all.extend(named.map(|(name, layer)| float(&format!("{name}.{component}"), layer.clone())));
    }
    write_one(&path, layer(None, (9, 8), (0, 0), scan_lines(Compression::ZIP16), all));
    let vray = |aovs: &[&str]| {
        let options = ReadOptions { profile: Some(Renderer::VRay), ..named(aovs) };
        Picture::read(&path, &options).unwrap().layout().clone()
    };
    let layout = vray(&["auto"]);
    assert_eq!(layout.sums.iter().map(|sum| sum.set.as_str()).collect::<Vec<_>>(), ["back to beauty"]);
    assert_eq!(layout.sums[0].layers, names[..4]);
    assert!(layout.warnings.iter().all(|warning| !warning.contains("do not sum")), "{:?}", layout.warnings);
    let plain = ReadOptions { profile: Some(Renderer::VRay), ..ReadOptions::default() };
    assert_eq!(promised(&path, plain), names[..4]);
}

#[test]
fn the_program_prints_and_reports_the_sums() {
    let folder = tempfile::tempdir().unwrap();
    let (output, report) = (folder.path().join("out.exr"), folder.path().join("report.json"));
    let program = || assert_cmd::Command::new(env!("CARGO_BIN_EXE_apr-denoise"));
    let input = fixture("blender/room_seed1.exr");
    let shown =
        program().arg(&input).args(["--inspect", "--aov", "Combined_key,Combined_rim"]).output().unwrap();
    let shown = String::from_utf8(shown.stdout).unwrap();
    assert!(shown.contains("less the beauty, largest deviation") && shown.contains("aov"), "{shown}");
    let run =
        program().args([&input, &output]).args(["--aov", "auto", "--report"]).arg(&report).output().unwrap();
    let said = String::from_utf8(run.stdout).unwrap();
    assert!(run.status.success() && said.contains("light groups: ViewLayer.Combined_key + "), "{said}");
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    let sums = &report["sums"][0];
    assert!(sums["after"]["relative_rms"].as_f64().unwrap() < 5e-4 && sums["before"]["largest"].is_f64());
}
