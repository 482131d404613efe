//! The direction of the arrows between modules, and one door for each crate: read from the sources,
//! so that an import against the plan fails here and not in a review.

use std::fs;
use std::path::{Path, PathBuf};

/// A module (first folder or file under src) and the modules it may import besides itself.
const ARROWS: [(&str, &[&str]); 15] = [
    ("error", &[]),
    ("likeness", &[]),
    ("image", &["error"]),
    ("tone", &["image"]),
    ("frame", &["error", "image"]),
    ("options", &["error", "frame", "likeness"]),
    ("denoise", &["error", "image", "frame", "options"]),
    ("baseline", &["error", "image", "frame", "options", "denoise"]),
    ("metrics", &["error", "image", "tone"]),
    ("io", &["error", "image", "frame", "likeness"]),
    ("report", &["error", "image", "tone", "metrics"]),
    ("trace", &["error", "image", "frame", "likeness"]),
    ("sampling", &["error", "image", "frame", "metrics"]),
    // The rounds of a render: the one place that knows both the tracer and the denoiser.
    ("adaptive", &["error", "image", "frame", "options", "denoise", "metrics", "sampling", "trace"]),
    ("lib", &[]),
];

/// A crate, how its paths begin, and the modules that may name it.
const DOORS: [(&str, &[&str]); 8] = [
    ("exr", &["io"]),
    ("half", &["io"]),
    ("nalgebra", &["trace"]),
    ("rayon", &["baseline", "denoise", "image", "io", "metrics", "trace"]),
    ("clap", &[]),
    ("indicatif", &[]),
    ("image", &["report", "trace"]),
    ("base64", &["report"]),
];

/// Source files of the library with their module, programs and unit tests (`#[cfg(test)]` and what
/// follows, so all of a file that begins with `#![cfg(test)]`) left out.
fn sources() -> Vec<(String, PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut folders = vec![root.clone()];
    let mut found = vec![];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            let relative = entry.strip_prefix(&root).unwrap().to_path_buf();
            if entry.is_dir() && relative != Path::new("bin") {
                folders.push(entry);
            } else if entry.extension().is_some_and(|e| e == "rs") && !entry.ends_with("tests.rs") {
                let module = relative.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs");
                let text = fs::read_to_string(&entry).unwrap();
                let code = text.split("[cfg(test)]").next().unwrap();
                let code = code.lines().filter(|line| !line.trim_start().starts_with("//"));
                let code = code.collect::<Vec<_>>().join("\n");
                found.push((module.to_string(), relative, code));
            }
        }
    }
    assert!(found.len() > 20, "the sources were not found");
    found
}

/// The names that follow `prefix` in `code`, where `prefix` begins a path of its own.
fn names_after<'a>(code: &'a str, prefix: &'a str) -> impl Iterator<Item = &'a str> {
    code.match_indices(prefix).filter_map(move |(at, _)| {
        let before = code[..at].chars().next_back();
        let own = !before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':');
        let after = &code[at + prefix.len()..];
        let end = after.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(after.len());
        own.then_some(&after[..end])
    })
}

#[test]
fn modules_import_only_what_lies_below_them() {
    let sources = sources();
    for (module, path, code) in &sources {
        let allowed = ARROWS.iter().find(|(name, _)| name == module);
        let (_, allowed) = allowed.unwrap_or_else(|| panic!("{module} has no arrows: add it to ARROWS"));
        for name in names_after(code, "crate::") {
            let is_module = sources.iter().any(|(module, ..)| module == name);
            assert!(
                !is_module || name == module || allowed.contains(&name),
                "src/{} imports crate::{name}, which {module} must not know",
                path.display()
            );
        }
    }
}

#[test]
fn each_crate_has_one_door() {
    for (module, path, code) in &sources() {
        for (name, doors) in DOORS {
            let used = names_after(code, &format!("{name}::")).next().is_some();
            assert!(
                !used || doors.contains(&module.as_str()),
                "src/{} names the crate {name}, whose place is in {doors:?}",
                path.display()
            );
        }
    }
}

#[test]
fn the_library_is_silent_reads_no_clock_and_opens_files_in_io_alone() {
    for (module, path, code) in &sources() {
        for (call, places) in [
            ("println!", &[][..]),
            ("eprintln!", &[]),
            ("dbg!", &[]),
            ("Instant::now", &[]),
            ("SystemTime", &[]),
            ("std::fs", &["io", "trace"]), // trace::scene opens scenes, meshes and textures
            ("File::", &["io", "trace"]),
        ] {
            assert!(
                !code.contains(call) || places.contains(&module.as_str()),
                "src/{} has {call}, which belongs in {places:?} or a program",
                path.display()
            );
        }
    }
}
