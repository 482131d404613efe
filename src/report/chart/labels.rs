//! Labels beside points, placed so that none covers another label or a point.

/// Height and mean width of a letter at the labels' 11 pixels, in a common sans-serif face.
const LETTER: (f64, f64) = (12.0, 5.9);
/// Distance of a label from its point.
const AWAY: f64 = 7.0;

/// A rectangle: left, top, right, bottom.
pub(super) type Area = [f64; 4];

/// Where a label goes: the start of its base line.
pub(super) type Spot = (f64, f64);

/// Keeps track of what is covered.
pub(super) struct Labels {
    frame: Area,
    taken: Vec<Area>,
}

impl Labels {
    /// Labels inside `frame`, none of which may cover one of the points.
    pub(super) fn new(frame: Area, points: impl Iterator<Item = (f64, f64)>) -> Self {
        let disc = |(x, y): (f64, f64)| [x - 4.0, y - 4.0, x + 4.0, y + 4.0];
        Self { frame, taken: points.map(disc).collect() }
    }

    /// Keeps labels off `area`.
    pub(super) fn cover(&mut self, area: Area) {
        self.taken.push(area);
    }

    /// A free spot for `words` beside the point at `x`, `y`: right or left of it, above, level or
    /// below. `None` when all are covered; the point's tooltip then has to do.
    pub(super) fn place(&mut self, x: f64, y: f64, words: &str) -> Option<Spot> {
        let width = words.chars().count() as f64 * LETTER.1;
        let sides = [x + AWAY, x - AWAY - width];
        let levels = [y - AWAY, y, y + AWAY].map(|middle| middle - LETTER.0 / 2.0);
        let areas =
            levels.iter().flat_map(|top| sides.map(|left| [left, *top, left + width, top + LETTER.0]));
        let area = areas.into_iter().find(|area| {
            let f = self.frame;
            let inside = area[0] >= f[0] && area[1] >= f[1] && area[2] <= f[2] && area[3] <= f[3];
            inside && !self.taken.iter().any(|other| overlap(area, other))
        })?;
        self.taken.push(area);
        Some((area[0], area[3] - 3.0)) // letters hang 3 pixels below their base line
    }
}

fn overlap(a: &Area, b: &Area) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_keep_off_each_other_their_points_and_the_edge() {
        let points = [(50.0, 50.0), (52.0, 51.0), (195.0, 50.0)];
        let mut labels = Labels::new([0.0, 0.0, 200.0, 100.0], points.into_iter());
        let spots: Vec<Spot> = points.iter().filter_map(|&(x, y)| labels.place(x, y, "a label")).collect();
        assert_eq!(spots.len(), 3);
        assert!(spots[2].0 + 7.0 * LETTER.1 < 195.0, "the last has no room on its right");
        let [.., a, b, c] = labels.taken[..] else { panic!("three labels") };
        assert!(!overlap(&a, &b) && !overlap(&a, &c) && !overlap(&b, &c));
    }

    #[test]
    fn where_all_is_covered_there_is_no_label() {
        let crowd = (0..200).map(|i| (f64::from(i % 20) * 5.0, f64::from(i / 20) * 5.0));
        assert_eq!(Labels::new([0.0, 0.0, 100.0, 50.0], crowd).place(50.0, 25.0, "lost"), None);
    }
}
