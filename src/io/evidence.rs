//! What numbers tell where names do not: Mitsuba's users name their layers as they like.

use super::channels::Evidence;
use crate::image::Plane;

/// Relative difference that half floats and sums in another order may leave.
const CLOSE: f32 = 0.02;
/// Below this the difference is absolute.
const SMALL: f32 = 1e-3;
/// The share of pixels that must agree: fireflies beyond the half floats' range may not.
const MOST: f32 = 0.99;
/// The share of pixels whose albedo must be one: Mitsuba's estimate on metals is above 1 (2 % in a
/// fixture of ours).
const MOST_ALBEDOS: f32 = 0.9;
/// How far a stored unit vector or a share may overshoot 1.
const OVERSHOOT: f32 = 0.01;
/// Averaged over a pixel, unit vectors at edges are shorter; most are not.
const NEARLY_UNIT: f32 = 0.9;

/// Linear Rec. 709 RGB to CIE XYZ.
const RGB_TO_XYZ: [[f32; 3]; 3] =
    [[0.412_453, 0.357_58, 0.180_423], [0.212_671, 0.715_16, 0.072_169], [0.019_334, 0.119_193, 0.950_227]];

/// What was seen of some planes so far. Whole counts, so that the rows may come in any portions. What is no
/// number, in the planes or in the colour that they are compared with, tells nothing.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    /// Pixels that can be compared with the colour.
    compared: usize,
    /// Pixels that agree with the colour.
    agreeing: usize,
    /// Vectors that are not 0, and of those the long ones.
    hits: usize,
    nearly_unit: usize,
    /// A vector is longer than 1.
    too_long: bool,
    /// For each plane how many values are numbers, and how many of those between 0 and 1, or nearly.
    in_range: Vec<[usize; 2]>,
}

impl Tally {
    /// Adds rows of `planes` and the same rows of the colour.
    pub(super) fn add(&mut self, evidence: Evidence, planes: &[&Plane], color: &[&Plane]) {
        let comparable = planes.len() == 3 && color.len() == 3;
        match evidence {
            Evidence::EqualsColor if comparable => self.compare(planes, |c, i| color[c].data()[i]),
            Evidence::EqualsColorInXyz if comparable => {
                self.compare(planes, |c, i| (0..3).map(|k| RGB_TO_XYZ[c][k] * color[k].data()[i]).sum())
            }
            Evidence::Name | Evidence::EqualsColor | Evidence::EqualsColorInXyz => {}
            Evidence::UnitVectors => self.measure(planes),
            Evidence::UnitRange => {
                self.in_range.resize(planes.len(), [0; 2]);
                let inside = |v: &&f32| (-OVERSHOOT..=1.0 + OVERSHOOT).contains(*v);
                for ([numbers, within], plane) in self.in_range.iter_mut().zip(planes) {
                    *numbers += plane.data().iter().filter(|v| v.is_finite()).count();
                    *within += plane.data().iter().filter(inside).count();
                }
            }
        }
    }

    /// Whether what was added looks as a row of the channel map asks.
    pub(super) fn holds(&self, evidence: Evidence) -> bool {
        let most = |count: usize, of: usize, share: f32| of > 0 && count as f32 >= share * of as f32;
        match evidence {
            Evidence::Name => true,
            Evidence::EqualsColor | Evidence::EqualsColorInXyz => most(self.agreeing, self.compared, MOST),
            Evidence::UnitVectors => {
                !self.too_long && self.nearly_unit > 0 && 2 * self.nearly_unit >= self.hits
            }
            Evidence::UnitRange => {
                self.in_range.iter().all(|&[numbers, within]| most(within, numbers, MOST_ALBEDOS))
            }
        }
    }

    fn compare(&mut self, planes: &[&Plane], expected: impl Fn(usize, usize) -> f32) {
        for i in 0..planes[0].data().len() {
            let pairs = || planes.iter().enumerate().map(|(c, plane)| (plane.data()[i], expected(c, i)));
            if pairs().all(|(got, wanted)| got.is_finite() && wanted.is_finite()) {
                let close = |(got, wanted): (f32, f32)| (got - wanted).abs() <= CLOSE * wanted.abs() + SMALL;
                self.compared += 1;
                self.agreeing += usize::from(pairs().all(close));
            }
        }
    }

    fn measure(&mut self, planes: &[&Plane]) {
        for i in 0..planes[0].data().len() {
            if planes.iter().any(|plane| !plane.data()[i].is_finite()) {
                continue;
            }
            let length = planes.iter().map(|plane| plane.data()[i].powi(2)).sum::<f32>().sqrt();
            self.too_long |= length > 1.0 + OVERSHOOT;
            self.hits += usize::from(length > 0.0);
            self.nearly_unit += usize::from(length > NEARLY_UNIT);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planes(f: impl Fn(usize, usize, usize) -> f32) -> [Plane; 3] {
        std::array::from_fn(|c| Plane::from_fn(9, 7, |x, y| f(c, x, y)))
    }

    fn shows(evidence: Evidence, planes: &[Plane; 3], color: &[Plane; 3]) -> bool {
        let mut tally = Tally::default();
        tally.add(evidence, &planes.each_ref(), &color.each_ref());
        tally.holds(evidence)
    }

    #[test]
    fn each_kind_of_layer_is_told_from_the_others() {
        let color = planes(|c, x, y| 0.3 * c as f32 + x as f32 + 0.5 * y as f32);
        let xyz = planes(|c, x, y| {
            (0..3).map(|k| RGB_TO_XYZ[c][k] * (0.3 * k as f32 + x as f32 + 0.5 * y as f32)).sum()
        });
        let normal = planes(|c, x, _| match (x, c) {
            (0, _) => 0.0, // a miss
            (_, 2) => (x as f32 / 9.0).cos(),
            (_, 0) => (x as f32 / 9.0).sin(),
            _ => 0.0,
        });
        let position = planes(|c, x, y| 0.1 * (x + y + c) as f32);
        let albedo = planes(|c, x, _| 0.1 * (x + c) as f32);
        let all = [
            (Evidence::EqualsColor, [true, false, false, false, false]),
            (Evidence::EqualsColorInXyz, [false, true, false, false, false]),
            (Evidence::UnitVectors, [false, false, true, false, false]),
            (Evidence::UnitRange, [false, false, true, false, true]),
        ];
        for (evidence, expected) in all {
            let layers = [&color, &xyz, &normal, &position, &albedo];
            assert_eq!(layers.map(|layer| shows(evidence, layer, &color)), expected, "{evidence:?}");
        }
    }

    #[test]
    fn what_is_no_number_tells_nothing() {
        let broken = |x: usize, y: usize| (x < 3 && y < 4) || (x, y) == (7, 5);
        let with = |bad: f32| planes(move |c, x, y| if broken(x, y) { bad } else { 0.1 + 0.4 * c as f32 });
        let normal = |bad: f32| {
            planes(move |c, x, y| if broken(x, y) { bad } else { f32::from(u8::from(c == x % 3)) })
        };
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert!(shows(Evidence::EqualsColor, &with(bad), &with(f32::NAN)), "{bad}");
            assert!(shows(Evidence::UnitRange, &with(bad), &with(bad)), "{bad}");
            assert!(shows(Evidence::UnitVectors, &normal(bad), &with(bad)), "{bad}");
        }
        let nothing = planes(|_, _, _| f32::NAN);
        for evidence in [Evidence::EqualsColor, Evidence::UnitRange, Evidence::UnitVectors] {
            assert!(!shows(evidence, &nothing, &nothing), "{evidence:?}");
        }
    }

    #[test]
    fn a_copy_may_lack_fireflies_and_have_nothing_finite() {
        let color = planes(|_, x, y| if (x, y) == (0, 0) { 1e6 } else { 1.0 });
        let clipped = planes(|_, _, _| 1.0);
        assert!(!shows(Evidence::EqualsColor, &planes(|_, _, _| f32::NAN), &color));
        assert!(!shows(Evidence::EqualsColor, &clipped, &planes(|_, x, _| 1.0 + x as f32)));
        assert!(!shows(Evidence::UnitVectors, &planes(|_, _, _| 0.0), &color), "no surface at all");
    }
}
