//! Every field of the format, one after the other: what it cannot hold is refused under its JSON path, with a
//! remedy, and so is every key that does not exist.

use apr::trace::Scene;
use serde_json::{Value, json};

use super::scenes;

/// A scene with every key that there is; lights and materials of every type.
fn everything() -> Value {
    json!({
        "camera": {
            "origin": [0, 1, 4], "target": [0, 1, 0], "up": [0, 1, 0], "fov": 40, "resolution": [8, 6],
            "crop": [1, 1, 4, 3], "aperture_radius": 0.1, "focus_distance": 3, "filter": "tent",
            "end": {"origin": [0, 1, 4], "target": [0, 1.1, 0], "up": [0, 1, 0]},
        },
        "integrator": {"max_depth": 4, "roulette_depth": 3},
        "materials": {
            "plain": {"type": "diffuse", "reflectance": [0.5, 0.4, 0.3]},
            "squares": {"type": "diffuse", "reflectance":
                {"type": "checker", "color0": 0.1, "color1": [0.5, 0.5, 0.6], "scale": [4, 4]}},
            "painted": {"type": "plastic", "eta": 1.5, "reflectance":
                {"type": "bitmap", "file": "painting.png", "raw": false, "scale": [1, -1]}},
            "glass": {"type": "dielectric", "eta": 1.4, "roughness": 0.1},
            "gold": {"type": "conductor", "metal": "gold", "reflectance": 0.9, "roughness": 0.2},
            "own": {"type": "conductor", "eta": [1, 0.5, 0.1], "k": 2},
        },
        "groups": {"pot": [{"type": "mesh", "file": "teapot.obj", "flat": true, "material": "plain"}]},
        "shapes": [
            {"type": "rectangle", "material": "squares", "emission": 0.5, "group": "key",
             "transform": [{"scale": 2}, {"rotate": {"axis": [1, 0, 0], "angle": -90}}, {"translate": [0, 0, 0]}]},
            {"type": "sphere", "center": [0, 1, 0], "radius": 0.3, "material": "glass",
             "motion": [{"translate": [0.1, 0, 0]}]},
            {"type": "cube", "material": "gold", "transform": [{"scale": [0.2, 0.3, 0.2]}]},
            {"type": "disk", "material": "own", "transform":
                [{"matrix": [1, 0, 0, 2, 0, 1, 0, 1, 0, 0, 1, 0, 0, 0, 0, 1]}]},
            {"type": "sphere", "material": "painted"},
            {"type": "instance", "of": "pot", "transform": [{"scale": 0.1}], "motion": [{"scale": 0.2}]},
        ],
        "lights": [
            {"type": "point", "position": [0, 3, 0], "intensity": 1, "group": "key"},
            {"type": "spot", "position": [0, 3, 0], "target": [0, 0, 0], "intensity": [1, 2, 3],
             "cutoff_angle": 30, "beam_angle": 10, "group": "spot"},
            {"type": "directional", "direction": [0, -1, 0], "irradiance": 1, "group": "sun"},
        ],
        "environment": {"type": "map", "file": "sky.hdr", "scale": 0.5, "rotate": 30, "group": "sky"},
        "medium": {"extinction": 0.1, "albedo": [0.5, 0.6, 0.7], "anisotropy": 0.3,
            "bounds": {"min": [-1, -1, -1], "max": [1, 1, 1]}},
    })
}

fn refusal(scene: &Value) -> Option<String> {
    Scene::parse(&scene.to_string(), &scenes()).err().map(|error| error.to_string())
}

/// The JSON path of a pointer: `$.shapes[1].radius` of `/shapes/1/radius`.
fn path(pointer: &str) -> String {
    let steps = pointer.split('/').skip(1).map(|step| match step.parse::<usize>() {
        Ok(index) => format!("[{index}]"),
        Err(_) => format!(".{step}"),
    });
    "$".to_owned() + &steps.collect::<String>()
}

/// The pointers of `value` and of everything in it.
fn pointers(value: &Value, at: &str, found: &mut Vec<String>) {
    found.push(at.to_owned());
    match value {
        Value::Object(map) => {
            map.iter().for_each(|(key, value)| pointers(value, &format!("{at}/{key}"), found))
        }
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, value)| pointers(value, &format!("{at}/{i}"), found))
        }
        _ => {}
    }
}

fn all() -> (Value, Vec<String>) {
    let scene = everything();
    assert_eq!(refusal(&scene), None);
    let mut found = vec![];
    pointers(&scene, "", &mut found);
    assert!(found.len() > 200);
    (scene, found)
}

/// The pointers of objects whose keys the format knows.
fn objects() -> (Value, Vec<String>) {
    let (scene, mut found) = all();
    found.retain(|at| {
        scene.pointer(at).unwrap().is_object() && !["/materials", "/groups"].contains(&at.as_str())
    });
    (scene, found)
}

#[test]
fn every_field_refuses_null_and_numbers_without_end_under_its_path() {
    let (scene, found) = all();
    for at in &found {
        for wrong in [json!(null), json!(1e300)] {
            let mut scene = scene.clone();
            *scene.pointer_mut(at).unwrap() = wrong;
            let message = refusal(&scene).unwrap_or_else(|| panic!("{at} is not refused"));
            assert!(
                message.contains(&format!("at {}: ", path(at))) && message.contains("; "),
                "{at}: {message}"
            );
        }
    }
}

#[test]
fn every_object_refuses_a_key_that_does_not_exist() {
    let (scene, found) = objects();
    for at in &found {
        let mut scene = scene.clone();
        scene.pointer_mut(at).unwrap()["zzzz"] = json!(1);
        let message = refusal(&scene).unwrap_or_else(|| panic!("{at} takes any key"));
        let told = format!("at {}: the key 'zzzz' is not known here; known are: ", path(at));
        assert!(message.contains(&told), "{at}: {message}");
    }
}

#[test]
fn every_misspelt_key_is_named_with_the_one_that_was_meant() {
    let (scene, found) = objects();
    for at in &found {
        let keys: Vec<String> = scene.pointer(at).unwrap().as_object().unwrap().keys().cloned().collect();
        for key in keys {
            let mut scene = scene.clone();
            let object = scene.pointer_mut(at).unwrap().as_object_mut().unwrap();
            let value = object.remove(&key).unwrap();
            object.insert(format!("{key}s"), value);
            let message = refusal(&scene).unwrap_or_else(|| panic!("{at}/{key}s is taken"));
            let told = [format!("'{key}s'"), format!("'{key}'"), format!("at {}: ", path(at))];
            assert!(told.iter().all(|part| message.contains(part)), "{at}/{key}: {message}");
        }
    }
}

#[test]
fn every_number_out_of_its_range_is_refused_under_its_path() {
    let cases = [
        ("/camera/fov", json!([0, -1, 179.5])),
        ("/camera/resolution/0", json!([0, -1, 1.5, 32769])),
        ("/camera/resolution", json!([[8], [8, 6, 1]])),
        ("/camera/crop", json!([[0, 0, 9, 6], [0, 0, 0, 1], [4, 0, 5, 1]])),
        ("/camera/crop/0", json!([-1, 0.5])),
        ("/camera/aperture_radius", json!([-0.1])),
        ("/camera/focus_distance", json!([0, -1, 1e-60])),
        ("/camera/filter", json!(["bos"])),
        ("/camera/up", json!([[0, 0, 0]])),
        ("/camera/end/up", json!([[0, 0, 0]])),
        ("/integrator/max_depth", json!([0, -1, 1.5, 65537])),
        ("/integrator/roulette_depth", json!([0, -1, 1.5, 65537])),
        ("/materials/plain/reflectance", json!([-0.1, 1.1, [1, 1], "red"])),
        ("/materials/plain/reflectance/2", json!([-0.1, 1.1])),
        ("/materials/squares/reflectance/color0", json!([-0.1, 1.1])),
        ("/materials/squares/reflectance/color1", json!([-0.1, 1.1])),
        ("/materials/squares/reflectance/scale", json!([4, [1], [1, 2, 3]])),
        ("/materials/painted/reflectance/file", json!(["no.png", "teapot.obj", ""])),
        ("/materials/painted/eta", json!([1, 0.5, 4.1])),
        ("/materials/glass/eta", json!([1, 0.5, 4.1])),
        ("/materials/glass/roughness", json!([-0.1, 1.1])),
        ("/materials/gold/metal", json!(["gould"])),
        ("/materials/gold/reflectance", json!([-0.1, 1.1])),
        ("/materials/gold/roughness", json!([-0.1, 1.1])),
        ("/materials/own/eta", json!([-0.1, 10001])),
        ("/materials/own/k", json!([-0.1, 10001])),
        ("/groups/pot/0/file", json!(["no.obj", "bricks.png"])),
        ("/shapes/0/emission", json!([-0.1, [1, -1, 1]])),
        (
            "/shapes/0/transform",
            json!([[{"scale": 0}], [{"scale": 1e-20}], [{"scale": 1e20}], [{"translate": [0, 0, 1e38]}, {"scale": 10}]]),
        ),
        ("/shapes/0/transform/1/rotate/axis", json!([[0, 0, 0]])),
        ("/shapes/0/transform/0", json!([{}, {"scale": 1, "translate": [0, 0, 0]}])),
        ("/shapes/1/radius", json!([0, -1, 1e-60])),
        ("/shapes/1/motion", json!([[{"scale": -1}], [{"scale": [1, 0, 1]}]])),
        ("/shapes/3/transform/0/matrix", json!([[1, 0, 0, 2, 0, 1, 0, 1, 0, 0, 1, 0, 0, 0, 1, 1]])),
        ("/shapes/3/transform", json!([[{"matrix": [1, 0, 0, 2, 1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 1]}]])),
        ("/shapes/4/material", json!(["paint"])),
        ("/shapes/5/of", json!(["pan"])),
        ("/lights/0/intensity", json!([-1])),
        ("/lights/1/intensity", json!([-1])),
        ("/lights/1/target", json!([[0, 3, 0]])),
        ("/lights/1/cutoff_angle", json!([0, 90.5])),
        ("/lights/1/beam_angle", json!([-1, 30, 91])),
        ("/lights/2/direction", json!([[0, 0, 0]])),
        ("/lights/2/irradiance", json!([-1])),
        ("/environment/scale", json!([-1])),
        ("/environment/file", json!(["no.hdr", "teapot.obj"])),
        ("/environment", json!([{"type": "constant", "radiance": -1}])),
        ("/medium/extinction", json!([0, -1, [1, 0, 1]])),
        ("/medium/albedo", json!([-0.1, 1.1])),
        ("/medium/anisotropy", json!([-1, 1])),
        ("/medium/bounds", json!([{"min": [0, 0, 0], "max": [1, 0, 1]}])),
    ];
    let scene = everything();
    for (at, wrong) in cases {
        for wrong in wrong.as_array().unwrap() {
            let mut scene = scene.clone();
            *scene.pointer_mut(at).unwrap() = wrong.clone();
            let message = refusal(&scene).unwrap_or_else(|| panic!("{at} takes {wrong}"));
            let told = format!("at {}", path(at));
            assert!(message.contains(&told) && message.contains("; "), "{at}, {wrong}: {message}");
        }
    }
}
