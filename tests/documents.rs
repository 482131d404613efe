//! The documents do not point at what is not there.

use std::path::Path;

/// The targets of the Markdown links and pictures in `text` that are paths, without their anchors.
fn paths(text: &str) -> impl Iterator<Item = &str> {
    text.split("](")
        .skip(1)
        .filter_map(|rest| rest.split(')').next())
        .filter_map(|target| target.split('#').next())
        .filter(|target| !target.is_empty() && !target.contains("://"))
}

#[test]
fn every_link_to_a_file_finds_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for document in ["README.md", "fixtures/README.md", "fixtures/scenes/README.md"] {
        let document = root.join(document);
        let text = std::fs::read_to_string(&document).unwrap();
        for path in paths(&text) {
            let target = document.parent().unwrap().join(path);
            assert!(target.exists(), "{} links to {path}, which is not there", document.display());
        }
    }
    let readme = std::fs::read_to_string(root.join("README.md")).unwrap();
    assert!(paths(&readme).count() >= 10, "the README's links were not found");
}
