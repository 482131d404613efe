//! The camera from JSON.

use super::json::{Node, Object};
use super::transform::check_motion;
use crate::error::Result;
use crate::image::Rect;
use crate::trace::camera::{Camera, Filter};
use crate::trace::math::{Vec3, direction};
use crate::trace::transform::Affine;

const MAX_SIDE: u64 = 1 << 15; // pixel numbers fit into 32 bits

/// The camera at `node`.
pub fn camera(node: &Node) -> Result<Camera> {
    let object = node.object()?;
    let start = look_at(node, &object)?;
    let to_world_end = match object.get("end") {
        None => None,
        Some(end) => {
            let view = end.object()?;
            let to_world = look_at(&end, &view)?;
            view.done()?;
            check_motion(&end, &start, &to_world)?;
            Some(to_world)
        }
    };
    let fov = object.need("fov")?;
    let degrees = fov.number_in(1e-3, 179.0)?;
    let resolution = object.need("resolution")?;
    let size = resolution.list()?;
    let [width, height] = size.as_slice() else {
        let error = resolution.error(format!("got {} numbers where 2 were expected", size.len()));
        return Err(error.remedy("give [width, height]"));
    };
    let resolution = [width.whole(1, MAX_SIDE)? as usize, height.whole(1, MAX_SIDE)? as usize];
    let whole = Rect { x: 0, y: 0, width: resolution[0], height: resolution[1] };
    let aperture_radius = object.or("aperture_radius", 0.0, |node| node.number_in(0.0, f64::INFINITY))?;
    let focus_distance = match aperture_radius > 0.0 {
        true => object.need("focus_distance")?.positive()?,
        false => object.or("focus_distance", 1.0, Node::positive)?,
    };
    let filters = [("box", Filter::Box), ("tent", Filter::Tent), ("gaussian", Filter::Gaussian)];
    let camera = Camera {
        to_world: start,
        to_world_end,
        tan_half_fov: (degrees.to_radians() / 2.0).tan(),
        resolution,
        crop: object.or("crop", whole, |node| crop(node, resolution))?,
        aperture_radius,
        focus_distance,
        filter: object.or("filter", Filter::Box, |node| node.choice(&filters))?,
    };
    object.done()?;
    Ok(camera)
}

fn look_at(node: &Node, object: &Object) -> Result<Affine> {
    let (origin, target) = (object.need("origin")?.vec3()?, object.need("target")?.vec3()?);
    let up = object.or("up", Vec3::y(), Node::unit)?;
    let forward = direction(target.cast() - origin.cast());
    let right = forward.and_then(|forward| forward.cross(&up).try_normalize(1e-6));
    let (Some(forward), Some(right)) = (forward, right) else {
        let error = node.error("the camera has no direction");
        return Err(error.remedy("put 'target' away from 'origin' and 'up' across the line of sight"));
    };
    let linear = nalgebra::Matrix3::from_columns(&[right, right.cross(&forward), forward]);
    Ok(Affine { linear, shift: origin })
}

fn crop(node: &Node, [width, height]: [usize; 2]) -> Result<Rect> {
    let [x, y, w, h] = node.numbers::<4>()?;
    let list = node.list()?;
    for side in &list {
        side.whole(0, MAX_SIDE)?;
    }
    if w < 1.0 || h < 1.0 || x + w > width as f64 || y + h > height as f64 {
        let error = node.error(format!("the crop is not inside {width}×{height}"));
        return Err(error.remedy("give [x, y, width, height]"));
    }
    Ok(Rect { x: x as usize, y: y as usize, width: w as usize, height: h as usize })
}
