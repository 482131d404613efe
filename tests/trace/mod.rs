//! The bundled tracer: closed forms, agreement with Mitsuba, determinism, scene errors, the program.

mod adaptive;
mod closed_forms;
mod determinism;
mod mitsuba;
mod motion;
mod program;
mod scene_errors;
mod scene_fields;

use std::path::{Path, PathBuf};

use apr::image::{Plane, Rgb};
use apr::trace::{RenderOptions, Rendered, Scene, render};
use serde_json::Value;

/// The folder of the shipped scenes.
fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/scenes")
}

/// A shipped scene's document at another resolution.
fn shipped(name: &str, resolution: [usize; 2]) -> Value {
    let text = std::fs::read_to_string(scenes().join(format!("{name}.json"))).unwrap();
    let mut scene: Value = serde_json::from_str(&text).unwrap();
    scene["camera"]["resolution"] = resolution.to_vec().into();
    scene
}

fn parse(scene: &Value) -> Scene {
    Scene::parse(&scene.to_string(), &scenes()).unwrap()
}

fn rendered(scene: &Value, spp: u32, seed: u64) -> Rendered {
    render(&parse(scene), &RenderOptions { spp, seed, ..RenderOptions::default() }).unwrap()
}

fn mean(plane: &Plane) -> f64 {
    plane.data().iter().map(|&v| f64::from(v)).sum::<f64>() / plane.data().len() as f64
}

/// The picture's mean in each channel, and the standard error of that mean.
fn picture_mean(rendered: &Rendered) -> [(f64, f64); 3] {
    let (color, variance): (&Rgb, &Rgb) =
        (rendered.frame.color(), rendered.frame.color_var_of_mean().unwrap());
    [0, 1, 2].map(|c| (mean(&color[c]), (mean(&variance[c]) / color[c].data().len() as f64).sqrt()))
}
