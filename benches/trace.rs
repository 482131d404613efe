//! What the tracer's effects and its hierarchy cost: `cargo bench --bench trace`.
//!
//! Prints nanoseconds per path of the Cornell box with one effect added at a time: first put into the
//! plan without being met by any path (what leaving it out saves), then in use; and the time that the
//! surface area heuristic saves over a median split. Each figure is the least of several runs, taken in
//! turns, on all cores.

#![allow(clippy::print_stdout)] // a benchmark prints

use std::path::{Path, PathBuf};
use std::time::Instant;

use apr::trace::{FeatureMode, RenderOptions, Scene, Split, render};
use serde_json::{Value, json};

const SPP: u32 = 16;
const RUNS: usize = 5;
const SIZE: [usize; 2] = [128, 128];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/scenes")
}

fn document(name: &str) -> Value {
    let text = std::fs::read_to_string(folder().join(format!("{name}.json"))).expect("a shipped scene");
    let mut scene: Value = serde_json::from_str(&text).expect("JSON");
    scene["camera"]["resolution"] = SIZE.to_vec().into();
    scene
}

fn nanoseconds_per_path(scene: &Scene, options: &RenderOptions) -> f64 {
    let start = Instant::now();
    render(scene, options).expect("a picture");
    start.elapsed().as_nanos() as f64 / (SIZE[0] * SIZE[1]) as f64 / f64::from(options.spp)
}

/// The least time of each of `cases`, whose runs take turns so that all meet the same disturbances.
fn least(cases: &[(Scene, RenderOptions)]) -> Vec<f64> {
    let mut times = vec![f64::INFINITY; cases.len()];
    for _ in 0..RUNS {
        for ((scene, options), time) in cases.iter().zip(&mut times) {
            *time = time.min(nanoseconds_per_path(scene, options));
        }
    }
    times
}

/// The Cornell box with `change` applied.
fn changed(change: impl Fn(&mut Value)) -> Scene {
    let mut scene = document("cornell_box");
    change(&mut scene);
    Scene::parse(&scene.to_string(), &folder()).expect("a scene")
}

fn with(pointer: &'static str, value: Value) -> Box<dyn Fn(&mut Value)> {
    Box::new(move |scene| {
        let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
        scene.pointer_mut(parent).expect("a place")[key] = value.clone();
    })
}

fn with_shape(shape: Value) -> Box<dyn Fn(&mut Value)> {
    Box::new(move |scene| scene["shapes"].as_array_mut().expect("shapes").push(shape.clone()))
}

/// Name of the effect; a change that puts it into the plan where no path meets it; one that uses it.
type Case = (&'static str, Box<dyn Fn(&mut Value)>, Box<dyn Fn(&mut Value)>);

fn cases() -> Vec<Case> {
    let checker = json!({"type": "diffuse", "reflectance":
        {"type": "checker", "color0": [0.885, 0.698, 0.667], "color1": [0.8, 0.7, 0.6], "scale": [8, 8]}});
    let gold = json!({"type": "conductor", "metal": "gold", "roughness": 0.2});
    let fog = |low: f64, high: f64| {
        json!({"extinction": 0.2, "albedo": 0.8,
        "bounds": {"min": [low, low, low], "max": [high, high, high]}})
    };
    let ball = |place: Value| {
        json!({"type": "sphere", "center": place, "radius": 0.2, "material": "white",
        "motion": [{"translate": [0.2, 0, 0]}]})
    };
    let lamp = |place: Value| json!({"type": "sphere", "center": place, "radius": 0.05, "emission": 20});
    let camera = |radius: f64| -> Box<dyn Fn(&mut Value)> {
        Box::new(move |scene| {
            scene["camera"]["aperture_radius"] = json!(radius);
            scene["camera"]["focus_distance"] = json!(3.9);
        })
    };
    let sky = |radiance: f64| with("/environment", json!({"type": "constant", "radiance": radiance}));
    vec![
        ("textures", with("/materials/unused", checker.clone()), with("/materials/white", checker)),
        ("glossy", with("/materials/unused", gold.clone()), with("/materials/white", gold)),
        ("environment", sky(1e-30), sky(1.0)),
        ("light choice", with_shape(lamp(json!([0, 0, -9]))), with_shape(lamp(json!([0, 0.5, 0])))),
        ("motion blur", with_shape(ball(json!([0, 0, -9]))), with_shape(ball(json!([0, 0.2, 0.2])))),
        ("depth of field", camera(1e-6), camera(0.1)),
        ("medium", with("/medium", fog(8.0, 9.0)), with("/medium", fog(-0.999, 0.999))),
    ]
}

fn effects() {
    let plain = RenderOptions { spp: SPP, features: FeatureMode::None, ..RenderOptions::default() };
    let first_hit = RenderOptions { features: FeatureMode::FirstHit, ..plain.clone() };
    let groups = RenderOptions { light_groups: true, ..plain.clone() };
    let second = RenderOptions { second_hit: true, ..first_hit.clone() };
    let mut renders = vec![(changed(|_| {}), plain.clone())];
    renders.extend([first_hit, second, groups].map(|options| (changed(|_| {}), options)));
    let cases = cases();
    for (_, idle, used) in &cases {
        renders.push((changed(idle), plain.clone()));
        renders.push((changed(used), plain.clone()));
    }
    let times = least(&renders);
    let relative = |i: usize| format!("{:5.0} ({:+.0} %)", times[i], 100.0 * (times[i] / times[0] - 1.0));
    println!("ns per path of the plain diffuse Cornell box: {:.0}", times[0]);
    for (i, name) in ["features", "features of the second hit too", "light groups"].iter().enumerate() {
        println!("{name:32} {}", relative(i + 1));
    }
    println!("{:16} {:>16} {:>16}", "effect", "planned, not met", "in use");
    for (i, (name, ..)) in cases.iter().enumerate() {
        println!("{name:16} {:>16} {:>16}", relative(4 + 2 * i), relative(5 + 2 * i));
    }
}

fn hierarchy() {
    println!("{:16} {:>10} {:>12} {:>8}   ns per path", "scene", "SAH", "median split", "gain");
    for name in ["teapot_diffuse", "glossy_gallery", "foliage", "hundred_lights"] {
        let text = document(name).to_string();
        let options = RenderOptions { spp: SPP, features: FeatureMode::None, ..RenderOptions::default() };
        let build = |split| (Scene::parse_with(&text, &folder(), split).expect("a scene"), options.clone());
        let times = least(&[build(Split::Sah), build(Split::Median)]);
        println!("{name:16} {:10.0} {:12.0} {:7.2}×", times[0], times[1], times[1] / times[0]);
    }
}

fn main() {
    if std::env::args().any(|argument| argument == "--test") {
        return; // `cargo test --benches` only wants to know that it starts
    }
    effects();
    hierarchy();
}
