//! Materials and textures from JSON.

use super::files::Files;
use super::json::{Node, Object};
use crate::error::Result;
use crate::trace::bsdf::{Conductor, Dielectric, Material, Plastic};
use crate::trace::math::Vec3;
use crate::trace::texture::Texture;

/// Real and imaginary part of a metal's refraction index, per channel.
type MetalIndex = ([f32; 3], [f32; 3]);

/// Refraction indices of metals in linear Rec. 709 RGB, from measured spectra.
const METALS: [(&str, MetalIndex); 4] = [
    ("aluminium", ([1.657, 0.880, 0.521], [9.224, 6.270, 4.837])),
    ("copper", ([0.200, 0.924, 1.102], [3.912, 2.452, 2.142])),
    ("gold", ([0.143, 0.375, 1.442], [3.983, 2.386, 1.603])),
    ("silver", ([0.155, 0.117, 0.138], [4.828, 3.122, 2.147])),
];

const GLASS_ETA: f32 = 1.5;
const COAT_ETA: f32 = 1.49;

#[derive(Clone, Copy)]
enum Kind {
    Diffuse,
    Conductor,
    Dielectric,
    Plastic,
}

/// The material at `node`.
pub fn material(node: &Node, files: &mut Files) -> Result<Material> {
    let object = node.object()?;
    let kind = object.need("type")?.choice(&[
        ("diffuse", Kind::Diffuse),
        ("conductor", Kind::Conductor),
        ("dielectric", Kind::Dielectric),
        ("plastic", Kind::Plastic),
    ])?;
    let material = match kind {
        Kind::Diffuse => Material::Diffuse(reflectance(&object, files)?),
        Kind::Conductor => Material::Conductor(conductor(&object)?),
        Kind::Dielectric => {
            Material::Dielectric(Dielectric { eta: eta(&object, GLASS_ETA)?, roughness: roughness(&object)? })
        }
        Kind::Plastic => {
            let coat = Plastic::coat(eta(&object, COAT_ETA)?);
            Material::Plastic { reflectance: reflectance(&object, files)?, coat }
        }
    };
    object.done()?;
    Ok(material)
}

fn roughness(object: &Object) -> Result<f32> {
    /// Facets as even as this leave single precision: they are a smooth surface.
    const SMOOTH: f32 = 1e-5;
    let roughness = object.or("roughness", 0.0, |node| node.number_in(0.0, 1.0))?;
    Ok(if roughness < SMOOTH { 0.0 } else { roughness })
}

fn eta(object: &Object, default: f32) -> Result<f32> {
    object.or("eta", default, |node| {
        let eta = node.number_in(1.0, 4.0)?;
        if eta > 1.0 {
            return Ok(eta);
        }
        Err(node.error("the refraction index is that of the surroundings").remedy("give a number above 1"))
    })
}

fn conductor(object: &Object) -> Result<Conductor> {
    let by_index = object.get("eta").is_some() || object.get("k").is_some();
    let (eta, k) = match object.get("metal") {
        None if by_index => index(object)?,
        Some(metal) if by_index => {
            let error = metal.error("a metal has an 'eta' and a 'k' of its own");
            return Err(error.remedy("leave it out, or those two"));
        }
        _ => {
            let (eta, k) = object.need("metal")?.choice(&METALS)?;
            (Vec3::from(eta), Vec3::from(k))
        }
    };
    let tint = object.or("reflectance", Vec3::repeat(1.0), |node| node.color(1.0))?;
    Ok(Conductor { eta, k, tint, roughness: roughness(object)? })
}

/// The refraction index of a metal: Fresnel's equations stay finite in this range.
fn index(object: &Object) -> Result<(Vec3, Vec3)> {
    const GREATEST: f64 = 10_000.0;
    const LEAST: f32 = 0.001;
    let (real, imaginary) = (object.need("eta")?, object.need("k")?);
    let (eta, k) = (real.color(GREATEST)?, imaginary.color(GREATEST)?);
    if eta.sup(&k).min() < LEAST {
        let error = imaginary.error(format!("'eta' and 'k' are both less than {LEAST} in some channel"));
        return Err(error.remedy("give one of them a larger number there, or a 'metal'"));
    }
    Ok((eta, k))
}

fn reflectance(object: &Object, files: &mut Files) -> Result<Texture> {
    let node = object.need("reflectance")?;
    if !node.is_object() {
        return Ok(Texture::Constant(node.color(1.0)?));
    }
    let texture = node.object()?;
    let checker = texture.need("type")?.choice(&[("checker", true), ("bitmap", false)])?;
    let scale = texture.or("scale", [1.0, 1.0], |node| Ok(node.numbers::<2>()?.map(|x| x as f32)))?;
    let result = match checker {
        true => {
            let colors = [texture.need("color0")?.color(1.0)?, texture.need("color1")?.color(1.0)?];
            Texture::Checker { colors, scale }
        }
        false => {
            let (raw, file) = (texture.or("raw", false, Node::bool)?, texture.need("file")?);
            let picture = files.picture(&file, raw)?;
            let most = picture.texels.iter().map(|texel| texel.max()).fold(0.0, f32::max);
            if most > 1.0 {
                let error = file.error(format!("the picture reflects {most} times what it receives"));
                return Err(error.remedy("scale its values to 0 to 1"));
            }
            Texture::Bitmap { picture, scale }
        }
    };
    texture.done()?;
    Ok(result)
}
