//! EXR files made on the spot, and a reading of them that does not use the library under test.

use std::path::Path;

use exr::prelude::*;

/// A layer ready to be written.
pub type TestLayer = Layer<AnyChannels<FlatSamples>>;

/// Numbers that look like a picture, different for every `salt`.
pub fn values(count: usize, salt: usize) -> Vec<f32> {
    (0..count).map(|i| ((i * 37 + salt * 101) % 251) as f32 / 125.0).collect()
}

/// A channel of 32-bit floats.
pub fn float(name: &str, values: Vec<f32>) -> AnyChannel<FlatSamples> {
    AnyChannel::new(name, FlatSamples::F32(values))
}

/// A channel of half floats.
pub fn half(name: &str, values: &[f32]) -> AnyChannel<FlatSamples> {
    AnyChannel::new(name, FlatSamples::F16(values.iter().map(|&v| f16::from_f32(v)).collect()))
}

/// A channel of whole numbers.
pub fn whole(name: &str, values: Vec<u32>) -> AnyChannel<FlatSamples> {
    AnyChannel::new(name, FlatSamples::U32(values))
}

/// `LAYER.COMPONENT` channels of floats, each with its own numbers; a component may be empty.
pub fn channels(size: (usize, usize), names: &[&str]) -> Vec<AnyChannel<FlatSamples>> {
    let channel = |(salt, name): (usize, &&str)| float(name, values(size.0 * size.1, salt));
    names.iter().enumerate().map(channel).collect()
}

/// A layer at `position` in the encoding.
pub fn layer(
    name: Option<&str>,
    size: (usize, usize),
    position: (i32, i32),
    encoding: Encoding,
    channels: Vec<AnyChannel<FlatSamples>>,
) -> TestLayer {
    let attributes = LayerAttributes {
        layer_name: name.map(Text::from),
        layer_position: Vec2(position.0, position.1),
        ..LayerAttributes::default()
    };
    Layer::new(size, attributes, encoding, AnyChannels::sort(channels.into()))
}

/// The codecs that keep every bit of every sample type.
pub const LOSSLESS: [Compression; 5] =
    [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::ZIP16, Compression::PIZ];

/// Scan lines, the usual way.
pub fn scan_lines(compression: Compression) -> Encoding {
    Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing }
}

/// Small files of every codec, scan lines (two parts) and tiles (one part), in this order of
/// [`LOSSLESS`] and then the lossy ones.
pub fn of_every_codec(size: (usize, usize)) -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sample.exr");
    let lossy = [
        Compression::PXR24,
        Compression::B44,
        Compression::B44A,
        Compression::DWAA(None),
        Compression::DWAB(None),
    ];
    let tiled = |compression| Encoding {
        compression,
        blocks: Blocks::Tiles(Vec2(8, 8)),
        line_order: LineOrder::Increasing,
    };
    let encodings = LOSSLESS.into_iter().chain(lossy).flat_map(|codec| [scan_lines(codec), tiled(codec)]);
    let bytes = |encoding: Encoding, parts: usize| {
        let part = |i: usize| {
            let names = ["R", "G", "B", "depth.Z"];
            let mut channels = channels(size, &names);
            channels.push(half("half.R", &values(size.0 * size.1, 8)));
            layer(Some(&format!("part{i}")), size, (-3, 4), encoding, channels)
        };
        write(&path, IntegerBounds::from_dimensions(size), (0..parts).map(part).collect());
        std::fs::read(&path).unwrap()
    };
    encodings.map(|encoding| bytes(encoding, 1 + usize::from(encoding.blocks == Blocks::ScanLines))).collect()
}

/// Writes `layers` with a display window of their own.
pub fn write(path: &Path, display: IntegerBounds, layers: Vec<TestLayer>) {
    let image = Image { attributes: ImageAttributes::new(display), layer_data: Layers::from_vec(layers) };
    image.write().to_file(path).unwrap();
}

/// Writes one layer that fills its display window.
pub fn write_one(path: &Path, layer: TestLayer) {
    let display = IntegerBounds::from_dimensions(layer.size);
    write(path, display, vec![layer]);
}

/// Everything in a file, as the exr crate's own reader has it.
pub fn read_all(path: &Path) -> FlatImage {
    read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_file(path)
        .unwrap()
}

/// The samples' bits, so that NaN equals itself.
pub fn bits(samples: &FlatSamples) -> Vec<u32> {
    match samples {
        FlatSamples::F16(values) => values.iter().map(|v| u32::from(v.to_bits())).collect(),
        FlatSamples::F32(values) => values.iter().map(|v| v.to_bits()).collect(),
        FlatSamples::U32(values) => values.clone(),
    }
}
