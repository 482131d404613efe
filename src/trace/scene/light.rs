//! Lights without a shape, the environment and the medium from JSON.

use nalgebra::{Rotation3, Vector3};

use super::files::Files;
use super::json::{Node, Object};
use crate::error::Result;
use crate::trace::film::feature_names;
use crate::trace::light::{Environment, Light};
use crate::trace::math::{Aabb, Vec3, direction};
use crate::trace::medium::Medium;
use crate::trace::texture::Picture;

/// Extinction whose free paths, and whose products with them, are finite.
const LEAST_EXTINCTION: f32 = 1e-20;
const MOST_EXTINCTION: f64 = 1e20;

#[derive(Clone, Copy)]
enum Kind {
    Point,
    Spot,
    Directional,
}

/// The light at `node` and the name of its group.
pub fn light<'a>(node: &Node<'a>) -> Result<(Light, Option<&'a str>)> {
    let object = node.object()?;
    let kind = object.need("type")?.choice(&[
        ("point", Kind::Point),
        ("spot", Kind::Spot),
        ("directional", Kind::Directional),
    ])?;
    let intensity = || object.need("intensity")?.color(f64::INFINITY);
    let light = match kind {
        Kind::Point => Light::Point { position: object.need("position")?.vec3()?, intensity: intensity()? },
        Kind::Directional => Light::Directional {
            direction: object.need("direction")?.unit()?,
            irradiance: object.need("irradiance")?.radiance()?,
        },
        Kind::Spot => {
            let position = object.need("position")?.vec3()?;
            let target = object.need("target")?;
            let axis = direction(target.vec3()?.cast() - position.cast());
            let axis = axis.ok_or_else(|| {
                target.error("the spot light has no direction").remedy("put 'target' away from 'position'")
            });
            let cutoff_angle = object.or("cutoff_angle", 20.0, |node| node.number_in(0.1, 90.0))?;
            let beam_angle = object.or("beam_angle", 0.75 * cutoff_angle, |node| {
                let angle = node.number_in(0.0, 90.0)?;
                if angle < cutoff_angle {
                    return Ok(angle);
                }
                let error = node.error("'beam_angle' is not less than 'cutoff_angle'");
                Err(error.remedy("leave room for the falloff between them"))
            })?;
            let (beam, cutoff) = (beam_angle.to_radians(), cutoff_angle.to_radians());
            Light::Spot { position, axis: axis?, intensity: intensity()?, beam, cutoff }
        }
    };
    let group = group(&object)?;
    object.done()?;
    Ok((light, group))
}

/// The environment at `node` and the name of its group.
pub fn environment<'a>(node: &Node<'a>, files: &mut Files) -> Result<(Light, Option<&'a str>)> {
    let object = node.object()?;
    let constant = object.need("type")?.choice(&[("constant", true), ("map", false)])?;
    let environment = match constant {
        true => Environment::Constant(object.need("radiance")?.radiance()?),
        false => {
            let picture = files.picture(&object.need("file")?, false)?;
            let scale = object.or("scale", 1.0, |node| node.number_in(0.0, 1e15))?;
            let angle = object.or("rotate", 0.0, Node::number)?.to_radians() as f32;
            let scaled =
                Picture { texels: picture.texels.iter().map(|t| t * scale).collect(), ..(*picture).clone() };
            let to_map = Rotation3::from_axis_angle(&Vector3::y_axis(), -angle);
            Environment::map(scaled, to_map.into_inner())
        }
    };
    let group = group(&object)?;
    object.done()?;
    Ok((Light::Environment(environment), group))
}

/// The medium at `node`.
pub fn medium(node: &Node) -> Result<Medium> {
    let object = node.object()?;
    let extinction = object.need("extinction")?;
    let medium = Medium {
        extinction: extinction.color(MOST_EXTINCTION)?,
        albedo: object.need("albedo")?.color(1.0)?,
        anisotropy: object.or("anisotropy", 0.0, |node| node.number_in(-0.99, 0.99))?,
        bounds: object.get("bounds").map(|node| bounds(&node)).transpose()?,
    };
    object.done()?;
    if medium.extinction.min() < LEAST_EXTINCTION {
        let error =
            extinction.error(format!("the extinction is less than {LEAST_EXTINCTION:e} in some channel"));
        return Err(error.remedy("give a larger extinction, or leave the medium out"));
    }
    Ok(medium)
}

fn bounds(node: &Node) -> Result<Aabb> {
    let object = node.object()?;
    let (min, max): (Vec3, Vec3) = (object.need("min")?.vec3()?, object.need("max")?.vec3()?);
    object.done()?;
    if (0..3).all(|axis| min[axis] < max[axis]) {
        return Ok(Aabb { min, max });
    }
    Err(node.error("the box is empty").remedy("make every coordinate of 'min' less than that of 'max'"))
}

/// The name of the light group at `object`, which becomes a layer of the picture.
pub fn group<'a>(object: &Object<'a>) -> Result<Option<&'a str>> {
    /// Layers that the picture has besides: those of features, with what is told of their errors, and others.
    const OWN: [&str; 5] = ["variance", "halfA", "motionPrevious", "motionNext", "sampleCount"];
    const MOST_BYTES: usize = 200; // a channel's name has up to 255
    let Some(node) = object.get("group") else { return Ok(None) };
    let name = node.string()?;
    let feature = ["Variance", "HalfA"].iter().find_map(|end| name.strip_suffix(end)).unwrap_or(name);
    let what = if name.is_empty() || name.chars().any(|c| c.is_control() || u32::from(c) > 0xff) {
        "is no name that a layer can have"
    } else if name.len() > MOST_BYTES {
        "is too long for a layer's name"
    } else if OWN.contains(&name) || feature_names().any(|own| own == feature) {
        "is the name of another layer of the picture"
    } else {
        return Ok(Some(name));
    };
    let error = node.error(format!("'{}' {what}", name.escape_debug()));
    Err(error.remedy(format!("name the group otherwise, with up to {MOST_BYTES} Latin-1 letters")))
}
