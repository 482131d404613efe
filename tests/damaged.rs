//! Truncated, damaged and hostile files: an error, soon, and in little memory.

use std::path::Path;
use std::sync::OnceLock;

use crate::exr_files::*;
use crate::fuzzed::exr_to_frame::read_and_write;
use apr::ErrorKind;
use apr::io::{Picture, ReadOptions};
use exr::prelude::Compression;
use proptest::prelude::*;

/// Small files of every codec.
fn samples() -> &'static [Vec<u8>] {
    static SAMPLES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    SAMPLES.get_or_init(|| of_every_codec((19, 37)))
}

/// Reads `bytes` as a file, and writes it again if it can be read: whatever comes, no panic.
fn survive(bytes: &[u8]) -> apr::Result<()> {
    read_and_write(bytes, tempfile::tempdir().unwrap().path())
}

#[test]
fn the_samples_themselves_are_fine() {
    samples().iter().for_each(|bytes| survive(bytes).unwrap());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_truncated_file_is_an_error(sample in 0..20_usize, share in 0.0..1.0_f64) {
        let bytes = &samples()[sample];
        let kept = (bytes.len() as f64 * share) as usize;
        let error = survive(&bytes[..kept]).expect_err("something is missing");
        prop_assert_eq!(error.kind(), ErrorKind::Unreadable);
    }

    #[test]
    fn flipped_bits_never_panic(
        sample in 0..20_usize,
        flips in prop::collection::vec((0.0..1.0_f64, 0..8_u32), 1..6),
        in_header in any::<bool>(),
    ) {
        let mut bytes = samples()[sample].clone();
        let range = if in_header { bytes.len().min(900) } else { bytes.len() };
        for (place, bit) in flips {
            bytes[(range as f64 * place) as usize] ^= 1 << bit;
        }
        if let Err(error) = survive(&bytes) {
            let kinds = [ErrorKind::Unreadable, ErrorKind::Lacking];
            prop_assert!(kinds.contains(&error.kind()), "{}", error);
        }
    }

    #[test]
    fn any_bytes_after_the_magic_number_are_an_error(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let file: Vec<u8> = [0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0].into_iter().chain(bytes).collect();
        prop_assert_eq!(survive(&file).unwrap_err().kind(), ErrorKind::Unreadable);
    }

    #[test]
    fn attributes_that_mean_nothing_here_come_out_as_they_were(
        sample in 0..20_usize,
        name in prop::sample::select(vec!["timeCode", "xDensity", "preview", "x", "aNameOfMoreThanThirtyOneLetters_"]),
        (type_name, size) in prop::sample::select(TYPES.to_vec()),
        whole in any::<bool>(),
        content in prop::array::uniform32(any::<u8>()),
    ) {
        let size = if whole { size } else { 1 }; // not too long: the decoder cuts that off
        let value: Vec<u8> = content.into_iter().cycle().take(size).collect();
        let length = (size as u32).to_le_bytes();
        let attribute = [name.as_bytes(), b"\0", type_name.as_bytes(), b"\0", &length, &value].concat();
        let folder = tempfile::tempdir().unwrap();
        read_and_write(&with_attribute(&samples()[sample], &attribute), folder.path()).unwrap();
        let out = folder.path().join("out.exr");
        let written = std::fs::read(&out).unwrap();
        let is_there = written.windows(attribute.len()).any(|window| window == attribute);
        prop_assert!(is_there, "{} of type {} is not", name, type_name);
        Picture::read(&out, &ReadOptions::default()).unwrap();
    }
}

/// Types of attributes, and how many bytes of any content make one.
const TYPES: [(&str, usize); 18] = [
    ("int", 4),
    ("float", 4),
    ("double", 8),
    ("rational", 8),
    ("timecode", 8),
    ("v2i", 8),
    ("v2f", 8),
    ("v3i", 12),
    ("v3f", 12),
    ("box2i", 16),
    ("box2f", 16),
    ("keycode", 28),
    ("chromaticities", 32),
    ("m33f", 36),
    ("m44f", 64),
    ("string", 20),
    ("preview", 7),
    ("aTypeWithANameOfMoreThan31Letters", 5),
];

/// With one more attribute at the front of the (first) header, and the table of blocks told of it.
fn with_attribute(bytes: &[u8], attribute: &[u8]) -> Vec<u8> {
    const MULTI_PART: u8 = 0x10;
    const LONG_NAMES: u8 = 0x04;
    let mut longer = [&bytes[..8], attribute, &bytes[8..]].concat();
    longer[5] |= LONG_NAMES;
    let mut at = 8;
    loop {
        while longer[at] != 0 {
            let name_and_type = longer[at..].split_inclusive(|&byte| byte == 0).take(2).map(<[u8]>::len);
            at += name_and_type.sum::<usize>();
            at += 4 + u32::from_le_bytes(longer[at..at + 4].try_into().unwrap()) as usize;
        }
        at += 1;
        if longer[5] & MULTI_PART == 0 || longer[at] == 0 {
            break;
        }
    }
    at += usize::from(longer[5] & MULTI_PART != 0);
    let mut first_block = longer.len();
    while at < first_block {
        let place = u64::from_le_bytes(longer[at..at + 8].try_into().unwrap()) + attribute.len() as u64;
        longer[at..at + 8].copy_from_slice(&place.to_le_bytes());
        first_block = first_block.min(place as usize);
        at += 8;
    }
    longer
}

/// Replaces the value of the attribute `name` in a file's header.
fn patched(bytes: &[u8], name: &str, offset: usize, value: &[u8]) -> Vec<u8> {
    let start = bytes.windows(name.len()).position(|window| window == name.as_bytes()).unwrap();
    let mut zeros = bytes[start..].iter().enumerate().filter(|(_, byte)| **byte == 0).map(|(i, _)| start + i);
    let (_, end_of_type) = (zeros.next().unwrap(), zeros.next().unwrap());
    let value_start = end_of_type + 1 + 4 + offset; // after the type come four bytes of length
    let mut bytes = bytes.to_vec();
    bytes[value_start..value_start + value.len()].copy_from_slice(value);
    bytes
}

/// A window from the origin to this last pixel.
fn window(right: i32, bottom: i32) -> Vec<u8> {
    [0, 0, right, bottom].iter().flat_map(|v: &i32| v.to_le_bytes()).collect()
}

/// Headers that claim far more than the file holds.
fn hostile() -> Vec<(&'static str, Vec<u8>)> {
    let zip = &samples()[6];
    let piz = &samples()[8];
    let tiled = &samples()[7];
    let mut padded = patched(piz, "dataWindow", 0, &window(16_383, 16_383));
    padded.resize(1 << 14, 0);
    vec![
        ("a quarter of a gigapixel and no blocks", padded),
        ("a window of 2^60 pixels", patched(zip, "dataWindow", 0, &window(i32::MAX / 4, i32::MAX / 4))),
        ("a window of 2^62 pixels", patched(zip, "dataWindow", 0, &window(i32::MAX, i32::MAX))),
        ("a gigapixel in a few bytes", patched(zip, "dataWindow", 0, &window(16_000, 16_000))),
        ("one line of a gigapixel", patched(zip, "dataWindow", 0, &window(1 << 28, 0))),
        ("a column of a gigapixel", patched(piz, "dataWindow", 0, &window(0, 1 << 28))),
        ("a window that ends before it begins", patched(zip, "dataWindow", 0, &window(-7, -7))),
        ("tiles of 2^62 pixels", patched(tiled, "tiles", 0, &[255, 255, 255, 127, 255, 255, 255, 127])),
        ("tiles of no pixels", patched(tiled, "tiles", 0, &[0; 8])),
    ]
}

#[test]
fn hostile_headers_are_refused() {
    for (what, bytes) in hostile() {
        let error = survive(&bytes).expect_err(what);
        assert_eq!(error.kind(), ErrorKind::Unreadable, "{what}: {error}");
    }
}

/// Nine bytes: the list of a file of several parts that is empty.
#[test]
fn a_file_without_parts_is_nobodys_result() {
    let folder = tempfile::tempdir().unwrap();
    let [input, empty] = ["in.exr", "empty.exr"].map(|name| folder.path().join(name));
    std::fs::write(&input, &samples()[6]).unwrap();
    std::fs::write(&empty, [0x76, 0x2f, 0x31, 0x01, 2, 0x10, 0, 0, 0]).unwrap();
    assert_eq!(apr::io::provenance(&empty).unwrap_err().kind(), ErrorKind::Unreadable);
    let run = std::process::Command::new(env!("CARGO_BIN_EXE_apr-denoise"))
        .args([&input, &empty])
        .output()
        .unwrap();
    assert_eq!(run.status.code(), Some(2), "{}", String::from_utf8_lossy(&run.stderr));
}

/// The program itself, with no more than half a gigabyte of address space.
#[test]
#[cfg(target_os = "linux")]
fn hostile_headers_are_refused_in_little_memory() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hostile.exr");
    for (what, bytes) in hostile() {
        std::fs::write(&path, bytes).unwrap();
        let output = limited(&path);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(3), "{what}: {said}");
    }
    std::fs::write(&path, &samples()[6]).unwrap();
    assert_eq!(limited(&path).status.code(), Some(0), "the limit itself is no obstacle");
}

/// The counters at the head of a block of DWA: the decoder asks for as much memory as they say.
#[test]
fn a_block_of_dwa_that_announces_too_much_is_refused() {
    let size = (19, 37);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dwa.exr");
    let channels = channels(size, &["R", "G", "B", "A", "depth.Z"]);
    write_one(&path, layer(None, size, (0, 0), scan_lines(Compression::DWAA(None)), channels));
    let bytes = std::fs::read(&path).unwrap();
    survive(&bytes).unwrap();
    // The blocks follow on the table that points to them; each starts with its row and its length.
    let table = (8..bytes.len()).find(|at| {
        let word = |n: usize| {
            bytes.get(at + 8 * n..at + 8 * n + 8).map(|b| u64::from_le_bytes(b.try_into().unwrap()))
        };
        word(0) == Some(*at as u64 + 16) && word(1) > word(0)
    });
    let counters = table.expect("two blocks of 32 rows") + 16 + 8;
    for n in [1, 6, 7, 8, 9] {
        let mut bytes = bytes.clone();
        bytes[counters + 8 * n + 6] = 1; // 2^48 more
        let error = survive(&bytes).unwrap_err();
        assert!(error.to_string().contains("announces"), "counter {n}: {error}");
    }
}

/// A block of 38 kB whose zeros go on for 64 MiB, in the place of one that holds what it announces.
#[test]
#[cfg(target_os = "linux")]
fn a_block_that_unpacks_to_more_than_it_announces_is_refused_in_little_memory() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bomb.exr");
    let write_zeros = |size: (usize, usize)| {
        let channels = ["R", "G", "B", "A"].map(|name| float(name, vec![0.0; size.0 * size.1])).into();
        write_one(&path, layer(None, size, (0, 0), scan_lines(Compression::ZIP16), channels));
        std::fs::read(&path).unwrap()
    };
    // The only block is at the end of the file: its row, its length, its content.
    let (large, mut small) = (write_zeros((1 << 18, 16)), write_zeros((640, 16)));
    let block = |file: &[u8]| {
        let table = file.len() - (8..file.len()).find(|back| starts_block(file, *back)).unwrap();
        u64::from_le_bytes(file[table - 8..table].try_into().unwrap()) as usize
    };
    let (from, to) = (block(&large), block(&small));
    small.truncate(to);
    small.extend(&large[from..]);
    std::fs::write(&path, small).unwrap();
    let output = limited_to(64 << 10, &path);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{said}");
}

/// Renders of several programs, cut and with bytes changed, through the whole program: an error that names the
/// file, and no result, or a result that can be read; nothing else is left.
#[test]
#[cfg(target_os = "linux")]
fn fixtures_cut_and_changed_end_in_an_error_or_a_sound_result() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures");
    let folder = tempfile::tempdir().unwrap();
    let [input, output] = ["in.exr", "out.exr"].map(|name| folder.path().join(name));
    let mut state = 1u32;
    let mut below = |n: usize| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize % n
    };
    for name in ["blender/room_ref", "mitsuba/gallery_aov", "trace/fog_shaft", "trace/lens_table"] {
        let whole = std::fs::read(root.join(name).with_extension("exr")).unwrap();
        let cuts = [0, 7, 8, whole.len() - 1, below(900), below(whole.len()), below(whole.len())];
        let mut cases: Vec<(Vec<u8>, bool)> = cuts.map(|kept| (whole[..kept].to_vec(), true)).into();
        for n in 0..15 {
            let mut bytes = whole.clone();
            let reach = [700, 3000, whole.len()][n % 3].min(whole.len());
            (0..=n % 2).for_each(|_| bytes[below(reach)] = [0, 127, 128, 255, below(256) as u8][below(5)]);
            cases.push((bytes, false));
        }
        for (n, (bytes, must_fail)) in cases.into_iter().enumerate() {
            std::fs::write(&input, bytes).unwrap();
            let run = limited_run(512 << 10, &[&input, &output]);
            let said = String::from_utf8_lossy(&run.stderr).into_owned();
            match run.status.code() {
                Some(0) if !must_fail => {
                    Picture::read(&output, &ReadOptions::default()).unwrap();
                    std::fs::remove_file(&output).unwrap();
                }
                Some(3 | 4) => assert!(said.contains("in.exr") && said.contains(';'), "{said}"),
                code => panic!("{name}, case {n}: {code:?}: {said}"),
            }
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "{name}, case {n}");
        }
    }
}

/// Thousands of channels, all of zeros: a few hundred kB that unpack to a block of 128 MB, and 60 MB of planes
/// where the channels are features.
#[test]
#[cfg(target_os = "linux")]
fn a_bomb_of_many_channels_is_refused_in_little_memory() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bomb.exr");
    let write = |size: (usize, usize), channel: &dyn Fn(usize) -> String, count: usize| {
        let further = (0..count).map(|i| float(&channel(i), vec![0.0; size.0 * size.1]));
        let channels = ["R", "G", "B"].map(|name| float(name, vec![0.0; size.0 * size.1])).into_iter();
        let channels = channels.chain(further).collect();
        write_one(&path, layer(None, size, (0, 0), scan_lines(Compression::ZIP16), channels));
    };
    let refused = |kib: u32, word: &str| {
        let output = limited_to(kib, &path);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(3), "{said}");
        assert!(said.contains("bomb.exr") && said.contains(word) && said.contains("more memory"), "{said}");
    };
    write((1024, 16), &|i| format!("other{i}.Y"), 2000);
    refused(256 << 10, "a block");
    write((256, 64), &|i| format!("depth{i}.Z"), 900);
    refused(64 << 10, "");
}

/// Whether the bytes `back` from the end are a table of one block that points behind itself.
fn starts_block(file: &[u8], back: usize) -> bool {
    let at = file.len() - back;
    at >= 8 && u64::from_le_bytes(file[at - 8..at].try_into().unwrap()) == at as u64
}

#[cfg(target_os = "linux")]
fn limited(path: &Path) -> std::process::Output {
    limited_to(512 << 10, path)
}

/// The program with no more than so many KiB of address space, and windows that cost little.
#[cfg(target_os = "linux")]
fn limited_run(kib: u32, arguments: &[&Path]) -> std::process::Output {
    let script = "ulimit -v \"$1\"; shift; exec \"$0\" \"$@\"";
    let cheap = ["--threads", "1", "--set", "window_radius=2", "--set", "center_spacing=4"];
    let program = env!("CARGO_BIN_EXE_apr-denoise");
    let mut command = std::process::Command::new("sh");
    command.args(["-c", script, program, &kib.to_string()]).args(cheap).args(arguments);
    command.output().unwrap()
}

/// The program looking at `path` with no more than so many KiB of address space.
#[cfg(target_os = "linux")]
fn limited_to(kib: u32, path: &Path) -> std::process::Output {
    limited_run(kib, &[Path::new("--inspect"), path])
}
