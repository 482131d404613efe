//! The tracer against Mitsuba 3, whose results `scripts/mitsuba_check.py --fixtures` wrote.

use std::path::Path;

use apr::io::{Picture, ReadOptions};
use apr::{Feature, Frame};
use serde_json::{Value, json};

use super::{rendered, shipped};

const SIZE: [usize; 2] = [32, 24];
const SPP: u32 = 512;
/// Largest |z| of about 2300 tests that chance alone exceeds once in a thousand runs.
const Z_LIMIT: f64 = 5.1;

fn mitsuba(name: &str) -> Frame {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("fixtures/trace/{name}.exr"));
    Picture::read(path, &ReadOptions::default()).unwrap().frame().clone()
}

/// The scene for features: Mitsuba has no albedo of metal and glass, and takes fog for a surface.
fn matt(mut scene: Value) -> Value {
    for material in scene["materials"].as_object_mut().unwrap().values_mut() {
        if material["type"] == "conductor" || material["type"] == "dielectric" {
            *material = json!({"type": "diffuse", "reflectance": 0.5});
        }
    }
    scene.as_object_mut().unwrap().remove("medium");
    scene["integrator"] = json!({"max_depth": 1});
    scene
}

/// Mean over 3 × 3 pixels: a pixel that happened to miss a rare bright sample knows too little of its
/// own variance.
fn around(variance: &apr::image::Plane, x: usize, y: usize) -> f64 {
    let near = |i: usize, size: usize| i.saturating_sub(1)..=(i + 1).min(size - 1);
    let values: Vec<f64> = near(y, variance.height())
        .flat_map(|y| near(x, variance.width()).map(move |x| f64::from(variance.get(x, y))))
        .collect();
    values.iter().sum::<f64>() / values.len() as f64
}

/// Checks every pixel and the sum of one plane, given as (mean, variance of the mean) of both programs.
fn agree(what: &str, own: [&apr::image::Plane; 2], other: [&apr::image::Plane; 2], rounding: f64) {
    let scale = other[0].data().iter().fold(0f64, |m, v| m.max(f64::from(v.abs()))) * rounding;
    let (mut difference_sum, mut variance_sum) = (0.0, 0.0);
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let at = |plane: &apr::image::Plane| f64::from(plane.get(x, y));
            let own_variance = at(own[1]).max(around(own[1], x, y));
            let variance = own_variance + at(other[1]).max(around(other[1], x, y));
            let difference = at(own[0]) - at(other[0]);
            let z = difference / (variance + scale * scale).sqrt();
            assert!(
                z.abs() <= Z_LIMIT,
                "{what} at {x}, {y}: z = {z:.1}, {} and {}",
                at(own[0]),
                at(other[0])
            );
            difference_sum += difference;
            variance_sum += at(own[1]) + at(other[1]) + scale * scale;
        }
    }
    let z = difference_sum / variance_sum.sqrt();
    assert!(z.abs() <= 3.6, "the whole of {what}: z = {z:.1}");
}

fn feature<'a>(frame: &'a Frame, name: &str) -> &'a Feature {
    frame.features().iter().find(|feature| feature.name == name).unwrap()
}

fn compare(name: &str) {
    let mut scene = shipped(name, SIZE);
    scene["camera"].as_object_mut().unwrap().remove("filter"); // Mitsuba splats its other filters
    let theirs = mitsuba(name);
    let ours = rendered(&scene, SPP, 1).frame;
    let flat = rendered(&matt(scene), SPP, 1).frame;
    for c in 0..3 {
        let of = |frame: &Frame| [frame.color()[c].clone(), frame.color_var_of_mean().unwrap()[c].clone()];
        let ([own, own_v], [other, other_v]) = (of(&ours), of(&theirs));
        agree(&format!("{name} colour {c}"), [&own, &own_v], [&other, &other_v], 1e-5);
    }
    for (layer, rounding) in [("position", 2e-5), ("normal", 2e-4), ("albedo", 1e-5), ("depth", 2e-5)] {
        let (own, other) = (feature(&flat, layer), feature(&theirs, layer));
        for c in 0..own.planes.len() {
            let of = |f: &'_ Feature| [f.planes[c].clone(), f.var_of_mean.as_ref().unwrap()[c].clone()];
            let ([own, own_v], [other, other_v]) = (of(own), of(other));
            agree(&format!("{name} {layer} {c}"), [&own, &own_v], [&other, &other_v], rounding);
        }
    }
}

#[test]
fn mesh_metal_and_checkerboard() {
    compare("teapot_specular");
}

#[test]
fn frosted_glass_plastic_point_and_distant_light() {
    compare("frosted_glass");
}

#[test]
fn fog_and_spot_light() {
    compare("fog_shaft");
}

#[test]
fn thin_lens_and_many_lamps() {
    compare("lens_table");
}

#[test]
fn instances_under_an_environment_map() {
    compare("foliage");
}
