//! Light from infinitely far away, all around: constant, or a latitude-longitude picture.

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use nalgebra::Matrix3;

use super::LightSample;
use crate::trace::bsdf::SPHERE;
use crate::trace::math::{Vec3, luminance};
use crate::trace::sampling::{Distribution, uniform_sphere};
use crate::trace::texture::Picture;

/// Radiance from all directions.
#[derive(Debug, Clone)]
pub enum Environment {
    /// The same from everywhere.
    Constant(Vec3),
    /// A picture: u is the azimuth from −z towards +x, v the angle from +y.
    Map(Box<Map>),
}

/// A latitude-longitude picture with the distribution of its light. The first and last row lie on the
/// poles, columns repeat; in between it is bilinear.
#[derive(Debug, Clone)]
pub struct Map {
    picture: Picture,
    to_map: Matrix3<f32>,
    rows: Distribution,
    cells: Vec<Distribution>, // of each row, over its columns
}

impl Environment {
    /// The map of `picture`, which has at least 2 columns and 2 rows; `to_map` rotates from the world.
    pub fn map(picture: Picture, to_map: Matrix3<f32>) -> Self {
        let (width, height) = (picture.width, picture.height);
        let light = |x: usize, y: usize| luminance(picture.texel(x % width, y));
        let cell = |x, y| light(x, y) + light(x + 1, y) + light(x, y + 1) + light(x + 1, y + 1);
        let sin = |y: usize| (PI * (y as f32 + 0.5) / (height - 1) as f32).sin();
        let cells: Vec<Distribution> = (0..height - 1)
            .map(|y| Distribution::new(&(0..width).map(|x| cell(x, y) * sin(y)).collect::<Vec<_>>()))
            .collect();
        let rows = Distribution::new(&cells.iter().map(Distribution::total).collect::<Vec<_>>());
        Self::Map(Box::new(Map { picture, to_map, rows, cells }))
    }

    /// Radiance that arrives from the unit direction `d`, as seen looking along it.
    pub fn radiance(&self, d: Vec3) -> Vec3 {
        match self {
            Environment::Constant(radiance) => *radiance,
            Environment::Map(map) => map.at(map.place(d)),
        }
    }

    /// Samples a direction by its light.
    pub fn sample(&self, u: [f32; 2]) -> Option<LightSample> {
        let sample = |direction, radiance, pdf| LightSample {
            direction,
            distance: f32::INFINITY,
            end: None,
            radiance,
            pdf,
            delta: false,
        };
        match self {
            Environment::Constant(radiance) => Some(sample(uniform_sphere(u), *radiance, 1.0 / SPHERE)),
            Environment::Map(map) => {
                let (row, fy) = map.rows.sample(u[1]);
                let (column, fx) = map.cells[row].sample(u[0]);
                let place = Place { column, row, fx, fy };
                let (direction, sin) = map.direction(&place);
                (sin > 0.0).then(|| sample(direction, map.at(place), map.density(column, row) / sin))
            }
        }
    }

    /// The density with which [`Environment::sample`] takes `d`.
    pub fn pdf(&self, d: Vec3) -> f32 {
        match self {
            Environment::Constant(_) => 1.0 / SPHERE,
            Environment::Map(map) => {
                let place = map.place(d);
                let (_, sin) = map.direction(&place);
                if sin > 0.0 { map.density(place.column, place.row) / sin } else { 0.0 }
            }
        }
    }
}

/// A cell between four texels and the place inside it.
struct Place {
    column: usize,
    row: usize,
    fx: f32,
    fy: f32,
}

impl Map {
    fn place(&self, d: Vec3) -> Place {
        let d = self.to_map * d;
        let (width, rows) = (self.picture.width as f32, (self.picture.height - 1) as f32);
        let turn = d.x.atan2(-d.z) / TAU - 0.5 / width;
        let x = (turn - turn.floor()) * width;
        let y = d.y.clamp(-1.0, 1.0).acos() * FRAC_1_PI * rows;
        let (column, row) = (x.floor().min(width - 1.0), y.floor().min(rows - 1.0));
        Place { column: column as usize, row: row as usize, fx: x - column, fy: y - row }
    }

    /// The direction of a place in the world, and the sine of its angle to the pole.
    fn direction(&self, place: &Place) -> (Vec3, f32) {
        let theta = PI * (place.row as f32 + place.fy) / (self.picture.height - 1) as f32;
        let phi = TAU * (place.column as f32 + place.fx + 0.5) / self.picture.width as f32;
        let ((sin_t, cos_t), (sin_p, cos_p)) = (theta.sin_cos(), phi.sin_cos());
        let local = Vec3::new(sin_p * sin_t, cos_t, -cos_p * sin_t);
        (self.to_map.tr_mul(&local), sin_t)
    }

    /// The density over solid angle times the sine of the angle to the pole.
    fn density(&self, column: usize, row: usize) -> f32 {
        let cells = (self.picture.width * (self.picture.height - 1)) as f32;
        self.rows.probability(row) * self.cells[row].probability(column) * cells / (TAU * PI)
    }

    fn at(&self, place: Place) -> Vec3 {
        let Place { column, row, fx, fy } = place;
        let next = (column + 1) % self.picture.width;
        let row_at = |y| self.picture.texel(column, y) * (1.0 - fx) + self.picture.texel(next, y) * fx;
        row_at(row) * (1.0 - fy) + row_at(row + 1) * fy
    }
}
