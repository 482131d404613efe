//! The main job in memory: 1280×720 with all features, every preset: `cargo bench --bench denoise`.

use std::path::Path;

use apr::image::{Plane, Rgb};
use apr::io::{Picture, ReadOptions};
use apr::{Feature, Frame, Options, denoise};
use criterion::{Criterion, SamplingMode, criterion_group, criterion_main};

const SIZE: (usize, usize) = (1280, 720);

/// The programs' own.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// The bundled render, mirrored at its borders until it fills the frame.
fn frame() -> Frame {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/mitsuba/gallery_spp16.exr");
    let picture = Picture::read(&path, &ReadOptions::default()).expect("the bundled render");
    let small = picture.frame();
    let mirrored = |i: usize, n: usize| if (i / n).is_multiple_of(2) { i % n } else { n - 1 - i % n };
    let tiled = |plane: &Plane| {
        let (width, height) = plane.size();
        Plane::from_fn(SIZE.0, SIZE.1, |x, y| plane.get(mirrored(x, width), mirrored(y, height)))
    };
    let rgb = |planes: &Rgb| -> Rgb { std::array::from_fn(|c| tiled(&planes[c])) };
    let variance = small.color_var_of_mean().expect("the render has a variance");
    let mut frame =
        Frame::new(rgb(small.color())).and_then(|frame| frame.with_variance_of_mean(rgb(variance)));
    for feature in small.features() {
        let tiled = Feature {
            planes: feature.planes.iter().map(tiled).collect(),
            var_of_mean: feature.var_of_mean.as_ref().map(|planes| planes.iter().map(tiled).collect()),
            halves: None,
            ..feature.clone()
        };
        frame = frame.and_then(|frame| frame.with_feature(tiled));
    }
    frame.expect("all planes have one size")
}

fn presets(criterion: &mut Criterion) {
    let frame = frame();
    let mut group = criterion.benchmark_group("denoise 1280x720");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    for (name, preset) in Options::PRESETS {
        let options = preset();
        group.bench_function(name, |bencher| bencher.iter(|| denoise(&frame, &options)));
    }
    group.finish();
}

criterion_group!(benches, presets);
criterion_main!(benches);
