//! Where a stage of fits works: tiles, and how far around what is wanted of it it looks.
//!
//! The picture is cut into tiles whose place and size are constants. Each tile's sums are formed in one order, and tiles
//! are added in their order: the bits do not depend on the threads. The coverage test of a tile sees the centres of
//! the grid and those it has added itself, not what other tiles add. So a pixel depends on pixels within a bounded
//! distance alone, wherever the picture is cut.

use super::forgiveness;
use crate::image::Rect;
use crate::options::Options;

/// Side of a tile in pixels: large enough that the windows' overhang is no burden and few pixels are
/// covered twice at its border, small enough that all threads have work.
pub const TILE: usize = 32;

/// Where a stage works; in the coordinates of the planes, which may be a part of the picture.
#[derive(Debug, Clone, Copy)]
pub struct Area {
    /// Column and row of the planes' first pixel in the picture, which the tiles and the grid are laid on.
    pub origin: (usize, usize),
    /// The pixels that are to come out as if the planes were the whole picture.
    pub wanted: Rect,
    /// The pixels whose centres are counted.
    pub counted: Rect,
}

/// How far around the wanted pixels a stage reads, patches aside: fits that reach them, those that the
/// coverage test sees with them, and their windows.
pub const fn reach(window_radius: usize) -> usize {
    3 * window_radius + TILE - 1
}

/// How much farther than the fits a stage looks at the one before: patches, and what it forgives in them.
pub fn more_of_a_pilot(options: &Options) -> usize {
    options.largest_patch() + forgiveness::RADIUS
}

impl Area {
    /// The areas of all stages, the last of which is this one, on planes of `size`.
    pub fn of_stages(self, size: (usize, usize), options: &Options) -> Vec<Self> {
        let before = |area: &Self| Some(Self { wanted: area.reads(size, options), ..*area });
        let mut areas: Vec<Self> =
            std::iter::successors(Some(self), before).take(options.stages.len()).collect();
        areas.reverse();
        areas
    }

    /// The pixels that are read of planes of `size`: where the stage before must be right.
    fn reads(&self, size: (usize, usize), options: &Options) -> Rect {
        let radius = options.window_radius;
        let around = 2 * radius + more_of_a_pilot(options);
        tested(self.wanted, self.origin, size, radius).grown(around, size)
    }
}

/// The tiles whose coverage centres reach `wanted`.
pub fn tested(wanted: Rect, origin: (usize, usize), size: (usize, usize), radius: usize) -> Rect {
    let reach = wanted.grown(radius, size);
    let out = |from: usize, length: usize, origin: usize, limit: usize| {
        let first = ((from + origin) / TILE * TILE).saturating_sub(origin);
        let end = ((from + length + origin).next_multiple_of(TILE) - origin).min(limit);
        (first, end - first)
    };
    let (x, width) = out(reach.x, reach.width, origin.0, size.0);
    let (y, height) = out(reach.y, reach.height, origin.1, size.1);
    Rect { x, y, width, height }
}

/// `rect` cut along the tiles, row by row.
pub fn tiles(rect: Rect, origin: (usize, usize)) -> Vec<Rect> {
    let cuts = |from: usize, length: usize, origin: usize| {
        let end = from + length;
        let next = move |at: &usize| Some((at + origin + 1).next_multiple_of(TILE) - origin);
        let starts = std::iter::successors(Some(from), next).take_while(move |at| *at < end);
        starts.map(move |at| (at, ((at + origin + 1).next_multiple_of(TILE) - origin).min(end) - at))
    };
    let columns: Vec<_> = cuts(rect.x, rect.width, origin.0).collect();
    let rows = cuts(rect.y, rect.height, origin.1);
    rows.flat_map(|(y, height)| columns.iter().map(move |&(x, width)| Rect { x, y, width, height })).collect()
}
