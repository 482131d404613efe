//! Transforms: a list of steps, the first of which acts first.

use nalgebra::{Matrix4, Rotation3, Unit, Vector3};

use super::json::Node;
use crate::error::Result;
use crate::trace::transform::Affine;

/// Least determinant that counts as invertible, relative to the product of the columns' lengths or, in a
/// motion, to the lesser one of its ends.
const LEAST_VOLUME: f64 = 1e-9;

fn vector(node: &Node) -> Result<Vector3<f64>> {
    Ok(Vector3::from(node.numbers::<3>()?))
}

fn step(node: &Node) -> Result<Matrix4<f64>> {
    let object = node.object()?;
    let steps = ["translate", "scale", "rotate", "matrix"].map(|key| (key, object.get(key)));
    object.done()?;
    let mut given = steps.into_iter().filter_map(|(key, value)| Some((key, value?)));
    let (Some((key, value)), None) = (given.next(), given.next()) else {
        let error = node.error("a step of a transform has exactly one key");
        return Err(error.remedy("give one of translate, scale, rotate, matrix"));
    };
    Ok(match key {
        "translate" => Matrix4::new_translation(&vector(&value)?),
        "scale" => match value.number() {
            Ok(factor) => Matrix4::new_scaling(factor),
            Err(_) => Matrix4::new_nonuniform_scaling(&vector(&value)?),
        },
        "rotate" => {
            let object = value.object()?;
            let (axis, angle) = (object.need("axis")?, object.need("angle")?);
            object.done()?;
            axis.unit()?;
            Rotation3::from_axis_angle(&Unit::new_normalize(vector(&axis)?), angle.number()?.to_radians())
                .to_homogeneous()
        }
        _ => {
            let matrix = Matrix4::from_row_slice(&value.numbers::<16>()?);
            if matrix.row(3) != Matrix4::identity().row(3) {
                let error = value.error("the last row of the matrix is not 0 0 0 1");
                return Err(error.remedy("give an affine matrix, row by row"));
            }
            matrix
        }
    })
}

/// The transform at `node`, a list of steps.
pub fn affine(node: &Node) -> Result<Affine> {
    let steps = node.list()?.iter().map(step).collect::<Result<Vec<_>>>()?;
    let matrix = steps.into_iter().fold(Matrix4::identity(), |so_far, next| next * so_far);
    let linear = matrix.fixed_view::<3, 3>(0, 0);
    let lengths: f64 = (0..3).map(|i| linear.column(i).norm()).product();
    let volume = linear.determinant().abs();
    if volume.is_nan() || volume <= LEAST_VOLUME * lengths {
        return Err(node.error("the transform is singular").remedy("give every axis a scale other than 0"));
    }
    let affine = Affine::from_matrix(&matrix);
    if !affine.linear.determinant().is_normal() || !affine.shift.iter().all(|x| x.is_finite()) {
        let error = node.error("the transform is beyond single precision");
        return Err(error.remedy("scale by factors from 1e-12 to 1e12 in all"));
    }
    Ok(affine)
}

/// Checks that the motion from `start` to `end` is invertible at every moment.
pub fn check_motion(node: &Node, start: &Affine, end: &Affine) -> Result<()> {
    const MOMENTS: usize = 64; // the determinant is a cubic in time: it cannot hide between these
    let determinant = |i: usize| f64::from(start.blend(end, i as f32 / MOMENTS as f32).linear.determinant());
    let (first, last) = (determinant(0), determinant(MOMENTS));
    let least = LEAST_VOLUME * first.abs().min(last.abs());
    if (0..=MOMENTS).all(|i| determinant(i) * first.signum() > least) {
        return Ok(());
    }
    let error = node.error("the motion passes through a singular transform");
    Err(error.remedy("matrices are interpolated element by element: rotate by less than 180 degrees"))
}
