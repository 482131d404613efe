//! The samples of a fit: the pixels of its window, in this frame and in those beside, that have weight.
//!
//! What does not resemble the centre is not even gathered. `[choice]` of a window of 225 pixels 2 to 200 are
//! left, and where the centre resembles nothing but itself nearly nothing is left to do.

use super::gram::LANES;
use super::window::Window;
use crate::image::Plane;
use std::ops::Range;

/// Samples, frame after frame, row by row; buffers are kept between windows.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    /// K of every sample, then zeros up to a whole number of vectors.
    kernel: Vec<f32>,
    /// Where each lies in the planes.
    places: Vec<usize>,
    /// Column and row of each in an unclipped window.
    spots: Vec<[u8; 2]>,
    /// Where the samples of each frame end.
    ends: Vec<usize>,
    /// Which of the samples is the centre.
    centre: usize,
}

impl Samples {
    /// Forgets all samples.
    pub fn clear(&mut self) {
        self.kernel.clear();
        self.places.clear();
        self.spots.clear();
        self.ends.clear();
    }

    /// Adds the samples of the next frame: `kernels` are K of the window's pixels, row by row, in a picture of
    /// `columns`; the radius is that of unclipped windows.
    #[inline(always)]
    pub fn add_frame(&mut self, window: &Window, radius: usize, columns: usize, kernels: &[f32]) {
        let start = self.ends.last().copied().unwrap_or(0);
        let most = start + window.pixels();
        self.kernel.resize(most, 0.0);
        self.places.resize(most, 0);
        self.spots.resize(most, [0; 2]);
        let (first_x, first_y) = window.offset(radius);
        let mut next = start;
        for (row, kernels) in kernels.chunks_exact(window.width).take(window.height).enumerate() {
            for (column, &kernel) in kernels.iter().enumerate() {
                // Written in any case and kept where it has weight: no branch to be mispredicted.
                self.kernel[next] = kernel;
                self.places[next] = (window.y0 + row) * columns + window.x0 + column;
                self.spots[next] = [(first_x + column) as u8, (first_y + row) as u8];
                next += usize::from(kernel > 0.0);
            }
        }
        self.ends.push(next);
        self.kernel.truncate(next);
        self.kernel.resize(next.next_multiple_of(LANES), 0.0);
        if self.ends.len() == 1 {
            let middle = [radius as u8; 2];
            self.centre = self.spots[..next].iter().position(|spot| *spot == middle).unwrap_or(0);
        }
    }

    /// Length of a column: the samples, rounded up to whole vectors.
    pub fn stride(&self) -> usize {
        self.kernel.len()
    }

    /// Whether there is one sample alone, in all frames together.
    pub fn is_one(&self) -> bool {
        self.ends.last() == Some(&1)
    }

    /// K of every sample, `stride` long.
    pub fn kernel(&self) -> &[f32] {
        &self.kernel
    }

    /// Which of the samples is the centre.
    pub fn centre(&self) -> usize {
        self.centre
    }

    /// The samples of a frame; frame 0 is this one.
    pub fn of_frame(&self, frame: usize) -> Range<usize> {
        frame.checked_sub(1).map_or(0, |before| self.ends[before])..self.ends[frame]
    }

    /// Column and row of samples in an unclipped window.
    pub fn spots(&self, samples: Range<usize>) -> &[[u8; 2]] {
        &self.spots[samples]
    }

    /// Copies `plane`, less `shift`, at `samples`.
    #[inline(always)]
    pub fn gather(&self, plane: &Plane, samples: Range<usize>, shift: f32, out: &mut [f32]) {
        let data = plane.data();
        out.iter_mut().zip(&self.places[samples]).for_each(|(out, &place)| *out = data[place] - shift);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_weight_is_kept_in_its_place() {
        let plane = Plane::from_fn(6, 4, |x, y| (x + 10 * y) as f32);
        let window = Window::new(0, 3, 1, (6, 4)); // columns 0..2, rows 2..4
        let mut samples = Samples::default();
        for round in 0..2 {
            samples.clear();
            samples.add_frame(&window, 1, 6, &[0.0, 0.5, 1.0, 0.0]);
            samples.add_frame(&window, 1, 6, &[0.25, 0.0, 0.0, 0.0]);
            assert_eq!(samples.stride(), LANES, "round {round}");
            assert_eq!(samples.kernel()[..4], [0.5, 1.0, 0.25, 0.0]);
            assert_eq!((samples.of_frame(0), samples.of_frame(1)), (0..2, 2..3));
            assert_eq!(samples.spots(0..3), [[2, 0], [1, 1], [1, 0]]);
            assert_eq!(samples.centre(), 1);
            let mut values = [0.0; 3];
            samples.gather(&plane, 0..3, 5.0, &mut values);
            assert_eq!(values, [21.0 - 5.0, 30.0 - 5.0, 20.0 - 5.0]);
        }
    }
}
