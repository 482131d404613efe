//! The window Ω_c around a centre, clipped at the picture's border.

use super::gram::LANES;
use crate::image::Plane;

/// A window and its place in the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// The centre's column.
    pub cx: usize,
    /// The centre's row.
    pub cy: usize,
    /// Leftmost column.
    pub x0: usize,
    /// Topmost row.
    pub y0: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Length of a column of samples: the pixels, rounded up to whole vectors.
    pub stride: usize,
}

impl Window {
    /// The window of `radius` around (`cx`, `cy`) in a picture of `size`.
    pub fn new(cx: usize, cy: usize, radius: usize, size: (usize, usize)) -> Self {
        let (x0, y0) = (cx.saturating_sub(radius), cy.saturating_sub(radius));
        let (width, height) = ((cx + radius + 1).min(size.0) - x0, (cy + radius + 1).min(size.1) - y0);
        Self { cx, cy, x0, y0, width, height, stride: (width * height).next_multiple_of(LANES) }
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Where this window's first pixel lies in an unclipped window of `radius`.
    pub fn offset(&self, radius: usize) -> (usize, usize) {
        (self.x0 + radius - self.cx, self.y0 + radius - self.cy)
    }

    /// Copies the window's part of `plane`, less `shift`, row by row.
    #[inline(always)]
    pub fn gather(&self, plane: &Plane, shift: f32, out: &mut [f32]) {
        for (y, out) in out.chunks_exact_mut(self.width).take(self.height).enumerate() {
            let row = &plane.row(self.y0 + y)[self.x0..self.x0 + self.width];
            out.iter_mut().zip(row).for_each(|(out, value)| *out = value - shift);
        }
    }

    /// The least value of `plane` in the window.
    pub fn least(&self, plane: &Plane) -> f32 {
        let mut least = [f32::INFINITY; LANES];
        for y in self.y0..self.y0 + self.height {
            let row = &plane.row(y)[self.x0..self.x0 + self.width];
            for values in row.chunks(LANES) {
                for (least, &value) in least.iter_mut().zip(values) {
                    *least = if value < *least { value } else { *least };
                }
            }
        }
        least.into_iter().fold(f32::INFINITY, f32::min)
    }
}
