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
            error_of(set("/shapes/1/motion", json!([{"rotate": {"axis": [0, 1, 0], "angle": 180}}]))),
            ["$.shapes[1].motion", "180 degrees"],
        ),
        (
            error_of(set("/camera/end", json!({"origin": [0, 0, 3.9], "target": [0, 0, 9]}))),
            ["$.camera.end", "180 degrees"],
        ),
        (error_of(set("/shapes/0/group", json!("albedoHalfA"))), ["$.shapes[0].group", "another layer"]),
        (error_of(set("/shapes/0/group", json!(""))), ["$.shapes[0].group", "no name"]),
        (error_of(set("/shapes/0/group", json!("a\0b"))), ["'a\\0b' is no name", "name the group otherwise"]),
        (error_of(set("/shapes/0/group", json!("x".repeat(300)))), ["$.shapes[0].group", "too long"]),
        (
            error_of(set("/shapes/1/group", json!("lamp"))),
            ["$.shapes[1]: the light group 'lamp'", "emission"],
        ),
        (error_of(set("/shapes/0/emission", json!(1e30))), ["$.shapes[0].emission", "to 1000000000000000"]),
        (
            Scene::parse("{\"camera\": {\"fov\": 40, \"fov\": 90}}", &scenes()).unwrap_err().to_string(),
            ["at $.camera: the key 'fov' is given twice", "line 1"],
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

/// What some editors put in front of a text is no part of it; another encoding is named.
#[test]
fn encodings_of_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    let text = shipped("cornell_box", [8, 6]).to_string();
    std::fs::write(&path, format!("\u{feff}{text}")).unwrap();
    Scene::load(&path).unwrap();
    let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    std::fs::write(&path, [&[0xff, 0xfe], &wide[..]].concat()).unwrap();
    let error = Scene::load(&path).unwrap_err().to_string();
    assert!(error.contains("scene.json") && error.contains("UTF-8"), "{error}");
}

#[test]
fn meshes_of_numbers_that_are_none_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = shipped("cornell_box", [8, 6]);
    scene["shapes"][1] = json!({"type": "mesh", "file": "m.obj", "material": "white"});
    let load = |vt: &str, vn: &str| {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt {vt}\nvn {vn}\nf 1/1/1 2/1/1 3/1/1\n");
        std::fs::write(folder.path().join("m.obj"), text).unwrap();
        Scene::parse(&scene.to_string(), folder.path())
    };
    load("0 0", "0 0 1e25").unwrap();
    for (vt, vn, what) in [("0 0", "0 0 nan", "normal"), ("0 inf", "0 0 1", "texture coordinate")] {
        let error = load(vt, vn).unwrap_err().to_string();
        assert!(error.contains("$.shapes[1].file") && error.contains(what), "{error}");
    }
}
