//! Picture buffers: one `f32` plane per channel, row by row from the top left.

use crate::error::{Error, ErrorKind, Result};
use rayon::prelude::*;

/// Rows that one task takes at least: fewer are not worth handing over.
pub(crate) const TASK_ROWS: usize = 8;

/// A rectangle of pixels, in the coordinates of the picture it is cut from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rect {
    /// Leftmost column.
    pub x: usize,
    /// Topmost row.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Rect {
    /// All of a picture of `size`.
    pub fn whole((width, height): (usize, usize)) -> Self {
        Self { x: 0, y: 0, width, height }
    }

    /// Whether the pixel at column `x`, row `y` lies in it.
    pub fn contains(&self, x: usize, y: usize) -> bool {
        (self.x..self.x + self.width).contains(&x) && (self.y..self.y + self.height).contains(&y)
    }

    /// Its pixels as column and row, row by row.
    pub fn pixels(self) -> impl Iterator<Item = (usize, usize)> {
        (self.y..self.y + self.height).flat_map(move |y| (self.x..self.x + self.width).map(move |x| (x, y)))
    }

    /// Width and height.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The same pixels in the coordinates of a picture that begins at `origin`, which lies above and left.
    #[must_use]
    pub fn seen_from(&self, origin: (usize, usize)) -> Self {
        Self { x: self.x - origin.0, y: self.y - origin.1, ..*self }
    }

    /// Whether all of `other` lies in it.
    pub fn holds(&self, other: Self) -> bool {
        let along = |from: usize, length: usize, other: usize, part: usize| {
            other.checked_sub(from).is_some_and(|before| before <= length && part <= length - before)
        };
        along(self.x, self.width, other.x, other.width) && along(self.y, self.height, other.y, other.height)
    }

    /// The blocks of 2×2 pixels that it touches, in a picture of blocks.
    #[must_use]
    pub fn blocks(&self) -> Self {
        let (x, y) = (self.x / 2, self.y / 2);
        let (right, bottom) = ((self.x + self.width).div_ceil(2), (self.y + self.height).div_ceil(2));
        Self { x, y, width: right - x, height: bottom - y }
    }

    /// It and what is left of the blocks of 2×2 pixels that it touches, in a picture of `size` that holds it.
    #[must_use]
    pub fn in_whole_blocks(&self, size: (usize, usize)) -> Self {
        let Self { x, y, width, height } = self.blocks();
        let ends = (2 * (x + width), 2 * (y + height));
        Self { x: 2 * x, y: 2 * y, width: ends.0.min(size.0) - 2 * x, height: ends.1.min(size.1) - 2 * y }
    }

    /// `by` pixels more on every side, clipped to a picture of `size` that holds it.
    #[must_use]
    pub fn grown(&self, by: usize, size: (usize, usize)) -> Self {
        let (x, y) = (self.x.saturating_sub(by), self.y.saturating_sub(by));
        let (right, bottom) = (self.x + self.width + by, self.y + self.height + by);
        Self { x, y, width: right.min(size.0) - x, height: bottom.min(size.1) - y }
    }
}

/// One channel of a picture: `width × height` samples, row major, top row first.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    width: usize,
    height: usize,
    data: Vec<f32>,
}

/// A linear RGB picture: three planes of one size.
pub type Rgb = [Plane; 3];

impl Plane {
    /// A plane filled with `value`.
    pub fn filled(width: usize, height: usize, value: f32) -> Self {
        Self { width, height, data: vec![value; width * height] }
    }

    /// Takes `data` as a plane.
    ///
    /// # Errors
    /// When `data` does not hold exactly `width × height` samples.
    pub fn from_vec(width: usize, height: usize, data: Vec<f32>) -> Result<Self> {
        if Some(data.len()) != width.checked_mul(height) {
            return Err(Error::new(
                ErrorKind::Lacking,
                format!("{} samples for a plane of {width}×{height}", data.len()),
            ));
        }
        Ok(Self { width, height, data })
    }

    /// A plane whose sample at column `x` and row `y` is `f(x, y)`, asked row by row.
    pub fn from_fn(width: usize, height: usize, mut f: impl FnMut(usize, usize) -> f32) -> Self {
        let mut data = Vec::with_capacity(width * height);
        for y in 0..height {
            data.extend((0..width).map(|x| f(x, y)));
        }
        Self { width, height, data }
    }

    /// The same with the rows in parallel.
    pub fn par_from_fn(width: usize, height: usize, f: impl Fn(usize, usize) -> f32 + Sync) -> Self {
        let mut plane = Self::filled(width, height, 0.0);
        plane.rows_mut().enumerate().for_each(|(y, row)| {
            row.iter_mut().enumerate().for_each(|(x, sample)| *sample = f(x, y));
        });
        plane
    }

    /// Replaces every sample v by `f`(v).
    pub fn change(&mut self, f: impl Fn(f32) -> f32 + Sync) {
        self.rows_mut().for_each(|row| row.iter_mut().for_each(|sample| *sample = f(*sample)));
    }

    /// Replaces every sample v by `f`(v, u), u the sample of `other`, of the same size, at its place.
    pub fn combine(&mut self, other: &Self, f: impl Fn(f32, f32) -> f32 + Sync) {
        self.rows_mut().enumerate().for_each(|(y, row)| {
            row.iter_mut().zip(other.row(y)).for_each(|(sample, other)| *sample = f(*sample, *other));
        });
    }

    /// All rows from the top, to change in parallel.
    pub fn rows_mut(&mut self) -> impl IndexedParallelIterator<Item = &mut [f32]> {
        self.data.par_chunks_exact_mut(self.width.max(1)).with_min_len(TASK_ROWS)
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Width and height.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// All samples, row by row.
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    /// All samples, row by row, to change.
    pub fn data_mut(&mut self) -> &mut [f32] {
        &mut self.data
    }

    /// The samples, the plane given up.
    pub fn into_vec(self) -> Vec<f32> {
        self.data
    }

    /// Row `y`.
    pub fn row(&self, y: usize) -> &[f32] {
        &self.data[y * self.width..(y + 1) * self.width]
    }

    /// Fills `out` with a part of row `y`, from column `x` on.
    pub fn copy_row(&self, [x, y]: [usize; 2], out: &mut [f32]) {
        out.copy_from_slice(&self.row(y)[x..x + out.len()]);
    }

    /// The sample at column `x`, row `y`, both inside the plane: beyond its width a release build may answer with
    /// a sample of another row.
    pub fn get(&self, x: usize, y: usize) -> f32 {
        debug_assert!(x < self.width);
        self.data[y * self.width + x]
    }

    /// A copy of the part of the plane under `rect`, which must lie inside it.
    pub fn crop(&self, rect: Rect) -> Self {
        let mut data = Vec::with_capacity(rect.width * rect.height);
        for y in rect.y..rect.y + rect.height {
            data.extend_from_slice(&self.row(y)[rect.x..rect.x + rect.width]);
        }
        Self { width: rect.width, height: rect.height, data }
    }

    /// Copies `part` into the plane, its first pixel to column and row `at`; it must lie inside.
    pub fn put(&mut self, part: &Self, at: (usize, usize)) {
        for y in 0..part.height {
            let start = (at.1 + y) * self.width + at.0;
            self.data[start..start + part.width].copy_from_slice(part.row(y));
        }
    }

    /// The part under `rect`; no copy where that is the whole plane.
    #[must_use]
    pub fn into_part(self, rect: Rect) -> Self {
        if rect == Rect::whole(self.size()) { self } else { self.crop(rect) }
    }
}

/// Asks the system for as many bytes, and gives them back.
pub(crate) fn can_be_had(bytes: u64) -> bool {
    let mut probe = Vec::<u8>::new();
    let given = usize::try_from(bytes).is_ok_and(|bytes| probe.try_reserve_exact(bytes).is_ok());
    std::hint::black_box(&mut probe); // what nobody looks at would not be asked for
    given
}

/// A black picture.
pub fn black(width: usize, height: usize) -> Rgb {
    std::array::from_fn(|_| Plane::filled(width, height, 0.0))
}

/// The sum of the three channels, pixel by pixel.
pub fn sum_of_channels(planes: &Rgb) -> Plane {
    let (width, height) = planes[0].size();
    Plane::par_from_fn(width, height, |x, y| planes.iter().map(|plane| plane.get(x, y)).sum::<f32>())
}

/// The squared difference, summed over the three channels, pixel by pixel; finite where the colours are.
pub fn squared_difference(a: [&Plane; 3], b: &Rgb) -> Plane {
    let (width, height) = a[0].size();
    Plane::par_from_fn(width, height, |x, y| {
        a.iter().zip(b).map(|(a, b)| (a.get(x, y) - b.get(x, y)).powi(2)).sum::<f32>().min(f32::MAX)
    })
}

/// The mean over the three channels, pixel by pixel.
pub fn mean_of_channels(planes: &Rgb) -> Plane {
    let mut mean = sum_of_channels(planes);
    mean.change(|value| value / 3.0);
    mean
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_columns_and_crops_of_a_picture_that_is_not_square() {
        let plane = Plane::from_fn(5, 3, |x, y| (10 * y + x) as f32);
        assert_eq!(plane.get(4, 2), 24.0);
        assert_eq!(plane.row(1), &[10.0, 11.0, 12.0, 13.0, 14.0]);
        let cut = plane.crop(Rect { x: 3, y: 1, width: 2, height: 2 });
        assert_eq!(cut.data(), &[13.0, 14.0, 23.0, 24.0]);
    }

    #[test]
    fn a_rectangle_holds_what_lies_in_it_and_nothing_beyond() {
        let rect = |x, y, width, height| Rect { x, y, width, height };
        let outer = rect(2, 3, 10, 5);
        assert!([outer, rect(2, 3, 1, 1), rect(11, 7, 1, 1)].iter().all(|inner| outer.holds(*inner)));
        let beyond = [rect(1, 3, 2, 1), rect(11, 7, 2, 1), rect(11, 7, 1, 2), rect(usize::MAX, 3, 5, 1)];
        assert!(beyond.iter().all(|inner| !outer.holds(*inner)));
    }

    #[test]
    fn a_wrong_number_of_samples_is_an_error() {
        assert!(Plane::from_vec(2, 3, vec![0.0; 5]).is_err());
    }
}
