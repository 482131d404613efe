//! What the tracer's effects and its hierarchy cost: `cargo bench --bench trace`.
//!
//! Prints nanoseconds per path of the Cornell box with one effect added at a time: first put into the
//! plan without being met by any path (what leaving it out saves), then in use; and the time that the
//! surface area heuristic saves over a median split. Each figure is the least of several runs, taken in
//! turns, on all cores.

#![allow(clippy::print_stdout)] // a benchmark prints

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use apr::trace::{FeatureMode, RenderOptions, Scene, Split, render};
use serde::Deserialize;
use serde_json::Value;

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

/// Values by their places in a scene, as JSON pointers; `-` at the end appends to a list.
type Additions = BTreeMap<String, Value>;

/// Changes of the Cornell box; scripts/effect_prices.py counts the instructions of the same.
#[derive(Deserialize)]
struct Effect {
    effect: String,
    /// Put it into the plan where no path meets it.
    planned: Additions,
    /// Let paths meet it.
    used: Additions,
}

/// The Cornell box with `additions`.
fn changed(additions: &Additions) -> Scene {
    let mut scene = document("cornell_box");
    for (pointer, value) in additions {
        let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
        match scene.pointer_mut(parent).expect("a place") {
            Value::Array(list) if key == "-" => list.push(value.clone()),
            place => place[key] = value.clone(),
        }
    }
    Scene::parse(&scene.to_string(), &folder()).expect("a scene")
}

fn effects() {
    let plain = RenderOptions { spp: SPP, features: FeatureMode::None, ..RenderOptions::default() };
    let first_hit = RenderOptions { features: FeatureMode::FirstHit, ..plain.clone() };
    let groups = RenderOptions { light_groups: true, ..plain.clone() };
    let second = RenderOptions { second_hit: true, ..first_hit.clone() };
    let nothing = Additions::new();
    let mut renders = vec![(changed(&nothing), plain.clone())];
    renders.extend([first_hit, second, groups].map(|options| (changed(&nothing), options)));
    let effects: Vec<Effect> = serde_json::from_str(include_str!("effects.json")).expect("effects");
    for effect in &effects {
        renders.push((changed(&effect.planned), plain.clone()));
        renders.push((changed(&effect.used), plain.clone()));
    }
    let times = least(&renders);
    let relative = |i: usize| format!("{:5.0} ({:+.0} %)", times[i], 100.0 * (times[i] / times[0] - 1.0));
    println!("ns per path of the plain diffuse Cornell box: {:.0}", times[0]);
    for (i, name) in ["features", "features of the second hit too", "light groups"].iter().enumerate() {
        println!("{name:32} {}", relative(i + 1));
    }
    println!("{:16} {:>16} {:>16}", "effect", "planned, not met", "in use");
    for (i, Effect { effect: name, .. }) in effects.iter().enumerate() {
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
