//! What every renderer's names come to.

use std::path::{Path, PathBuf};

use crate::exr_files::{self, channels, float, layer, scan_lines, values, write_one};
use apr::FeatureKind;
use apr::io::{Picture, ReadOptions, Renderer, VarianceKind};
use exr::prelude::*;

const SIZE: (usize, usize) = (6, 5);

/// Writes a file with these channels and attributes, and reads it.
fn picture(
    folder: &Path,
    names: &[&str],
    attributes: &[(&str, AttributeValue)],
    options: &ReadOptions,
) -> Picture {
    let mut layer = layer(None, SIZE, (0, 0), scan_lines(Compression::ZIP16), channels(SIZE, names));
    layer.attributes.other.extend(attributes.iter().map(|(name, value)| (Text::from(*name), value.clone())));
    let path = folder.join("render.exr");
    write_one(&path, layer);
    Picture::read(&path, options).unwrap()
}

/// The roles as `role statistic: first channel`.
fn roles(picture: &Picture) -> Vec<String> {
    let roles = picture.layout().roles.iter();
    roles.map(|role| format!("{} {}: {}", role.role, role.statistic, role.channels[0])).collect()
}

fn text(value: &str) -> AttributeValue {
    AttributeValue::Text(Text::from(value))
}

#[test]
fn every_renderer_is_recognised_and_its_channels_find_their_roles() {
    type Case<'a> = (Renderer, &'a [&'a str], &'a [(&'a str, AttributeValue)], &'a [&'a str]);
    let blender = [("cycles.View.samples", text("16")), ("BlenderMultiChannel", text("Blender"))];
    let arnold = [("arnold/AA_samples", AttributeValue::I32(3))];
    let cases: &[Case] = &[
        (
            Renderer::Plain,
            &[
                "R",
                "G",
                "B",
                "variance.R",
                "variance.G",
                "variance.B",
                "halfA.R",
                "halfA.G",
                "halfA.B",
                "albedo.R",
                "albedo.G",
                "albedo.B",
                "albedoVariance.R",
                "albedoVariance.G",
                "albedoVariance.B",
                "albedo2.R",
                "albedo2.G",
                "albedo2.B",
                "depth.Z",
                "depthVariance.Z",
                "visibility.Y",
            ],
            &[],
            &[
                "color mean: R",
                "color variance of the mean: variance.R",
                "color half A: halfA.R",
                "albedo mean: albedo.R",
                "albedo variance of the mean: albedoVariance.R",
                "albedo2 mean: albedo2.R",
                "depth mean: depth.Z",
                "depth variance of the mean: depthVariance.Z",
                "visibility mean: visibility.Y",
            ],
        ),
        (
            Renderer::Pbrt,
            &[
                "R",
                "G",
                "B",
                "Albedo.R",
                "Albedo.G",
                "Albedo.B",
                "N.X",
                "N.Y",
                "N.Z",
                "Ns.X",
                "Ns.Y",
                "Ns.Z",
                "P.X",
                "P.Y",
                "P.Z",
                "Variance.R",
                "Variance.G",
                "Variance.B",
                "RelativeVariance.R",
                "RelativeVariance.G",
                "RelativeVariance.B",
                "u",
                "v",
                "dzdx",
                "dzdy",
            ],
            &[("samplesPerPixel", AttributeValue::I32(8))],
            &[
                "color mean: R",
                "color variance of one sample: Variance.R",
                "albedo mean: Albedo.R",
                "normal mean: Ns.X",
                "position mean: P.X",
            ],
        ),
        (
            Renderer::VRay,
            &[
                "R",
                "G",
                "B",
                "VRayDiffuseFilter.R",
                "VRayDiffuseFilter.G",
                "VRayDiffuseFilter.B",
                "VRayNormals.X",
                "VRayNormals.Y",
                "VRayNormals.Z",
                "VRayZDepth.R",
                "VRayZDepth.G",
                "VRayZDepth.B",
            ],
            &[("vrayInfo/render_version", text("6"))],
            &[
                "color mean: R",
                "albedo mean: VRayDiffuseFilter.R",
                "normal mean: VRayNormals.X",
                "depth mean: VRayZDepth.R",
            ],
        ),
        (
            Renderer::Cycles,
            &[
                "View.Combined.R",
                "View.Combined.G",
                "View.Combined.B",
                "View.Combined.A",
                "View.Noisy Image.R",
                "View.Noisy Image.G",
                "View.Noisy Image.B",
                "View.Denoising Albedo.R",
                "View.Denoising Albedo.G",
                "View.Denoising Albedo.B",
                "View.Normal.X",
                "View.Normal.Y",
                "View.Normal.Z",
                "View.Depth.V",
                "View.Combined_key.R",
                "View.Combined_key.G",
                "View.Combined_key.B",
                "Other.Position.X",
                "Other.Position.Y",
                "Other.Position.Z",
                "View.CryptoObject00.r",
                "View.CryptoObject00.g",
                "View.CryptoObject00.b",
                "View.CryptoObject00.a",
            ],
            &blender,
            &[
                "color mean: View.Noisy Image.R",
                "albedo mean: View.Denoising Albedo.R",
                "normal mean: View.Normal.X",
                "depth mean: View.Depth.V",
            ],
        ),
        (
            Renderer::Arnold,
            &[
                "R",
                "G",
                "B",
                "A",
                "Z",
                "N.X",
                "N.Y",
                "N.Z",
                "P.R",
                "P.G",
                "P.B",
                "diffuse_albedo.R",
                "diffuse_albedo.G",
                "diffuse_albedo.B",
                "variance.R",
                "variance.G",
                "variance.B",
            ],
            &arnold,
            &[
                "color mean: R",
                "color variance of the mean: variance.R",
                "albedo mean: diffuse_albedo.R",
                "normal mean: N.X",
                "position mean: P.R",
                "depth mean: Z",
            ],
        ),
        (
            Renderer::RenderMan,
            &[
                "Ci.r",
                "Ci.g",
                "Ci.b",
                "a",
                "albedo.r",
                "albedo.g",
                "albedo.b",
                "albedo_mse.r",
                "albedo_mse.g",
                "albedo_mse.b",
                "albedo_var.r",
                "albedo_var.g",
                "albedo_var.b",
                "normal.X",
                "normal.Y",
                "normal.Z",
                "normal_var.X",
                "normal_var.Y",
                "normal_var.Z",
                "zfiltered",
                "zfiltered_var",
                "mse.r",
                "mse.g",
                "mse.b",
                "sampleCount",
            ],
            &[],
            &[
                "color mean: Ci.r",
                "color variance of the mean: mse.r",
                "albedo mean: albedo.r",
                "albedo variance of the mean: albedo_mse.r",
                "normal mean: normal.X",
                "normal variance of one sample: normal_var.X",
                "depth mean: zfiltered",
                "depth variance of one sample: zfiltered_var",
                "sampleCount mean: sampleCount",
            ],
        ),
        (
            Renderer::VRay,
            &[
                "R",
                "G",
                "B",
                "diffuse.R",
                "diffuse.G",
                "diffuse.B",
                "normals.X",
                "normals.Y",
                "normals.Z",
                "noiseLevel",
            ],
            &[("vrayInfo/vraycore", text("3.60"))],
            &["color mean: R", "albedo mean: diffuse.R", "normal mean: normals.X"],
        ),
        (
            Renderer::Corona,
            &[
                "R",
                "G",
                "B",
                "VisibleDiffuse.R",
                "VisibleDiffuse.G",
                "VisibleDiffuse.B",
                "VisibleNormals.R",
                "VisibleNormals.G",
                "VisibleNormals.B",
                "CGeometry_ZDepth",
                "SqrBeauty.R",
                "SqrBeauty.G",
                "SqrBeauty.B",
            ],
            &[("corona.version", text("9"))],
            &[
                "color mean: R",
                "albedo mean: VisibleDiffuse.R",
                "normal mean: VisibleNormals.R",
                "depth mean: CGeometry_ZDepth",
            ],
        ),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (renderer, names, attributes, expected) in cases {
        let picture = picture(folder.path(), names, attributes, &ReadOptions::default());
        assert_eq!(picture.layout().renderer, *renderer);
        assert_eq!(roles(&picture), *expected, "{renderer:?}");
    }
}

#[test]
fn samples_per_pixel_stand_in_the_header_in_several_ways() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        (("samplesPerPixel", AttributeValue::I32(64)), Some(64.0)),
        (("samplesPerPixel", AttributeValue::F32(2.5)), Some(2.5)),
        (("cycles.ViewLayer.samples", text("128")), Some(128.0)),
        (("arnold/AA_samples", AttributeValue::I32(6)), Some(36.0)),
        (("samplesPerPixel", AttributeValue::I32(0)), None),
        (("samplesPerPixelX", AttributeValue::I32(9)), None),
    ];
    for (attribute, expected) in cases {
        let names = ["R", "G", "B"];
        let picture =
            picture(folder.path(), &names, std::slice::from_ref(&attribute), &ReadOptions::default());
        assert_eq!(picture.frame().spp(), expected, "{attribute:?}");
        let told = ReadOptions { spp: Some(5.0), ..ReadOptions::default() };
        let picture = self::picture(folder.path(), &names, &[attribute], &told);
        assert_eq!(picture.frame().spp(), Some(5.0), "the user knows better");
    }
}

#[test]
fn variance_of_one_sample_is_divided_by_the_samples() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["R", "G", "B", "Ns.X", "Variance.R", "Variance.G", "Variance.B"];
    let spp = [("samplesPerPixel", AttributeValue::I32(8))];
    let stored = values(SIZE.0 * SIZE.1, 4);
    for (kind, factor) in [(None, 0.125), (Some(VarianceKind::Mean), 1.0)] {
        let options = ReadOptions { variance_kind: kind, ..ReadOptions::default() };
        let picture = picture(folder.path(), &names, &spp, &options);
        let expected: Vec<f32> = stored.iter().map(|v| v * factor).collect();
        assert_eq!(picture.frame().color_var_of_mean().unwrap()[0].data(), expected);
    }
}

#[test]
fn what_is_said_of_variances_that_are_not_there_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let told = |names: &[&str], kind, spp| {
        let options = ReadOptions { variance_kind: kind, spp, ..ReadOptions::default() };
        let layout = picture(folder.path(), names, &[], &options).layout().clone();
        let has = |words: &str, all: &[String]| all.iter().any(|line| line.starts_with(words));
        (
            has("--variance-kind is of no use", &layout.warnings),
            has("--spp changes no variance", &layout.notes),
        )
    };
    let plain = ["R", "G", "B"];
    let variance = ["R", "G", "B", "variance.R", "variance.G", "variance.B"];
    let half = ["R", "G", "B", "halfA.R", "halfA.G", "halfA.B"];
    let (stddev, halves) = (Some(VarianceKind::Stddev), Some(VarianceKind::Halves));
    assert_eq!(told(&plain, None, None), (false, false));
    assert_eq!(told(&plain, stddev, Some(4.0)), (true, true));
    assert_eq!(told(&plain, halves, None), (true, false));
    assert_eq!(told(&variance, stddev, Some(4.0)), (false, false));
    assert_eq!(told(&variance, halves, None), (true, false));
    assert_eq!(told(&half, halves, Some(4.0)), (false, true));
    assert_eq!(told(&half, stddev, None), (true, false));
}

#[test]
fn the_user_maps_adds_and_takes_away() {
    let folder = tempfile::tempdir().unwrap();
    let names =
        ["R", "G", "B", "x.R", "x.G", "x.B", "albedo.R", "albedo.G", "albedo.B", "depth.Z", "curv", "sd.Y"];
    let options = ReadOptions {
        map: ["color=x", "albedo=none", "normal=albedo.R,albedo.G,albedo.B", "curvatureVariance=sd.Y"]
            .map(|m| m.parse().unwrap())
            .to_vec(),
        features: vec!["curvature=curv".parse().unwrap()],
        variance_kind: Some(VarianceKind::Stddev),
        ..ReadOptions::default()
    };
    let picture = picture(folder.path(), &names, &[], &options);
    let expected = [
        "color mean: x.R",
        "normal mean: albedo.R",
        "curvature mean: curv",
        "curvature variance of the mean: sd.Y",
        "depth mean: depth.Z",
    ];
    assert_eq!(roles(&picture), expected);
    let curvature = picture.frame().features().iter().find(|feature| feature.name == "curvature").unwrap();
    assert_eq!(curvature.kind, FeatureKind::Other);
    let squared: Vec<f32> = values(SIZE.0 * SIZE.1, 11).iter().map(|v| v * v).collect();
    assert_eq!(curvature.var_of_mean.as_ref().unwrap()[0].data(), squared);
}

#[test]
fn the_end_of_one_name_stands_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let names = [
        "R", "G", "B", "L.key.R", "L.key.G", "L.key.B", "L.nrm.X", "L.nrm.Y", "L.nrm.Z", "M.nrm.X",
        "M.nrm.Y", "M.nrm.Z",
    ];
    let names: Vec<&str> = names.into_iter().chain(["depth.Z"]).collect();
    let options = |map: &[&str]| ReadOptions {
        map: map.iter().map(|m| m.parse().unwrap()).collect(),
        ..Default::default()
    };
    for (color, first) in [("color=KEY", "L.key.R"), ("color=key.G,key.R,key.B", "L.key.G")] {
        let picture = picture(folder.path(), &names, &[], &options(&[color, "normal=M.nrm"]));
        let expected = [&format!("color mean: {first}"), "normal mean: M.nrm.X", "depth mean: depth.Z"];
        assert_eq!(roles(&picture), expected);
    }
    let refused = |map| {
        let path = folder.path().join("render.exr");
        Picture::read(path, &options(&[map])).unwrap_err().to_string()
    };
    let said = refused("normal=nrm");
    assert!(
        said.contains("channel 'nrm': is the end of several names, but 'normal' is mapped to it"),
        "{said}"
    );
    assert!(said.contains("there are 'L.nrm', 'M.nrm'"), "{said}");
    for missing in ["depth=Y", "albedo=ey"] {
        assert!(refused(missing).contains("is not there"), "a component or a part of a word is no name");
    }
}

#[test]
fn the_other_half_follows_from_the_mean() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["R", "G", "B", "halfA.R", "halfA.G", "halfA.B"];
    let picture = picture(folder.path(), &names, &[], &ReadOptions::default());
    let frame = picture.frame();
    let [a, b] = frame.halves().unwrap();
    for i in 0..a[1].data().len() {
        assert_eq!(b[1].data()[i], 2.0 * frame.color()[1].data()[i] - a[1].data()[i]);
    }
}

#[test]
fn one_mapped_channel_of_a_statistic_is_that_of_all_channels() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["R", "G", "B", "V.Y", "W.Y", "normal.X", "normal.Y", "normal.Z"];
    let map = ["variance=V.Y", "halfB=V.Y", "normalVariance=W.Y", "normalHalfA=W.Y"];
    let options = ReadOptions { map: map.map(|m| m.parse().unwrap()).to_vec(), ..ReadOptions::default() };
    let picture = picture(folder.path(), &names, &[], &options);
    let (frame, pixels) = (picture.frame(), SIZE.0 * SIZE.1);
    let (v, w) = (values(pixels, 3), values(pixels, 4));
    let [normal] = frame.features() else { panic!("{:?}", frame.features()) };
    let ([a, b], [of_normal, _]) = (frame.halves().unwrap(), normal.halves.as_ref().unwrap());
    for c in 0..3 {
        assert_eq!(frame.color_var_of_mean().unwrap()[c].data(), v);
        assert_eq!((b[c].data(), of_normal[c].data()), (&v[..], &w[..]));
        assert_eq!(normal.var_of_mean.as_ref().unwrap()[c].data(), w);
        let other: Vec<f32> = frame.color()[c].data().iter().zip(&v).map(|(m, b)| 2.0 * m - b).collect();
        assert_eq!(a[c].data(), other, "the half that is lacking follows from the mean");
    }
}

#[test]
fn two_seeds_become_one_render_with_halves() {
    let folder = tempfile::tempdir().unwrap();
    let count = SIZE.0 * SIZE.1;
    let write = |name: &str, shift: f32| {
        let plane = |salt| values(count, salt).iter().map(|v| v + shift).collect::<Vec<f32>>();
        let channels =
            vec![float("R", plane(0)), float("G", plane(1)), float("B", plane(2)), float("Z", plane(3))];
        let mut layer = layer(None, SIZE, (0, 0), scan_lines(Compression::RLE), channels);
        layer.attributes.other.insert(Text::from("samplesPerPixel"), AttributeValue::I32(4));
        write_one(&folder.path().join(name), layer);
    };
    write("a.exr", 0.0);
    write("b.exr", 1.0);
    let options = ReadOptions { half: Some(folder.path().join("b.exr")), ..ReadOptions::default() };
    let picture = Picture::read(folder.path().join("a.exr"), &options).unwrap();
    let frame = picture.frame();
    let mean: Vec<f32> = values(count, 1).iter().map(|v| 0.5 * (v + (v + 1.0))).collect();
    assert_eq!(frame.color()[1].data(), mean);
    assert_eq!(frame.spp(), Some(8.0));
    assert_eq!(frame.halves().unwrap()[0][1].data(), values(count, 1));
    assert!(frame.features()[0].halves.is_some());
}

#[test]
fn renderers_with_one_file_per_buffer_are_read_from_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let buffer = |name: &str, components: &[&str]| {
        let channels = channels(SIZE, components);
        write_one(
            &folder.path().join(name),
            layer(None, SIZE, (0, 0), scan_lines(Compression::PIZ), channels),
        );
    };
    let rgb = ["R", "G", "B"];
    for name in ["x_color.exr", "x_colorVariance.exr", "x_colorA.exr", "x_colorB.exr", "x_albedo.exr"] {
        buffer(name, &rgb);
    }
    buffer("x_depth.exr", &["Y"]);
    buffer("y_normal.exr", &rgb);
    let options = ReadOptions { profile: Some(Renderer::Tungsten), ..ReadOptions::default() };
    let tungsten = Picture::read(folder.path().join("x_color.exr"), &options).unwrap();
    let unasked = Picture::read(folder.path().join("x_color.exr"), &ReadOptions::default()).unwrap();
    assert!(unasked.frame().features().is_empty());
    assert!(unasked.layout().notes[0].contains("--profile tungsten"), "{:?}", unasked.layout().notes);
    let found: Vec<String> =
        tungsten.layout().roles.iter().map(|role| format!("{} {}", role.role, role.statistic)).collect();
    let expected = [
        "color mean",
        "color variance of the mean",
        "color half A",
        "color half B",
        "albedo mean",
        "depth mean",
    ];
    assert_eq!(found, expected);

    for name in ["s.RGB.exr", "s.ALBEDO.exr", "s.DEPTH.exr", "s.AVG_SHADING_NORMAL.exr"] {
        buffer(name, &rgb); // LuxCore writes a depth as three channels
    }
    let options = ReadOptions { profile: Some(Renderer::LuxCore), ..ReadOptions::default() };
    let luxcore = Picture::read(folder.path().join("s.RGB.exr"), &options).unwrap();
    let found: Vec<(&str, usize)> = luxcore
        .frame()
        .features()
        .iter()
        .map(|feature| (feature.name.as_str(), feature.planes.len()))
        .collect();
    assert_eq!(found, [("albedo", 3), ("normal", 3), ("depth", 1)]);
}

#[test]
fn a_colour_without_any_light_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let count = SIZE.0 * SIZE.1;
    let warned = |light: f32| {
        let planes =
            ["R", "G", "B"].map(|name| float(name, vec![if name == "G" { light } else { -1.0 }; count]));
        write_one(&path, layer(None, SIZE, (0, 0), scan_lines(Compression::ZIP16), planes.to_vec()));
        let picture = Picture::read(&path, &ReadOptions::default()).unwrap();
        picture
            .layout()
            .warnings
            .iter()
            .any(|it| it.contains("nowhere above 0") && it.contains("--map color"))
    };
    assert!(warned(0.0) && warned(-1.0) && !warned(0.1));
}

#[test]
fn parts_are_layers_but_for_the_one_that_holds_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("parts.exr");
    let part = |name, names: &[&str]| {
        layer(Some(name), SIZE, (0, 0), scan_lines(Compression::ZIP1), channels(SIZE, names))
    };
    let cases: [(&str, &str, &[&str]); 3] = [
        ("rgba", "Z", &["color mean: rgba.R", "albedo mean: albedo.R", "depth mean: rgba.Z"]),
        (
            "whatever",
            "depth.Z",
            &["color mean: whatever.R", "albedo mean: albedo.R", "depth mean: whatever.depth.Z"],
        ),
        ("V.Combined", "depth.Z", &["color mean: V.Combined.R", "depth mean: V.Depth.Z"]),
    ];
    for (name, depth, expected) in cases {
        let blender = name == "V.Combined";
        let parts = if blender {
            vec![part("V.Depth", &["Z"]), part(name, &["R", "G", "B"])]
        } else {
            vec![part(name, &["R", "G", "B", depth]), part("albedo", &["R", "G", "B"])]
        };
        exr_files::write(&path, IntegerBounds::from_dimensions(SIZE), parts);
        let picture = Picture::read(&path, &ReadOptions::default()).unwrap();
        assert_eq!(roles(&picture), expected, "{name}");
    }
}

#[test]
fn what_is_lacking_or_senseless_is_told_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("render.exr");
    let error = |names: &[&str], options: &ReadOptions| {
        write_one(&path, layer(None, SIZE, (0, 0), scan_lines(Compression::ZIP1), channels(SIZE, names)));
        let error = Picture::read(&path, options).unwrap_err();
        format!("{} {error}", error.kind().exit_code())
    };
    let map = |mapping: &str| ReadOptions { map: vec![mapping.parse().unwrap()], ..ReadOptions::default() };
    let plain = ReadOptions::default();
    let file = path.display();
    let none = error(&["a.X", "b.X"], &plain);
    assert_eq!(
        none,
        format!("4 {file}: no colour was found; the layers are 'a', 'b'; name it by --map color=LAYER")
    );
    assert!(error(&["Y", "RY", "BY"], &plain).starts_with("3 "), "luminance and chroma");
    assert!(error(&["R", "G", "B"], &map("albedo=x.R")).contains("'x.R': is not there"));
    assert!(error(&["R", "G", "B"], &map("gloss=R")).starts_with("2 "));
    for role in ["color", "albedo", "variance", "albedoHalfA"] {
        let complaint = error(&["R", "G", "B"], &map(&format!("{role}=R,G")));
        assert!(complaint.starts_with("4 ") && complaint.contains(&format!("'{role}' is mapped to 2")));
    }
    let maps =
        |maps: [&str; 2]| ReadOptions { map: maps.map(|m| m.parse().unwrap()).to_vec(), ..plain.clone() };
    for two in [["color=R", "variance=V"], ["normal=V", "normalVariance=V.R,V.G"]] {
        let complaint = error(&["R", "G", "B", "V.R", "V.G", "V.B"], &maps(two));
        assert!(complaint.starts_with("4 ") && complaint.contains("a statistic of "), "{complaint}");
    }
    let complaint = error(&["R", "G", "B", "Z"], &maps(["depth=Z", "Depth=R"]));
    assert!(complaint.starts_with("2 ") && complaint.contains("'Depth' is mapped twice"), "{complaint}");
    let complaint = error(&["R", "G", "B", "Albedo.R", "Albedo.G", "N.X"], &map("albedo=Albdo.R"));
    assert!(complaint.contains("there are 'Albedo.R', 'Albedo.G', "), "the likest first: {complaint}");
}

#[test]
fn of_two_eyes_one_is_denoised_with_its_own_features_and_the_other_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stereo.exr");
    let part = |name: &str, view: &str, names: &[&str]| {
        let mut part = layer(Some(name), SIZE, (0, 0), scan_lines(Compression::ZIP1), channels(SIZE, names));
        part.attributes.view_name = Some(Text::from(view));
        part
    };
    let parts = vec![
        part("depth_left", "left", &["Z"]),
        part("rgba_right", "right", &["R", "G", "B"]),
        part("rgba_left", "left", &["R", "G", "B"]),
        part("variance.left", "left", &["A", "G", "R", "B"]),
        part("variance_right", "right", &["B", "G", "R"]),
        part("depth.right", "right", &["A", "Z"]),
    ];
    exr_files::write(&path, IntegerBounds::from_dimensions(SIZE), parts);
    let picture = Picture::read(&path, &ReadOptions::default()).unwrap();
    let depth = &picture.frame().features()[0].planes[0];
    assert_eq!(depth.data(), values(SIZE.0 * SIZE.1, 1), "the right eye's depth");
    let variance = picture.frame().color_var_of_mean().unwrap();
    assert_eq!(variance[0].data(), values(SIZE.0 * SIZE.1, 2), "the right eye's variance");
    let note = "'left' could be the colour as well and passes through; choose it by --map color=…";
    assert_eq!(picture.layout().notes, [note]);
    for color in ["rgba_left.R,rgba_left.G,rgba_left.B", "rgba_left", "left"] {
        let map = vec![format!("color={color}").parse().unwrap()];
        let picture = Picture::read(&path, &ReadOptions { map, ..ReadOptions::default() }).unwrap();
        assert_eq!(picture.frame().features()[0].planes[0].data(), values(SIZE.0 * SIZE.1, 0), "{color}");
        let variance = picture.frame().color_var_of_mean().unwrap();
        assert_eq!(variance[0].data(), values(SIZE.0 * SIZE.1, 2), "{color}: the left eye's");
        let color = &picture.layout().roles[0].channels;
        assert_eq!(*color, ["rgba_left.R", "rgba_left.G", "rgba_left.B"], "the part is told");
    }
}

#[test]
fn thousands_of_channels_are_sorted_out() {
    let folder = tempfile::tempdir().unwrap();
    let names: Vec<String> = (0..5000).map(|i| format!("layer{i}.Y")).collect();
    let mut all: Vec<&str> = names.iter().map(String::as_str).collect();
    all.extend(["R", "G", "B", "visibility.Y"]);
    let picture = picture(folder.path(), &all, &[], &ReadOptions::default());
    assert_eq!(roles(&picture), ["color mean: R", "visibility mean: visibility.Y"]);
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name)
}

#[test]
fn mitsubas_layers_are_told_by_their_numbers() {
    let plain = Picture::read(fixture("mitsuba/gallery_aov.exr"), &ReadOptions::default()).unwrap();
    let expected = [
        "color mean: R",
        "albedo mean: alb.R",
        "normal mean: nn.X",
        "position mean: pos.X",
        "depth mean: dd.T",
    ];
    assert_eq!(roles(&plain), expected);
    let albedo = &plain.frame().features()[0].planes;
    assert!(
        albedo.iter().flat_map(apr::image::Plane::data).all(|v| (0.0..=1.0).contains(v)),
        "metals are cut to 1"
    );

    let spp = ReadOptions { spp: Some(16.0), ..ReadOptions::default() };
    let moments = Picture::read(fixture("mitsuba/gallery_moment.exr"), &spp).unwrap();
    assert!(roles(&moments).contains(&"color second moment: m2_nested.img.R".to_owned()));
    let frame = moments.frame();
    assert!(frame.features().iter().all(|feature| feature.var_of_mean.is_some()));
    assert!(moments.layout().notes.iter().all(|note| !note.contains("XYZ")), "the RGB moments are there");
    // The variance of 16 samples' mean, against the error that the reference shows.
    let reference = apr::io::read_rgb(fixture("mitsuba/gallery_ref.exr")).unwrap();
    let (color, variance) = (frame.color(), frame.color_var_of_mean().unwrap());
    let count = variance[1].data().len();
    let mean = |of: &dyn Fn(usize) -> f32| (0..count).map(|i| f64::from(of(i))).sum::<f64>() / count as f64;
    let told = mean(&|i| variance[1].data()[i]);
    let true_error = mean(&|i| (color[1].data()[i] - reference[1].data()[i]).powi(2));
    assert!((0.5..2.0).contains(&(told / true_error)), "{told} against {true_error}");

    let unknown = Picture::read(fixture("mitsuba/gallery_moment.exr"), &ReadOptions::default()).unwrap();
    assert!(unknown.frame().color_var_of_mean().is_none());
    assert!(unknown.layout().warnings[0].contains("--spp"), "{:?}", unknown.layout().warnings);
}

#[test]
fn two_blender_renders_make_up_for_the_variance_that_cycles_lacks() {
    let alone = Picture::read(fixture("blender/room_seed1.exr"), &ReadOptions::default()).unwrap();
    assert!(alone.layout().warnings.iter().any(|warning| warning.contains("--half")));
    let half = Some(fixture("blender/room_seed2.exr"));
    let both =
        Picture::read(fixture("blender/room_seed1.exr"), &ReadOptions { half, ..ReadOptions::default() });
    let both = both.unwrap();
    assert_eq!(both.frame().spp(), Some(32.0));
    assert!(both.frame().halves().is_some());
    assert!(both.layout().warnings.is_empty(), "{:?}", both.layout().warnings);
}

#[test]
fn motion_vectors_of_every_convention_point_right_and_down_from_here() {
    let folder = tempfile::tempdir().unwrap();
    let wanted = ReadOptions { motion: true, ..ReadOptions::default() };
    // Blender 4.5 wrote (−3, −1, −5, −2) for an object that comes 3 columns to the right and 1 row up,
    // then goes 5 to the right and 2 up.
    let at = |name, value: f32| float(name, vec![value; SIZE.0 * SIZE.1]);
    let mut cycles = channels(SIZE, &["View.Combined.R", "View.Combined.G", "View.Combined.B"]);
    let vector =
        [("View.Vector.X", -3.0), ("View.Vector.Y", -1.0), ("View.Vector.Z", -5.0), ("View.Vector.W", -2.0)];
    cycles.extend(vector.map(|(name, value)| at(name, value)));
    let path = folder.path().join("cycles.exr");
    write_one(&path, layer(None, SIZE, (0, 0), scan_lines(Compression::ZIP16), cycles));
    let picture = Picture::read(&path, &wanted).unwrap();
    let motion = picture.frame().motion().unwrap();
    let first =
        |planes: &Option<[apr::image::Plane; 2]>| planes.as_ref().unwrap().each_ref().map(|p| p.get(0, 0));
    assert_eq!((first(&motion.previous), first(&motion.next)), ([-3.0, 1.0], [5.0, -2.0]));
    assert!(roles(&picture).contains(&"motionCycles mean: View.Vector.X".to_owned()));
    assert_eq!(Picture::read(&path, &ReadOptions::default()).unwrap().frame().motion(), None);

    let names = ["R", "G", "B", "flow.R", "flow.G", "flow.B"];
    let mapped = |mapping: &str| {
        let file = layer(None, SIZE, (0, 0), scan_lines(Compression::ZIP16), channels(SIZE, &names));
        write_one(&path, file);
        let map = vec![mapping.parse().unwrap()];
        Picture::read(&path, &ReadOptions { map, motion: true, ..ReadOptions::default() })
    };
    let picture = mapped("motionNext=flow.R,flow.G").unwrap();
    let motion = picture.frame().motion().unwrap();
    assert_eq!(
        (motion.previous.is_none(), motion.next.as_ref().unwrap()[1].data()[0]),
        (true, values(1, 4)[0])
    );
    let error = mapped("motionPrevious=flow").unwrap_err().to_string();
    assert!(error.contains("3 channels where 2 were expected"), "{error}");
}
