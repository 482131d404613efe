//! Buffers that a renderer wrote as files of their own, beside the colour.

use std::path::{Path, PathBuf};

use super::channels::{COMPANIONS, LAYERS, Renderer};

/// The files beside `color` whose names are `prefix` and a buffer's name of the channel map, sorted.
pub(super) fn buffers_beside(color: &Path, prefix: &str, renderer: Renderer) -> Vec<PathBuf> {
    let folder = color.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.file_name() != color.file_name())
        .filter(|path| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr")))
        .filter(|path| {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            stem.strip_prefix(prefix).is_some_and(|name| is_buffer(name, renderer))
        })
        .collect();
    found.sort();
    found
}

/// Whether a layer, or a statistic of it, has this name.
pub(super) fn is_buffer(name: &str, renderer: Renderer) -> bool {
    LAYERS.iter().filter(|row| row.renderer == renderer).any(|layer| {
        let statistics = COMPANIONS.iter().filter(|row| row.renderer == renderer);
        let names = statistics.map(|row| row.layer.replace("{}", layer.layer));
        layer.layer.eq_ignore_ascii_case(name) || names.into_iter().any(|n| n.eq_ignore_ascii_case(name))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_buffers_of_the_same_shot_are_taken() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a_color", "a_colorVariance", "a_albedoA", "b_albedo", "a_other", "a_depth"] {
            std::fs::write(folder.path().join(format!("{name}.exr")), "").unwrap();
        }
        std::fs::write(folder.path().join("a_normal.png"), "").unwrap();
        let found = buffers_beside(&folder.path().join("a_color.exr"), "a_", Renderer::Tungsten);
        let names: Vec<_> = found.iter().map(|path| path.file_stem().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["a_albedoA", "a_colorVariance", "a_depth"]);
    }
}
