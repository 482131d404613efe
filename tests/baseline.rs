//! The baselines on cases whose result is known, through the library's public door.

use apr::baseline::{Denoiser, Method, lp, nfor, nlm, student, wavelet};
use apr::denoise::Silent;
use apr::image::{Plane, Rgb};
use apr::{Aov, Denoised, Feature, FeatureKind, Frame};

const SIZE: (usize, usize) = (61, 45);

/// Uniform numbers from −½ to ½.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32 - 0.5
    }

    /// Nearly Gaussian, of unit variance.
    fn normal(&mut self) -> f32 {
        (0..12).map(|_| self.next()).sum()
    }
}

fn rgb(f: impl Fn(usize, usize, usize) -> f32) -> Rgb {
    std::array::from_fn(|c| Plane::from_fn(SIZE.0, SIZE.1, |x, y| f(c, x, y)))
}

fn texture(x: usize, y: usize) -> f32 {
    ((x * 7 + y * 11) % 5) as f32 / 4.0
}

/// First order in position and in the one feature.
fn truth(c: usize, x: usize, y: usize) -> f32 {
    1.0 + 0.2 * c as f32 + 0.01 * x as f32 - 0.005 * y as f32 + 0.5 * texture(x, y)
}

/// `truth` with noise of deviation `sigma`, two halves, a feature, and an AOV that is half of the mean.
fn frame(sigma: f32, seed: u64) -> Frame {
    let mut random = Random(seed);
    let halves: [Rgb; 2] = std::array::from_fn(|_| {
        let mut half = rgb(truth);
        let noise = sigma * 2f32.sqrt();
        half.iter_mut().flat_map(|p| p.data_mut()).for_each(|v| *v += noise * random.normal());
        half
    });
    let color = rgb(|c, x, y| 0.5 * (halves[0][c].get(x, y) + halves[1][c].get(x, y)));
    let part = rgb(|c, x, y| 0.5 * color[c].get(x, y));
    let feature = Plane::from_fn(SIZE.0, SIZE.1, texture);
    Frame::new(color)
        .and_then(|f| f.with_variance_of_mean(rgb(|_, _, _| sigma * sigma)))
        .and_then(|f| f.with_halves(halves))
        .and_then(|f| f.with_feature(Feature::new("texture", FeatureKind::Other, vec![feature])))
        .and_then(|f| f.with_aov(Aov { name: "part".into(), color: part }))
        .unwrap()
}

fn mse(result: &Rgb, truth: impl Fn(usize, usize, usize) -> f32) -> f64 {
    let error = rgb(|c, x, y| (result[c].get(x, y) - truth(c, x, y)).powi(2));
    error.iter().flat_map(Plane::data).map(|&e| f64::from(e)).sum::<f64>() / (3 * SIZE.0 * SIZE.1) as f64
}

fn run(method: Method, frame: &Frame) -> Denoised {
    Denoiser::new(method).denoise(frame, &Silent).unwrap()
}

#[test]
fn every_method_names_itself_and_keeps_a_constant() {
    let flat = rgb(|c, _, _| 0.25 + c as f32);
    let frame = Frame::new(flat.clone())
        .and_then(|f| f.with_variance_of_mean(rgb(|_, _, _| 1e-3)))
        .and_then(|f| f.with_halves([flat.clone(), flat]))
        .unwrap();
    for (name, method) in Method::NAMES {
        let result = run(method, &frame);
        assert_eq!(result.summary.method, name);
        assert_eq!(method.name(), name);
        for (c, plane) in result.color.iter().enumerate() {
            let expected = 0.25 + c as f32;
            assert!(plane.data().iter().all(|v| (v / expected - 1.0).abs() < 1e-5), "{name}");
        }
    }
}

#[test]
fn every_method_denoises_and_its_aov_is_the_half_that_it_was() {
    let frame = frame(0.1, 1);
    for (name, method) in Method::NAMES {
        let result = run(method, &frame);
        let error = mse(&result.color, truth);
        // Soft thresholds cost a one-pixel texture as much as they take out of the noise: 0.0098 measured.
        // The student's windows leave pixels that resemble no centre as noisy as they were: 0.0081.
        let most = if matches!(method, Method::Wavelet | Method::Student) { 0.01 } else { 0.01 / 1.5 };
        assert!(error < most, "{name}: mean squared error {error} of a noise of 0.01");
        // Methods that filter the halves by different weights do not keep sums exactly.
        let tolerance = if matches!(method, Method::Nlm | Method::Nfor) { 0.3 } else { 1e-4 };
        for (part, whole) in result.aovs[0].color.iter().zip(&result.color) {
            let pairs = part.data().iter().zip(whole.data());
            let worst = pairs.fold(0.0f32, |most, (p, w)| most.max((p - 0.5 * w).abs()));
            assert!(worst < tolerance, "{name}: off by {worst}");
        }
    }
}

#[test]
fn the_bits_do_not_depend_on_the_threads() {
    let frame = frame(0.1, 2);
    for (name, method) in Method::NAMES {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run(method, &frame))
        };
        assert!(on(1) == on(8), "{name}");
    }
}

#[test]
fn whatever_comes_in_what_goes_out_is_finite() {
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1e30, 1e30, 1e-42, -5.0, 0.0];
    let mut random = Random(11);
    let mut spoil = |plane: &mut Plane| {
        for value in plane.data_mut() {
            if random.next() > 0.3 {
                *value = bad[((random.next() + 0.5) * bad.len() as f32) as usize % bad.len()];
            }
        }
    };
    let good = frame(0.1, 3);
    let (mut color, mut variance) = (good.color().clone(), good.color_var_of_mean().unwrap().clone());
    let (mut halves, mut feature) = (good.halves().unwrap().clone(), good.features()[0].clone());
    feature.var_of_mean = Some(feature.planes.clone());
    color.iter_mut().chain(&mut variance).chain(halves.iter_mut().flatten()).for_each(&mut spoil);
    feature.planes.iter_mut().chain(feature.var_of_mean.iter_mut().flatten()).for_each(&mut spoil);
    let bare = Frame::new(color).and_then(|f| f.with_variance_of_mean(variance)).unwrap();
    let full = bare.clone().with_halves(halves).and_then(|f| f.with_feature(feature)).unwrap();
    for (name, method) in Method::NAMES {
        for frame in [&bare, &full] {
            let result = run(method, frame);
            assert!(result.color.iter().flat_map(Plane::data).all(|v| v.is_finite()), "{name}");
            let more = result.sampling_priority.iter().chain(&result.mse);
            assert!(more.flat_map(Plane::data).all(|v| v.is_finite() && *v >= 0.0), "{name}");
            assert!(result.summary.repaired_color > 0, "{name}");
        }
    }
}

#[test]
fn pictures_of_a_pixel_a_row_and_a_column_pass() {
    for (width, height) in [(1, 1), (1, 40), (40, 1), (2, 2)] {
        let color: Rgb =
            std::array::from_fn(|_| Plane::from_fn(width, height, |x, y| 1.0 + 0.1 * ((x + y) % 3) as f32));
        let frame = Frame::new(color.clone()).and_then(|f| f.with_halves([color.clone(), color])).unwrap();
        for (name, method) in Method::NAMES {
            let result = run(method, &frame);
            let values = result.color.iter().flat_map(Plane::data);
            assert!({ values }.all(|v| (0.9..1.3).contains(v)), "{name}, {width}×{height}");
        }
    }
}

/// Two flat regions: with patches of one pixel the weight across the edge is exp(−Δ²/k²), and a pixel is the
/// mean of its window.
#[test]
fn nlm_of_two_flat_regions_is_the_closed_form() {
    const VARIANCE: f32 = 0.01;
    // The edge lies at x = 30; the picture's typical radiance is near 1, so that nothing is exposed.
    let (left, right) = (1.0, 1.15f32);
    let flat = rgb(|_, x, _| if x < 30 { left } else { right });
    let frame = Frame::new(flat).and_then(|f| f.with_variance_of_mean(rgb(|_, _, _| VARIANCE))).unwrap();
    let options = nlm::Options { patch_radius: 0, window_radius: 4, ..nlm::Options::default() };
    let result = nlm::denoise(&frame, &options).unwrap();
    let k2 = options.bandwidth.powi(2);
    let weight = (-((right - left).powi(2) - 2.0 * VARIANCE) / (2.0 * VARIANCE * k2)).exp();
    assert!(weight > options.threshold);
    for x in [20, 26, 28, 29] {
        let far = (x + 5).max(30) as f32 - 30.0;
        let expected = ((9.0 - far) * left + far * weight * right) / (9.0 - far + far * weight);
        let got = result.color[1].get(x, 20);
        assert!((got - expected).abs() < 1e-5, "{x}: {got} against {expected}");
    }
    // Without halves the method has no estimate, and says so.
    assert!(result.mse.is_none() && result.sampling_priority.is_none());
    assert!(result.summary.notes.iter().any(|note| note.contains("no estimate")));
}

#[test]
fn nlm_knows_from_its_halves_where_it_errs() {
    let mut random = Random(5);
    // Noise in the right half of a flat picture, none in the left.
    let halves: [Rgb; 2] = std::array::from_fn(|_| {
        let mut half = rgb(|_, _, _| 1.0);
        for plane in &mut half {
            let width = plane.width();
            let values = plane.data_mut().iter_mut().enumerate();
            values.filter(|(i, _)| i % width > 30).for_each(|(_, v)| *v += 0.3 * random.normal());
        }
        half
    });
    let color = rgb(|c, x, y| 0.5 * (halves[0][c].get(x, y) + halves[1][c].get(x, y)));
    let variance = rgb(|_, x, _| if x > 30 { 0.045 } else { 0.0 });
    let frame = Frame::new(color)
        .and_then(|f| f.with_variance_of_mean(variance))
        .and_then(|f| f.with_halves(halves))
        .unwrap();
    let result = nlm::denoise(&frame, &nlm::Options::default()).unwrap();
    let map = result.sampling_priority.unwrap();
    assert!(map.get(5, 20) < 1e-3 * map.get(50, 20));
    let mse = result.mse.unwrap();
    let estimate = (40..61).flat_map(|x| (0..45).map(move |y| (x, y))).map(|(x, y)| mse.get(x, y));
    let truth = (40..61).flat_map(|x| (0..45).map(move |y| (x, y)));
    let truth =
        truth.map(|(x, y)| (0..3).map(|c| (result.color[c].get(x, y) - 1.0).powi(2)).sum::<f32>() / 3.0);
    let ratio = estimate.sum::<f32>() / truth.sum::<f32>();
    assert!((0.3..3.0).contains(&ratio), "estimated over true {ratio}");
}

#[test]
fn regressions_reproduce_first_order_functions_without_noise() {
    let frame = frame(0.0, 6);
    for (name, method) in [("lp", Method::Lp), ("nfor", Method::Nfor)] {
        let error = mse(&run(method, &frame).color, truth).sqrt();
        assert!(error < 1e-4, "{name}: {error}");
    }
}

#[test]
fn regressions_of_a_first_order_function_leave_little_noise() {
    let frame = frame(0.1, 7);
    let options = lp::Options { window_radius: 9, ..lp::Options::default() };
    for result in
        [lp::denoise(&frame, &options).unwrap(), nfor::denoise(&frame, &nfor::Options::default()).unwrap()]
    {
        let error = mse(&result.color, truth);
        assert!(error < 0.01 / 10.0, "{}: {error}", result.summary.method);
        assert_eq!(result.summary.columns, ["texture.0"]);
    }
}

#[test]
fn wavelets_without_a_threshold_or_noise_change_nothing() {
    let options = wavelet::Options { deviations: 0.0, ..wavelet::Options::default() };
    for (frame, options) in [(frame(0.1, 8), options), (frame(0.0, 8), wavelet::Options::default())] {
        let result = wavelet::denoise(&frame, &options).unwrap();
        for (a, b) in result.color.iter().zip(frame.color()) {
            assert!(a.data().iter().zip(b.data()).all(|(a, b)| (a - b).abs() < 1e-5));
        }
    }
}

/// Of Gaussian noise of unit variance a soft threshold of one deviation leaves
/// 2 ((1 + 1)(1 − Φ(1)) − φ(1)) = 0.151; of five levels one coefficient in 1024 stays whole, and the 9/7
/// wavelets are orthonormal to a few per cent.
#[test]
fn wavelets_leave_the_expected_share_of_pure_noise() {
    let mut random = Random(9);
    let mut color = rgb(|_, _, _| 1.0);
    color.iter_mut().flat_map(|p| p.data_mut()).for_each(|v| *v += 0.1 * random.normal());
    let frame = Frame::new(color).and_then(|f| f.with_variance_of_mean(rgb(|_, _, _| 0.01))).unwrap();
    let result = wavelet::denoise(&frame, &wavelet::Options::default()).unwrap();
    let share = mse(&result.color, |_, _, _| 1.0) / 0.01;
    assert!((0.13..0.19).contains(&share), "{share}");
    // Pure noise of one variance: no pixel is more urgent than another by much.
    let map = result.sampling_priority.unwrap();
    assert!(map.data().iter().all(|v| (0.005..0.03).contains(v)));
}

/// Centres lie in the middle of cells of 15×15: a lone pixel that resembles no centre stays as it is, and
/// pixels of flat cells take their cell's fit.
#[test]
fn the_student_leaves_what_resembles_no_centre() {
    let (lone, centre) = ((10, 10), (37, 22));
    let color = rgb(|_, x, y| if (x, y) == lone { 30.0 } else { 1.0 + 0.02 * ((x * 5 + y * 3) % 7) as f32 });
    let frame = Frame::new(color.clone()).and_then(|f| f.with_variance_of_mean(rgb(|_, _, _| 1e-2))).unwrap();
    let result = run(Method::Student, &frame);
    assert_eq!(result.color[0].get(lone.0, lone.1), 30.0);
    assert_ne!(result.color[0].get(centre.0, centre.1), color[0].get(centre.0, centre.1));
    assert_eq!((result.summary.centres, result.summary.coverage_centres), (4 * 3, 0));
    assert_eq!(result.summary.outliers, 0);
    // A residual never grows with the order: every centre takes the highest, but the one whose patch holds
    // the lone pixel, which nothing resembles.
    assert_eq!(result.summary.orders, [1, 0, 0, 4 * 3 - 1]);
    assert_eq!(Denoiser::new(Method::Student), Denoiser::Student(student::options()));
}

#[test]
fn an_option_out_of_range_is_named() {
    let error = nlm::Options { bandwidth: f32::NAN, ..nlm::Options::default() }.check().unwrap_err();
    assert!(error.to_string().contains("'bandwidth' is NaN"), "{error}");
    for (name, method) in Method::NAMES {
        assert_eq!(Denoiser::new(method).check(), Ok(()), "{name}");
        let options = serde_json::to_value(Denoiser::new(method)).unwrap();
        assert_eq!(Denoiser::deserialize(method, options).unwrap(), Denoiser::new(method));
        assert!(Denoiser::deserialize(method, serde_json::json!({ "windou": 3 })).is_err());
    }
}
