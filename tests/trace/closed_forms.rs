//! Pictures whose radiance is known exactly, compared by z-tests with fixed seeds.

use std::f64::consts::PI;

use apr::trace::{FeatureMode, RenderOptions, render};
use serde_json::{Value, json};

use super::{parse, picture_mean, rendered, shipped};

/// Most standard errors by which a mean may miss; the seeds are fixed, so a pass stays one.
const Z_LIMIT: f64 = 3.5;
/// Rounding of single precision in a mean of many samples.
const ROUNDING: f64 = 2e-5;

/// Renders `scene` and checks the mean of each channel.
fn expect_with(scene: &Value, spp: u32, expected: [f64; 3], slack: f64) {
    for (channel, (mean, error)) in picture_mean(&rendered(scene, spp, 1)).into_iter().enumerate() {
        let allowed = Z_LIMIT * error + (ROUNDING + slack) * expected[channel];
        let miss = (mean - expected[channel]).abs();
        assert!(miss <= allowed, "channel {channel}: {mean} ± {error}, expected {}", expected[channel]);
    }
}

fn expect(scene: &Value, spp: u32, expected: [f64; 3]) {
    expect_with(scene, spp, expected, 0.0);
}

/// A sphere that fills the view.
fn ball(material: Value, extra: Value) -> Value {
    let mut scene = json!({
        "camera": {"origin": [0, 0, 4], "target": [0, 0, 0], "fov": 20, "resolution": [12, 9]},
        "integrator": {"max_depth": 200, "roulette_depth": 200},
        "materials": {"m": material},
        "shapes": [{"type": "sphere", "material": "m"}]
    });
    scene.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
    scene
}

fn white_sky() -> Value {
    json!({"environment": {"type": "constant", "radiance": 1}})
}

#[test]
fn white_furnace() {
    let conserving = [
        json!({"type": "diffuse", "reflectance": 1}),
        json!({"type": "dielectric"}),
        json!({"type": "dielectric", "eta": 2.2}),
        json!({"type": "plastic", "reflectance": 1}),
        json!({"type": "conductor", "eta": 0.01, "k": 1e4}),
    ];
    for material in conserving {
        expect_with(&ball(material, white_sky()), 256, [1.0; 3], 5e-4);
    }
}

/// Facets shadow one another, and what they shadow is lost, at every bounce: rough surfaces stay under 1.
#[test]
fn rough_surfaces_lose_little_and_gain_nothing() {
    let rough = [
        json!({"type": "dielectric", "roughness": 0.1}),
        json!({"type": "conductor", "eta": 0.01, "k": 1e4, "roughness": 0.2}),
    ];
    for material in rough {
        for (mean, error) in picture_mean(&rendered(&ball(material, white_sky()), 256, 1)) {
            assert!((0.92..=1.0 + Z_LIMIT * error).contains(&mean), "{mean} ± {error}");
        }
    }
}

#[test]
fn a_sphere_under_a_constant_sky_has_its_reflectance() {
    let material = json!({"type": "diffuse", "reflectance": [0.2, 0.5, 0.9]});
    let sky = json!({"environment": {"type": "constant", "radiance": [2, 1, 0.5]}});
    expect(&ball(material, sky), 64, [0.4, 0.5, 0.45]);
}

/// A floor of reflectance ½ seen from so near that its radiance hardly varies.
fn floor(extra: Value) -> Value {
    let mut scene = json!({
        "camera": {"origin": [1, 0.5, 1], "target": [0, 0, 0], "fov": 0.05, "resolution": [8, 6]},
        "integrator": {"max_depth": 2},
        "materials": {"gray": {"type": "diffuse", "reflectance": 0.5}},
        "shapes": [{"type": "rectangle", "material": "gray",
                    "transform": [{"rotate": {"axis": [1, 0, 0], "angle": -90}}, {"scale": 9}]}]
    });
    for (key, value) in extra.as_object().unwrap() {
        match scene[key].as_array_mut() {
            Some(list) => list.extend(value.as_array().unwrap().clone()),
            None => scene[key] = value.clone(),
        }
    }
    scene
}

/// Irradiance under the middle of a rectangle of radiance 1 with sides 2a and 2b at height h.
fn irradiance_of_rectangle(a: f64, b: f64, h: f64) -> f64 {
    let (x, y) = (a / h, b / h);
    let side = |x: f64, y: f64| x / x.hypot(1.0) * (y / x.hypot(1.0)).atan();
    2.0 * (side(x, y) + side(y, x))
}

#[test]
fn irradiance_of_a_rectangle_whole_and_in_many_pieces() {
    let (a, b, h) = (1.5, 0.8, 2.0);
    let expected = 0.5 / PI * irradiance_of_rectangle(a, b, h) * 10.0;
    let pieces = |n: usize| -> Value {
        let piece = |i: usize, j: usize| {
            let place = |k: usize, half: f64| half * ((2 * k + 1) as f64 / n as f64 - 1.0);
            json!({"type": "rectangle", "emission": 10, "transform": [
                {"rotate": {"axis": [1, 0, 0], "angle": 90}}, {"scale": [a / n as f64, 1, b / n as f64]},
                {"translate": [place(i, a), h, place(j, b)]}]})
        };
        (0..n * n).map(|k| piece(k / n, k % n)).collect()
    };
    expect(&floor(json!({"shapes": pieces(1)})), 1024, [expected; 3]);
    expect(&floor(json!({"shapes": pieces(6)})), 1024, [expected; 3]);
}

#[test]
fn lights_without_a_shape() {
    let radiance = |irradiance: f64| [0.5 / PI * irradiance; 3];
    let point = json!({"lights": [{"type": "point", "position": [1, 2, 0], "intensity": 7}]});
    expect(&floor(point), 16, radiance(7.0 * 2.0 / 5f64.powf(1.5)));
    let directional = json!({"lights": [{"type": "directional", "direction": [0, -3, 4], "irradiance": 2}]});
    expect(&floor(directional), 16, radiance(2.0 * 0.6));
    // Half way between the beam's 20 and the cone's 40 degrees.
    let angle = 30f64.to_radians();
    let target = [2.0 * angle.tan(), 0.0, 0.0];
    let spot = json!({"lights": [{"type": "spot", "position": [0, 2, 0], "target": target, "intensity": 8,
                                  "cutoff_angle": 40, "beam_angle": 20}]});
    expect_with(&floor(spot), 16, radiance(0.5 * 8.0 / 4.0), 1e-3);
}

/// A small lamp near the floor: its own near side must not shade it.
#[test]
fn irradiance_of_a_sphere() {
    let lamp = json!({"shapes": [{"type": "sphere", "center": [0, 1, 0], "radius": 0.02, "emission": 500}]});
    expect(&floor(lamp), 256, [0.5 * 500.0 * 0.02f64.powi(2); 3]);
}

#[test]
fn absorption_follows_beer_and_lambert() {
    let scene = json!({
        "camera": {"origin": [0, 0, 5], "target": [0, 0, 0], "fov": 1, "resolution": [8, 6]},
        "shapes": [], "environment": {"type": "constant", "radiance": 1},
        "medium": {"extinction": [0.1, 0.5, 1.2], "albedo": 0, "bounds": {"min": [-1, -1, -1], "max": [1, 1, 1]}}
    });
    expect_with(&scene, 4096, [0.1, 0.5, 1.2].map(|s: f64| (-2.0 * s).exp()), 1e-4);
}

#[test]
fn a_medium_that_only_scatters_is_invisible_in_a_furnace() {
    let scene = json!({
        "camera": {"origin": [0, 0, 5], "target": [0, 0, 0], "fov": 30, "resolution": [12, 9]},
        "integrator": {"max_depth": 500, "roulette_depth": 500},
        "shapes": [], "environment": {"type": "constant", "radiance": 1},
        "medium": {"extinction": [0.5, 1, 2], "albedo": 1, "anisotropy": 0.6,
                   "bounds": {"min": [-1, -1, -1], "max": [1, 1, 1]}}
    });
    expect(&scene, 256, [1.0; 3]);
}

/// The environment map's own light, found by its distribution: a bright texel among dark ones.
#[test]
fn a_mean_over_an_environment_map_is_the_same_by_light_and_by_chance() {
    // A diffuse sphere is lit by next-event estimation; a metal ball meets the map by its own rays. Seen
    // from the same place, the irradiance is checked against the map's mean over the floor's hemisphere.
    let map = json!({"environment": {"type": "map", "file": "sky.hdr"}});
    let by_light = floor(map.clone());
    let mut by_chance = floor(map);
    by_chance["materials"]["gray"] = json!({"type": "conductor", "eta": 0.01, "k": 1e4});
    by_chance["camera"] = json!({"origin": [0, 0.001, 0], "target": [0, 1, 0], "up": [0, 0, 1], "fov": 150,
                                 "resolution": [120, 120]});
    // Radiance along the camera's own rays, weighted with cos⁴ over the image plane, is the irradiance.
    let seen = rendered(&by_chance, 4, 1);
    let tan = 75f64.to_radians().tan();
    let mut irradiance = [0.0; 3];
    for y in 0..120 {
        for x in 0..120 {
            let at = |i: usize| (2.0 * (i as f64 + 0.5) / 120.0 - 1.0) * tan;
            let distance2 = 1.0 + at(x).powi(2) + at(y).powi(2);
            let patch = (2.0 * tan / 120.0).powi(2);
            for (c, sum) in irradiance.iter_mut().enumerate() {
                *sum += f64::from(seen.frame.color()[c].get(x, y)) * patch / (distance2 * distance2);
            }
        }
    }
    // The picture leaves out directions within 15 degrees of the horizon: less than 7 % of the irradiance.
    for (c, (mean, error)) in picture_mean(&rendered(&by_light, 1024, 1)).into_iter().enumerate() {
        let least = 0.5 / PI * irradiance[c];
        assert!(
            mean + Z_LIMIT * error > least && mean - Z_LIMIT * error < 1.07 * least,
            "{c}: {mean}, {least}"
        );
    }
}

/// Rays start as near to their surface as the rounding there allows: a pane of 1 mm far from the origin is
/// entered and left again, and what refraction squeezes in between is undone.
#[test]
fn a_thin_pane_far_away_is_a_furnace() {
    for x in [0, 20, 1000] {
        let mut scene = ball(json!({"type": "dielectric"}), white_sky());
        scene["camera"]["origin"] = json!([x, 0.3, 4]);
        scene["camera"]["target"] = json!([x, 0, 0]);
        scene["shapes"] = json!([{"type": "cube", "material": "m", "transform": [
            {"scale": [1, 1, 0.0005]}, {"translate": [x, 0, 0]}]}]);
        expect_with(&scene, 64, [1.0; 3], 5e-4);
    }
}

/// Nor do they start too near: huge ground, whose points and hit tests are rounded by their size and not by
/// where they are seen, does not shade itself. Seen still, and as an instance.
#[test]
fn huge_ground_does_not_shade_itself() {
    let tilt = |angle: f64| json!({"rotate": {"axis": [1, 0, 0], "angle": angle}});
    for size in [1.0, 3e3, 1e5] {
        let sphere = json!([{"scale": size}, {"translate": [-0.6 * size, -0.8 * size, 0]}]);
        let plane = |angle: f64| json!([{"scale": size}, tilt(angle)]);
        let grounds = [("sphere", sphere), ("rectangle", plane(-75.0)), ("disk", plane(-50.0))];
        for (kind, transform) in grounds {
            let shape = |transform: &Value| json!({"type": kind, "material": "m", "transform": transform});
            let gray = json!({"type": "diffuse", "reflectance": 0.5});
            let mut scene = ball(gray, white_sky());
            scene["camera"]["origin"] = json!([2, 3, 1]);
            scene["camera"]["fov"] = json!(1);
            scene["shapes"] = json!([shape(&transform)]);
            expect(&scene, 64, [0.5; 3]);
            scene["groups"] = json!({"ground": [shape(&json!([tilt(20.0)]))]});
            let mut placed = vec![tilt(-20.0)];
            placed.extend(transform.as_array().unwrap().clone());
            scene["shapes"] = json!([{"type": "instance", "of": "ground", "transform": placed}]);
            expect(&scene, 64, [0.5; 3]);
        }
    }
}

/// Lengths have any unit.
#[test]
fn a_box_of_any_size_looks_the_same() {
    let of_size = |size: f64, seed: u64| {
        let mut scene = shipped("cornell_box", [24, 24]);
        for key in ["origin", "target"] {
            for coordinate in scene["camera"][key].as_array_mut().unwrap() {
                *coordinate = json!(coordinate.as_f64().unwrap() * size);
            }
        }
        for shape in scene["shapes"].as_array_mut().unwrap() {
            let mut transform = shape["transform"].as_array().cloned().unwrap_or_default();
            transform.push(json!({"scale": size}));
            shape["transform"] = json!(transform);
        }
        picture_mean(&rendered(&scene, 64, seed))
    };
    let own = of_size(1.0, 1);
    for (seed, size) in [1e-12, 1e-5, 1e3, 1e12].into_iter().enumerate() {
        for ((a, a_error), (b, b_error)) in own.into_iter().zip(of_size(size, 2 + seed as u64)) {
            assert!((a - b).abs() < Z_LIMIT * a_error.hypot(b_error), "{a} of size 1, {b} of size {size}");
        }
    }
}

/// Whether a path gets through the medium is independent of where in the pixel it began.
#[test]
fn half_a_lamp_behind_what_absorbs() {
    for side in [-1, 1] {
        let scene = json!({
            "camera": {"origin": [0, 0, 2.9957], "target": [0, 0, 0], "fov": 0.1, "resolution": [1, 1]},
            "shapes": [{"type": "rectangle", "emission": 1, "transform": [{"translate": [side, 0, 0]}]}],
            "medium": {"extinction": 1, "albedo": 0}
        });
        expect(&scene, 1 << 18, [0.5 * (-2.9957f64).exp(); 3]);
    }
}

/// What stands close to a lamp shades it, however far away it is lit from.
#[test]
fn a_lamp_in_a_closed_box_lights_nothing() {
    for height in [1, 100] {
        let lamp = json!({"shapes": [
            {"type": "sphere", "center": [0, height, 0], "radius": 0.05, "emission": 500},
            {"type": "cube", "material": "gray", "transform": [{"scale": 0.06}, {"translate": [0, height, 0]}]}
        ]});
        assert_eq!(picture_mean(&rendered(&floor(lamp), 64, 1)), [(0.0, 0.0); 3]);
    }
}

/// What a dark mirror shows is recorded however little light the path can still carry.
#[test]
fn roulette_leaves_features_beyond_mirrors_alone() {
    let mut scene =
        ball(json!({"type": "conductor", "eta": 0.01, "k": 1e4, "reflectance": 0.1}), white_sky());
    scene["integrator"] = json!({"roulette_depth": 1});
    scene["materials"]["wall"] = json!({"type": "diffuse", "reflectance": 0.5});
    scene["shapes"] = json!([
        {"type": "rectangle", "material": "m", "transform": [{"scale": 9}]},
        {"type": "rectangle", "material": "wall", "transform": [{"scale": 99}, {"translate": [0, 0, 5]}]}
    ]);
    let options = RenderOptions { features: FeatureMode::FirstRough, ..RenderOptions::default() };
    let frame = render(&parse(&scene), &options).unwrap().frame;
    let albedo = frame.features().iter().find(|feature| feature.name == "albedo").unwrap();
    assert!(albedo.planes[0].data().iter().all(|&value| value == 0.5));
}
