//! The hard cases: pictures that bring a window's fit to the edge of what `f32` can say.
#![cfg(test)]

use crate::image::{Plane, Rgb};

/// Standard deviation of the cases' noise, unless they say otherwise.
const SIGMA: f32 = 0.1;

/// A picture and the window in it that is fitted.
pub struct Case {
    pub name: &'static str,
    pub center: (usize, usize),
    pub color: Rgb,
    pub variance: Rgb,
    pub pilot: Rgb,
    pub features: Vec<Plane>,
    /// Bound of ξ's deviation where it is not the usual one.
    pub risk_bound: Option<f64>,
}

/// Independent numbers of zero mean and unit variance (uniform), one sequence per `seed`.
fn noise(size: (usize, usize), seed: u64) -> Plane {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    Plane::from_fn(size.0, size.1, |_, _| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 40) as f32 / (1u64 << 24) as f32 - 0.5) * 12f32.sqrt()
    })
}

fn light(c: usize, x: usize, y: usize) -> f32 {
    let (x, y) = (x as f32 / 10.0, y as f32 / 10.0);
    1.0 + 0.2 * c as f32 + 0.1 * x - 0.05 * y + 0.04 * x * y - 0.03 * x * x
}

impl Case {
    /// A smooth light, noise of [`SIGMA`], no feature, the window in the middle.
    fn sized(name: &'static str, size: (usize, usize)) -> Self {
        let truth = |c| Plane::from_fn(size.0, size.1, |x, y| light(c, x, y));
        let mut case = Self {
            name,
            center: (size.0 / 2, size.1 / 2),
            color: std::array::from_fn(truth),
            variance: std::array::from_fn(|_| Plane::filled(size.0, size.1, SIGMA * SIGMA)),
            pilot: std::array::from_fn(truth),
            features: vec![],
            risk_bound: None,
        };
        for (c, plane) in case.color.iter_mut().enumerate() {
            let noise = noise(size, 1 + c as u64);
            plane.data_mut().iter_mut().zip(noise.data()).for_each(|(v, n)| *v += SIGMA * n);
        }
        case
    }

    fn new(name: &'static str) -> Self {
        Self::sized(name, (31, 23))
    }

    fn at(mut self, x: usize, y: usize) -> Self {
        self.center = (x, y);
        self
    }

    fn bounded(mut self, risk_bound: f64) -> Self {
        self.risk_bound = Some(risk_bound);
        self
    }

    /// Adds a feature; `f` hears the place and a random number.
    fn feature(mut self, f: impl Fn(usize, usize, f32) -> f32) -> Self {
        let size = self.color[0].size();
        let random = noise(size, 100 + self.features.len() as u64);
        self.features.push(Plane::from_fn(size.0, size.1, |x, y| f(x, y, random.get(x, y))));
        self
    }

    /// Sets colour, pilot and variance; the closures hear channel, place and what was there.
    fn with(
        mut self,
        color: impl Fn(usize, usize, f32) -> f32,
        pilot: impl Fn(usize, usize, f32) -> f32,
        variance: impl Fn(usize, usize, f32) -> f32,
    ) -> Self {
        let (width, height) = self.color[0].size();
        let set = |planes: &mut Rgb, f: &dyn Fn(usize, usize, f32) -> f32| {
            for plane in planes {
                *plane = Plane::from_fn(width, height, |x, y| f(x, y, plane.get(x, y)));
            }
        };
        set(&mut self.color, &color);
        set(&mut self.pilot, &pilot);
        set(&mut self.variance, &variance);
        self
    }

    /// Multiplies radiance.
    fn scaled(self, factor: f32) -> Self {
        let times = move |_: usize, _: usize, v: f32| v * factor;
        self.with(times, times, move |_, _, v| v * factor * factor)
    }
}

fn wave(x: usize, y: usize) -> f32 {
    (0.7 * x as f32).sin() + (0.5 * y as f32).cos()
}

/// Everything that a renderer gives, on a curved surface.
fn full(case: Case) -> Case {
    case.feature(|x, y, _| 0.3 * wave(x, y))
        .feature(|x, y, _| 0.3 * wave(y, x))
        .feature(|x, y, _| (1.0 - 0.09 * (wave(x, y).powi(2) + wave(y, x).powi(2)) / 2.0).sqrt())
        .feature(|x, y, _| if (x / 3 + y / 3) % 2 == 0 { 0.8 } else { 0.2 })
        .feature(|x, y, _| if (x / 2 + y / 3) % 2 == 0 { 0.5 } else { 0.3 })
        .feature(|_, _, r| 0.5 + 0.1 * r)
        .feature(|x, y, _| 4.0 + 0.05 * x as f32 + 0.02 * y as f32 * wave(x, y))
}

/// A feature and a copy of it that differs by `share` of its deviation.
fn copies(name: &'static str, share: f32) -> Case {
    let random = noise((31, 23), 900);
    Case::new(name).feature(|x, y, _| random.get(x, y)).feature(|x, y, r| random.get(x, y) + share * r)
}

/// All cases.
pub fn all() -> Vec<Case> {
    [features(), ranges(), radiance(), windows()].into_iter().flatten().collect()
}

/// Features that say nothing, or the same twice.
fn features() -> Vec<Case> {
    let mut chain = Case::new("eight features, each nearly the one before");
    for n in 0..8u64 {
        let sum = (0..=n).map(|k| noise((31, 23), 700 + k)).collect::<Vec<_>>();
        chain = chain.feature(move |x, y, _| {
            sum.iter().enumerate().map(|(k, p)| p.get(x, y) * if k == 0 { 1.0 } else { 0.05 }).sum()
        });
    }
    vec![
        full(Case::new("curved surface, seven features")),
        Case::new("no features"),
        full(Case::new("constant features").feature(|_, _, _| 0.3).feature(|_, _, _| -7e5)),
        full(Case::new("a feature of zeros").feature(|_, _, _| 0.0)),
        Case::new("grey albedo: one feature thrice")
            .feature(|x, y, _| wave(x, y))
            .feature(|x, y, _| wave(x, y))
            .feature(|x, y, _| wave(x, y)),
        Case::new("features equal to x and y").feature(|x, _, _| x as f32).feature(|_, y, _| y as f32),
        Case::new("normal and position on a plane")
            .feature(|_, _, _| 0.6)
            .feature(|_, _, _| 0.8)
            .feature(|x, y, _| 3.1 + 0.01 * x as f32 - 0.02 * y as f32)
            .feature(|x, y, _| -2.2 + 0.03 * x as f32 + 0.01 * y as f32)
            .feature(|x, y, _| 9.7 - 0.02 * x as f32 + 0.005 * y as f32),
        copies("a feature and a copy that differs by 10 %", 0.1),
        copies("a feature and a copy that differs by 5 %", 0.05),
        copies("a feature and a copy that differs by 1 %", 0.01),
        copies("a feature and a copy that differs by 1e-6", 1e-6),
        chain,
        Case::new("a texture of one-pixel checks").feature(|x, y, _| ((x + y) % 2) as f32),
        Case::new("depth blurred by defocus and motion")
            .feature(|x, y, r| {
                5.0 + 3.0 / (1.0 + (-0.6 * (x as f32 - 15.0)).exp()) + 0.05 * r + 0.01 * y as f32
            })
            .feature(|x, _, r| ((x as f32 - 12.0) / 6.0).clamp(0.0, 1.0) + 0.02 * r),
        {
            let own = noise((31, 23), 1);
            Case::new("visibility with the colour's own noise").feature(|x, y, _| 0.5 + 0.1 * own.get(x, y))
        },
    ]
}

/// Features far from zero, small, large, missing.
fn ranges() -> Vec<Case> {
    let miss = |x: usize, y: usize| (x * 7 + y * 3).is_multiple_of(5);
    let hit = |x: usize, y: usize| 3.0 + 0.1 * wave(x, y);
    vec![
        Case::new("features at offsets of 1e6")
            .feature(|x, y, _| 1e6 + 10.0 * wave(x, y))
            .feature(|_, _, r| -1e6 + r),
        Case::new("features of scale 1e-6").feature(|x, y, _| 1e-6 * wave(x, y)).feature(|_, _, r| 1e-6 * r),
        Case::new("features of scale 1e9").feature(|x, y, _| 1e9 * wave(x, y)).feature(|_, _, r| 1e9 * r),
        Case::new("features of scale 1e-30 and 1e15")
            .feature(|x, y, _| 1e-30 * wave(x, y))
            .feature(|_, _, r| 2e14 * r),
        Case::new("positions in millimetres, 2 km off")
            .feature(|x, y, _| 2e6 + 30.0 * x as f32 + 5.0 * wave(x, y))
            .feature(|x, y, _| -1.5e6 + 12.0 * y as f32 + 5.0 * wave(y, x)),
        Case::new("positions in kilometres")
            .feature(|x, y, _| 2.0 + 3e-5 * x as f32 + 5e-6 * wave(x, y))
            .feature(|x, y, _| -1.5 + 1.2e-5 * y as f32 + 5e-6 * wave(y, x)),
        Case::new("misses of depth 1e10, the centre a hit")
            .at(16, 11)
            .feature(move |x, y, _| if miss(x, y) { 1e10 } else { hit(x, y) }),
        Case::new("misses of depth 1e10, the centre a miss")
            .at(15, 10)
            .feature(move |x, y, _| if miss(x, y) { 1e10 } else { hit(x, y) }),
        Case::new("only the centre a miss of infinite depth")
            .feature(move |x, y, _| if (x, y) == (15, 11) { 1e15 } else { hit(x, y) }),
        Case::new("misses in depth and position")
            .feature(move |x, y, _| if miss(x, y) { 1e10 } else { hit(x, y) })
            .feature(move |x, y, _| if miss(x, y) { 1e10 } else { 0.1 * x as f32 + 0.05 * wave(y, x) })
            .feature(move |x, y, _| if miss(x, y) { -1e10 } else { wave(x, y) }),
        Case::new("a constant feature but for the centre")
            .feature(|x, y, _| if (x, y) == (15, 11) { 0.7 } else { 0.3 }),
        Case::new("a constant feature but for one pixel by its last digit")
            .feature(|x, y, _| if (x, y) == (12, 9) { 0.3f32.next_up() } else { 0.3 }),
    ]
}

/// Radiance and its noise beyond the ordinary.
fn radiance() -> Vec<Case> {
    let same = |_: usize, _: usize, v: f32| v;
    let zero = |_: usize, _: usize, _: f32| 0.0;
    let draws = noise((31, 23), 40);
    let other = noise((31, 23), 41);
    vec![
        full(Case::new("all black").with(zero, zero, zero)),
        full(Case::new("one noisy pixel in a constant window").with(
            |x, y, _| if (x, y) == (13, 12) { 1.4 } else { 1.0 },
            |_, _, _| 1.0,
            |x, y, _| if (x, y) == (13, 12) { 0.1 } else { 0.0 },
        )),
        full(Case::new("no variance anywhere").with(same, same, zero)),
        full(
            Case::new("no variance at every other pixel")
                .with(same, same, |x, y, v| if (x + y) % 2 == 0 { 0.0 } else { v }),
        ),
        // The rounding of the light itself is 3e-4 of such noise.
        full(
            Case::new("noise of 1e-4 of the light")
                .with(|x, y, v| 1.0 + 1e-4 * (v + draws.get(x, y)), same, |_, _, _| 1e-8)
                .bounded(2e-3),
        ),
        full(Case::new("noise of 100 times the light").with(
            |_, _, v| 1.0 + 1e3 * (v - 1.0),
            same,
            |_, _, _| 1e4,
        )),
        full(
            Case::new("variance from two samples")
                .with(same, same, |x, y, v| v * (draws.get(x, y) - other.get(x, y)).powi(2) / 2.0),
        ),
        full(Case::new("radiance of 1e-30").scaled(1e-18)),
        full(Case::new("radiance of 1e15").scaled(1e15)),
        full(Case::new("radiance of 1e-30 and 1e15 side by side").with(
            |x, _, v| if x < 15 { 1e-30 * v } else { 1e15 * v },
            |x, _, v| if x < 15 { 1e-30 * v } else { 1e15 * v },
            |_, _, _| 1e30,
        )),
        // As far apart as exposure leaves them: 2^90 is the most, of light and of variance. The window is one
        // column of pixels and its noise nothing beside the light, so that ξ is what two sums leave of each
        // other, each rounded to 1e-7 and divided by pivots down to 1e-3.
        full(Case::new("radiance of 1e-33 and 1e27 side by side").with(
            |x, _, v| if x < 15 { 1e-33 * v } else { 6e26 * v },
            |x, _, v| if x < 15 { 1e-33 * v } else { 6e26 * v },
            |_, _, _| 1e27,
        ))
        .bounded(1e-2),
        full(Case::new("half floats' largest value").with(
            |x, y, v| if draws.get(x, y) > 0.0 { 65504.0 } else { v },
            same,
            |_, _, _| 1e9,
        )),
        full(Case::new("noise of 1e25 times the light").with(
            |_, _, v| 1e-25 * v,
            |_, _, v| 1e-25 * v,
            |_, _, _| 1.0,
        )),
        full(Case::new("denormal radiance").with(|_, _, v| 1e-40 * v, |_, _, v| 1e-40 * v, zero)),
        full(Case::new("negative radiance").with(|_, _, v| v - 2.0, |_, _, v| v - 2.0, same)),
        full(Case::new("a firefly of 1e6 with its own variance").with(
            |x, y, v| if (x, y) == (17, 9) { 1e6 } else { v },
            same,
            |x, y, v| if (x, y) == (17, 9) { 1e12 } else { v },
        )),
    ]
}

/// Windows with few pixels.
fn windows() -> Vec<Case> {
    let alike = |x: usize, y: usize| (x + 2 * y) % 23 == 14; // (15, 11) is one of them
    vec![
        full(Case::new("fewer pixels with weight than columns").with(
            |x, y, v| if alike(x, y) { v } else { 50.0 },
            |_, _, v| v,
            |_, _, v| v,
        )),
        full(Case::new("a pixel unlike all others").with(
            |x, y, v| if (x, y) == (15, 11) { 90.0 } else { v },
            |_, _, v| v,
            |_, _, _| 1e-6,
        )),
        full(Case::new("a corner").at(0, 0)),
        full(Case::sized("a picture of one row", (40, 1))),
        full(Case::sized("a picture of one column", (1, 40))),
        full(Case::sized("a picture of two by two", (2, 2))),
        full(Case::sized("a picture of one pixel", (1, 1))),
    ]
}
