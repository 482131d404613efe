//! A picture denoised part by part has the very bits of the picture denoised as a whole.
//!
//! The pictures are long strips, so that a part's halo (over 100 pixels for the smallest options, see
//! `apr::denoise::halo`) does not reach from end to end.

use apr::denoise::{Facts, Part, Silent, denoise_part, halo};
use apr::image::{Plane, Rect, Rgb};
use apr::options::{Kernel, OutlierOptions, PrefilterOptions};
use apr::{Aov, Denoised, Feature, FeatureKind, Frame, Options, denoise};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// The length of a strip.
const LENGTH: usize = 400;

/// Numbers from −½ to ½.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32 - 0.5
    }

    fn rgb(&mut self, size: (usize, usize), f: impl Fn(usize, usize) -> f32, noise: f32) -> Rgb {
        std::array::from_fn(|_| Plane::from_fn(size.0, size.1, |x, y| f(x, y) + noise * self.next()))
    }
}

/// What a random picture holds.
#[derive(Debug, Clone, Copy)]
struct Content {
    upright: bool,
    breadth: usize,
    seed: u64,
    variance: bool,
    halves: bool,
    aov: bool,
    features: bool,
    /// Broken pixels come in blocks of this side.
    broken: usize,
    fireflies: usize,
}

fn contents() -> impl Strategy<Value = Content> {
    let flags = (any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>());
    (flags, 6usize..14, any::<u64>(), 0usize..40, 0usize..20).prop_map(
        |((upright, variance, halves, aov, features), breadth, seed, broken, fireflies)| Content {
            upright,
            breadth,
            seed,
            variance,
            halves,
            aov,
            features,
            broken,
            fireflies,
        },
    )
}

impl Content {
    fn size(&self) -> (usize, usize) {
        if self.upright { (self.breadth, LENGTH) } else { (LENGTH, self.breadth) }
    }

    fn frame(&self) -> Frame {
        let size @ (width, height) = self.size();
        let mut random = Random(self.seed);
        let edge = |x: usize, y: usize| if (x + 2 * y) % 37 < 18 { 1.0 } else { 0.4 };
        let smooth = |x: usize, y: usize| edge(x, y) * (1.0 + 0.3 * ((x + y) as f32 * 0.05).sin());
        let mut color = random.rgb(size, smooth, 0.3);
        let mut variance = random.rgb(size, |_, _| 0.0075, 0.002);
        for _ in 0..self.fireflies {
            let at = random.below(width) + random.below(height) * width;
            for c in 0..3 {
                color[c].data_mut()[at] = 400.0 + 100.0 * c as f32;
                variance[c].data_mut()[at] = 2e5;
            }
        }
        let (x, y) = (random.below(width), random.below(height));
        let rect = Rect { x, y, width: 1, height: 1 }.grown(self.broken / 2, size);
        if self.broken > 0 {
            rect.pixels().for_each(|(x, y)| color[random.below(3)].data_mut()[y * width + x] = f32::NAN);
            variance[1].data_mut()[y * width + x] = f32::INFINITY;
        }
        let difference = random.rgb(size, |_, _| 0.0, 0.3);
        let half = |sign: f32| -> Rgb {
            std::array::from_fn(|c| {
                Plane::from_fn(width, height, |x, y| color[c].get(x, y) + sign * difference[c].get(x, y))
            })
        };
        let halves = [half(1.0), half(-1.0)];
        let mut frame = Frame::new(color.clone()).unwrap();
        if self.variance {
            frame = frame.with_variance_of_mean(variance).unwrap();
        }
        if self.halves {
            frame = frame.with_halves(halves).unwrap();
        }
        if self.aov {
            let share = random.rgb(size, |_, _| 0.5, 0.4);
            let light =
                |c: usize| Plane::from_fn(width, height, |x, y| color[c].get(x, y) * share[c].get(x, y));
            frame = frame.with_aov(Aov { name: "key".into(), color: std::array::from_fn(light) }).unwrap();
        }
        if self.features {
            frame = self.with_features(frame, &mut random, edge);
        }
        frame
    }

    fn with_features(&self, frame: Frame, random: &mut Random, edge: impl Fn(usize, usize) -> f32) -> Frame {
        let size @ (width, height) = self.size();
        let mut albedo = Feature::new("albedo", FeatureKind::Albedo, random.rgb(size, &edge, 0.2).to_vec());
        albedo.var_of_mean = Some(random.rgb(size, |_, _| 0.004, 0.001).to_vec());
        let mut depth = vec![Plane::from_fn(width, height, |x, y| edge(x, y) + x as f32)];
        depth[0].data_mut()[random.below(width)] = f32::INFINITY;
        let mut depth = Feature::new("depth", FeatureKind::Depth, depth);
        let [a, b, _] = random.rgb(size, |x, y| edge(x, y) + x as f32, 0.1);
        depth.halves = Some([vec![a], vec![b]]);
        // The same everywhere but in the last pixel: in most parts it is constant.
        let mut last = Plane::filled(width, height, 1.0);
        *last.data_mut().last_mut().unwrap() = 2.0;
        let other = Feature::new("id", FeatureKind::Other, vec![last, Plane::filled(width, height, 3.0)]);
        [albedo, depth, other].into_iter().fold(frame, |frame, f| frame.with_feature(f).unwrap())
    }
}

impl Random {
    fn below(&mut self, n: usize) -> usize {
        ((self.next() + 0.5) * n as f32) as usize % n
    }
}

/// The smallest windows, whose halo is the smallest.
fn small() -> Options {
    let kernel = |demodulate| Kernel { demodulate, feature_bandwidth: Some(2.0), ..Kernel::by_color(1, 1.0) };
    Options {
        window_radius: 2,
        center_spacing: 3,
        stages: vec![vec![kernel(false)], vec![kernel(true)]],
        outliers: OutlierOptions { witnesses: 4.0, ..OutlierOptions::default() },
        prefilter: PrefilterOptions { window_radius: 2, ..PrefilterOptions::default() },
        ..Options::default()
    }
}

/// The frame's pixels under `rect`.
fn crop(frame: &Frame, rect: Rect) -> Frame {
    let rgb = |planes: &Rgb| planes.each_ref().map(|plane| plane.crop(rect));
    let list = |planes: &Vec<Plane>| planes.iter().map(|plane| plane.crop(rect)).collect::<Vec<_>>();
    let mut cut = Frame::new(rgb(frame.color())).unwrap();
    if let Some(variance) = frame.color_var_of_mean() {
        cut = cut.with_variance_of_mean(rgb(variance)).unwrap();
    }
    if let Some([a, b]) = frame.halves() {
        cut = cut.with_halves([rgb(a), rgb(b)]).unwrap();
    }
    for feature in frame.features() {
        let mut part = Feature::new(&feature.name, feature.kind, list(&feature.planes));
        part.var_of_mean = feature.var_of_mean.as_ref().map(list);
        part.halves = feature.halves.as_ref().map(|[a, b]| [list(a), list(b)]);
        cut = cut.with_feature(part).unwrap();
    }
    for aov in frame.aovs() {
        cut = cut.with_aov(Aov { name: aov.name.clone(), color: rgb(&aov.color) }).unwrap();
    }
    cut
}

/// `wanted` alone, from no more of the picture than its part reads.
fn alone(frame: &Frame, wanted: Rect, options: &Options) -> Denoised {
    let size = (frame.width(), frame.height());
    let mut facts = Facts::of(frame);
    for y in (0..size.1).step_by(50) {
        let rows = Rect { x: 0, y, width: size.0, height: 50.min(size.1 - y) };
        let part = Part::of_outliers(rows, size, options).unwrap();
        facts.add_outliers(crop(frame, part.read()), &part, options).unwrap();
    }
    let part = Part::new(wanted, size, options, &facts).unwrap();
    denoise_part(crop(frame, part.read()), &part, &facts, options, &Silent).unwrap()
}

fn planes(denoised: &Denoised) -> impl Iterator<Item = &Plane> {
    let aovs = denoised.aovs.iter().flat_map(|aov| &aov.color);
    denoised.color.iter().chain(aovs).chain(&denoised.mse).chain([&denoised.order])
}

fn assert_same_bits(part: &Denoised, whole: &Denoised, wanted: Rect) {
    for (i, (part, whole)) in planes(part).zip(planes(whole)).enumerate() {
        let bits = |plane: &Plane| plane.data().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert!(bits(part) == bits(&whole.crop(wanted)), "plane {i} of {wanted:?} differs");
    }
}

/// Cuts of 0..`length` at the given places.
fn spans(length: usize, cuts: &[f32]) -> Vec<(usize, usize)> {
    let mut ends: Vec<usize> = cuts.iter().map(|cut| 1 + (cut * (length - 1) as f32) as usize).collect();
    ends.extend([0, length]);
    ends.sort_unstable();
    ends.dedup();
    ends.windows(2).map(|pair| (pair[0], pair[1] - pair[0])).collect()
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 32,
        rng_seed: RngSeed::Fixed(5),
        failure_persistence: None,
        ..Default::default()
    })]

    #[test]
    fn parts_of_any_place_and_size_merge_to_the_bits_of_the_whole(
        content in contents(),
        columns in prop::collection::vec(0.0f32..1.0, 1..3),
        rows in prop::collection::vec(0.0f32..1.0, 0..2),
    ) {
        let (frame, options) = (content.frame(), small());
        let whole = denoise(&frame, &options).unwrap();
        let (mut centres, mut outliers, mut repaired) = (0, 0, 0);
        for (y, height) in spans(frame.height(), &rows) {
            for (x, width) in spans(frame.width(), &columns) {
                let wanted = Rect { x, y, width, height };
                let part = alone(&frame, wanted, &options);
                assert_same_bits(&part, &whole, wanted);
                centres += part.summary.centres;
                outliers += part.summary.outliers;
                repaired += part.summary.repaired_color;
            }
        }
        let all = &whole.summary;
        prop_assert_eq!((centres, outliers, repaired), (all.centres, all.outliers, all.repaired_color));
    }
}

#[test]
fn so_it_is_with_every_preset() {
    let content = Content {
        upright: false,
        breadth: 24,
        seed: 3,
        variance: true,
        halves: false,
        aov: true,
        features: true,
        broken: 3,
        fireflies: 12,
    };
    let frame = content.frame();
    for (name, preset) in Options::PRESETS {
        let options = preset();
        let halo = halo(&options, &Facts::of(&frame));
        assert!(halo < 360, "{name}: the halo is {halo}");
        let whole = denoise(&frame, &options).unwrap();
        let wanted = Rect { x: 371, y: 5, width: 29, height: 13 };
        assert_same_bits(&alone(&frame, wanted, &options), &whole, wanted);
    }
}

#[test]
fn a_part_of_a_picture_whose_outliers_nobody_looked_for_is_refused() {
    let frame = Frame::new(Random(3).rgb((400, 8), |x, _| x as f32, 0.5)).unwrap();
    let facts = Facts::of(&frame);
    let part = Part::new(Rect { x: 0, y: 0, width: 8, height: 8 }, (400, 8), &small(), &facts).unwrap();
    let cut = crop(&frame, part.read());
    let error = denoise_part(&cut, &part, &facts, &small(), &Silent).unwrap_err();
    assert!(error.to_string().contains("Facts::add_outliers"), "{error}");
}

#[test]
fn a_part_that_is_not_in_the_picture_is_refused() {
    let (options, facts) = (small(), Facts::default());
    let rect = |x, y, width, height| Rect { x, y, width, height };
    for wanted in
        [rect(400, 0, 1, 1), rect(9000, 0, 1, 1), rect(395, 0, 6, 8), rect(0, 3, 9, 6), rect(7, 3, 0, 2)]
    {
        let error = Part::new(wanted, (400, 8), &options, &facts).unwrap_err();
        assert!(error.to_string().ends_with("of a picture of 400×8; give one inside the picture"), "{error}");
        assert!(Part::of_outliers(wanted, (400, 8), &options).is_err());
    }
}

#[test]
fn a_frame_that_is_not_of_the_parts_size_is_refused() {
    let frame = Frame::new(apr::image::black(30, 20)).unwrap();
    let part = Part::whole((20, 20));
    let error = denoise_part(&frame, &part, &Facts::of(&frame), &small(), &Silent).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the frame is 30×20 where its part is 20×20; read the pixels that the part names"
    );
}
