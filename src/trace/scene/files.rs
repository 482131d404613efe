//! Files that a scene names: meshes and pictures, each read once.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::json::Node;
use crate::error::Result;
use crate::trace::math::{Vec3, direction};
use crate::trace::texture::Picture;

/// A mesh as its file has it.
#[derive(Debug)]
pub struct Mesh {
    /// Corners of each triangle.
    pub triangles: Vec<[Corner; 3]>,
}

/// A corner of a triangle.
#[derive(Debug, Clone, Copy)]
pub struct Corner {
    /// Where it is.
    pub position: Vec3,
    /// Its normal, if the file has any.
    pub normal: Option<Vec3>,
    /// Its texture coordinates; v is flipped, so that a picture's first row is the top.
    pub uv: [f32; 2],
}

/// Reads files relative to the scene's folder.
#[derive(Debug)]
pub struct Files {
    folder: PathBuf,
    meshes: HashMap<PathBuf, Arc<Mesh>>,
    pictures: HashMap<(PathBuf, bool), Arc<Picture>>,
    /// Everything that was read.
    pub paths: Vec<PathBuf>,
    /// Running hash of everything that was read.
    pub fingerprint: u64,
}

/// FNV-1a: enough to tell whether a scene is still the one that a checkpoint was made from.
pub fn hash(state: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(state, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3))
}

impl Files {
    /// Files below `folder`.
    pub fn new(folder: &Path) -> Self {
        const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
        Self {
            folder: folder.into(),
            meshes: HashMap::new(),
            pictures: HashMap::new(),
            paths: vec![],
            fingerprint: FNV_OFFSET,
        }
    }

    fn read(&mut self, node: &Node) -> Result<(PathBuf, Vec<u8>)> {
        let path = self.folder.join(node.string()?);
        let bytes = std::fs::read(&path).map_err(|error| {
            node.error(format!("'{}' cannot be read: {error}", path.display()))
                .remedy("paths are relative to the scene's folder")
        })?;
        self.fingerprint = hash(self.fingerprint, &bytes);
        self.paths.push(path.clone());
        Ok((path, bytes))
    }

    /// The mesh in the OBJ file that `node` names.
    pub fn mesh(&mut self, node: &Node) -> Result<Arc<Mesh>> {
        let path = self.folder.join(node.string()?);
        if let Some(mesh) = self.meshes.get(&path) {
            return Ok(mesh.clone());
        }
        let (path, bytes) = self.read(node)?;
        let mesh = Arc::new(parse_obj(&bytes).map_err(|what| {
            let error = node.error(format!("'{}' {what}", path.display()));
            error.remedy("give an OBJ file of triangles or polygons")
        })?);
        self.meshes.insert(path, mesh.clone());
        Ok(mesh)
    }

    /// The picture that `node` names, in linear RGB; `raw` takes the numbers as linear already, which
    /// HDR pictures are in any case.
    pub fn picture(&mut self, node: &Node, raw: bool) -> Result<Arc<Picture>> {
        let key = (self.folder.join(node.string()?), raw);
        if let Some(picture) = self.pictures.get(&key) {
            return Ok(picture.clone());
        }
        let (path, bytes) = self.read(node)?;
        let picture = Arc::new(decode_picture(&bytes, raw).map_err(|what| {
            let error = node.error(format!("'{}' {what}", path.display()));
            error.remedy("give a PNG, JPEG or HDR picture of at least 2×2 pixels")
        })?);
        self.pictures.insert(key, picture.clone());
        Ok(picture)
    }
}

/// The mesh in an OBJ file, or what is wrong with it.
fn parse_obj(bytes: &[u8]) -> std::result::Result<Mesh, String> {
    let options = tobj::LoadOptions { triangulate: true, single_index: false, ..Default::default() };
    let no_materials = |_: &Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, no_materials)
        .map_err(|error| format!("is no readable OBJ mesh: {error}"))?;
    for mesh in models.iter().map(|model| &model.mesh) {
        let numbers =
            [("place", &mesh.positions), ("normal", &mesh.normals), ("texture coordinate", &mesh.texcoords)];
        if let Some((what, _)) = numbers.iter().find(|(_, values)| !values.iter().all(|x| x.is_finite())) {
            return Err(format!("has a vertex whose {what} is no finite number"));
        }
    }
    let mesh = Mesh { triangles: models.iter().flat_map(|model| triangles(&model.mesh)).collect() };
    match mesh.triangles.is_empty() {
        true => Err("has no triangle".into()),
        false => Ok(mesh),
    }
}

fn triangles(mesh: &tobj::Mesh) -> Vec<[Corner; 3]> {
    let vector = |v: &[f32], i: u32| -> Option<Vec3> {
        let i = 3 * i as usize;
        Some(Vec3::from_column_slice(v.get(i..i + 3)?))
    };
    let corner = |k: usize| {
        let normal = mesh.normal_indices.get(k).and_then(|&i| vector(&mesh.normals, i));
        let uv = mesh.texcoord_indices.get(k).and_then(|&i| {
            let pair = mesh.texcoords.get(2 * i as usize..2 * i as usize + 2)?;
            Some([pair[0], 1.0 - pair[1]])
        });
        Some(Corner {
            position: vector(&mesh.positions, mesh.indices[k])?,
            normal: normal.and_then(|n| direction(n.cast())),
            uv: uv.unwrap_or_default(),
        })
    };
    let triangle = |t: usize| Some([corner(3 * t)?, corner(3 * t + 1)?, corner(3 * t + 2)?]);
    (0..mesh.indices.len() / 3).filter_map(triangle).collect()
}

/// The picture in a file, or what is wrong with it.
fn decode_picture(bytes: &[u8], raw: bool) -> std::result::Result<Picture, String> {
    let unreadable = |error: &dyn std::fmt::Display| format!("is no readable picture: {error}");
    let reader = image::ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let reader = reader.map_err(|error| unreadable(&error))?;
    let linear = raw || reader.format() == Some(image::ImageFormat::Hdr);
    let picture = reader.decode().map_err(|error| unreadable(&error))?.into_rgb32f();
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    if width < 2 || height < 2 {
        return Err(format!("has {width}×{height} pixels"));
    }
    let decode = |c: f32| if linear { c } else { srgb_to_linear(c) };
    let texels = picture.pixels().map(|pixel| Vec3::from(pixel.0).map(decode)).collect();
    Ok(Picture { width, height, texels })
}

/// The inverse of sRGB's transfer curve (IEC 61966-2-1).
fn srgb_to_linear(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}
