//! Shapes from JSON: what they are made of, in their own coordinates and placed.

use nalgebra::Matrix3;

use super::files::{Files, Mesh};
use super::json::{Node, Object};
use crate::error::Result;
use crate::trace::light::AreaShape;
use crate::trace::math::Vec3;
use crate::trace::sampling::Distribution;
use crate::trace::shape::{Disk, Sphere};
use crate::trace::transform::{Affine, Placement};
use crate::trace::world::{Solid, Triangle};

/// A shape in its own coordinates.
pub enum Outline {
    /// The square from −1 to 1 in the plane z = 0, facing +z.
    Rectangle,
    /// The cube from −1 to 1.
    Cube,
    /// The unit disk in the plane z = 0, facing +z.
    Disk,
    /// A sphere.
    Sphere {
        /// Its middle.
        center: Vec3,
        /// Its radius.
        radius: f32,
    },
    /// A mesh; flat, if its normals are not wanted.
    Mesh(std::sync::Arc<Mesh>, bool),
}

#[derive(Clone, Copy)]
enum Kind {
    Rectangle,
    Cube,
    Disk,
    Sphere,
    Mesh,
}

/// The outline that `object` describes.
pub fn outline(object: &Object, files: &mut Files) -> Result<Outline> {
    let kind = object.need("type")?.choice(&[
        ("rectangle", Kind::Rectangle),
        ("cube", Kind::Cube),
        ("disk", Kind::Disk),
        ("sphere", Kind::Sphere),
        ("mesh", Kind::Mesh),
    ])?;
    Ok(match kind {
        Kind::Rectangle => Outline::Rectangle,
        Kind::Cube => Outline::Cube,
        Kind::Disk => Outline::Disk,
        Kind::Sphere => Outline::Sphere {
            center: object.or("center", Vec3::zeros(), Node::vec3)?,
            radius: object.or("radius", 1.0, Node::positive)?,
        },
        Kind::Mesh => {
            let flat = object.or("flat", false, Node::bool)?;
            Outline::Mesh(files.mesh(&object.need("file")?)?, flat)
        }
    })
}

/// The triangles and solids of a shape.
#[derive(Default)]
pub struct Pieces {
    /// Its triangles.
    pub triangles: Vec<Triangle>,
    /// Its sphere or disk.
    pub solids: Vec<Solid>,
}

impl Outline {
    /// The shape placed by `to_world`, as part of shape number `shape`.
    pub fn placed(&self, node: &Node, to_world: &Affine, shape: u32) -> Result<Pieces> {
        let mut pieces = Pieces::default();
        match self {
            Outline::Rectangle => pieces.triangles = quad(&Affine::identity(), to_world, shape),
            Outline::Cube => {
                pieces.triangles = cube_faces().iter().flat_map(|face| quad(face, to_world, shape)).collect();
            }
            Outline::Mesh(mesh, flat) => {
                pieces.triangles = mesh_triangles(mesh, *flat, to_world, shape);
                if pieces.triangles.is_empty() {
                    let error = node.error("the mesh has no triangle with an area");
                    return Err(error.remedy("give a mesh whose corners do not lie on lines"));
                }
            }
            Outline::Disk => {
                pieces.solids.push(Solid::Disk(Disk { placement: placement(node, to_world)? }, shape))
            }
            Outline::Sphere { center, radius } => {
                pieces.solids.push(Solid::Sphere(sphere(node, *center, *radius, to_world)?, shape));
            }
        }
        Ok(pieces)
    }

    /// The surface of a light of this outline, made of `pieces` placed by `to_world`.
    pub fn area_shape(&self, pieces: &Pieces, to_world: &Affine) -> AreaShape {
        if let Some(solid) = pieces.solids.first() {
            match solid {
                Solid::Sphere(sphere, _) => return AreaShape::Sphere(*sphere),
                Solid::Disk(disk, _) => return AreaShape::Disk(*disk),
                Solid::Instance { .. } => {}
            }
        }
        if let Outline::Rectangle = self {
            let column = |i: usize| to_world.linear.column(i) * 2.0;
            let corner = to_world.point(Vec3::new(-1.0, -1.0, 0.0));
            let normal = pieces.triangles[0].normal();
            let error = pieces.triangles.iter().map(Triangle::error).fold(0.0, f32::max);
            return AreaShape::Parallelogram { corner, edges: [column(0), column(1)], normal, error };
        }
        let areas: Vec<f32> = pieces.triangles.iter().map(Triangle::area).collect();
        AreaShape::Triangles(pieces.triangles.clone(), Distribution::new(&areas))
    }
}

fn placement(node: &Node, to_world: &Affine) -> Result<Placement> {
    Placement::new(*to_world)
        .ok_or_else(|| node.error("the transform is singular").remedy("scale by more than 0"))
}

fn sphere(node: &Node, center: Vec3, radius: f32, to_world: &Affine) -> Result<Sphere> {
    let scale = to_world.linear.column(0).norm();
    let rotation = to_world.linear / scale;
    let skew = (rotation * rotation.transpose() - Matrix3::identity()).amax();
    if skew > 1e-4 {
        let error = node.error("the transform makes an ellipsoid of the sphere");
        return Err(error.remedy("scale all axes alike, or use a mesh"));
    }
    Ok(Sphere { center: to_world.point(center), radius: radius * scale, to_poles: rotation.transpose() })
}

/// A triangle with its outer side kept outside when `to_world` mirrors.
fn triangle(
    corners: [Vec3; 3],
    normals: Option<[Vec3; 3]>,
    uv: [[f32; 2]; 3],
    to_world: &Affine,
    shape: u32,
) -> Triangle {
    let normal_map = to_world.linear.try_inverse().unwrap_or_else(Matrix3::identity).transpose();
    let order = if to_world.linear.determinant() < 0.0 { [0, 2, 1] } else { [0, 1, 2] };
    Triangle::new(
        order.map(|i| to_world.point(corners[i])),
        normals.map(|n| order.map(|i| (normal_map * n[i]).normalize())),
        order.map(|i| uv[i]),
        shape,
    )
}

/// The square from −1 to 1, placed by `face` and then by `to_world`.
fn quad(face: &Affine, to_world: &Affine, shape: u32) -> Vec<Triangle> {
    let corner = |u: f32, v: f32| (face.point(Vec3::new(2.0 * u - 1.0, 2.0 * v - 1.0, 0.0)), [u, v]);
    let corners = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
    [[0, 1, 2], [0, 2, 3]]
        .map(|ids| triangle(ids.map(|i| corners[i].0), None, ids.map(|i| corners[i].1), to_world, shape))
        .to_vec()
}

/// The placements of a square as the six faces of the cube, facing outwards.
fn cube_faces() -> [Affine; 6] {
    let (x, y, z) = (Vec3::x(), Vec3::y(), Vec3::z());
    [[x, y, z], [-x, y, -z], [y, z, x], [z, y, -x], [z, x, y], [x, z, -y]]
        .map(|axes| Affine { linear: Matrix3::from_columns(&axes), shift: axes[2] })
}

fn mesh_triangles(mesh: &Mesh, flat: bool, to_world: &Affine, shape: u32) -> Vec<Triangle> {
    let one = |corners: &[super::files::Corner; 3]| {
        let normals = match corners.map(|corner| corner.normal) {
            [Some(a), Some(b), Some(c)] if !flat => Some([a, b, c]),
            _ => None,
        };
        triangle(corners.map(|c| c.position), normals, corners.map(|c| c.uv), to_world, shape)
    };
    let with_area = |triangle: &Triangle| triangle.area() > 0.0;
    mesh.triangles.iter().map(one).filter(with_area).collect()
}
