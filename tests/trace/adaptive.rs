//! Renders in rounds: exact sums, the same bits on any threads, an early end, statistics that stay right.

use apr::Frame;
use apr::adaptive::{AdaptiveOptions, Outcome, Step, render};
use apr::trace::{RenderOptions, Rendered, Renderer, Samples};

use super::{parse, picture_mean, rendered, shipped};

fn in_rounds(
    name: &str,
    resolution: [usize; 2],
    options: &AdaptiveOptions,
    seed: u64,
) -> (Rendered, Outcome) {
    let scene = parse(&shipped(name, resolution));
    let mut renderer = Renderer::new(&scene, &RenderOptions { seed, ..RenderOptions::default() }).unwrap();
    let mut steps = vec![];
    let outcome = render(&mut renderer, options, &mut |step| steps.push(step)).unwrap();
    let traced = steps.iter().filter(|step| matches!(step, Step::Traced(_))).count();
    assert_eq!(traced, outcome.rounds.len(), "every round is told");
    (renderer.finish().unwrap(), outcome)
}

#[test]
fn all_samples_are_drawn_and_the_first_round_is_uniform() {
    for (spp, rounds) in [(9, 4), (7, 3), (3, 2)] {
        let options = AdaptiveOptions { spp, rounds, ..AdaptiveOptions::default() };
        let (picture, outcome) = in_rounds("textured_room", [27, 19], &options, 3);
        assert_eq!(picture.samples, u64::from(spp) * 27 * 19);
        assert_eq!(outcome.rounds.len(), rounds as usize);
        assert_eq!(outcome.rounds.iter().map(|round| round.samples).sum::<u64>(), picture.samples);
        assert_eq!(outcome.rounds[0].samples, u64::from((spp / rounds).max(2)) * 27 * 19);
        assert!(outcome.rounds[0].estimated_error.unwrap() > 0.0);
        assert_eq!((outcome.rounds.last().unwrap().estimated_error, outcome.met), (None, None));
        let variance = picture.frame.color_var_of_mean().unwrap();
        assert!(variance.iter().all(|plane| plane.data().iter().all(|v| v.is_finite())));
    }
}

#[test]
fn the_number_of_threads_changes_no_sample() {
    let options = AdaptiveOptions { spp: 8, rounds: 3, ..AdaptiveOptions::default() };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| in_rounds("glossy_gallery", [33, 21], &options, 5).0.frame)
    };
    assert_eq!(on(1), on(5));
}

#[test]
fn a_render_ends_when_the_target_is_met() {
    let with = |target| {
        let options =
            AdaptiveOptions { spp: 12, rounds: 3, target_error: Some(target), ..AdaptiveOptions::default() };
        in_rounds("teapot_diffuse", [24, 18], &options, 1)
    };
    let (picture, outcome) = with(1e6);
    assert_eq!((picture.samples, outcome.met), (4 * 24 * 18, Some(true)));
    assert_eq!(outcome.rounds.len(), 1);
    let (picture, outcome) = with(1e-9);
    assert_eq!((picture.samples, outcome.met), (12 * 24 * 18, Some(false)));
    assert!(outcome.rounds.iter().all(|round| round.estimated_error.unwrap() > 1e-9));
    // Between the estimates after the first and the second round: the third is spared.
    let estimate = |round: usize| outcome.rounds[round].estimated_error.unwrap();
    assert!(estimate(1) < estimate(0));
    let target = 0.8 * estimate(1) + 0.2 * estimate(0);
    let (picture, early) = with(target as f32);
    assert_eq!((picture.samples, early.met, early.rounds.len()), (8 * 24 * 18, Some(true), 2));
    assert!(early.rounds[1].estimated_error.unwrap() <= target);
}

#[test]
fn what_cannot_be_rendered_in_rounds_is_refused() {
    let scene = parse(&shipped("cornell_box", [8, 6]));
    let refused = |options: AdaptiveOptions, first: u32| {
        let mut renderer = Renderer::new(&scene, &RenderOptions::default()).unwrap();
        renderer.pass(Samples::Uniform(first)).unwrap();
        render(&mut renderer, &options, &mut |_| {}).unwrap_err().to_string()
    };
    let options = AdaptiveOptions::default;
    assert!(refused(AdaptiveOptions { rounds: 1, ..options() }, 0).contains("give 2 rounds"));
    assert!(refused(AdaptiveOptions { spp: 4, ..options() }, 0).contains("an spp of 5"));
    for spp in [4, u32::MAX] {
        assert!(
            refused(AdaptiveOptions { spp, rounds: u32::MAX, ..options() }, 0)
                .contains("an spp of 4294967296")
        );
    }
    assert!(refused(AdaptiveOptions { target_error: Some(-1.0), ..options() }, 0).contains("above 0"));
    assert!(refused(options(), 1).contains("begun already"));
}

/// ((A − B)/2)² of the halves must have the variance of the mean for its expectation, and their average
/// must be the mean, though one half of 5 samples has 3 and the other 2.
#[test]
fn halves_of_odd_counts_tell_the_variance() {
    let picture = rendered(&shipped("teapot_diffuse", [80, 60]), 5, 9);
    let frame = &picture.frame;
    let ([a, b], variance) = (frame.halves().unwrap(), frame.color_var_of_mean().unwrap());
    let mut differences = vec![];
    for c in 0..3 {
        for (i, mean) in frame.color()[c].data().iter().enumerate() {
            let (a, b) = (a[c].data()[i], b[c].data()[i]);
            assert!((0.5 * (a + b) - mean).abs() <= 1e-5 * (1.0 + mean.abs()));
            differences.push(f64::from((0.5 * (a - b)).powi(2) - variance[c].data()[i]));
        }
    }
    let n = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / n;
    let error = (differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / n / (n / 3.0)).sqrt();
    assert!(mean.abs() < 4.0 * error, "{mean} where the deviation is {error}");
}

/// Where pixels have unlike numbers of samples, the variance of each is that of its own mean: what two renders
/// differ by tells.
#[test]
fn variances_and_halves_are_right_for_unequal_counts() {
    let scene = parse(&shipped("teapot_diffuse", [64, 48]));
    let map: Vec<u32> = (0..64 * 48).map(|i| [2, 3, 7, 24][i % 4]).collect();
    let render = |seed: u64| {
        let mut renderer =
            Renderer::new(&scene, &RenderOptions { seed, ..RenderOptions::default() }).unwrap();
        // In two passes, as rounds draw them.
        let first: Vec<u32> = map.iter().map(|n| n / 2).collect();
        let second: Vec<u32> = map.iter().map(|n| n - n / 2).collect();
        renderer.pass(Samples::Map(&first)).unwrap();
        renderer.pass(Samples::Map(&second)).unwrap();
        assert!(renderer.film().sample_map().data().iter().zip(&map).all(|(n, m)| *n == *m as f32));
        renderer.finish().unwrap().frame
    };
    let (one, two) = (render(5), render(6));
    let variance = |frame: &Frame, c: usize, i: usize| frame.color_var_of_mean().unwrap()[c].data()[i];
    let halves = |frame: &Frame, c: usize, i: usize| {
        let [a, b] = frame.halves().unwrap();
        (0.5 * (a[c].data()[i] - b[c].data()[i])).powi(2)
    };
    for n in [2, 3, 7, 24] {
        let mut differences = [vec![], vec![]];
        for i in (0..map.len()).filter(|&i| map[i] == n) {
            let over = |value: &dyn Fn(usize) -> f32| (0..3).map(value).map(f64::from).sum::<f64>();
            let noise = over(&|c| variance(&one, c, i) + variance(&two, c, i));
            let apart = over(&|c| (one.color()[c].data()[i] - two.color()[c].data()[i]).powi(2));
            differences[0].push(apart - noise);
            differences[1].push(over(&|c| halves(&one, c, i) + halves(&two, c, i)) - noise);
        }
        for (what, differences) in ["renders", "halves"].iter().zip(&differences) {
            let count = differences.len() as f64;
            let mean = differences.iter().sum::<f64>() / count;
            let spread = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>();
            let z = mean / (spread / count / (count - 1.0)).sqrt();
            assert!(z.abs() < 4.0, "{n} samples, {what}: {mean}, z = {z}");
        }
    }
}

/// Means of pictures whose samples were chosen by earlier samples, against uniform ones of another seed.
#[test]
fn the_mean_of_a_render_in_rounds_is_that_of_a_uniform_one() {
    let options = AdaptiveOptions { spp: 32, ..AdaptiveOptions::default() };
    for name in ["teapot_diffuse", "textured_room"] {
        let (adaptive, _) = in_rounds(name, [64, 48], &options, 21);
        let uniform = rendered(&shipped(name, [64, 48]), 64, 22);
        for ((a, sa), (u, su)) in picture_mean(&adaptive).into_iter().zip(picture_mean(&uniform)) {
            let z = (a - u) / sa.hypot(su);
            assert!(z.abs() < 4.0, "{name}: {a} and {u}, z = {z}");
        }
    }
}

/// The same where a rare path carries much of the light: fog lit through a gap. Samples placed by those that
/// they are averaged with, as they once were, lost 4 to 6 % of it. The variances of such pixels are as doubtful
/// as their means, so that the spread over seeds tells the deviation.
#[test]
fn rare_bright_paths_are_not_sampled_until_they_fade() {
    /// Mean of the three channels over 19200 pixels of 2048 samples (`--reference 2048 --seed 99`), and
    /// its deviation. The resolution does not matter: the mean is over the same film.
    const TRUTH: (f64, f64) = (0.023537, 0.00014);
    const SEEDS: u64 = 12;
    let options = AdaptiveOptions { spp: 32, ..AdaptiveOptions::default() };
    let mean_of = |seed| {
        let (picture, _) = in_rounds("fog_shaft", [64, 48], &options, 100 + seed);
        picture_mean(&picture).into_iter().map(|(mean, _)| mean).sum::<f64>() / 3.0
    };
    let means: Vec<f64> = (0..SEEDS).map(mean_of).collect();
    let mean = means.iter().sum::<f64>() / SEEDS as f64;
    let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / ((SEEDS - 1) * SEEDS) as f64;
    let z = (mean - TRUTH.0) / variance.sqrt().hypot(TRUTH.1);
    assert!(z.abs() < 3.0, "{mean} where {} is right, z = {z}", TRUTH.0);
}
