//! Identities of the whole denoiser, through its public door.

use apr::denoise::{Stage, denoise_observed};
use apr::image::{Plane, Rgb};
use apr::options::OrderChoice;
use apr::{Aov, Denoised, ErrorKind, Feature, FeatureKind, Frame, Observer, Options, denoise};
use std::sync::Mutex;

const SIZE: (usize, usize) = (53, 37);

/// Uniform numbers from −½ to ½.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32 - 0.5
    }
}

fn plane(f: impl Fn(usize, usize) -> f32) -> Plane {
    Plane::from_fn(SIZE.0, SIZE.1, f)
}

fn rgb(f: impl Fn(usize, usize, usize) -> f32) -> Rgb {
    std::array::from_fn(|c| plane(|x, y| f(c, x, y)))
}

/// Two surfaces that meet in an edge, textured, lit by a gradient.
fn truth(c: usize, x: usize, y: usize) -> f32 {
    let light = 0.5 + 0.01 * x as f32 + 0.005 * y as f32;
    let albedo = if x > 26 {
        [0.2, 0.5, 0.8][c]
    } else if (x / 4 + y / 4).is_multiple_of(2) {
        0.9
    } else {
        0.3
    };
    light * albedo
}

fn noisy(sigma: f32, seed: u64) -> Frame {
    let mut random = Random(seed);
    let mut values = rgb(truth);
    for plane in &mut values {
        plane.data_mut().iter_mut().for_each(|v| *v += sigma * 12f32.sqrt() * random.next());
    }
    let albedo: Rgb = rgb(|c, x, y| truth(c, x, y) / (0.5 + 0.01 * x as f32 + 0.005 * y as f32));
    Frame::new(values)
        .and_then(|frame| frame.with_variance_of_mean(rgb(|_, _, _| sigma * sigma)))
        .and_then(|frame| frame.with_feature(Feature::new("albedo", FeatureKind::Albedo, albedo.to_vec())))
        .unwrap()
}

fn mse(result: &Rgb) -> f64 {
    let mut sum = 0.0;
    for (c, plane) in result.iter().enumerate() {
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                sum += f64::from(plane.get(x, y) - truth(c, x, y)).powi(2);
            }
        }
    }
    sum / (3 * SIZE.0 * SIZE.1) as f64
}

#[test]
fn noise_falls_by_much_and_the_estimated_error_is_of_the_true_ones_size() {
    let result = denoise(noisy(0.1, 1), &Options::default()).unwrap();
    let error = mse(&result.color);
    assert!(error < 0.01 / 6.0, "mean squared error {error} of a noise of 0.01");
    let estimates = result.mse.iter().flat_map(Plane::data).map(|&v| f64::from(v));
    let estimate = estimates.sum::<f64>() / (SIZE.0 * SIZE.1) as f64;
    // It is the average of the single fits' risks; their overlap average is better than each.
    assert!((0.5..10.0).contains(&(estimate / error)), "estimated {estimate}, true {error}");
}

/// Of a row of pixels that the rim of a lamp goes through, samples tell both how much of a pixel the lamp takes and how
/// deep it is: on a slope the one's noise is the other's.
#[test]
fn the_rim_of_a_lamp_does_not_keep_the_noise_that_its_depth_shares() {
    const RIM: usize = 20;
    const SAMPLES: usize = 16;
    let mut random = Random(5);
    // Where a pixel's samples fall, from its upper edge.
    let heights: Vec<[f32; SAMPLES]> =
        (0..SIZE.0 * SIZE.1).map(|_| std::array::from_fn(|_| random.next() + 0.5)).collect();
    let moments = |x: usize, y: usize, of: &dyn Fn(f32) -> f32| {
        let values = heights[y * SIZE.0 + x].map(|height| of(y as f32 + height));
        let mean = values.iter().sum::<f32>() / SAMPLES as f32;
        let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f32>();
        (mean, square / (SAMPLES * (SAMPLES - 1)) as f32)
    };
    let light = |height: f32| if height < RIM as f32 + 0.3 { 10.0 } else { 0.1 };
    let depth = |height: f32| 4.0 + 0.1 * height;
    let feature = Feature::new("depth", FeatureKind::Depth, vec![plane(|x, y| moments(x, y, &depth).0)])
        .with_variance_of_mean(vec![plane(|x, y| moments(x, y, &depth).1)]);
    let frame = Frame::new(rgb(|_, x, y| moments(x, y, &light).0))
        .and_then(|frame| frame.with_variance_of_mean(rgb(|_, x, y| moments(x, y, &light).1)))
        .and_then(|frame| frame.with_feature(feature))
        .unwrap();
    let rim = |picture: &Rgb| {
        let row = &picture[1].row(RIM)[8..SIZE.0 - 8];
        row.iter().map(|v| f64::from(v - 3.07).powi(2)).sum::<f64>() / row.len() as f64
    };
    let denoised = denoise(&frame, &Options::default()).unwrap();
    let (before, after) = (rim(frame.color()), rim(&denoised.color));
    assert!(after < 0.15 * before, "{after} of {before}");
}

#[test]
fn every_way_of_choosing_the_order_denoises() {
    for order_choice in [OrderChoice::Hard, OrderChoice::Soft, OrderChoice::Shrink, OrderChoice::Residual] {
        let options = Options { order_choice, ..Options::default() };
        assert!(mse(&denoise(noisy(0.1, 2), &options).unwrap().color) < 0.01 / 4.0, "{order_choice:?}");
    }
    assert!(mse(&denoise(noisy(0.1, 3), &Options::published()).unwrap().color) < 0.01 / 4.0);
}

#[test]
fn a_constant_stays_constant_and_no_noise_means_no_change() {
    let flat = |variance: f32| {
        Frame::new(rgb(|c, _, _| 0.25 + c as f32))
            .and_then(|frame| frame.with_variance_of_mean(rgb(|_, _, _| variance)))
            .unwrap()
    };
    for variance in [1e-3, 0.0] {
        let result = denoise(flat(variance), &Options::default()).unwrap();
        for (c, plane) in result.color.iter().enumerate() {
            let expected = 0.25 + c as f32;
            assert!(plane.data().iter().all(|v| (v / expected - 1.0).abs() < 1e-5), "variance {variance}");
        }
    }
}

#[test]
fn what_sums_before_sums_after() {
    let frame = noisy(0.1, 4);
    let mut random = Random(9);
    let shares = plane(|_, _| 0.0);
    let part: Rgb = std::array::from_fn(|c| {
        let mut plane = shares.clone();
        for (value, total) in plane.data_mut().iter_mut().zip(frame.color()[c].data()) {
            *value = total * (0.5 + random.next());
        }
        plane
    });
    let rest: Rgb = std::array::from_fn(|c| plane(|x, y| frame.color()[c].get(x, y) - part[c].get(x, y)));
    let alone = denoise(&frame, &Options::default()).unwrap();
    let frame = frame
        .with_aov(Aov { name: "diffuse".into(), color: part })
        .and_then(|frame| frame.with_aov(Aov { name: "rest".into(), color: rest }))
        .unwrap();
    let result = denoise(&frame, &Options::default()).unwrap();
    for (a, b) in alone.color.iter().flat_map(Plane::data).zip(result.color.iter().flat_map(Plane::data)) {
        assert_eq!(a, b, "AOVs must not change the beauty");
    }
    for c in 0..3 {
        for (i, total) in result.color[c].data().iter().enumerate() {
            let sum = result.aovs[0].color[c].data()[i] + result.aovs[1].color[c].data()[i];
            assert!((sum - total).abs() < 1e-5, "channel {c}, pixel {i}: {sum} against {total}");
        }
    }
}

#[test]
fn the_bits_do_not_depend_on_the_threads() {
    let frame = noisy(0.1, 5);
    let on = |threads: usize| -> Denoised {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| denoise(&frame, &Options::default()).unwrap())
    };
    let one = on(1);
    assert!(one == on(2) && one == on(8));
}

#[test]
fn radiance_scaled_by_a_power_of_two_scales_the_result_bit_for_bit() {
    let frame = noisy(0.1, 6);
    let scaled = |factor: f32| {
        let times = |planes: &Rgb, factor: f32| -> Rgb {
            std::array::from_fn(|c| plane(|x, y| planes[c].get(x, y) * factor))
        };
        Frame::new(times(frame.color(), factor))
            .and_then(|f| f.with_variance_of_mean(times(frame.color_var_of_mean().unwrap(), factor * factor)))
            .and_then(|f| f.with_feature(frame.features()[0].clone()))
            .unwrap()
    };
    let plain = denoise(&frame, &Options::default()).unwrap();
    for factor in [0.125, 1024.0] {
        let result = denoise(scaled(factor), &Options::default()).unwrap();
        for (a, b) in plain.color.iter().flat_map(Plane::data).zip(result.color.iter().flat_map(Plane::data))
        {
            assert_eq!(a * factor, *b);
        }
    }
}

#[test]
fn whatever_comes_in_what_goes_out_is_finite() {
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1e30, 1e30, 1e-30, 1e-42, -5.0, 0.0];
    let mut random = Random(11);
    let mut spoil = |plane: &mut Plane| {
        for value in plane.data_mut() {
            if random.next() > 0.3 {
                *value = bad[((random.next() + 0.5) * bad.len() as f32) as usize % bad.len()];
            }
        }
    };
    let frame = noisy(0.1, 7);
    let (mut color, mut variance) = (frame.color().clone(), frame.color_var_of_mean().unwrap().clone());
    let mut feature = frame.features()[0].clone();
    color.iter_mut().chain(&mut variance).chain(&mut feature.planes).for_each(&mut spoil);
    let mut noise = feature.planes.clone();
    noise.iter_mut().for_each(spoil);
    feature.var_of_mean = Some(noise);
    let frame = Frame::new(color)
        .and_then(|frame| frame.with_variance_of_mean(variance))
        .and_then(|frame| frame.with_feature(feature))
        .unwrap();
    for options in [Options::default(), Options::published()] {
        let result = denoise(&frame, &options).unwrap();
        assert!(result.color.iter().flat_map(Plane::data).all(|v| v.is_finite()));
        assert!(result.mse.iter().flat_map(Plane::data).all(|v| v.is_finite() && *v >= 0.0));
        assert!(result.summary.repaired_color > 0 && result.summary.repaired_features > 0);
    }
}

#[test]
fn a_value_beyond_all_measure_costs_no_more_than_nan() {
    let spoilt = |layer: usize, value: f32| {
        let frame = noisy(0.1, 4);
        let color = frame.color().clone();
        let mut layers = [color.clone(), color.clone(), color];
        layers[layer][1].data_mut()[20 * SIZE.0 + 30] = value;
        let [color, half, aov] = layers;
        let features = frame.features().to_vec();
        let frame = Frame::new(color)
            .and_then(|f| f.with_variance_of_mean(frame.color_var_of_mean().unwrap().clone()))
            .and_then(|f| f.with_halves([half.clone(), half]))
            .and_then(|f| f.with_aov(Aov { name: "key".into(), color: aov }));
        let frame = features.into_iter().fold(frame.unwrap(), |f, feature| f.with_feature(feature).unwrap());
        denoise(frame, &Options::default()).unwrap()
    };
    for layer in 0..3 {
        let broken = spoilt(layer, f32::NAN);
        let repaired = |s: &apr::Summary| [s.repaired_color, s.repaired_halves, s.repaired_aovs];
        assert_eq!(repaired(&broken.summary), std::array::from_fn(|n| usize::from(n == layer)));
        for value in [1e29, -1e31] {
            assert!(spoilt(layer, value) == broken, "{value} in layer {layer}");
        }
    }
}

#[test]
fn pictures_of_a_pixel_a_row_and_a_column_pass() {
    for (width, height) in [(1, 1), (1, 40), (40, 1), (2, 2), (3, 17)] {
        let mut random = Random(3);
        let mut draw = |scale: f32| Plane::from_fn(width, height, |_, _| 1.0 + scale * random.next());
        let color: Rgb = std::array::from_fn(|_| draw(0.2));
        let frame = Frame::new(color).unwrap();
        let result = denoise(&frame, &Options::default()).unwrap();
        assert!(
            result.color.iter().flat_map(Plane::data).all(|v| (0.5..1.5).contains(v)),
            "{width}×{height}"
        );
    }
}

#[test]
fn missing_variance_is_had_from_halves_or_the_picture_and_noted() {
    let frame = noisy(0.1, 8);
    let bare = Frame::new(frame.color().clone()).unwrap();
    let result = denoise(&bare, &Options::default()).unwrap();
    assert!(result.summary.notes.iter().any(|note| note.contains("from the picture")));
    assert!(mse(&result.color) < 0.01);
    let (a, b) = (noisy(0.1, 21), noisy(0.1, 22));
    let both = rgb(|c, x, y| 0.5 * (a.color()[c].get(x, y) + b.color()[c].get(x, y)));
    let frame = Frame::new(both)
        .and_then(|frame| frame.with_halves([a.color().clone(), b.color().clone()]))
        .and_then(|frame| frame.with_feature(a.features()[0].clone()))
        .unwrap();
    let result = denoise(&frame, &Options::default()).unwrap();
    assert!(result.summary.notes.iter().any(|note| note.contains("half buffers")));
    assert!(mse(&result.color) < 0.005 / 3.0);
}

#[test]
fn a_frame_that_is_given_away_comes_out_the_same() {
    // With all that is copied and repaired where it is lent: halves, broken pixels, a feature of no use, an AOV.
    let [mut color, half] = [noisy(0.1, 8), noisy(0.1, 9)].map(|frame| frame.color().clone());
    color[1].data_mut()[77] = f32::NAN;
    let other = rgb(|c, x, y| 2.0 * color[c].get(x, y) - half[c].get(x, y));
    let mut depth = plane(|x, y| (x + y) as f32);
    depth.data_mut()[3] = f32::INFINITY;
    let depth = Feature {
        var_of_mean: Some(vec![plane(|x, _| 0.1 * (x % 2) as f32)]),
        ..Feature::new("depth", FeatureKind::Depth, vec![depth])
    };
    let position = rgb(|_, x, y| (x * y) as f32).to_vec();
    let frame = Frame::new(color.clone())
        .and_then(|frame| frame.with_halves([half, other]))
        .and_then(|frame| frame.with_feature(depth))
        .and_then(|frame| frame.with_feature(Feature::new("P", FeatureKind::Position, position)))
        .and_then(|frame| frame.with_aov(Aov { name: "all".into(), color }))
        .unwrap();
    for options in [Options::default(), Options::fast()] {
        let lent = denoise(&frame, &options).unwrap();
        assert!(lent.summary.repaired_color == 1 && lent.summary.centres > 0);
        assert_eq!(denoise(frame.clone(), &options).unwrap(), lent);
    }
}

#[test]
fn several_bandwidths_give_the_mean_of_what_each_gives() {
    let picture = noisy(0.1, 7);
    let by = |bandwidths: &[f32]| {
        let options = Options { bandwidths: bandwidths.to_vec(), ..Options::default() };
        denoise(&picture, &Options { coarse: false, restore: false, ..options }).unwrap().color
    };
    let (narrow, wide) = (by(&[0.7]), by(&[1.5]));
    assert_ne!(narrow, wide);
    let mean = |sum: &[&Rgb], c: usize, at: (usize, usize)| {
        sum.iter().map(|color| color[c].get(at.0, at.1)).sum::<f32>() / sum.len() as f32
    };
    for (bandwidths, parts) in
        [(&[0.7, 1.5][..], &[&narrow, &wide][..]), (&[1.5, 0.7, 0.7], &[&wide, &narrow, &narrow])]
    {
        let result = by(bandwidths);
        for (c, x, y) in [(0, 0, 0), (1, 27, 18), (2, 52, 36), (0, 26, 5)] {
            let expected = mean(parts, c, (x, y));
            assert!((result[c].get(x, y) - expected).abs() < 1e-5, "{bandwidths:?} {c}, {x}, {y}");
        }
    }
}

/// Stops the run when it is asked for the `last`th time, and hears all of it.
struct Stopping {
    last: usize,
    asked: Mutex<usize>,
    heard: Mutex<Vec<(Option<Stage>, f32)>>,
}

impl Stopping {
    fn at(last: usize) -> Self {
        Self { last, asked: Mutex::default(), heard: Mutex::default() }
    }
}

impl Observer for Stopping {
    fn stage(&self, stage: Stage) {
        self.heard.lock().unwrap().push((Some(stage), f32::NAN));
    }

    fn progress(&self, done: f32) {
        let mut heard = self.heard.lock().unwrap();
        let stage = heard.last().and_then(|(stage, _)| *stage);
        heard.push((stage, done));
    }

    fn is_stopped(&self) -> bool {
        let mut asked = self.asked.lock().unwrap();
        *asked += 1;
        *asked >= self.last
    }
}

#[test]
fn a_run_is_stopped_wherever_it_is_and_one_that_is_not_gives_the_same_bits() {
    let sigma = rgb(|_, _, _| 0.01).to_vec();
    let feature = Feature::new("x", FeatureKind::Other, rgb(truth).to_vec()).with_variance_of_mean(sigma);
    let frame = noisy(0.1, 5).with_feature(feature).unwrap();
    let options = Options::default();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let run = |hears: &Stopping| one.install(|| denoise_observed(&frame, &options, hears));

    let whole = Stopping::at(usize::MAX);
    assert_eq!(run(&whole).unwrap(), denoise(&frame, &options).unwrap());
    let heard = whole.heard.into_inner().unwrap();
    let shares: Vec<f32> = heard.iter().map(|(_, done)| *done).filter(|done| !done.is_nan()).collect();
    assert!(shares.is_sorted() && shares[0] == 0.0 && shares.last() == Some(&1.0), "{shares:?}");
    // Within the stages that take long, not at their beginnings alone.
    for stage in [Stage::Coarse, Stage::Fit(1), Stage::Fit(2)] {
        assert!(
            heard.iter().filter(|(current, _)| *current == Some(stage)).count() > 4,
            "{stage:?}: {heard:?}"
        );
    }
    let asked = whole.asked.into_inner().unwrap();
    for last in 1..=asked {
        let stopped = Stopping::at(last);
        assert_eq!(run(&stopped).unwrap_err().kind(), ErrorKind::Stopped);
        assert_eq!(stopped.asked.into_inner().unwrap(), last, "it was told, and went on");
    }
}
