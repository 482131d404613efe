//! The samples of a fit: the pixels of its window, in this frame and in those beside, that have weight.
//!
//! What does not resemble the centre is not even gathered. `[choice]` of a window of 225 pixels 2 to 200 are
//! left, and where the centre resembles nothing but itself nearly nothing is left to do.

use super::gram::LANES;
use super::weights;
use super::window::Window;
use crate::image::Plane;
use std::ops::Range;

/// Samples, frame after frame, row by row; buffers are kept between windows.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    /// K of every sample, then zeros up to a whole number of vectors.
    kernel: Vec<f32>,
    /// Of the frame at hand, before they become weights.
    distances: Vec<f32>,
    /// Where they lie in the planes.
    runs: Vec<Run>,
    /// Column and row of each in an unclipped window.
    spots: Vec<[u8; 2]>,
    /// Where the samples and the runs of each frame end.
    ends: Vec<[usize; 2]>,
    /// Which of the samples is the centre.
    centre: usize,
}

/// Samples side by side in a row of the planes, at most [`LONGEST_RUN`].
#[derive(Debug, Clone, Copy)]
struct Run {
    /// Where the first one lies.
    place: usize,
    /// How many there are.
    length: usize,
}

/// As many samples are copied at once, whatever the length of the run: what is too much, the next one covers.
/// `[choice]` against a sample at a time: ×0.91 of the fits' time.
const LONGEST_RUN: usize = 16;

impl Samples {
    /// Forgets all samples.
    pub fn clear(&mut self) {
        self.kernel.clear();
        self.runs.clear();
        self.spots.clear();
        self.ends.clear();
    }

    /// Adds the samples of the next frame: the pixels of the window whose `distances` have a weight at the
    /// `bandwidth`, in a picture of `columns`; K is multiplied by their `trust`, a plane and a factor. The radius is
    /// that of unclipped windows, of which `distances` holds all rows (see [`weights::distance_stride`]).
    #[inline(always)]
    pub fn add_frame(
        &mut self,
        window: &Window,
        radius: usize,
        columns: usize,
        distances: &[f32],
        bandwidth: f32,
        trust: Option<(&Plane, f32)>,
    ) {
        let (start, first_run) = (self.spots.len(), self.runs.len());
        let (first_x, first_y) = window.offset(radius);
        let inside = ((1u32 << window.width) - 1) << first_x;
        self.distances.clear();
        let rows = distances.chunks_exact(weights::distance_stride(radius)).skip(first_y);
        for (row, distances) in rows.take(window.height).enumerate() {
            let mut near = weights::near(distances, bandwidth) & inside;
            let place = |column: usize| (window.y0 + row) * columns + window.x0 + column - first_x;
            if let Some((trust, _)) = trust {
                let trusted = |column: &usize| trust.data()[place(*column)] > 0.0;
                let columns = (first_x..first_x + window.width).filter(trusted);
                near &= columns.fold(0, |bits, column| bits | 1 << column);
            }
            while near != 0 {
                let column = near.trailing_zeros() as usize;
                let length = ((near >> column).trailing_ones() as usize).min(LONGEST_RUN);
                near &= !(((1 << length) - 1) << column);
                let run = column..column + length;
                self.distances.extend_from_slice(&distances[run.clone()]);
                self.spots.extend(run.map(|column| [column as u8, (first_y + row) as u8]));
                self.runs.push(Run { place: place(column), length });
            }
        }
        self.kernel.truncate(start);
        self.kernel.resize(self.spots.len(), 0.0);
        weights::kernel(&self.distances, bandwidth, &mut self.kernel[start..]);
        self.ends.push([self.spots.len(), self.runs.len()]);
        if let Some((trust, factor)) = trust {
            let trusts = values(&self.runs[first_run..], trust);
            self.kernel[start..].iter_mut().zip(trusts).for_each(|(k, trust)| *k *= trust * factor);
        }
        self.kernel.resize(self.spots.len().next_multiple_of(LANES), 0.0);
        if self.ends.len() == 1 {
            let middle = [radius as u8; 2];
            self.centre = self.spots.iter().position(|spot| *spot == middle).unwrap_or(0);
        }
    }

    /// Of all frames.
    pub fn len(&self) -> usize {
        self.spots.len()
    }

    /// Length of a column: the samples, rounded up to whole vectors.
    pub fn stride(&self) -> usize {
        self.kernel.len()
    }

    /// Whether there is one sample alone, in all frames together.
    pub fn is_one(&self) -> bool {
        self.len() == 1
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
        let [start, _] = self.start(frame);
        start..self.ends[frame][0]
    }

    fn runs(&self, frame: usize) -> &[Run] {
        &self.runs[self.start(frame)[1]..self.ends[frame][1]]
    }

    /// The first sample and the first run of a frame.
    fn start(&self, frame: usize) -> [usize; 2] {
        frame.checked_sub(1).map_or([0; 2], |before| self.ends[before])
    }

    /// The mean of `plane` over the samples of a frame, by K; 1 without any.
    pub fn mean(&self, frame: usize, plane: &Plane) -> f32 {
        let values = self.kernel[self.of_frame(frame)].iter().zip(values(self.runs(frame), plane));
        let (sum, all) = values.fold((0.0, 0.0), |(s, a), (k, value)| (s + k * value, a + k));
        if all > 0.0 { sum / all } else { 1.0 }
    }

    /// Column and row of samples in an unclipped window.
    pub fn spots(&self, samples: Range<usize>) -> &[[u8; 2]] {
        &self.spots[samples]
    }

    /// Copies `plane`, less `shift`, at the samples of a frame.
    #[inline(always)]
    pub fn gather(&self, plane: &Plane, frame: usize, shift: f32, out: &mut [f32]) {
        let mut at = 0;
        for Run { place, length } in self.runs(frame) {
            let (from, to) = (&plane.data()[*place..], &mut out[at..]);
            match (from.first_chunk::<LONGEST_RUN>(), to.first_chunk_mut::<LONGEST_RUN>()) {
                (Some(from), Some(to)) => *to = from.map(|value| value - shift),
                _ => to.iter_mut().zip(from).take(*length).for_each(|(to, from)| *to = from - shift),
            }
            at += length;
        }
    }
}

/// The values of `plane` at the samples of some runs.
fn values<'a>(runs: &'a [Run], plane: &'a Plane) -> impl Iterator<Item = &'a f32> {
    runs.iter().flat_map(|run| &plane.data()[run.place..run.place + run.length])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_weight_is_kept_in_its_place() {
        let plane = Plane::from_fn(6, 4, |x, y| (x + 10 * y) as f32);
        let window = Window::new(0, 3, 1, (6, 4)); // columns 0..2, rows 2..4
        // Of an unclipped window: 3 rows of 16, of which the columns 1 and 2 and the rows 0 and 1 are inside.
        let distances = |of: [f32; 4]| {
            let mut all = [0.0; 3 * LANES];
            [1, 2, LANES + 1, LANES + 2].into_iter().zip(of).for_each(|(at, distance)| all[at] = distance);
            all
        };
        let trust = Plane::from_fn(6, 4, |x, y| if (x, y) == (0, 2) { 0.5 } else { 0.0 });
        let mut samples = Samples::default();
        for round in 0..2 {
            samples.clear();
            samples.add_frame(&window, 1, 6, &distances([9.0, 0.5, 0.0, 9.0]), 1.0, None);
            samples.add_frame(&window, 1, 6, &distances([0.0, 9.0, 9.0, 0.0]), 1.0, Some((&trust, 0.5)));
            assert_eq!(samples.stride(), LANES, "round {round}");
            let kernel = [(-0.5f32).exp(), 1.0, 0.25, 0.0];
            samples.kernel()[..4].iter().zip(kernel).for_each(|(k, exact)| assert!((k - exact).abs() < 1e-6));
            assert_eq!((samples.of_frame(0), samples.of_frame(1)), (0..2, 2..3));
            assert_eq!(samples.spots(0..3), [[2, 0], [1, 1], [1, 0]]);
            assert_eq!(samples.centre(), 1);
            let mean = (21.0 * kernel[0] + 30.0) / (kernel[0] + 1.0);
            assert!((samples.mean(0, &plane) - mean).abs() < 1e-4);
            let mut values = [0.0; 3];
            samples.gather(&plane, 0, 5.0, &mut values[..2]);
            samples.gather(&plane, 1, 5.0, &mut values[2..]);
            assert_eq!(values, [21.0 - 5.0, 30.0 - 5.0, 20.0 - 5.0]);
        }
    }
}
