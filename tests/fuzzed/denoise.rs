//! Arbitrary bits as a small frame with options: whatever they are, the result is finite.

use apr::image::{Plane, Rgb};
use apr::options::{Kernel, OrderChoice};
use apr::{Aov, ErrorKind, Feature, FeatureKind, Frame, Options, denoise};

/// The largest width and height: more than a window, so that windows lie inside, at borders, in corners.
const LARGEST_SIDE: usize = 20;

/// Numbers at the ends of what `f32` and renderers know.
const SPECIAL: [f32; 16] = [
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MAX,
    f32::MIN,
    f32::MIN_POSITIVE,
    1e-45,
    0.0,
    -0.0,
    1.0,
    -1.0,
    65504.0,
    1e10,
    1e15,
    1e-30,
    1e32,
];

/// The bytes, one after the other, and zeros when they are used up.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn byte(&mut self) -> u8 {
        self.0.split_off_first().copied().unwrap_or(0)
    }

    fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n
    }

    fn float(&mut self) -> f32 {
        f32::from_le_bytes(std::array::from_fn(|_| self.byte()))
    }

    /// A number from `low` to `high`, the ends among them; now and then any.
    fn within(&mut self, low: f32, high: f32) -> f32 {
        let any = self.float();
        match any.to_bits() % 8 {
            0 => any,
            _ if (low..=high).contains(&any) => any,
            1 => low,
            2 => high,
            _ => low + (high - low) * ((any.to_bits() >> 3 & 255) as f32 / 255.0).powi(4),
        }
    }

    /// A plane in one of five ways: all one, any bits, special numbers, small steps, noise about a value.
    fn plane(&mut self, (width, height): (usize, usize)) -> Plane {
        match self.byte() % 5 {
            0 => Plane::filled(width, height, self.float()),
            1 => Plane::from_fn(width, height, |_, _| self.float()),
            2 => Plane::from_fn(width, height, |_, _| SPECIAL[self.below(SPECIAL.len())]),
            3 => Plane::from_fn(width, height, |_, _| f32::from(self.byte()) / 64.0),
            _ => {
                let (mean, deviation) = (self.float(), self.float());
                let mut state = u32::from(self.byte());
                Plane::from_fn(width, height, |_, _| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    mean + deviation * ((state >> 8) as f32 / (1 << 24) as f32 - 0.5)
                })
            }
        }
    }

    fn rgb(&mut self, size: (usize, usize)) -> Rgb {
        let first = self.plane(size);
        match self.byte() % 2 {
            0 => [first.clone(), first.clone(), first], // grey
            _ => [first, self.plane(size), self.plane(size)],
        }
    }

    fn feature(&mut self, size: (usize, usize)) -> Feature {
        use FeatureKind::{Albedo, Depth, Normal, Other, Position, Visibility};
        let kind = [Normal, Albedo, Depth, Visibility, Position, Other][self.below(6)];
        let count = if matches!(kind, Normal | Albedo | Position) { 3 } else { 1 + self.below(2) };
        let mut planes = || (0..count).map(|_| self.plane(size)).collect::<Vec<_>>();
        let mut feature = Feature::new("feature", kind, planes());
        let (variance, halves) = (planes(), [planes(), planes()]);
        feature.var_of_mean = (self.byte() % 2 == 1).then_some(variance);
        feature.halves = (self.byte() % 2 == 1).then_some(halves);
        feature
    }

    fn frame(&mut self) -> apr::Result<Frame> {
        let size = (1 + self.below(LARGEST_SIDE), 1 + self.below(LARGEST_SIDE));
        let has = self.byte();
        let mut frame = Frame::new(self.rgb(size))?;
        if has & 1 != 0 {
            frame = frame.with_variance_of_mean(self.rgb(size))?;
        }
        if has & 2 != 0 {
            frame = frame.with_halves([self.rgb(size), self.rgb(size)])?;
        }
        for _ in 0..has >> 2 & 3 {
            frame = frame.with_feature(self.feature(size))?;
        }
        if has & 16 != 0 {
            frame = frame.with_aov(Aov { name: "light".into(), color: self.rgb(size) })?;
        }
        Ok(frame)
    }

    /// A preset, with some of its options changed, now and then out of their range.
    fn options(&mut self) -> Options {
        let (_, preset) = Options::PRESETS[self.below(Options::PRESETS.len())];
        let mut options = preset();
        let changed = self.byte();
        if changed & 1 != 0 {
            options.window_radius = self.below(10);
            options.center_spacing = self.below(9);
        }
        if changed & 2 != 0 {
            options.max_order = self.below(5);
            options.order_choice = [OrderChoice::Hard, OrderChoice::Soft, OrderChoice::Shrink][self.below(3)];
        }
        if changed & 4 != 0 {
            let kernel = Kernel {
                patch_radius: self.below(4),
                bandwidth: self.within(0.01, 1e6),
                demodulate: self.byte() % 2 == 1,
                feature_bandwidth: (self.byte() % 2 == 1).then(|| self.within(0.01, 1e6)),
            };
            options.stages = vec![vec![kernel]; 1 + self.below(2)];
        }
        if changed & 8 != 0 {
            options.outliers.deviations = self.within(0.0, 1e6);
            options.outliers.radius = self.below(5);
            options.prefilter.bandwidth = self.within(0.01, 1e6);
        }
        if changed & 16 != 0 {
            options.min_coverage = self.within(0.0, 1e3);
            options.noise_weight = self.within(0.0, 1e3);
            options.risk_power = self.within(0.0, 4.0);
            options.tolerance = self.within(0.0, 1.0);
        }
        if changed & 32 != 0 {
            options.dark_level = self.within(1e-3, 1e3);
            options.albedo_floor = self.within(1e-3, 1e3);
            options.variance_radius = self.below(17);
        }
        if changed & 64 != 0 {
            options.outliers.share = self.within(0.0, 1.0);
        }
        options
    }
}

/// Makes options and a frame of `bytes` and denoises it: no panic, and a finite result of its size.
pub fn survives(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    let options = bytes.options();
    let frame = bytes.frame().expect("all planes are of one size");
    let result = match denoise(&frame, &options) {
        Ok(result) => result,
        Err(error) => {
            assert_eq!(error.kind(), ErrorKind::Usage, "{error}");
            return;
        }
    };
    let size = (frame.width(), frame.height());
    let finite = |plane: &Plane| plane.size() == size && plane.data().iter().all(|v| v.is_finite());
    assert!(result.color.iter().all(finite), "colour");
    assert!(result.aovs.len() == frame.aovs().len(), "number of AOVs");
    assert!(result.aovs.iter().flat_map(|aov| &aov.color).all(finite), "AOV");
    assert!(
        result.mse.iter().all(|mse| finite(mse) && mse.data().iter().all(|v| *v >= 0.0)),
        "estimated error"
    );
    let order = |v: &f32| (0.0..=3.01).contains(v);
    assert!(finite(&result.order) && result.order.data().iter().all(order), "order");
}
