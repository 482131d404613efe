//! Closed forms of the allocation.

use super::*;

const W: usize = 13;
const H: usize = 7;

fn error(f: impl Fn(usize, usize) -> f32) -> Plane {
    Plane::from_fn(W, H, f)
}

fn sum(samples: &[u32]) -> u64 {
    samples.iter().map(|&n| u64::from(n)).sum()
}

#[test]
fn sums_are_exact_for_any_error_budget_and_decay() {
    let ragged = error(|x, y| if (x + y) % 3 == 0 { 0.0 } else { 1e-6 * 7f32.powi((x * 5 + y) as i32 % 9) });
    for map in [ragged, error(|_, _| 0.25), error(|_, _| 0.0), error(|_, _| f32::NAN)] {
        for budget in [0, 1, 90, 91, 1000, 12_345] {
            for (decay, limit, even_share) in [(1.0, 8.0, 0.5), (0.5, 1.0, 0.0), (2.0, 2.5, 1.0)] {
                let options = SamplingOptions { decay, limit, even_share };
                let counts: Vec<u32> = (0..W * H).map(|i| (i % 4) as u32).collect();
                let samples = allocate(&map, &counts, budget, None, &options).unwrap();
                assert_eq!(sum(&samples), budget, "{budget} samples, {options:?}");
            }
        }
    }
}

#[test]
fn a_density_times_the_samples_per_pixel_keeps_its_sum() {
    let even = counts(&error(|x, _| if x == 0 { 2.0 } else { 0.25 }), 8).unwrap();
    assert!(even.iter().enumerate().all(|(i, &n)| n == if i % W == 0 { 16 } else { 2 }));
    for share in [0.1, 1.0 / 3.0, 1.7] {
        let samples = counts(&error(|_, _| share), 5).unwrap();
        assert_eq!(sum(&samples), (f64::from(share) * 5.0 * (W * H) as f64).round() as u64);
    }
    assert!(counts(&error(|x, y| if x + y == 0 { 1e7 } else { 0.0 }), 1000).is_err());
}

#[test]
fn without_any_sample_yet_all_pixels_count_as_having_one() {
    let map = error(|x, _| 0.01 * (1 + x) as f32);
    let options = SamplingOptions::default();
    let first = allocate(&map, &[0; W * H], 1000, None, &options).unwrap();
    assert_eq!(first, allocate(&map, &[1; W * H], 1000, None, &options).unwrap());
    assert_eq!(sum(&first), 1000);
    assert!(samples_needed(&map, &[0.0; W * H], 1e-4, &options).unwrap() > 100.0 * (W * H) as f64);
}

#[test]
fn samples_level_the_priority() {
    // n ∝ √(E n₀) for α = 1: errors of 1 and 4 with 8 samples each end with 1 : 2.
    let map = error(|x, _| if x < 6 { 1.0 } else { 4.0 });
    let counts = vec![8; W * H];
    let options = SamplingOptions { decay: 1.0, limit: 100.0, even_share: 0.0 };
    let few = (6 * H * 16 + 7 * H * 32 - 8 * W * H) as u64;
    let samples = allocate(&map, &counts, few, None, &options).unwrap();
    for (i, &more) in samples.iter().enumerate() {
        assert_eq!(8 + more, if i % W < 6 { 16 } else { 32 });
    }
    // What is left by then, E·8/n, over n is the same everywhere.
    let levels = error(|x, y| map.get(x, y) * 8.0 / (8 + samples[y * W + x]).pow(2) as f32);
    assert!(levels.data().iter().all(|p| (p - 1.0 / 32.0).abs() < 1e-6), "{levels:?}");
    // A pixel that has more than its share gets none.
    let counts: Vec<u32> = (0..W * H).map(|i| if i == 5 { 1000 } else { 8 }).collect();
    let even = error(|x, y| if y * W + x == 5 { 1e-4 } else { 1.0 });
    let samples = allocate(&even, &counts, 900, None, &options).unwrap();
    assert_eq!(samples[5], 0);
    assert!(samples.iter().enumerate().all(|(i, &n)| i == 5 || n == 10));
}

#[test]
fn no_pixel_gets_more_than_the_limit() {
    let map = error(|x, y| if (x, y) == (3, 3) { 1e9 } else { 1.0 });
    let options = SamplingOptions { decay: 1.0, limit: 3.0, even_share: 0.0 };
    let samples = allocate(&map, &[4; W * H], 10 * (W * H) as u64, None, &options).unwrap();
    assert_eq!(samples[3 * W + 3], 30);
    assert!(samples.iter().all(|&n| n <= 30));
}

#[test]
fn every_pixel_that_gets_any_has_its_even_share() {
    let map = error(|x, y| if (x, y) == (3, 3) { 1.0 } else { 1e-9 * (1 + x) as f32 });
    let options = SamplingOptions { even_share: 0.5, ..SamplingOptions::default() };
    let samples = allocate(&map, &[4; W * H], 10 * (W * H) as u64, None, &options).unwrap();
    assert_eq!((samples[3 * W + 3], sum(&samples)), (80, 10 * (W * H) as u64));
    assert!(samples.iter().all(|&n| n >= 5), "{samples:?}");
    let samples = allocate(&map, &[4; W * H], 1000, Some(1e-8), &options).unwrap();
    assert!(samples.iter().enumerate().all(|(i, &n)| (n == 0) == (map.data()[i] <= 1e-8)), "{samples:?}");
}

#[test]
fn pixels_at_the_target_get_no_sample() {
    let map = error(|x, _| if x == 4 { 0.02 } else { 0.01 });
    let options = SamplingOptions::default();
    let samples = allocate(&map, &[8; W * H], 700, Some(0.01), &options).unwrap();
    assert_eq!(sum(&samples), 700);
    assert!(samples.iter().enumerate().all(|(i, &n)| if i % W == 4 { n == 100 } else { n == 0 }));
    assert_eq!(sum(&allocate(&map, &[8; W * H], 700, Some(0.02), &options).unwrap()), 0);
}

#[test]
fn leftovers_do_not_line_up() {
    let width = 12;
    let map = Plane::filled(width, 6, 1.0);
    let samples = allocate(&map, &[1; 72], 36, None, &SamplingOptions::default()).unwrap();
    for x in 0..width {
        assert_eq!((0..6).map(|y| samples[y * width + x]).sum::<u32>(), 3, "column {x}");
    }
}

#[test]
fn a_density_is_one_on_the_average_and_a_converged_pictures_is_flat() {
    let options = SamplingOptions::default();
    let mean = |plane: &Plane| plane.data().iter().map(|&v| f64::from(v)).sum::<f64>() / (W * H) as f64;
    let map = error(|x, y| (x * y) as f32);
    let plain = density(&map, None, None, &options).unwrap();
    assert!((mean(&plain) - 1.0).abs() < 1e-6);
    // An error e left by n samples wants √(e·n) in all: of 6 columns with 4 and 7 with 16 samples, in units
    // of their mean 136/13 and with as many again, 1.3 and 2.6.
    let counts = error(|x, _| if x < W / 2 { 4.0 } else { 16.0 });
    let law = SamplingOptions { decay: 1.0, even_share: 0.0, ..options };
    let known = density(&error(|_, _| 0.5), Some(&counts), None, &law).unwrap();
    assert!((known.get(0, 0) - (1.3 - 52.0 / 136.0)).abs() < 1e-5, "{}", known.get(0, 0));
    assert!((known.get(W - 1, 0) - (2.6 - 208.0 / 136.0)).abs() < 1e-5, "{}", known.get(W - 1, 0));
    let flat = density(&error(|_, _| 0.0), None, None, &options).unwrap();
    assert!(flat.data().iter().all(|v| (v - 1.0).abs() < 1e-6));
    let done = density(&error(|_, _| 0.001), None, Some(0.001), &options).unwrap();
    assert!(done.data().iter().all(|&v| v == 0.0));
}

#[test]
fn a_methods_own_priority_is_brought_to_a_mean_of_one() {
    let map = proportional(&error(|x, _| if x == 0 { 14.0 } else { 1.0 }));
    assert!((map.get(0, 3) - 7.0).abs() < 1e-6 && (map.get(9, 3) - 0.5).abs() < 1e-6);
    assert!(proportional(&error(|_, _| 0.0)).data().iter().all(|&v| v == 1.0));
}

#[test]
fn the_samples_needed_follow_the_power_law() {
    let map = error(|_, _| 0.08);
    let needed = |decay: f64, target: f64| {
        let options = SamplingOptions { decay, ..SamplingOptions::default() };
        samples_needed(&map, &[16.0; W * H], target, &options).unwrap() / (W * H) as f64
    };
    assert!((needed(1.0, 0.02) - 48.0).abs() < 1e-4, "{}", needed(1.0, 0.02));
    assert!((needed(0.5, 0.02) - 240.0).abs() < 1e-3);
    assert_eq!(needed(1.0, 0.09), 0.0);
    let error = samples_needed(&map, &[16.0; W * H], 0.0, &SamplingOptions::default()).unwrap_err();
    assert!(error.to_string().contains("give 0.001"), "{error}");
}

#[test]
fn the_error_is_relative_to_the_light() {
    let denoised = Denoised {
        color: std::array::from_fn(|_| error(|_, _| 0.3)),
        aovs: vec![],
        mse: Some(error(|_, _| 0.001)),
        order: error(|_, _| 0.0),
        sampling_priority: None,
        summary: crate::Summary::default(),
    };
    let estimate = relative_error(&denoised).unwrap();
    assert!(estimate.data().iter().all(|e| (e - 0.01).abs() < 1e-6), "0.001 / (0.3² + 0.01)");
    assert!((mean_error(&estimate) - 0.01).abs() < 1e-6);
}

#[test]
fn wrong_sizes_and_options_are_refused() {
    let map = error(|_, _| 1.0);
    let with = |decay, limit, even_share| {
        let options = SamplingOptions { decay, limit, even_share };
        allocate(&map, &[1; W * H], 9, None, &options).unwrap_err().to_string()
    };
    assert!(with(0.0, 8.0, 0.5).contains("decay"));
    assert!(with(1.0, 0.5, 0.5).contains("limit"));
    assert!(with(1.0, 8.0, -0.1).contains("even share"));
    let error = allocate(&map, &[1; 3], 9, None, &SamplingOptions::default()).unwrap_err();
    assert!(error.to_string().contains("13×7"), "{error}");
    let error = allocate(&map, &[1; W * H], u64::MAX, None, &SamplingOptions::default()).unwrap_err();
    assert!(error.to_string().contains("too many"), "{error}");
}
