//! Properties of the whole denoiser on random pictures, through its public door.
//!
//! The random numbers are the same in every run. The size is 1 more than a multiple of the centres'
//! spacing, so that a mirrored picture has the mirrored grid of centres. Which centres the coverage
//! test adds depends on the order in which it goes over the pixels: mirrored runs do without it.

use apr::image::{Plane, Rgb};
use apr::options::{Kernel, OrderChoice, OutlierOptions};
use apr::{Aov, Denoised, Feature, FeatureKind, Frame, Options, denoise};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const SIZE: (usize, usize) = (25, 21);
const SIGMA: f32 = 0.1;

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(5), failure_persistence: None, ..Default::default() }
}

fn plane(f: impl Fn(usize, usize) -> f32) -> Plane {
    Plane::from_fn(SIZE.0, SIZE.1, f)
}

/// A plane of numbers from −½ to ½.
fn random_plane() -> impl Strategy<Value = Plane> {
    prop::collection::vec(-0.5f32..0.5, SIZE.0 * SIZE.1)
        .prop_map(|data| Plane::from_vec(SIZE.0, SIZE.1, data).unwrap())
}

/// Noise on a gradient with an edge, and a feature that knows the edge.
fn random_frame() -> impl Strategy<Value = Frame> {
    (prop::array::uniform3(random_plane()), random_plane(), 0.5f32..2.0, 0.0f32..0.05, 5usize..20).prop_map(
        |(noise, texture, step, slope, edge)| {
            let beyond = move |x: usize| if x > edge { step } else { 0.0 };
            let color: Rgb = std::array::from_fn(|c| {
                plane(|x, y| {
                    1.0 + beyond(x) + slope * (x + c * y) as f32 + SIGMA * 12f32.sqrt() * noise[c].get(x, y)
                })
            });
            let feature = plane(|x, y| beyond(x) + 0.1 * texture.get(x, y));
            frame(color, SIGMA * SIGMA, vec![feature])
        },
    )
}

fn frame(color: Rgb, variance: f32, features: Vec<Plane>) -> Frame {
    let (width, height) = color[0].size();
    let frame = Frame::new(color)
        .and_then(|f| {
            f.with_variance_of_mean(std::array::from_fn(|_| Plane::filled(width, height, variance)))
        })
        .unwrap();
    features.into_iter().fold(frame, |frame, feature| {
        frame.with_feature(Feature::new("feature", FeatureKind::Other, vec![feature])).unwrap()
    })
}

/// The frame with every plane changed alike: the colour by `color`, the features by `feature`.
fn mapped(from: &Frame, color: impl Fn(&Plane) -> Plane, feature: impl Fn(&Plane) -> Plane) -> Frame {
    let features = from.features().iter().map(|f| feature(&f.planes[0])).collect();
    frame(from.color().each_ref().map(color), SIGMA * SIGMA, features)
}

/// Largest difference of two results' colours.
fn difference(a: &[Plane], b: &[Plane]) -> f32 {
    let pairs = a.iter().zip(b).flat_map(|(a, b)| a.data().iter().zip(b.data()));
    pairs.fold(0.0, |largest, (a, b)| largest.max((a - b).abs()))
}

fn run(frame: &Frame, options: &Options) -> Denoised {
    denoise(frame, options).unwrap()
}

proptest! {
    #![proptest_config(config(16))]

    /// Without noise the model reproduces what it can express, over windows full of unlike pixels.
    #[test]
    fn a_polynomial_plus_features_is_reproduced(
        order in 0usize..4,
        beta in prop::array::uniform10(-0.3f32..0.3),
        alpha in prop::array::uniform2(-1.0f32..1.0),
        features in prop::array::uniform2(random_plane()),
        choice in prop::sample::select(&[OrderChoice::Hard, OrderChoice::Soft, OrderChoice::Shrink][..]),
    ) {
        let terms = [1, 3, 6, 10][order];
        let color: Rgb = std::array::from_fn(|c| plane(|x, y| {
            let (u, v) = (x as f32 / 12.0 - 1.0, y as f32 / 10.0 - 1.0);
            let monomials = [1.0, u, v, u * u, u * v, v * v, u * u * u, u * u * v, u * v * v, v * v * v];
            let smooth: f32 = monomials.iter().zip(&beta).take(terms).map(|(m, b)| m * b).sum();
            let detail: f32 = features.iter().zip(&alpha).map(|(f, a)| a * f.get(x, y)).sum();
            3.0 + c as f32 + smooth + detail
        }));
        let wide = vec![Kernel::by_color(1, 1e5)];
        let options = Options {
            max_order: order,
            order_choice: choice,
            stages: vec![wide.clone(), wide],
            ..Options::default()
        };
        let result = run(&frame(color.clone(), 1e-10, features.to_vec()), &options);
        prop_assert!(difference(&result.color, &color) < 1e-4, "{}", difference(&result.color, &color));
    }

    /// By what can be mirrored: a grid of centres that mirrors has no blocks of 2×2 pixels that do, and centres
    /// of the coverage test are found row by row.
    #[test]
    fn a_mirrored_picture_gives_the_mirrored_result(noisy in random_frame(), upright in any::<bool>()) {
        let (w, h) = SIZE;
        let flip = |p: &Plane| plane(|x, y| if upright { p.get(w - 1 - x, y) } else { p.get(x, h - 1 - y) });
        let options = Options { min_coverage: 0.0, coarse: false, ..Options::default() };
        let (plain, mirrored) = (run(&noisy, &options), run(&mapped(&noisy, flip, flip), &options));
        let difference = difference(&plain.color.each_ref().map(flip), &mirrored.color);
        prop_assert!(difference < 1e-3 * SIGMA, "{difference}");
    }

    /// By the order with the least risk: shrinking takes x before y.
    #[test]
    fn a_transposed_picture_gives_the_transposed_result(noisy in random_frame()) {
        let turn = |p: &Plane| Plane::from_fn(p.height(), p.width(), |x, y| p.get(y, x));
        let options = Options { min_coverage: 0.0, order_choice: OrderChoice::Hard, ..Options::default() };
        let (plain, turned) = (run(&noisy, &options), run(&mapped(&noisy, turn, turn), &options));
        let difference = difference(&plain.color.each_ref().map(turn), &turned.color);
        prop_assert!(difference < 1e-3 * SIGMA, "{difference}");
    }

    #[test]
    fn a_feature_in_other_units_changes_nothing(
        noisy in random_frame(), power in -40i32..40, factor in 1e-3f32..1e3, offset in -100.0f32..100.0,
    ) {
        let with = |f: &dyn Fn(f32) -> f32| {
            let changed = |p: &Plane| plane(|x, y| f(p.get(x, y)));
            run(&mapped(&noisy, Plane::clone, changed), &Options::default())
        };
        let plain = run(&noisy, &Options::default());
        let scale = (power as f32).exp2();
        prop_assert!(plain == with(&|v| v * scale), "a power of two changes no bit");
        // Rounded at its offset the feature itself is good to 1e-4 of its range.
        let affine = with(&|v| factor * (v + offset));
        prop_assert!(difference(&plain.color, &affine.color) < 0.01 * SIGMA);
    }

    #[test]
    fn radiance_times_a_power_of_two_is_the_result_times_it(noisy in random_frame(), power in -40i32..40) {
        let factor = (power as f32).exp2();
        let times = |p: &Plane, factor: f32| plane(|x, y| p.get(x, y) * factor);
        let scaled = noisy
            .clone()
            .with_variance_of_mean(std::array::from_fn(|_| plane(|_, _| SIGMA * SIGMA * factor * factor)))
            .unwrap();
        let scaled = Frame::new(noisy.color().each_ref().map(|p| times(p, factor)))
            .and_then(|f| f.with_variance_of_mean(scaled.color_var_of_mean().unwrap().clone()))
            .and_then(|f| f.with_feature(noisy.features()[0].clone()))
            .unwrap();
        let (plain, scaled) = (run(&noisy, &Options::default()), run(&scaled, &Options::default()));
        prop_assert!(plain.color.each_ref().map(|p| times(p, factor)) == scaled.color);
        prop_assert!(plain.mse.map(|mse| times(&mse, factor * factor)) == scaled.mse);
    }

    /// On a constant the fit neither adds nor takes light, so what the fireflies held must all be there. Small ones
    /// are to be taken out too, and few are to be enough.
    #[test]
    fn the_light_of_fireflies_is_kept(
        heights in prop::collection::vec(prop::array::uniform3(5.0f32..1e5), 1..20),
        places in prop::sample::subsequence((0..20).collect::<Vec<usize>>(), 20),
    ) {
        let place = |n: usize| (places[n] % 5 * 5 + 2, places[n] / 5 * 5 + 2);
        let mut color: Rgb = std::array::from_fn(|_| plane(|_, _| 1.0));
        let mut variance: Rgb = std::array::from_fn(|_| plane(|_, _| 1e-4));
        for (n, height) in heights.iter().enumerate() {
            let at = place(n).1 * SIZE.0 + place(n).0;
            for c in 0..3 {
                color[c].data_mut()[at] = height[c];
                variance[c].data_mut()[at] = height[c] * height[c];
            }
        }
        let noisy = Frame::new(color).and_then(|f| f.with_variance_of_mean(variance)).unwrap();
        let outliers = OutlierOptions { share: 0.0, witnesses: 1.0, ..OutlierOptions::default() };
        let result = run(&noisy, &Options { outliers, ..Options::default() });
        prop_assert_eq!(result.summary.outliers, heights.len());
        let sum = |p: &Plane| p.data().iter().map(|&v| f64::from(v)).sum::<f64>();
        for (before, after) in noisy.color().iter().zip(&result.color) {
            prop_assert!((sum(after) / sum(before) - 1.0).abs() < 1e-6, "{} {}", sum(before), sum(after));
        }
    }
}

/// The options that make most of small differences, as far as their ranges go.
fn sharpest() -> Options {
    let outliers =
        OutlierOptions { deviations: 0.0, share: 0.0, witnesses: 1.0, ..OutlierOptions::default() };
    Options { risk_power: 4.0, dark_level: 1e-3, albedo_floor: 1e-3, outliers, ..Options::default() }
}

/// Planes of any bits whatever, of one small size.
fn any_planes(count: usize) -> impl Strategy<Value = Vec<Plane>> {
    (1usize..13, 1usize..13).prop_flat_map(move |(width, height)| {
        let data = prop::collection::vec(prop::num::f32::ANY, width * height);
        let plane = data.prop_map(move |data| Plane::from_vec(width, height, data).unwrap());
        prop::collection::vec(plane, count)
    })
}

proptest! {
    #![proptest_config(config(200))]

    #[test]
    fn any_bits_give_a_finite_result(
        planes in any_planes(21),
        options in prop::sample::select(vec![Options::default(), Options::published(), sharpest()]),
        known in any::<bool>(),
    ) {
        let mut planes = planes.into_iter();
        let mut next = || -> Rgb { std::array::from_fn(|_| planes.next().unwrap()) };
        let mut noisy = Frame::new(next()).and_then(|f| f.with_halves([next(), next()])).unwrap();
        if known {
            noisy = noisy.with_variance_of_mean(next()).unwrap();
        }
        let mut albedo = Feature::new("albedo", FeatureKind::Albedo, next().to_vec());
        albedo.var_of_mean = Some(next().to_vec());
        let noisy = noisy
            .with_feature(albedo)
            .and_then(|f| f.with_aov(Aov { name: "diffuse".into(), color: next() }))
            .unwrap();
        let result = run(&noisy, &options);
        let finite = |planes: &[Plane]| planes.iter().flat_map(Plane::data).all(|v| v.is_finite());
        prop_assert!(finite(&result.color), "color");
        prop_assert!(finite(&result.aovs[0].color), "AOV");
        prop_assert!(finite(&[result.order]), "order");
        prop_assert!(result.mse.iter().flat_map(Plane::data).all(|v| v.is_finite() && *v >= 0.0), "mse");
    }
}
