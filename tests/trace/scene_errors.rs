//! Scenes that make no sense are refused with the JSON path and a remedy.

use apr::trace::Scene;
use serde_json::{Value, json};

use super::{scenes, shipped};

/// The error of the Cornell box after `change`.
fn error_of(change: impl Fn(&mut Value)) -> String {
    let mut scene = shipped("cornell_box", [8, 6]);
    change(&mut scene);
    Scene::parse(&scene.to_string(), &scenes()).unwrap_err().to_string()
}

#[test]
fn every_mistake_is_named_with_its_place() {
    let set = |pointer: &'static str, value: Value| {
        move |scene: &mut Value| {
            let (parent, key) = pointer.rsplit_once('/').unwrap();
            let parent = scene.pointer_mut(parent).unwrap();
            match key.parse::<usize>() {
                Ok(index) => parent[index] = value.clone(),
                Err(_) => parent[key] = value.clone(),
            }
        }
    };
    let cases: Vec<(String, [&str; 2])> = vec![
        (error_of(set("/camera/fow", json!(3))), ["$.camera: the key 'fow'", "did you mean 'fov'?"]),
        (error_of(set("/camera/fov", json!("wide"))), ["$.camera.fov: got a string", "docs/SCENES.md"]),
        (error_of(set("/camera/crop", json!([0, 0, 9, 6]))), ["$.camera.crop", "inside 8×6"]),
        (error_of(set("/camera/target", json!([0, 0, 3.9]))), ["$.camera", "direction"]),
        (
            error_of(set("/materials/white/type", json!("difuse"))),
            ["$.materials.white.type", "did you mean 'diffuse'?"],
        ),
        (
            error_of(set("/materials/white/reflectance", json!(1.5))),
            ["$.materials.white.reflectance", "0 to 1"],
        ),
        (
            error_of(set("/materials/new", json!({"type": "conductor", "metal": "gold", "roughness": -0.1}))),
            ["$.materials.new.roughness: -0.1", "0 to 1"],
        ),
        (
            error_of(set(
                "/materials/new",
                json!({"type": "diffuse", "reflectance": {"type": "bitmap", "file": "no.png"}}),
            )),
            ["$.materials.new.reflectance.file", "cannot be read"],
        ),
        (
            error_of(set("/shapes/1/material", json!("wite"))),
            ["$.shapes[1].material: 'wite'", "did you mean 'white'?"],
        ),
        (
            error_of(set("/shapes/1/transform", json!([{"scale": [1, 0, 1]}]))),
            ["$.shapes[1].transform", "singular"],
        ),
        (
            error_of(set("/shapes/1/motion", json!([{"scale": [-1, 1, 1]}]))),
            ["$.shapes[1].motion", "180 degrees"],
        ),
        (
            error_of(set("/shapes/1", json!({"type": "sphere", "material": "white", "radius": -1}))),
            ["$.shapes[1].radius", "at least 0"],
        ),
        (error_of(set("/shapes/1/type", json!("mesh"))), ["'file' is missing", "add it; see docs"]),
        (
            error_of(set("/medium", json!({"extinction": 0, "albedo": 1}))),
            ["$.medium.extinction", "leave the medium out"],
        ),
        (
            error_of(set("/lights", json!([{"type": "point", "position": [0, 1], "intensity": 1}]))),
            ["$.lights[0].position", "3 numbers"],
        ),
        (error_of(set("/integrator", json!({"max_depth": 0}))), ["$.integrator.max_depth", "1 to"]),
        (Scene::parse("{\"camera\": 1,}", &scenes()).unwrap_err().to_string(), ["not valid JSON", "line 1"]),
        (
            Scene::load(scenes().join("absent.json")).unwrap_err().to_string(),
            ["absent.json", "cannot be read"],
        ),
    ];
    for (message, parts) in cases {
        for part in parts {
            assert!(message.contains(part), "'{part}' is not in: {message}");
        }
    }
}

#[test]
fn every_shipped_scene_loads() {
    let mut count = 0;
    for entry in std::fs::read_dir(scenes()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "json") {
            Scene::load(&path).unwrap();
            count += 1;
        }
    }
    assert!(count >= 12, "{count} scenes");
}
