//! What is NaN or infinite in a render, in any of its layers: the result is finite, what was repaired is
//! counted, channels that say nothing are named, and the rest of the picture stays as right as it was.

use std::path::Path;
use std::process::Command;

use crate::exr_files::{float, layer, read_all, scan_lines, write_one};
use exr::prelude::{AttributeValue, Compression, Text};
use serde_json::Value;

const SIZE: (usize, usize) = (40, 32);
const PIXELS: usize = SIZE.0 * SIZE.1;
/// Standard deviation of the colour's noise, where the picture is about 1.
const NOISE: f32 = 0.1;

/// A render: channels by their names.
struct Render(Vec<(String, Vec<f32>)>);

/// A layer of a render, its components, and the count of the report that its repairs go into.
type Row = (&'static str, &'static [&'static str], &'static str);

const LAYERS: [Row; 10] = [
    ("", &["R", "G", "B"], "repaired_color"),
    ("variance", &["R", "G", "B"], "repaired_variance"),
    ("halfA", &["R", "G", "B"], "repaired_halves"),
    ("albedo", &["R", "G", "B"], "repaired_features"),
    ("albedoVariance", &["R", "G", "B"], "repaired_variance"),
    ("normal", &["X", "Y", "Z"], "repaired_features"),
    ("position", &["X", "Y", "Z"], "repaired_features"),
    ("depth", &["Z"], "repaired_features"),
    ("visibility", &["Y"], "repaired_features"),
    ("key", &["R", "G", "B"], "repaired_aovs"),
];

fn name(layer: &str, component: &str) -> String {
    if layer.is_empty() { component.to_owned() } else { format!("{layer}.{component}") }
}

/// Without noise: a floor, and a wall of another colour from column 20 on.
fn truth(c: usize, x: usize, y: usize) -> f32 {
    let wall = if x < SIZE.0 / 2 { 1.0 } else { 0.6 + 0.1 * c as f32 };
    wall * (0.8 + 0.01 * y as f32)
}

/// Normally distributed, from sums of a small generator.
fn noise(state: &mut u32) -> f32 {
    let mut sum = 0.0;
    for _ in 0..12 {
        *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        sum += (*state >> 8) as f32 / (1 << 24) as f32;
    }
    sum - 6.0
}

/// All of [`LAYERS`], with noise in the colour and the albedo.
fn render() -> Render {
    let mut seed = 1;
    let planes = |_: usize| -> Vec<f32> { (0..PIXELS).map(|_| noise(&mut seed)).collect() };
    let [a, b, texture]: [[Vec<f32>; 3]; 3] = {
        let mut planes = (0..9).map(planes);
        [(); 3].map(|()| [(); 3].map(|()| planes.next().unwrap()))
    };
    let value = |layer: &str, c: usize, i: usize| {
        let (x, y) = (i % SIZE.0, i / SIZE.0);
        let left = x < SIZE.0 / 2;
        let mean = truth(c, x, y) + NOISE * (a[c][i] + b[c][i]) / 2f32.sqrt();
        match layer {
            "" => mean,
            "variance" => NOISE * NOISE,
            "halfA" => truth(c, x, y) + NOISE * 2f32.sqrt() * a[c][i],
            "albedo" => (if left { 0.9 } else { 0.5 }) + 0.02 * texture[c][i],
            "albedoVariance" => 0.02 * 0.02,
            "normal" => f32::from(u8::from(c == if left { 1 } else { 0 })),
            "position" => [x, y, x + y][c] as f32 * 0.1,
            "depth" => 4.0 + 0.05 * x.min(SIZE.0 / 2) as f32,
            "visibility" => {
                if left {
                    1.0
                } else {
                    0.25
                }
            }
            "key" => 0.75 * mean,
            _ => unreachable!(),
        }
    };
    let channels = LAYERS.iter().flat_map(|(layer, components, _)| {
        let plane = move |c: usize| (0..PIXELS).map(|i| value(layer, c, i)).collect();
        components.iter().enumerate().map(move |(c, component)| (name(layer, component), plane(c)))
    });
    Render(channels.collect())
}

/// What the report counts.
const COUNTS: [&str; 5] =
    ["repaired_color", "repaired_variance", "repaired_features", "repaired_halves", "repaired_aovs"];

/// What a run gave.
struct Outcome {
    color: [Vec<f32>; 3],
    report: Value,
    complaints: String,
}

impl Outcome {
    fn count(&self, key: &str) -> u64 {
        self.report["summary"][key].as_u64().unwrap()
    }

    /// The channels that the program warned of.
    fn warned_of(&self) -> Vec<&str> {
        let start = "apr-denoise: warning: ";
        let warnings = self.complaints.lines().filter_map(|line| line.strip_prefix(start));
        warnings
            .filter_map(|warning| warning.split_once(": NaN or infinite"))
            .flat_map(|(n, _)| n.split(", "))
            .collect()
    }
}

impl Render {
    fn spoil(&mut self, channel: &str, value: f32, pixels: &[usize]) {
        let (_, plane) = self.0.iter_mut().find(|(name, _)| name == channel).unwrap();
        pixels.iter().for_each(|&i| plane[i] = value);
    }

    fn write(&self, path: &Path) {
        let channels = self.0.iter().map(|(name, values)| float(name, values.clone())).collect();
        let mut layer = layer(None, SIZE, (0, 0), scan_lines(Compression::Uncompressed), channels);
        layer.attributes.other.insert(Text::from("samplesPerPixel"), AttributeValue::I32(16));
        write_one(path, layer);
    }

    /// Through the program, which writes nothing but finite numbers.
    fn denoise(&self, folder: &Path, further: &[&str]) -> Outcome {
        let [input, output, report] = ["in.exr", "out.exr", "report.json"].map(|name| folder.join(name));
        self.write(&input);
        let program = Command::new(env!("CARGO_BIN_EXE_apr-denoise"))
            .args([&input, &output])
            .args(["--aov", "key", "--aux", "--threads", "1"])
            .args(further)
            .arg("--report")
            .arg(&report)
            .output()
            .unwrap();
        let complaints = String::from_utf8(program.stderr).unwrap();
        assert!(program.status.success(), "{complaints}");
        let written = read_all(&output).layer_data.remove(0).channel_data.list;
        let samples = |name: &str| -> Vec<f32> {
            let channel = written.iter().find(|channel| channel.name == *name).unwrap();
            channel.sample_data.values_as_f32().collect()
        };
        // Not all methods have an estimate of their error.
        let aux =
            written.iter().map(|channel| channel.name.to_string()).filter(|name| name.starts_with("apr."));
        let aux: Vec<String> = aux.collect();
        assert!(aux.contains(&"apr.order.Y".to_owned()), "{aux:?}");
        for name in
            ["R", "G", "B", "key.R", "key.G", "key.B"].into_iter().chain(aux.iter().map(String::as_str))
        {
            assert!(samples(name).iter().all(|v| v.is_finite()), "{name} is not finite");
        }
        let report = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
        Outcome { color: ["R", "G", "B"].map(samples), report, complaints }
    }
}

/// Root of the mean squared error of these channels at these pixels.
fn error(out: &Outcome, channels: &[usize], pixels: &[usize]) -> f32 {
    let truth = |c: usize, i: usize| truth(c, i % SIZE.0, i / SIZE.0);
    rms(channels, pixels, |c, i| out.color[c][i] - truth(c, i))
}

fn rms(channels: &[usize], pixels: &[usize], difference: impl Fn(usize, usize) -> f32) -> f32 {
    let terms = channels.iter().flat_map(|&c| pixels.iter().map(move |&i| (c, i)));
    let sum: f32 = terms.map(|(c, i)| difference(c, i).powi(2)).sum();
    (sum / (channels.len() * pixels.len()) as f32).sqrt()
}

const BAD: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

/// Infinite depths and positions are misses, which are moved to the end of the range, not repaired.
fn is_a_miss(layer: &str, value: f32) -> bool {
    value.is_infinite() && ["depth", "position"].contains(&layer)
}

/// Error without any damage: 0.0087, a twelfth of the noise; with a block of 42 pixels guessed, where an edge runs, 0.0113.
#[test]
fn single_pixels_and_blocks_are_repaired_and_counted_and_the_rest_stays_as_right() {
    let folder = tempfile::tempdir().unwrap();
    let (all, colors) = ((0..PIXELS).collect::<Vec<_>>(), [0, 1, 2]);
    let clean = render().denoise(folder.path(), &[]);
    let unharmed = error(&clean, &colors, &all);
    assert!(unharmed < 0.15 * NOISE, "{unharmed}");
    let pixel = vec![15 * SIZE.0 + 17];
    let block: Vec<usize> = (12..18).flat_map(|y| (14..21).map(move |x| y * SIZE.0 + x)).collect();
    let far = |i: &usize| (i % SIZE.0).abs_diff(17) >= 12 || (i / SIZE.0).abs_diff(15) >= 12;
    let far: Vec<usize> = (0..PIXELS).filter(far).collect();
    for (layer, components, count) in LAYERS {
        for value in BAD {
            for damaged in [&pixel, &block] {
                let mut render = render();
                render.spoil(&name(layer, components[0]), value, damaged);
                let out = render.denoise(folder.path(), &[]);
                let case = format!("{value} in {} pixels of '{layer}'", damaged.len());
                let expected = if is_a_miss(layer, value) { 0 } else { damaged.len() };
                let counts: Vec<u64> = COUNTS.iter().map(|key| out.count(key)).collect();
                let alone = COUNTS.map(|key| if key == count { expected as u64 } else { 0 });
                assert_eq!(counts, alone, "{case}: {COUNTS:?}");
                // Where the block hides the wall's edge, its place is guessed.
                let inside = error(&out, &colors, damaged);
                assert!(inside < NOISE, "{case}: {inside} inside");
                let everywhere = error(&out, &colors, &all);
                assert!(everywhere < 1.4 * unharmed, "{case}: {everywhere} where {unharmed} is without");
                let changed = rms(&colors, &far, |c, i| out.color[c][i] - clean.color[c][i]);
                assert!(changed < 0.2 * unharmed, "{case}: {changed} far from it");
            }
        }
    }
}

#[test]
fn channels_and_layers_that_say_nothing_are_left_out_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let all: Vec<usize> = (0..PIXELS).collect();
    let unharmed = error(&render().denoise(folder.path(), &[]), &[0, 1, 2], &all);
    for (layer, components, _) in LAYERS {
        for value in BAD {
            for broken in [&components[..1], components] {
                let mut render = render();
                let names: Vec<String> = broken.iter().map(|component| name(layer, component)).collect();
                names.iter().for_each(|name| render.spoil(name, value, &all));
                let out = render.denoise(folder.path(), &[]);
                let case = format!("{value} in all of {names:?}");
                let counts: Vec<u64> = COUNTS.iter().map(|key| out.count(key)).collect();
                assert_eq!(counts, [0; 5], "{case}: {COUNTS:?}");
                if !is_a_miss(layer, value) {
                    let mut listed: Vec<&str> = out.warned_of();
                    listed.sort_unstable();
                    let mut expected: Vec<&str> = names.iter().map(String::as_str).collect();
                    expected.sort_unstable();
                    assert_eq!(listed, expected, "{case}: {}", out.complaints);
                }
                let black = if layer.is_empty() { broken.len() } else { 0 };
                assert!(out.color[..black].iter().flatten().all(|v| *v == 0.0), "{case}");
                let rest: Vec<usize> = (black..3).collect();
                if !rest.is_empty() {
                    let error = error(&out, &rest, &all);
                    assert!(error < 1.25 * unharmed, "{case}: {error} where {unharmed} is without");
                }
            }
        }
    }
}

/// Everything at once, through every method, and in a region.
#[test]
fn every_method_gives_finite_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let mut render = render();
    for (n, (layer, components, _)) in LAYERS.into_iter().enumerate() {
        let corner: Vec<usize> = (0..6).flat_map(|y| (n..n + 5).map(move |x| y * SIZE.0 + x)).collect();
        for (component, value) in components.iter().zip(BAD) {
            render.spoil(&name(layer, component), value, &corner);
        }
        if n % 2 == 1 {
            render.spoil(&name(layer, components[0]), f32::NAN, &(0..PIXELS).collect::<Vec<_>>());
        }
    }
    for method in ["apr", "nlm", "lp", "wavelet", "nfor", "student"] {
        let out = render.denoise(folder.path(), &["--method", method]);
        assert_eq!(out.count("repaired_color"), 30, "{method}");
    }
    // A region's run learns from a pass of its own what the whole says nothing of.
    let whole = render.denoise(folder.path(), &[]);
    let region = render.denoise(folder.path(), &["--region", "3,2,20,9"]);
    let inside: Vec<usize> = (2..11).flat_map(|y| (3..23).map(move |x| y * SIZE.0 + x)).collect();
    for (whole, region) in whole.color.iter().zip(&region.color) {
        assert_eq!(inside.iter().map(|&i| whole[i]).collect::<Vec<_>>(), *region);
    }
}

/// Two renders of which one is broken at a pixel: the mean is, too.
#[test]
fn what_is_broken_in_one_of_two_renders_is_repaired() {
    let folder = tempfile::tempdir().unwrap();
    let half = folder.path().join("half.exr");
    let mut other = render();
    other.spoil("G", f32::INFINITY, &[77]);
    other.write(&half);
    let out = render().denoise(folder.path(), &["--half", half.to_str().unwrap()]);
    assert_eq!(out.count("repaired_color"), 1);
}
