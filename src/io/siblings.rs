//! Buffers that a renderer wrote as files of their own, beside the colour.

use std::path::{Path, PathBuf};

use super::channels::{COMPANIONS, LAYERS, Renderer, match_layer};
use super::layers::{buffer_prefix, stem};

/// The files beside `color` whose names differ from its by the buffer's name of the channel map, sorted: those of another
/// shot or frame do not belong to it.
pub(super) fn buffers_beside(color: &Path, renderer: Renderer) -> Vec<PathBuf> {
    let (name, number) = stem(color);
    let prefix = buffer_prefix(&name, renderer);
    let folder = color.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.file_name() != color.file_name())
        .filter(|path| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr")))
        .filter(|path| {
            let (name, of_frame) = stem(path);
            let buffer = name.strip_prefix(&prefix).filter(|_| of_frame == number);
            buffer.is_some_and(|name| is_buffer(name, renderer))
        })
        .collect();
    found.sort();
    found
}

/// Whether a layer, or a statistic of it, has this name.
pub(super) fn is_buffer(name: &str, renderer: Renderer) -> bool {
    LAYERS.iter().filter(|row| row.renderer == renderer && row.layer != "*").any(|layer| {
        let statistics = COMPANIONS.iter().filter(|row| row.renderer == renderer);
        let mut names =
            statistics.map(|row| row.layer.replace("{}", layer.layer)).chain([layer.layer.to_owned()]);
        !name.is_empty() && names.any(|pattern| match_layer(&pattern, name).is_some())
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
        for name in ["a_albedo.0001", "a_albedo.0002", "b_albedo.0001"] {
            std::fs::write(folder.path().join(format!("{name}.exr")), "").unwrap();
        }
        std::fs::write(folder.path().join("a_normal.png"), "").unwrap();
        let beside = |color: &str| {
            let found = buffers_beside(&folder.path().join(color), Renderer::Tungsten);
            let name = |path: &PathBuf| path.file_stem().unwrap().to_str().unwrap().to_owned();
            found.iter().map(name).collect::<Vec<_>>()
        };
        assert_eq!(beside("a_color.exr"), ["a_albedoA", "a_colorVariance", "a_depth"]);
        assert_eq!(beside("a_color.0001.exr"), ["a_albedo.0001"]);
    }
}
