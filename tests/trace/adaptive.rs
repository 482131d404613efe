//! Renders in rounds: exact sums, the same bits on any threads, an early end, statistics that stay right.

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
    let mut renderer = Renderer::new(&scene, &RenderOptions { seed, ..RenderOptions::default() });
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
}

#[test]
fn what_cannot_be_rendered_in_rounds_is_refused() {
    let scene = parse(&shipped("cornell_box", [8, 6]));
    let refused = |options: AdaptiveOptions, first: u32| {
        let mut renderer = Renderer::new(&scene, &RenderOptions::default());
        renderer.pass(Samples::Uniform(first)).unwrap();
        render(&mut renderer, &options, &mut |_| {}).unwrap_err().to_string()
    };
    let options = AdaptiveOptions::default;
    assert!(refused(AdaptiveOptions { rounds: 1, ..options() }, 0).contains("--rounds 2"));
    assert!(refused(AdaptiveOptions { spp: 4, ..options() }, 0).contains("--spp 5"));
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
