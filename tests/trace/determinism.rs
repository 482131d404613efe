//! The same bits whatever the threads, the passes and the plan's other effects; sums that must agree.

use apr::image::Plane;
use apr::trace::{FeatureMode, RenderOptions, Renderer, Samples, Split, render};
use apr::{Frame, trace::Scene};
use serde_json::json;

use super::{parse, rendered, scenes, shipped};

/// Bits of everything in a frame.
fn bits(frame: &Frame) -> Vec<u32> {
    let mut planes: Vec<&Plane> = frame.color().iter().collect();
    planes.extend(frame.color_var_of_mean().into_iter().flatten());
    planes.extend(frame.halves().into_iter().flatten().flatten());
    for feature in frame.features() {
        planes.extend(&feature.planes);
        planes.extend(feature.var_of_mean.iter().flatten());
    }
    planes.iter().flat_map(|plane| plane.data()).map(|value| value.to_bits()).collect()
}

fn everything() -> RenderOptions {
    RenderOptions {
        spp: 6,
        seed: 5,
        features: FeatureMode::FirstRough,
        second_hit: true,
        light_groups: true,
        frame: None,
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    for name in ["lens_table", "fog_shaft", "motion_blur"] {
        let scene = parse(&shipped(name, [24, 17]));
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            bits(&pool.install(|| render(&scene, &everything())).unwrap().frame)
        };
        let one = on(1);
        assert_eq!(one, on(2), "{name} on 2 threads");
        assert_eq!(one, on(8), "{name} on 8 threads");
    }
}

#[test]
fn passes_checkpoints_and_maps_give_the_bits_of_one_pass() {
    let scene = parse(&shipped("glossy_gallery", [20, 15]));
    let whole = bits(&render(&scene, &everything()).unwrap().frame);

    let mut first = Renderer::new(&scene, &everything()).unwrap();
    first.pass(Samples::Uniform(1)).unwrap();
    first.pass(Samples::Map(&[2; 20 * 15])).unwrap();
    let kept = first.film().to_bytes();
    let mut second = Renderer::new(&scene, &everything()).unwrap();
    second.film_mut().restore(&kept).unwrap();
    second.pass(Samples::Uniform(3)).unwrap();
    assert_eq!(bits(&second.finish().unwrap().frame), whole);

    let error = second.film_mut().restore(&kept[1..]).unwrap_err();
    assert!(error.to_string().contains("bytes"), "{error}");
}

#[test]
fn a_map_gives_each_pixel_its_own_number_of_samples() {
    let scene = parse(&shipped("cornell_box", [6, 4]));
    let counts: Vec<u32> = (0..24).map(|i| i % 5).collect();
    let mut renderer = Renderer::new(&scene, &RenderOptions::default()).unwrap();
    renderer.pass(Samples::Map(&counts)).unwrap();
    let some = renderer.finish().unwrap();
    assert_eq!(some.samples, counts.iter().map(|&n| u64::from(n)).sum::<u64>());
    let of_four = rendered(&shipped("cornell_box", [6, 4]), 4, 0);
    let [r, variance] =
        [some.frame.color(), some.frame.color_var_of_mean().unwrap()].map(|rgb| rgb[0].data());
    for (pixel, &count) in counts.iter().enumerate() {
        match count {
            0 => assert!(r[pixel].is_nan()),
            1 => assert!(r[pixel].is_finite() && variance[pixel].is_nan()),
            4 => assert_eq!(r[pixel].to_bits(), of_four.frame.color()[0].data()[pixel].to_bits()),
            _ => assert!(r[pixel].is_finite() && variance[pixel].is_finite()),
        }
    }
    assert!(renderer.pass(Samples::Map(&counts[1..])).is_err());
}

#[test]
fn a_crop_shows_the_bits_of_the_whole() {
    let whole = rendered(&shipped("textured_room", [24, 18]), 4, 2);
    let mut scene = shipped("textured_room", [24, 18]);
    scene["camera"]["crop"] = json!([7, 5, 9, 8]);
    let crop = rendered(&scene, 4, 2);
    let rect = apr::image::Rect { x: 7, y: 5, width: 9, height: 8 };
    assert_eq!(crop.frame.color()[1], whole.frame.color()[1].crop(rect));
}

/// An effect that nothing in the picture shows leaves the picture as it is, though the plan has it.
#[test]
fn effects_out_of_sight_change_no_bit() {
    let plain = shipped("cornell_box", [24, 18]);
    let before = rendered(&plain, 4, 3);
    let used = |rendered: &apr::trace::Rendered, name: &str| {
        rendered.plan.effects.iter().any(|effect| effect.name == name && effect.used)
    };
    // Behind the back wall, where no path can get.
    let hidden = json!({"type": "sphere", "center": [0, 0, -4], "radius": 0.2, "material": "white",
                        "motion": [{"translate": [1, 0, 0]}]});
    let mut moving = plain.clone();
    moving["shapes"].as_array_mut().unwrap().push(hidden);
    let after = rendered(&moving, 4, 3);
    assert!(used(&after, "motion blur") && !used(&before, "motion blur"));
    assert_eq!(bits(&before.frame), bits(&after.frame));

    let mut glossy = plain.clone();
    glossy["materials"]["unused"] = json!({"type": "conductor", "metal": "gold", "roughness": 0.3});
    glossy["medium"] =
        json!({"extinction": 1, "albedo": 0.5, "bounds": {"min": [8, 8, 8], "max": [9, 9, 9]}});
    let after = rendered(&glossy, 4, 3);
    assert!(used(&after, "glossy") && used(&after, "medium"));
    assert_eq!(bits(&before.frame), bits(&after.frame));
}

#[test]
fn the_hierarchys_split_changes_no_bit() {
    let text = shipped("teapot_diffuse", [24, 18]).to_string();
    let with = |split| {
        let scene = Scene::parse_with(&text, &scenes(), split).unwrap();
        bits(&render(&scene, &RenderOptions { spp: 4, ..RenderOptions::default() }).unwrap().frame)
    };
    assert_eq!(with(Split::Sah), with(Split::Median));
}

#[test]
fn light_groups_sum_to_the_colour() {
    let mut scene = shipped("glossy_gallery", [16, 12]);
    let mut number = 0;
    for shape in scene["shapes"].as_array_mut().unwrap() {
        if shape.get("emission").is_some() {
            number += 1;
            shape["group"] = json!(format!("lamp{number}"));
        }
    }
    let frame = render(&parse(&scene), &everything()).unwrap().frame;
    assert_eq!(frame.aovs().iter().map(|aov| aov.name.as_str()).collect::<Vec<_>>(), ["lamp1", "lamp2"]);
    for channel in 0..3 {
        for (pixel, &color) in frame.color()[channel].data().iter().enumerate() {
            let sum: f32 = frame.aovs().iter().map(|aov| aov.color[channel].data()[pixel]).sum();
            assert!((sum - color).abs() <= 2e-6 * color.abs().max(1e-3), "{sum} {color}");
        }
    }
}

#[test]
fn variance_of_the_mean_is_the_spread_between_seeds_and_halves_average_to_the_mean() {
    const SEEDS: u64 = 48;
    let scene = shipped("teapot_diffuse", [12, 9]);
    let frames: Vec<Frame> = (0..SEEDS).map(|seed| rendered(&scene, 8, seed).frame).collect();
    let (mut told, mut spread) = (0.0, 0.0);
    for pixel in 0..12 * 9 {
        let values: Vec<f64> = frames.iter().map(|f| f64::from(f.color()[1].data()[pixel])).collect();
        let mean = values.iter().sum::<f64>() / SEEDS as f64;
        spread += values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (SEEDS - 1) as f64;
        let variances = frames.iter().map(|f| f64::from(f.color_var_of_mean().unwrap()[1].data()[pixel]));
        told += variances.sum::<f64>() / SEEDS as f64;
        let [a, b] = frames[0].halves().unwrap();
        let half_sum = (a[1].data()[pixel] + b[1].data()[pixel]) / 2.0;
        assert!((half_sum - frames[0].color()[1].data()[pixel]).abs() <= 1e-5 * half_sum.abs());
    }
    assert!((told / spread - 1.0).abs() < 0.1, "told {told}, spread {spread}");
}

#[test]
fn a_constant_feature_is_flagged() {
    let scene = json!({
        "camera": {"origin": [0, 0, 3], "target": [0, 0, 0], "fov": 30, "resolution": [8, 6]},
        "materials": {"gray": {"type": "diffuse", "reflectance": 0.5}},
        "shapes": [{"type": "rectangle", "material": "gray", "transform": [{"scale": 9}]}],
        "environment": {"type": "constant", "radiance": 1}
    });
    assert_eq!(rendered(&scene, 2, 0).constant_features, ["albedo", "normal"]);
}
