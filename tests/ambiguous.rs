//! Files that can be misunderstood: several view layers, two halves that are one, variances that say nothing,
//! pictures that do not fit together. What is taken is what was meant, or it is told.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::exr_files::*;
use apr::ErrorKind;
use apr::io::{Mapping, Picture, ReadOptions};
use exr::prelude::*;

const SIZE: (usize, usize) = (24, 18);
const PIXELS: usize = SIZE.0 * SIZE.1;

/// A file of one part with these channels.
fn file(folder: &Path, name: &str, channels: Vec<AnyChannel<FlatSamples>>) -> PathBuf {
    placed(folder, name, SIZE, (0, 0), channels)
}

fn placed(
    folder: &Path,
    name: &str,
    size: (usize, usize),
    at: (i32, i32),
    channels: Vec<AnyChannel<FlatSamples>>,
) -> PathBuf {
    let path = folder.join(name);
    write_one(&path, layer(None, size, at, scan_lines(Compression::ZIP1), channels));
    path
}

/// R, G and B with noise of their own for every `salt`.
fn rgb(salt: usize) -> Vec<AnyChannel<FlatSamples>> {
    ["R", "G", "B"].iter().enumerate().map(|(c, name)| float(name, values(PIXELS, salt + c))).collect()
}

fn read(path: &Path, options: &ReadOptions) -> apr::Result<Picture> {
    Picture::read(path, options)
}

fn mapped(mappings: &[&str]) -> ReadOptions {
    let map: Vec<Mapping> = mappings.iter().map(|mapping| mapping.parse().unwrap()).collect();
    ReadOptions { map, ..ReadOptions::default() }
}

/// The channels of every role.
fn channels_of(picture: &Picture) -> Vec<String> {
    picture.layout().roles.iter().map(|role| format!("{}: {}", role.role, role.channels.join(" "))).collect()
}

/// Exit code, answers and complaints of the program.
fn run(arguments: &[&str]) -> (i32, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_apr-denoise")).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

#[test]
fn two_halves_keep_the_motion_of_the_first() {
    let folder = tempfile::tempdir().unwrap();
    let render = |name: &str, salt: usize| {
        let vector = ["X", "Y"].map(|c| float(&format!("motionPrevious.{c}"), values(PIXELS, 90 + salt)));
        file(folder.path(), name, rgb(salt).into_iter().chain(vector).collect())
    };
    let (a, b) = (render("a.exr", 0), render("b.exr", 5));
    let options = ReadOptions { motion: true, half: Some(b), ..ReadOptions::default() };
    let both = read(&a, &options).unwrap();
    let alone = read(&a, &ReadOptions { half: None, ..options }).unwrap();
    assert!(both.frame().halves().is_some() && both.frame().motion().is_some());
    assert_eq!(both.frame().motion(), alone.frame().motion());
}

#[test]
fn a_render_is_not_taken_for_its_own_other_half() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (file(folder.path(), "a.exr", rgb(0)), file(folder.path(), "b.exr", rgb(0)));
    let with = |half: &Path| ReadOptions { half: Some(half.to_owned()), ..ReadOptions::default() };
    for half in [&a, &b] {
        let error = read(&a, &with(half)).unwrap_err();
        assert_eq!((error.kind(), error.file()), (ErrorKind::Lacking, Some(half.as_path())));
        assert!(error.to_string().contains("another seed"), "{error}");
    }
    let out = folder.path().join("out.exr");
    let [input, half, out] = [&a, &b, &out].map(|path| path.to_str().unwrap());
    for further in [&[][..], &["--region", "0,0,9,9"]] {
        let arguments = [&[input, out, "--quiet", "--half", half], further].concat();
        assert_eq!(run(&arguments).0, 4, "{further:?}");
    }
    let one_pixel_apart = rgb(0).into_iter().map(|mut channel| {
        if let FlatSamples::F32(values) = &mut channel.sample_data {
            values[77] += 0.1;
        }
        channel
    });
    let other = file(folder.path(), "other.exr", one_pixel_apart.collect());
    assert!(read(&a, &with(&other)).is_ok());
    let black = || ["R", "G", "B"].map(|name| float(name, vec![0.0; PIXELS])).to_vec();
    let (black, night) =
        (file(folder.path(), "black.exr", black()), file(folder.path(), "night.exr", black()));
    assert!(read(&black, &with(&night)).is_ok(), "a black frame of a sequence is no mistake");
}

#[test]
fn halves_of_other_windows_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let a = file(folder.path(), "a.exr", rgb(0));
    let moved = placed(folder.path(), "moved.exr", SIZE, (1, 0), rgb(5));
    let options = ReadOptions { half: Some(moved.clone()), ..ReadOptions::default() };
    let error = read(&a, &options).unwrap_err();
    assert_eq!((error.kind(), error.file()), (ErrorKind::Lacking, Some(moved.as_path())));
    assert!(error.to_string().contains("1,0,24,18 where the first half's is 0,0,24,18"), "{error}");
}

/// Two view layers of Cycles, the second of them named like the first with a number.
fn view_layers(folder: &Path, names: [&str; 2]) -> PathBuf {
    let passes = ["Combined.R", "Combined.G", "Combined.B", "Depth.Z"];
    let further = ["Denoising Albedo.R", "Denoising Albedo.G", "Denoising Albedo.B", "Combined_key.R"];
    let all = names.map(|name| passes.iter().chain(&further).map(move |pass| format!("{name}.{pass}")));
    let all: Vec<String> = all.into_iter().flatten().collect();
    let names_of: Vec<&str> = all.iter().map(String::as_str).collect();
    let mut part = layer(None, SIZE, (0, 0), scan_lines(Compression::ZIP1), channels(SIZE, &names_of));
    for (name, samples) in names.iter().zip(["16", "64"]) {
        let name = Text::from(format!("cycles.{name}.samples").as_str());
        part.attributes.other.insert(name, AttributeValue::Text(Text::from(samples)));
    }
    let path = folder.join("views.exr");
    write_one(&path, part);
    path
}

#[test]
fn each_view_layer_has_its_own_samples_and_features() {
    let folder = tempfile::tempdir().unwrap();
    for names in [["A", "B"], ["View", "View.001"], ["View.001", "View"], ["Z", "A"]] {
        let path = view_layers(folder.path(), names);
        for (view, samples) in names.into_iter().zip([16.0, 64.0]) {
            for _ in 0..20 {
                // The attributes are in no order, another one each time.
                let picture = read(&path, &mapped(&[&format!("color={view}.Combined")])).unwrap();
                assert_eq!(picture.frame().spp(), Some(samples), "{names:?}, {view}");
                let roles = channels_of(&picture);
                let expected = [
                    format!("color: {view}.Combined.R {view}.Combined.G {view}.Combined.B"),
                    format!(
                        "albedo: {view}.Denoising Albedo.R {view}.Denoising Albedo.G {view}.Denoising Albedo.B"
                    ),
                    format!("depth: {view}.Depth.Z"),
                ];
                assert_eq!(roles, expected, "{names:?}");
            }
            let key = ReadOptions {
                aovs: vec!["Combined_*".into()],
                ..mapped(&[&format!("color={view}.Combined")])
            };
            let aovs = read(&path, &key).unwrap();
            assert_eq!(aovs.frame().aovs().len(), 1, "only the view layer's own");
            assert_eq!(aovs.frame().aovs()[0].name, format!("{view}.Combined_key"));
        }
    }
}

/// A variance that is this at every pixel.
fn with_variance(of: [f32; 3]) -> Vec<AnyChannel<FlatSamples>> {
    let plane = |(name, value): (&str, f32)| float(&format!("variance.{name}"), vec![value; PIXELS]);
    rgb(0).into_iter().chain(["R", "G", "B"].into_iter().zip(of).map(plane)).collect()
}

#[test]
fn variances_that_say_nothing_are_done_without_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let read_of = |variance: [f32; 3]| {
        let path = file(folder.path(), "in.exr", with_variance(variance));
        let picture = read(&path, &ReadOptions::default()).unwrap();
        (picture.frame().color_var_of_mean().is_some(), picture.layout().warnings.join("\n"))
    };
    for (variance, why) in
        [([0.0; 3], "0 at every pixel though"), ([-2.0, 1.0, 1.0], "below 0 at every pixel")]
    {
        let (there, warnings) = read_of(variance);
        assert!(!there && warnings.contains(why), "{variance:?}: {warnings}");
        assert!(warnings.contains("variance.B, variance.G, variance.R") || warnings.contains("variance.R"));
        assert!(warnings.contains("it will be estimated from the picture"), "{warnings}");
    }
    assert_eq!(read_of([0.0, 0.0, 1.0]), (true, String::new()), "nothing red and green may be there");

    // What is the same everywhere may well be free of noise.
    let flat = ["R", "G", "B"].map(|name| float(name, vec![0.5; PIXELS]));
    let flat = flat.into_iter().chain(with_variance([0.0; 3]).into_iter().skip(3)).collect();
    let path = file(folder.path(), "flat.exr", flat);
    assert!(read(&path, &ReadOptions::default()).unwrap().frame().color_var_of_mean().is_some());
}

/// A second moment below the squared mean, as half floats and wrong names make it.
#[test]
fn second_moments_that_make_no_variance_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let moment = |factor: f32| {
        let squares = |salt| values(PIXELS, salt).iter().map(|v| factor * v * v).collect::<Vec<f32>>();
        let plane = |(salt, name)| float(&format!("variance.{name}"), squares(salt));
        let all = rgb(0).into_iter().chain(["R", "G", "B"].into_iter().enumerate().map(plane)).collect();
        let path = file(folder.path(), "in.exr", all);
        let kind = Some(apr::io::VarianceKind::M2);
        let options = ReadOptions { variance_kind: kind, spp: Some(16.0), ..ReadOptions::default() };
        read(&path, &options).unwrap().layout().warnings.join(" ")
    };
    for factor in [0.9, 1.0] {
        assert!(moment(factor).contains("above 0 at no pixel though the colour varies"), "{factor}");
    }
    assert_eq!(moment(1.1), "");
}

/// Without any noise: a slope of light with an edge in it. That it is one nobody can tell whose variance says
/// nothing, but it must not be smeared.
#[test]
fn a_picture_without_noise_is_left_as_it_is_but_for_little() {
    let folder = tempfile::tempdir().unwrap();
    let light = |i: usize| {
        let (x, y) = (i % SIZE.0, i / SIZE.0);
        if x < 11 { 0.2 + 0.01 * y as f32 } else { 1.0 + 0.02 * x as f32 }
    };
    let plane = || (0..PIXELS).map(light).collect::<Vec<f32>>();
    let zeros = with_variance([0.0; 3]).into_iter().skip(3);
    let all = ["R", "G", "B"].map(|name| float(name, plane())).into_iter().chain(zeros).collect();
    let (input, out) = (file(folder.path(), "in.exr", all), folder.path().join("out.exr"));
    let (code, _, complaints) = run(&[input.to_str().unwrap(), out.to_str().unwrap()]);
    assert!(code == 0 && complaints.contains("0 at every pixel though the colour varies"), "{complaints}");
    let written = read_all(&out).layer_data.remove(0).channel_data.list;
    let red = written.iter().find(|channel| channel.name == *"R").unwrap();
    let apart =
        red.sample_data.values_as_f32().zip(plane()).map(|(got, wanted)| (got - wanted).abs() / wanted);
    let worst = apart.fold(0.0, f32::max);
    assert!(worst < 0.1, "{worst}");
}

#[test]
fn the_estimate_of_the_input_takes_no_negative_variances() {
    let folder = tempfile::tempdir().unwrap();
    let mut channels = with_variance([0.01; 3]);
    if let FlatSamples::F32(values) = &mut channels[4].sample_data {
        values.iter_mut().step_by(2).for_each(|v| *v = -1e6);
    }
    let input = file(folder.path(), "in.exr", channels);
    let (out, report) = (folder.path().join("out.exr"), folder.path().join("report.json"));
    let [input, out, told] = [&input, &out, &report].map(|path| path.to_str().unwrap());
    assert_eq!(run(&[input, out, "--quiet", "--report", told]).0, 0);
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    let before = report["estimated_error"]["mse_before"].as_f64().unwrap();
    assert!((before - 0.01).abs() < 1e-6, "{before}");
}

#[test]
fn what_is_read_beside_the_picture_must_cover_it_and_be_of_use() {
    let folder = tempfile::tempdir().unwrap();
    let input = file(folder.path(), "in.exr", rgb(0));
    let beside = |name: &str, size: (usize, usize), at: (i32, i32)| {
        placed(folder.path(), name, size, at, channels(size, &["R", "G", "B"]))
    };
    let with = |path: &Path| ReadOptions { with: vec![path.to_owned()], ..ReadOptions::default() };
    for (size, at) in [((12, 18), (0, 0)), ((24, 18), (0, 1)), ((24, 18), (-1, 0))] {
        let albedo = beside("albedo.exr", size, at);
        let error = read(&input, &with(&albedo)).unwrap_err();
        assert_eq!((error.kind(), error.file()), (ErrorKind::Lacking, Some(albedo.as_path())));
        assert!(error.to_string().contains("does not cover that of the picture, 0,0,24,18"), "{error}");
    }
    let larger = beside("albedo.exr", (40, 40), (-3, -3));
    let picture = read(&input, &with(&larger)).unwrap();
    assert_eq!(channels_of(&picture)[1], format!("albedo: {0}:R {0}:G {0}:B", larger.display()));
    assert!(picture.layout().warnings.iter().all(|warning| !warning.contains("plays a role")));
    let useless = beside("whatever.exr", SIZE, (0, 0));
    let warnings = read(&input, &with(&useless)).unwrap().layout().warnings.join(" ");
    assert!(warnings.contains("whatever.exr: none of its layers plays a role"), "{warnings}");
}

#[test]
fn components_in_words_are_colours_in_their_order() {
    let folder = tempfile::tempdir().unwrap();
    for layer in ["rgba.", "", "beauty."] {
        let names = ["alpha", "blue", "green", "red"].map(|word| format!("{layer}{word}"));
        let all = names.iter().enumerate().map(|(i, name)| float(name, values(PIXELS, i))).collect();
        let path = file(folder.path(), "words.exr", all);
        let lights = [3, 2, 1].map(|salt| values(PIXELS, salt));
        let mapping = format!(
            "color={}",
            if layer.is_empty() { "red,green,blue" } else { layer.trim_end_matches('.') }
        );
        for options in [ReadOptions::default(), mapped(&[&mapping])] {
            let picture = read(&path, &options).unwrap();
            let color = picture.frame().color();
            assert_eq!(color.each_ref().map(|plane| plane.data().to_vec()), lights, "{layer}");
        }
    }
    let mask = file(folder.path(), "mask.exr", [rgb(0), channels(SIZE, &["red"])].concat());
    let picture = read(&mask, &mapped(&["albedo=red"])).unwrap();
    assert_eq!(channels_of(&picture), ["color: R G B", "albedo: red"]);
}
