//! Whatever is not the beauty comes out as it went in, bit for bit.

use std::path::Path;

use crate::exr_files::*;
use apr::image::{Plane, Rgb};
use apr::io::{Picture, ReadOptions};
use apr::{Denoised, Summary};
use exr::prelude::*;

/// A result that no input has.
fn result(picture: &Picture) -> Denoised {
    let (width, height) = (picture.frame().width(), picture.frame().height());
    let plane = |k: f32| Plane::from_fn(width, height, move |x, y| k + x as f32 + 0.5 * y as f32);
    let color: Rgb = [plane(1.0), plane(2.0), plane(3.0)];
    Denoised {
        color,
        aovs: vec![],
        mse: Some(plane(4.0)),
        order: plane(5.0),
        sampling_priority: None,
        summary: Summary::default(),
    }
}

/// Writes the result of `input` and returns both files in full.
fn through(folder: &Path, input: &Path, aux: bool) -> (FlatImage, FlatImage, Vec<String>) {
    let picture = Picture::read(input, &ReadOptions::default()).unwrap();
    let output = folder.join("out.exr");
    let notes = picture.write(&output, &result(&picture), aux).unwrap();
    // The first time of blocks that were kept from reading, then of blocks that are read again.
    let again = folder.join("again.exr");
    assert_eq!(picture.write(&again, &result(&picture), aux).unwrap(), notes);
    assert!(std::fs::read(&output).unwrap() == std::fs::read(&again).unwrap());
    (read_all(input), read_all(&output), notes)
}

/// Everything but `beauty` (part and channels) must be the same.
fn assert_same_but(before: &FlatImage, after: &FlatImage, part: usize, beauty: &[&str]) {
    assert_eq!(before.attributes, after.attributes);
    assert_eq!(before.layer_data.len(), after.layer_data.len());
    for (i, (a, b)) in before.layer_data.iter().zip(&after.layer_data).enumerate() {
        assert_eq!((a.size, &a.attributes, a.encoding), (b.size, &b.attributes, b.encoding), "part {i}");
        for (x, y) in a.channel_data.list.iter().zip(&b.channel_data.list) {
            assert_eq!(
                (&x.name, x.quantize_linearly, x.sampling),
                (&y.name, y.quantize_linearly, y.sampling)
            );
            let same = bits(&x.sample_data) == bits(&y.sample_data);
            let changes = i == part && beauty.iter().any(|name| x.name == *(*name));
            assert_eq!(same, !changes, "part {i}, channel {}", x.name);
        }
    }
}

fn samples<'a>(image: &'a FlatImage, part: usize, name: &str) -> &'a FlatSamples {
    let list = &image.layer_data[part].channel_data.list;
    &list.iter().find(|channel| channel.name == *name).unwrap().sample_data
}

/// Colour, alpha, matte identities that are NaN as floats, and whole numbers.
fn mixed(size: (usize, usize)) -> Vec<AnyChannel<FlatSamples>> {
    let count = size.0 * size.1;
    let identities =
        (0..count).map(|i| f32::from_bits(0x7fa0_0000 ^ ((i as u32).wrapping_mul(2_654_435_761)))).collect();
    vec![
        half("R", &values(count, 1)),
        half("G", &values(count, 2)),
        half("B", &values(count, 3)),
        half("A", &values(count, 4)),
        float("crypto a very long layer name of more than thirty-one letters00.r", identities),
        whole("id", (0..count as u32).map(|i| i.wrapping_mul(77_777_777)).collect()),
    ]
}

#[test]
fn every_lossless_encoding_and_window_survives() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.exr");
    let tiles = |line_order| Encoding {
        compression: Compression::ZIP1,
        blocks: Blocks::Tiles(Vec2(16, 8)),
        line_order,
    };
    let mut encodings: Vec<Encoding> = LOSSLESS.map(scan_lines).to_vec();
    encodings.push(Encoding { line_order: LineOrder::Decreasing, ..scan_lines(Compression::ZIP16) });
    encodings.extend([
        tiles(LineOrder::Unspecified),
        tiles(LineOrder::Increasing),
        tiles(LineOrder::Decreasing),
    ]);
    for encoding in encodings {
        for (size, position) in [((37, 41), (-13, -7)), ((1, 50), (5, 3)), ((53, 1), (0, -1))] {
            let mut layer = layer(None, size, position, encoding, mixed(size));
            let attributes = &mut layer.attributes;
            attributes.owner = Some(Text::from("the owner"));
            attributes.other.insert(Text::from("a.b/own"), AttributeValue::Text(Text::from("{\"a\":1}")));
            attributes.other.insert(
                Text::from("opaque"),
                AttributeValue::Custom { kind: Text::from("my type"), bytes: vec![0, 255, 7].into() },
            );
            write(&input, IntegerBounds::new((-20, 4), (100, 30)), vec![layer]);
            let (before, after, notes) = through(folder.path(), &input, false);
            assert_same_but(&before, &after, 0, &["R", "G", "B"]);
            assert!(notes.is_empty());
            let FlatSamples::F16(green) = samples(&after, 0, "G") else { panic!("the type changed") };
            let last = 2.0 + (size.0 - 1) as f32 + 0.5 * (size.1 - 1) as f32;
            assert_eq!(green.last().unwrap().to_f32(), f16::from_f32(last).to_f32(), "{encoding:?}");
        }
    }
}

#[test]
fn parts_with_windows_of_their_own_survive_even_when_lossy() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.exr");
    let (small, large) = ((19, 23), (40, 31));
    let part = |name, size, position, codec, names: &[&str]| {
        layer(Some(name), size, position, scan_lines(codec), channels(size, names))
    };
    let lossy = layer(
        Some("matte"),
        large,
        (-5, -5),
        scan_lines(Compression::B44),
        vec![half("m", &values(large.0 * large.1, 9))],
    );
    let parts = vec![
        part("depth", large, (-5, -5), Compression::ZIP16, &["Z"]),
        lossy,
        part("rgba", small, (3, 2), Compression::ZIP1, &["R", "G", "B", "A"]),
        part("normal", (8, 8), (20, 20), Compression::PIZ, &["X", "Y", "Z"]),
    ];
    write(&input, IntegerBounds::new((0, 0), (64, 48)), parts);
    let (before, after, _) = through(folder.path(), &input, false);
    assert_same_but(&before, &after, 2, &["R", "G", "B"]);

    let picture = Picture::read(&input, &ReadOptions::default()).unwrap();
    let depth = &picture.frame().features().iter().find(|feature| feature.name == "depth").unwrap().planes[0];
    assert_eq!(depth.size(), small, "the depth is cut to the colour's window");
    let stored = values(large.0 * large.1, 0);
    assert_eq!(depth.get(1, 2), stored[(2 + 2 + 5) * large.0 + 1 + 3 + 5]);
    let normal =
        &picture.frame().features().iter().find(|feature| feature.name == "normal").unwrap().planes[2];
    assert_eq!(normal.get(16, 18), 0.0, "outside of its part");
    assert_eq!(normal.get(17, 18), values(64, 2)[0], "its first pixel");
    assert!(picture.layout().notes.iter().any(|note| note.contains("data window")));
}

#[test]
fn a_codec_that_would_alter_the_rest_gives_way_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.exr");
    let size = (33, 270); // more lines than any codec takes together
    let lossy = [Compression::B44, Compression::B44A, Compression::DWAA(None), Compression::DWAB(None)];
    for (codec, line_order) in lossy
        .into_iter()
        .chain([Compression::PXR24])
        .flat_map(|codec| [(codec, LineOrder::Increasing), (codec, LineOrder::Decreasing)])
    {
        let encoding = Encoding { line_order, ..scan_lines(codec) };
        write_one(&input, layer(None, size, (0, 0), encoding, mixed(size)));
        let (before, after, notes) = through(folder.path(), &input, false);
        for name in ["A", "id", "crypto a very long layer name of more than thirty-one letters00.r"] {
            assert_eq!(bits(samples(&before, 0, name)), bits(samples(&after, 0, name)), "{codec:?} {name}");
        }
        let keeps = codec == Compression::PXR24;
        assert_eq!((after.layer_data[0].encoding.compression == codec, notes.is_empty()), (keeps, keeps));
    }
}

#[test]
fn aux_layers_are_added_and_replaced_and_nothing_else_changes() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.exr");
    let size = (21, 17);
    write_one(&input, layer(None, size, (0, 0), scan_lines(Compression::ZIP16), mixed(size)));
    let (before, once, _) = through(folder.path(), &input, true);
    let with_aux = folder.path().join("aux.exr");
    std::fs::rename(folder.path().join("out.exr"), &with_aux).unwrap();
    let (_, twice, _) = through(folder.path(), &with_aux, true);
    for after in [&once, &twice] {
        assert_eq!(
            after.layer_data[0].channel_data.list.len(),
            before.layer_data[0].channel_data.list.len() + 2
        );
        let FlatSamples::F32(order) = samples(after, 0, "apr.order.Y") else { panic!("aux is float") };
        assert_eq!(order[size.0 + 2], 5.0 + 2.0 + 0.5);
        for name in ["A", "id"] {
            assert_eq!(bits(samples(&before, 0, name)), bits(samples(after, 0, name)));
        }
    }
}

#[test]
fn a_render_that_is_denoised_already_is_read_from_its_noisy_twin() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.exr");
    let size = (9, 9);
    let names = [
        "V.Combined.R",
        "V.Combined.G",
        "V.Combined.B",
        "V.Noisy Image.R",
        "V.Noisy Image.G",
        "V.Noisy Image.B",
    ];
    write_one(&input, layer(None, size, (0, 0), scan_lines(Compression::ZIP16), channels(size, &names)));
    let picture = Picture::read(&input, &ReadOptions::default()).unwrap();
    assert_eq!(picture.frame().color()[0].data(), values(81, 3));
    let (before, after, _) = through(folder.path(), &input, false);
    assert_same_but(&before, &after, 0, &names[..3]);
    assert_eq!(apr::io::read_rgb(folder.path().join("out.exr")).unwrap(), result(&picture).color);
}

#[test]
fn the_input_may_be_its_own_output() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let size = (40, 40);
    write_one(&path, layer(None, size, (0, 0), scan_lines(Compression::ZIP16), mixed(size)));
    let before = read_all(&path);
    let picture = Picture::read(&path, &ReadOptions::default()).unwrap();
    picture.write(&path, &result(&picture), false).unwrap();
    assert_same_but(&before, &read_all(&path), 0, &["R", "G", "B"]);
}
