//! What the fuzzers found, kept: every file under tests/found is a run that once failed.
//!
//! `scripts/fuzz.sh` fuzzes the same functions with inputs of its own making.

use std::path::{Path, PathBuf};

use crate::exr_files::{channels, layer, of_every_codec, scan_lines, whole, write_one};
use crate::fuzzed;
use exr::prelude::{AttributeValue, Compression, Text};

/// The kept inputs of a target.
fn found(target: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/found").join(target);
    let entries = std::fs::read_dir(folder).into_iter().flatten(); // a target may have none
    let mut paths: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths
}

#[test]
fn files_that_once_broke_the_reading_no_longer_do() {
    for path in found("exr_to_frame") {
        let folder = tempfile::tempdir().unwrap();
        fuzzed::exr_to_frame::survives(&std::fs::read(path).unwrap(), folder.path());
    }
}

#[test]
fn frames_that_once_broke_the_denoiser_no_longer_do() {
    for path in found("denoise") {
        fuzzed::denoise::survives(&std::fs::read(path).unwrap());
    }
}

/// The first inputs of both targets are inputs like any other.
#[test]
fn the_fuzzers_seeds_are_fine() {
    let folder = tempfile::tempdir().unwrap();
    write_seeds(folder.path());
    let seeds = |target: &str| {
        std::fs::read_dir(folder.path().join(target))
            .unwrap()
            .map(|entry| std::fs::read(entry.unwrap().path()).unwrap())
            .collect::<Vec<_>>()
    };
    for bytes in seeds("exr_to_frame") {
        let folder = tempfile::tempdir().unwrap();
        fuzzed::exr_to_frame::survives(&bytes, folder.path());
        fuzzed::exr_to_frame::read_and_write(&bytes, folder.path()).unwrap();
    }
    seeds("denoise").iter().for_each(|bytes| fuzzed::denoise::survives(bytes));
}

#[test]
#[ignore = "writes the fuzzers' first inputs into $SEEDS, for scripts/fuzz.sh"]
fn write_the_seeds() {
    write_seeds(Path::new(&std::env::var_os("SEEDS").expect("SEEDS names a folder")));
}

const SIZE: (usize, usize) = (9, 5);

/// Layers and an attribute of renderers: with them an input gets past the search for the colour.
const RENDERERS: [(&str, &[&str], &str); 7] = [
    (
        "plain",
        &[".RGB", "variance.RGB", "halfA.RGB", "halfB.RGB", "albedo.RGB", "albedoVariance.RGB", "depth.Z"],
        "samplesPerPixel",
    ),
    (
        "pbrt",
        &[".RGB", "Albedo.RGB", "Ns.XYZ", "P.XYZ", "Variance.RGB", "RelativeVariance.RGB"],
        "samplesPerPixel",
    ),
    ("cycles", &["View.Combined.RGB", "View.Noisy Image.RGB", "View.Depth.Z"], "cycles.View.samples"),
    ("mitsuba", &[".RGB", "m2_.RGB", "a.albedo.RGB", "m2_a.albedo.RGB", "a.sh_normal.XYZ"], "generatedBy"),
    ("renderman", &["Ci.RGB", "mse.RGB", "normal.XYZ", "normal_var.XYZ", "zfiltered.Z"], "rman"),
    ("arnold", &["RGBA.RGB", "variance.RGB", "N.XYZ", "Z.Z"], "arnold/AA_samples"),
    ("corona", &[".RGB", "VisibleDiffuse.RGB", "VisibleNormals.XYZ", "CGeometry_ZDepth.Z"], "corona.version"),
];

/// Fills FOLDER/exr_to_frame and FOLDER/denoise.
fn write_seeds(folder: &Path) {
    let place = |target: &str, name: &str| {
        let folder = folder.join(target);
        std::fs::create_dir_all(&folder).unwrap();
        folder.join(name)
    };
    for (n, bytes) in of_every_codec(SIZE).into_iter().enumerate() {
        std::fs::write(place("exr_to_frame", &format!("codec{n}.exr")), bytes).unwrap();
    }
    for (name, layers, attribute) in RENDERERS {
        render(&place("exr_to_frame", &format!("{name}.exr")), layers, attribute);
    }
    for n in 0..24u32 {
        let mut state = n;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        let bytes: Vec<u8> = (0..64 << (n % 6)).map(|_| random()).collect();
        std::fs::write(place("denoise", &format!("random{n}")), bytes).unwrap();
    }
}

/// A file with a channel for every letter behind a layer's last dot, and a count of samples.
fn render(path: &Path, layers: &[&str], attribute: &str) {
    let names: Vec<String> = layers
        .iter()
        .flat_map(|layer| {
            let (layer, components) = layer.rsplit_once('.').expect("LAYER.COMPONENTS");
            let name = move |c| if layer.is_empty() { String::from(c) } else { format!("{layer}.{c}") };
            components.chars().map(name)
        })
        .collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut channels = channels(SIZE, &names);
    channels.push(whole("id", vec![7; SIZE.0 * SIZE.1]));
    let mut layer = layer(None, SIZE, (0, 0), scan_lines(Compression::ZIP16), channels);
    let value = match attribute {
        "generatedBy" => AttributeValue::Text(Text::from("Mitsuba")),
        "cycles.View.samples" => AttributeValue::Text(Text::from("16")),
        _ => AttributeValue::I32(3),
    };
    layer.attributes.other.insert(Text::from(attribute), value);
    write_one(path, layer);
}
