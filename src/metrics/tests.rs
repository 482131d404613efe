//! Closed forms: pictures whose metrics can be had with a pencil.

use super::*;

const W: usize = 40;
const H: usize = 25;

fn picture(f: impl Fn(usize, usize) -> f32) -> Rgb {
    std::array::from_fn(|c| Plane::from_fn(W, H, |x, y| f(x, y) * (c + 1) as f32))
}

fn close(got: f64, expected: f64) {
    assert!((got - expected).abs() <= 1e-6 * expected.abs().max(1e-3), "{got} where {expected} was expected");
}

#[test]
fn a_picture_equals_itself() {
    let p = picture(|x, y| ((x * 7 + y * 3) % 11) as f32 * 0.1);
    let s = scores(&p, &p).unwrap();
    assert_eq!([s.rmse, s.rel_mse, s.trimmed_rel_mse, s.smape, s.energy], [0.0; 5]);
    close(s.ssim, 1.0);
}

#[test]
fn a_constant_factor_has_closed_forms() {
    // Channels are 1, 2, 3 in the reference and 1.1 times that in the result.
    let reference = picture(|_, _| 1.0);
    let result = reference.each_ref().map(|p| Plane::from_fn(W, H, |x, y| p.get(x, y) * 1.1));
    let s = scores(&result, &reference).unwrap();
    let tenth = f64::from(1.1f32) - 1.0;
    let relative = |r: f64| (tenth * r).powi(2) / (r * r + 0.01);
    close(s.rmse, tenth * (14.0f64 / 3.0).sqrt());
    close(s.rel_mse, (relative(1.0) + relative(2.0) + relative(3.0)) / 3.0);
    close(s.trimmed_rel_mse, s.rel_mse);
    close(s.smape, tenth / 2.1);
    close(s.energy, tenth);
    close(s.ssim, 1.0); // both are white after the tone map
}

#[test]
fn trimming_drops_exactly_the_worst_pixel_of_a_thousand() {
    let reference = picture(|_, _| 0.0);
    let mut result = reference.clone();
    result[0].data_mut()[3] = 0.1; // relative squared error 1 in one of three channels
    result[1].data_mut()[700] = 9.0;
    let full = rel_mse(&result, &reference).unwrap();
    close(full.value, (0.01 / 0.01 + 81.0 / 0.01) / 3000.0);
    let trimmed = trimmed_rel_mse(&result, &reference).unwrap();
    close(trimmed.value, (1.0 / 3.0) / 999.0);
    assert_eq!(trimmed.plane.data()[700], 0.0);
    assert!(trimmed.plane.data()[3] > 0.3);
}

#[test]
fn smape_is_one_where_one_side_is_black_and_zero_where_both_are() {
    let half = picture(|x, _| if x < W / 2 { 1.0 } else { 0.0 });
    let black = picture(|_, _| 0.0);
    let measure = smape(&half, &black).unwrap();
    close(measure.value, 0.5);
    assert_eq!([measure.plane.get(0, 0), measure.plane.get(W - 1, 0)], [1.0, 0.0]);
}

#[test]
fn energy_is_signed_and_its_plane_averages_to_it() {
    let reference = picture(|_, _| 0.5);
    let result = picture(|x, _| if x == 0 { 0.0 } else { 0.5 });
    let measure = energy(&result, &reference).unwrap();
    close(measure.value, -1.0 / W as f64);
    close(measure.plane.data().iter().map(|v| f64::from(*v)).sum::<f64>() / (W * H) as f64, measure.value);
    let black = picture(|_, _| 0.0);
    assert_eq!(energy(&black, &black).unwrap().value, 0.0);
    assert_eq!(energy(&reference, &black).unwrap().value, f64::INFINITY);
}

#[test]
fn ssim_of_two_flat_greys_is_its_luminance_term() {
    let grey = |v: f32| -> Rgb { std::array::from_fn(|_| Plane::filled(W, H, v)) };
    let (a, b) = (f64::from(srgb(0.2)), f64::from(srgb(0.6)));
    close(ssim(&grey(0.2), &grey(0.6)).unwrap().value, (2.0 * a * b + 1e-4) / (a * a + b * b + 1e-4));
}

#[test]
fn ssim_of_a_picture_and_its_negative_is_negative() {
    let board = |on: usize| -> Rgb {
        std::array::from_fn(|_| Plane::from_fn(W, H, |x, y| if (x + y) % 2 == on { 0.8 } else { 0.1 }))
    };
    assert!(ssim(&board(0), &board(1)).unwrap().value < -0.5);
}

#[test]
fn a_pixel_that_is_not_finite_is_named_in_either_picture() {
    let good = picture(|_, _| 1.0);
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut bad = good.clone();
        bad[1].data_mut()[2 * W + 7] = value;
        for (pair, who) in [((&bad, &good), "the result"), ((&good, &bad), "the reference")] {
            for metric in [rmse, rel_mse, trimmed_rel_mse, smape, ssim, energy] {
                let message = metric(pair.0, pair.1).unwrap_err().to_string();
                assert!(
                    message.contains(who) && message.contains("'G'") && message.contains("(7, 2)"),
                    "{message}"
                );
            }
        }
    }
}

#[test]
fn sizes_that_differ_are_refused() {
    let small: Rgb = std::array::from_fn(|_| Plane::filled(2, 2, 0.0));
    assert!(rmse(&small, &picture(|_, _| 0.0)).unwrap_err().to_string().contains("2×2"));
}
