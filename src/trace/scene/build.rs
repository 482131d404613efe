//! From the JSON document to the scene.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;

use super::files::{self, Files};
use super::json::{Node, Object};
use super::shape::{Outline, Pieces, outline};
use super::transform::{affine, check_motion};
use super::{Scene, ShapeInfo, camera, light, material};
use crate::error::Result;
use crate::trace::bsdf::Material;
use crate::trace::bvh::Split;
use crate::trace::light::{Emitter, Light, Lights};
use crate::trace::math::Vec3;
use crate::trace::texture::Texture;
use crate::trace::transform::{Affine, Motion, Placement};
use crate::trace::world::{Level, Solid, World};

const DEFAULT_MAX_DEPTH: u32 = 8;
const DEFAULT_ROULETTE_DEPTH: u32 = 5;
const UNNAMED_GROUP: &str = "other";

/// Everything that grows while the document is read.
struct Builder<'a> {
    files: Files,
    split: Split,
    names: BTreeMap<&'a str, u32>, // of the materials
    materials: Vec<Material>,
    shapes: Vec<ShapeInfo>,
    lights: Vec<Light>,
    groups: Vec<u32>,
    group_names: Vec<String>,
    levels: Vec<Level>,
    level_names: BTreeMap<&'a str, u32>,
    moving: usize,
    instances: usize,
}

/// The scene of `value`, whose text is `text`.
pub fn scene(value: &Value, text: &str, folder: &Path, split: Split) -> Result<Scene> {
    let root = Node::root(value);
    let object = root.object()?;
    let (camera, shapes) = (object.need("camera")?, object.need("shapes")?);
    let [integrator, materials, groups, lights, environment, medium] =
        ["integrator", "materials", "groups", "lights", "environment", "medium"].map(|key| object.get(key));
    object.done()?; // before names are missed that a section without its right name defines
    let mut builder = Builder::new(folder, split);
    let camera = camera::camera(&camera)?;
    let (max_depth, roulette_depth) = depths(integrator)?;
    for (name, node) in materials.map_or(Ok(vec![]), |node| node.members())? {
        builder.names.insert(name, builder.materials.len() as u32);
        let material = material::material(&node, &mut builder.files)?;
        builder.materials.push(material);
    }
    for (name, node) in groups.map_or(Ok(vec![]), |node| node.members())? {
        let level = builder.level(&node, false)?;
        builder.level_names.insert(name, builder.levels.len() as u32);
        builder.levels.push(level);
    }
    let top = builder.level(&shapes, true)?;
    for node in lights.map_or(Ok(vec![]), |node| node.list())? {
        let (light, group) = light::light(&node)?;
        builder.add_light(light, group);
    }
    if let Some(node) = environment {
        let (light, group) = light::environment(&node, &mut builder.files)?;
        builder.add_light(light, group);
    }
    let medium = medium.map(|node| light::medium(&node)).transpose()?;
    Ok(Scene {
        camera,
        world: World::new(top, builder.levels),
        shapes: builder.shapes,
        materials: builder.materials,
        lights: Lights::new(builder.lights),
        groups: builder.groups,
        group_names: builder.group_names,
        medium,
        max_depth,
        roulette_depth,
        moving_shapes: builder.moving,
        instances: builder.instances,
        fingerprint: files::hash(builder.files.fingerprint, text.as_bytes()),
        files: builder.files.paths,
    })
}

/// The most segments of a path, and the segment after which roulette begins.
fn depths(integrator: Option<Node>) -> Result<(u32, u32)> {
    let Some(node) = integrator else { return Ok((DEFAULT_MAX_DEPTH, DEFAULT_ROULETTE_DEPTH)) };
    let object = node.object()?;
    let whole = |key, default| object.or(key, default, |node| Ok(node.whole(1, 1 << 16)? as u32));
    let depths = (whole("max_depth", DEFAULT_MAX_DEPTH)?, whole("roulette_depth", DEFAULT_ROULETTE_DEPTH)?);
    object.done()?;
    Ok(depths)
}

impl<'a> Builder<'a> {
    fn new(folder: &Path, split: Split) -> Self {
        Self {
            files: Files::new(folder),
            split,
            names: BTreeMap::new(),
            materials: vec![],
            shapes: vec![],
            lights: vec![],
            groups: vec![],
            group_names: vec![],
            levels: vec![],
            level_names: BTreeMap::new(),
            moving: 0,
            instances: 0,
        }
    }

    fn group(&mut self, name: Option<&str>) -> u32 {
        let name = name.unwrap_or(UNNAMED_GROUP);
        let known = self.group_names.iter().position(|known| known == name);
        known.unwrap_or_else(|| {
            self.group_names.push(name.into());
            self.group_names.len() - 1
        }) as u32
    }

    fn add_light(&mut self, light: Light, group: Option<&str>) {
        let group = self.group(group);
        self.groups.push(group);
        self.lights.push(light);
    }

    /// The level of the shapes in the list `node`; `top` is the world, which may hold instances.
    fn level(&mut self, node: &Node<'a>, top: bool) -> Result<Level> {
        let mut pieces = Pieces::default();
        for node in node.list()? {
            let object = node.object()?;
            let added = match top && object.need("type")?.string()? == "instance" {
                true => self.instance(&node, &object)?,
                false => self.shape(&node, &object, top)?,
            };
            object.done()?;
            pieces.triangles.extend(added.triangles);
            pieces.solids.extend(added.solids);
        }
        Ok(Level::new(pieces.triangles, pieces.solids, &self.levels, self.split))
    }

    fn instance(&mut self, node: &Node<'a>, object: &Object<'a>) -> Result<Pieces> {
        let of = object.need("of")?;
        let known: Vec<_> = self.level_names.iter().map(|(name, level)| (*name, *level)).collect();
        let level = of.choice(&known)?;
        let (start, end) = placing(object)?;
        self.instances += 1;
        self.moving += usize::from(end.is_some());
        Ok(Pieces { triangles: vec![], solids: vec![instance_of(node, level, start, end)?] })
    }

    fn shape(&mut self, node: &Node<'a>, object: &Object<'a>, top: bool) -> Result<Pieces> {
        let outline = outline(object, &mut self.files)?;
        let (start, end) = placing(object)?;
        let emission = object.get("emission");
        let radiance = emission.as_ref().map_or(Ok(Vec3::zeros()), Node::radiance)?;
        let material = self.material(object, radiance)?;
        let group = light::group(object)?;
        if let (Some(name), None) = (group, &emission) {
            object.done()?; // before an 'emission' is missed that has not its right name
            let error =
                node.error(format!("the light group '{name}' is given to a shape without 'emission'"));
            return Err(error.remedy("give it an 'emission', or leave 'group' out"));
        }
        let index = self.shapes.len() as u32;
        let info = ShapeInfo { material, radiance, emitter: None, group: 0 };
        self.shapes.push(info);
        if let (Some(_), false) = (&end, top) {
            let error = node.error("a shape of a group cannot move");
            return Err(error.remedy("give the motion to the instance"));
        }
        if let Some(end) = end {
            return self.moving_shape(node, &outline, [start, end], group);
        }
        let pieces = outline.placed(node, &start, index)?;
        if radiance != Vec3::zeros() {
            self.shapes[index as usize].group = self.group(group);
            if top {
                self.shapes[index as usize].emitter = Some(self.lights.len() as u32);
                let emitter = Emitter::new(outline.area_shape(&pieces, &start), radiance);
                self.add_light(Light::Area(emitter), group);
            }
        }
        Ok(pieces)
    }

    /// A shape that moves is an instance of a group of its own.
    fn moving_shape(
        &mut self,
        node: &Node,
        outline: &Outline,
        [start, end]: [Affine; 2],
        group: Option<&str>,
    ) -> Result<Pieces> {
        let shape = self.shapes.len() - 1;
        if self.shapes[shape].radiance != Vec3::zeros() {
            self.shapes[shape].group = self.group(group);
        }
        let pieces = outline.placed(node, &Affine::identity(), shape as u32)?;
        let level = self.levels.len() as u32;
        self.levels.push(Level::new(pieces.triangles, pieces.solids, &[], self.split));
        self.moving += 1;
        Ok(Pieces { triangles: vec![], solids: vec![instance_of(node, level, start, Some(end))?] })
    }

    /// The material's index; a shape that glows may go without one and is black then.
    fn material(&mut self, object: &Object<'a>, radiance: Vec3) -> Result<u32> {
        if radiance != Vec3::zeros() && object.get("material").is_none() {
            self.materials.push(Material::Diffuse(Texture::Constant(Vec3::zeros())));
            return Ok(self.materials.len() as u32 - 1);
        }
        let known: Vec<_> = self.names.iter().map(|(name, index)| (*name, *index)).collect();
        object.need("material")?.choice(&known)
    }
}

fn placing(object: &Object) -> Result<(Affine, Option<Affine>)> {
    let start = object.or("transform", Affine::identity(), affine)?;
    let Some(node) = object.get("motion") else { return Ok((start, None)) };
    let end = affine(&node)?;
    check_motion(&node, &start, &end)?;
    Ok((start, Some(end)))
}

fn instance_of(node: &Node, level: u32, start: Affine, end: Option<Affine>) -> Result<Solid> {
    let motion = match end {
        Some(end) => Motion::Linear(start, end),
        None => {
            let placement = Placement::new(start);
            let singular = || node.error("the transform is singular").remedy("scale by more than 0");
            Motion::Still(placement.ok_or_else(singular)?)
        }
    };
    Ok(Solid::Instance { level, motion })
}
