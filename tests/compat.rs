//! Every file that other programs wrote is denoised, or refused with a clear error.
//!
//! The files are not in this repository, for their licences differ. `APR_COMPAT_DIR` names their folder;
//! without it `../shared/compat` beside the checkout is tried. Renders of our own are in fixtures/ and are
//! always tested.

#![expect(clippy::print_stderr, reason = "a skipped test says so")]

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::exr_files::{bits, read_all};
use exr::prelude::Text;

/// Refused for what they are: deep data, and luminance without RGB.
const REFUSED: [&str; 2] = ["openexr_Trunks_deep", "openexr_Garden_subsampled_luminance_chroma"];

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<_> =
        entries.filter(|path| path.extension().is_some_and(|ending| ending == "exr")).collect();
    files.sort();
    files
}

/// Denoises `input` and checks that only the colour changed.
fn check(input: &Path, folder: &Path) {
    let output = folder.join("out.exr");
    // What passes through does not depend on how well the rest is denoised: small windows save minutes.
    let cheap = ["--set", "window_radius=2", "--set", "center_spacing=4"];
    let run = Command::new(env!("CARGO_BIN_EXE_apr-denoise"))
        .args([input, &output])
        .arg("--quiet")
        .args(cheap)
        .output()
        .unwrap();
    let complaint = String::from_utf8_lossy(&run.stderr).into_owned();
    let name = input.file_stem().unwrap().to_str().unwrap();
    if REFUSED.contains(&name) {
        assert_eq!(run.status.code(), Some(3), "{name}: {complaint}");
        assert!(complaint.contains(name) && complaint.contains(';'), "it names file and remedy: {complaint}");
        return;
    }
    assert_eq!(run.status.code(), Some(0), "{name}: {complaint}");
    let (before, after) = (read_all(input), read_all(&output));
    assert_eq!(before.attributes, after.attributes, "{name}");
    let mut changed = Vec::new();
    for (part, (a, b)) in before.layer_data.iter().zip(&after.layer_data).enumerate() {
        let mut kept = b.attributes.clone();
        for added in ["apr.settings", "apr.denoised"] {
            kept.other.remove(&Text::from(added));
        }
        assert_eq!((&a.attributes, a.encoding, a.size), (&kept, b.encoding, b.size), "{name}, part {part}");
        for (x, y) in a.channel_data.list.iter().zip(&b.channel_data.list) {
            assert_eq!(x.name, y.name, "{name}");
            if bits(&x.sample_data) != bits(&y.sample_data) {
                changed.push((part, x.name.to_string()));
            }
        }
    }
    let beauty = |channel: &str| {
        ["R", "G", "B", "ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B"]
            .contains(&channel)
    };
    assert!(changed.iter().all(|(part, channel)| *part == 0 && beauty(channel)), "{name}: {changed:?}");
}

#[test]
fn files_of_other_programs_go_through_or_are_refused() {
    let named = std::env::var_os("APR_COMPAT_DIR").map(PathBuf::from);
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/compat");
    let folder = named.clone().unwrap_or(beside);
    let files = files(&folder);
    if files.is_empty() {
        assert!(named.is_none(), "APR_COMPAT_DIR has no EXR files");
        eprintln!("SKIPPED: no files of other programs in {} (set APR_COMPAT_DIR)", folder.display());
        return;
    }
    let out = tempfile::tempdir().unwrap();
    files.iter().for_each(|file| check(file, out.path()));
}

#[test]
fn the_fixtures_of_mitsuba_and_blender_go_through() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures");
    let out = tempfile::tempdir().unwrap();
    let all: Vec<_> = ["mitsuba", "blender"].iter().flat_map(|name| files(&fixtures.join(name))).collect();
    assert!(!all.is_empty());
    all.iter().for_each(|file| check(file, out.path()));
}
