//! Textures: one colour, a checkerboard, a picture.

use std::sync::Arc;

use super::math::Vec3;

/// Linear RGB over texture coordinates.
#[derive(Debug, Clone)]
pub enum Texture {
    /// The same everywhere.
    Constant(Vec3),
    /// Squares of half a unit in `scale · uv`: the first colour where both coordinates' fractions lie
    /// on the same side of ½.
    Checker {
        /// The two colours.
        colors: [Vec3; 2],
        /// Repetitions over the unit square.
        scale: [f32; 2],
    },
    /// A picture, repeated, bilinear.
    Bitmap {
        /// The picture.
        picture: Arc<Picture>,
        /// Repetitions over the unit square.
        scale: [f32; 2],
    },
}

/// A picture of linear RGB texels; the first row lies at v = 0.
#[derive(Debug, Clone)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Texels, row by row.
    pub texels: Vec<Vec3>,
}

impl Picture {
    /// The texel at column `x` and row `y`.
    pub fn texel(&self, x: usize, y: usize) -> Vec3 {
        self.texels[y * self.width + x]
    }

    fn repeated(&self, uv: [f32; 2]) -> Vec3 {
        let place = |w: f32, size: usize| {
            let x = (w - w.floor()) * size as f32 - 0.5;
            let low = x.floor();
            let wrap = |i: f32| (i as i64).rem_euclid(size as i64) as usize;
            (wrap(low), wrap(low + 1.0), x - low)
        };
        let (x0, x1, fx) = place(uv[0], self.width);
        let (y0, y1, fy) = place(uv[1], self.height);
        let row = |y| self.texel(x0, y) * (1.0 - fx) + self.texel(x1, y) * fx;
        row(y0) * (1.0 - fy) + row(y1) * fy
    }
}

impl Texture {
    /// The colour at `uv`.
    #[inline]
    pub fn at(&self, [u, v]: [f32; 2]) -> Vec3 {
        match self {
            Texture::Constant(color) => *color,
            Texture::Checker { colors, scale } => {
                let upper = |w: f32| w - w.floor() > 0.5;
                colors[usize::from(upper(u * scale[0]) != upper(v * scale[1]))]
            }
            Texture::Bitmap { picture, scale } => picture.repeated([u * scale[0], v * scale[1]]),
        }
    }

    /// The colour where it is the same everywhere.
    pub fn constant(&self) -> Option<Vec3> {
        match self {
            Texture::Constant(color) => Some(*color),
            _ => None,
        }
    }
}
