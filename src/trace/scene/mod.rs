//! The scene file: JSON, every field of which is described in `docs/SCENES.md` (the docs of [`Scene`]). A key
//! that is not known, a missing file or a value out of range is an error that names its JSON path.

mod build;
mod camera;
mod document;
mod files;
mod json;
mod light;
mod material;
mod shape;
mod transform;

use std::path::{Path, PathBuf};

use super::bsdf::Material;
use super::bvh::Split;
use super::camera::Camera;
use super::light::{Light, Lights};
use super::math::Vec3;
use super::medium::Medium;
use super::world::World;
use crate::error::{Error, ErrorKind, Result};

/// What a surface is, beside its geometry.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShapeInfo {
    pub material: u32,
    pub radiance: Vec3,
    pub emitter: Option<u32>, // index among the lights
    pub group: u32,
}

/// A scene, ready to be rendered.
///
#[doc = include_str!("../../../docs/SCENES.md")]
#[derive(Debug, Clone)]
pub struct Scene {
    pub(super) camera: Camera,
    pub(super) world: World,
    pub(super) shapes: Vec<ShapeInfo>,
    pub(super) materials: Vec<Material>,
    pub(super) lights: Lights,
    pub(super) groups: Vec<u32>, // of each light
    pub(super) group_names: Vec<String>,
    pub(super) medium: Option<Medium>,
    pub(super) max_depth: u32,
    pub(super) roulette_depth: u32,
    pub(super) moving_shapes: usize,
    pub(super) instances: usize,
    fingerprint: u64,
    files: Vec<PathBuf>,
}

impl Scene {
    /// Loads the scene file at `path`.
    ///
    /// # Errors
    /// When the file, or one that it names, cannot be read or makes no sense.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let unreadable = |what, remedy| Error::new(ErrorKind::Unreadable, what).in_file(path).remedy(remedy);
        let bytes = std::fs::read(path)
            .map_err(|error| unreadable(format!("the scene cannot be read: {error}"), "check the path"))?;
        let text = String::from_utf8(bytes)
            .map_err(|_| unreadable("the scene is no text in UTF-8".into(), "save it in that encoding"))?;
        let folder = path.parent().unwrap_or(Path::new("."));
        Self::parse(&text, folder).map_err(|error| error.in_file(path))
    }

    /// Reads a scene from JSON; files it names are found relative to `folder`.
    ///
    /// # Errors
    /// When `text`, or a file that it names, cannot be read or makes no sense.
    pub fn parse(text: &str, folder: &Path) -> Result<Self> {
        Self::parse_with(text, folder, Split::Sah)
    }

    /// As [`Scene::parse`], with the hierarchy built by `split`: to compare.
    ///
    /// # Errors
    /// When `text`, or a file that it names, cannot be read or makes no sense.
    pub fn parse_with(text: &str, folder: &Path, split: Split) -> Result<Self> {
        let value = document::parse(text.trim_start_matches('\u{feff}')).map_err(|error| {
            Error::new(ErrorKind::Unreadable, format!("not valid JSON: {error}")).remedy("correct it there")
        })?;
        build::scene(&value, text, folder, split)
    }

    /// Width and height of the rendered picture.
    pub fn size(&self) -> (usize, usize) {
        (self.camera.crop.width, self.camera.crop.height)
    }

    /// A hash of the scene and the files it names: a checkpoint of another scene is not continued.
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// The files that the scene file names, as they were opened.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// The names of the light groups.
    pub fn light_groups(&self) -> &[String] {
        &self.group_names
    }

    /// Triangles stored, and nodes of the hierarchies over them.
    pub fn geometry_counts(&self) -> (usize, usize) {
        (self.world.triangle_count(), self.world.node_count())
    }

    /// The density with which the area light `light` is sampled in the direction of a point on it.
    pub(super) fn emitter_pdf(&self, light: usize, from: Vec3, distance: f32, cos: f32) -> f32 {
        match self.lights.get(light) {
            Light::Area(emitter) => emitter.pdf(from, distance, cos),
            _ => 0.0,
        }
    }
}
