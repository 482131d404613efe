//! Every tunable of the denoiser, each with its one default.

mod described;
mod replace;

pub use described::Key;
pub(crate) use described::{check, described, told};
pub(crate) use replace::replaced;

use crate::error::Result;
use crate::frame::FeatureKind;
use serde::{Deserialize, Serialize};

/// The largest radius of a window.
pub const MAX_WINDOW_RADIUS: usize = 15;

/// The largest radius of a kernel's patches.
pub const MAX_PATCH_RADIUS: usize = 3;

/// The bandwidth of the features. `[choice]` of 1, 1.25, 1.5 and 2: the least error on the whole; 2 is ×1.02 on
/// five scenes and ×1.00 on thirteen others, 1 is ×1.00 on both and ×1.01 at 64 spp.
const FEATURE_BANDWIDTH: f32 = 1.25;

/// How much wider than the last stage's the pilot's bandwidth of colour is. A pilot that has less noise tells better
/// which components hold light. `[choice]` the pilot by this kernel against one by colour instead of colour over albedo
/// and a bandwidth of 1, in the order of `denoise/pursuit.rs`: relMSE ×0.993 on five scenes, ×0.974 on thirteen others,
/// ×0.992 on seventeen (16 to 256 spp), MSE ×0.972, ×0.969, ×0.988, and less energy lost; of 1, 1.25, 1.6 and 2.2 ×0.995,
/// ×0.994, ×0.995 and ×1.006; ×0.987, ×0.978, ×0.975 and ×0.989; ×1.000, ×0.994, ×0.995 and ×0.999.
const WIDER_PILOT: f32 = 1.4;

described! {
    /// Options of [`crate::denoise()`].
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Options {
        /// Radius of the windows Ω_c in pixels; 7 is 15×15. `[choice]` 6 against 7: relMSE ×1.010 on five
        /// scenes, ×1.014 on thirteen others (16 to 256 spp); 8 is in [`Self::best`].
        #[range(1..=MAX_WINDOW_RADIUS)]
        pub window_radius: usize,
        /// Distance between the centres of the grid in pixels; 1 puts a centre on every pixel. `[choice]` 3 against 4:
        /// relMSE ×1.010 on five scenes, ×1.006 on thirteen others (16 to 256 spp).
        #[range(1..=15)]
        pub center_spacing: usize,
        /// Summed weight that a pixel needs from the fits around it, else it becomes a centre itself. `[choice]` of 1,
        /// 2, 4, 8, 16 and 32: relMSE of 4 ×1.01, of 16 ×1.00 in 1.3 times the time.
        #[range(0.0..=1e3)]
        pub min_coverage: f32,
        /// The share of `min_coverage` that the stages before the last ask for: a pilot only says how far
        /// coefficients are shrunk and fits are trusted. `[choice]` of 1, ½, ¼ and ⅛: relMSE ×1.000, ×1.001 and ×1.002
        /// (18 scenes at 16 to 256 spp) in 0.8, 0.7 and 0.65 of the time.
        #[range(0.0..=1.0)]
        pub pilot_coverage: f32,
        /// Highest polynomial order in pixel position.
        #[range(0..=3)]
        pub max_order: usize,
        /// How the order of a fit is chosen: `hard` takes that with the least risk (Moon et al. 2016), `soft` weighs all by
        /// their risk, `shrink` shrinks every component by its own signal-to-noise ratio, `residual` takes the highest.
        pub order_choice: OrderChoice,
        /// The first stage's risk as published (y put for μ) instead of the unbiased one (SURE).
        pub plain_first_stage: bool,
        /// The kernels of every stage, 1 to 8 stages of 1 to 16 kernels; their fits all join one average.
        pub stages: Vec<Vec<Kernel>>,
        /// The last stage is done once for each of these factors on its kernels' bandwidths of colour, 1 to 8, and the
        /// results are averaged. `[choice]` in [`Self::best`].
        #[range(0.1..=10.0)]
        pub bandwidths: Vec<f32>,
        /// Differences of this share of the radiance count as noise when patches are compared: where noise
        /// vanishes, weights still know what is nearly the same. 0 is the published distance. `[choice]` with one
        /// bandwidth of 1 for all kernels against 0 with bandwidths of 0.6 and 1.2, thirteen scenes: relMSE ×0.97 at 4
        /// and 16 spp, ×0.83 at 256, ×0.76 at 1024, in fewer fits; 0.08 ×1.01, 0.16 ×1.01.
        #[range(0.0..=1.0)]
        pub tolerance: f32,
        /// Kinds of features that enter the fit: any of `normal`, `albedo`, `depth`, `visibility`, `position`, `other`.
        pub features: Vec<FeatureKind>,
        /// The outlier step.
        pub outliers: OutlierOptions,
        /// The filter of noisy features.
        pub prefilter: PrefilterOptions,
        /// The weight of every sample in its fit is divided by 1 + this × its share of the window's noise, that is of
        /// Σ K σ²; 0 leaves it out. `[choice]` of 12, 16, 20 and 28: relMSE ×1.003, ×1, ×0.997 and ×0.995 (five scenes at
        /// 16 to 256 spp), ×1.000, ×1, ×1.003 and ×1.005 (thirteen others); by the variance over the window's mean,
        /// whatever the number of samples, ×1.003 and ×1.006.
        #[range(0.0..=1e3)]
        pub noise_weight: f32,
        /// Radius over which the colour's variance is averaged before the fit uses it. `[choice]` 1 against 2:
        /// relMSE ×0.975 on thirteen scenes and ×0.99 on five others; 0 ×1.09 and ×1.00.
        #[range(0..=15)]
        pub variance_radius: usize,
        /// Fits are averaged by K·(floor/(ξ + floor))^power from the second stage on; 0 is the published K alone.
        /// `[choice]` in `denoise/amounts.rs`.
        #[range(0.0..=4.0)]
        pub risk_power: f32,
        /// A fit's predictions count less towards its window's border: by (1 − (d/(radius+1))²)^power along
        /// each axis, d the distance from the centre; 0 is the published plain K. `[choice]` 1 against ½: ×0.995
        /// on thirteen scenes, ×1.00 on five others.
        #[range(0.0..=4.0)]
        pub taper_power: f32,
        /// Radiance, in units of the picture's exposure, under which errors count as absolute, not as
        /// relative ones; a hundredth of its square is added to every risk. `[choice]` against twice as much and eight
        /// times: relMSE ×1.006 and ×1.03 (thirteen scenes at 16 and 64 spp).
        #[range(1e-3..=1e3)]
        pub dark_level: f32,
        /// Added to the albedo before a demodulated kernel divides by it. `[choice]` of 0.05, 0.0125, 0.003 and 0.001:
        /// relMSE ×1, ×0.963, ×0.945 and ×0.941 (five scenes at 16 to 256 spp), ×1, ×0.988, ×0.987 and ×0.987 (thirteen
        /// others).
        #[range(1e-3..=1e3)]
        pub albedo_floor: f32,
        /// Denoise the picture at half its resolution too, and take from it what it knows better.
        pub coarse: bool,
        /// Restore what the residual shows to be more than noise.
        pub restore: bool,
    }
}

/// Makes a set of options that has a name.
pub type Preset = fn() -> Options;

described! {
    /// One family of weights.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Kernel {
        /// Radius of the patches that are compared; 1 is 3×3.
        #[range(0..=MAX_PATCH_RADIUS)]
        pub patch_radius: usize,
        /// Bandwidth k: distances are divided by k².
        #[range(0.01..=1e6)]
        pub bandwidth: f32,
        /// Compare and fit colour over albedo instead of colour, where there is an albedo.
        #[serde(default)]
        pub demodulate: bool,
        /// Compare the features too, with this bandwidth; what is farther apart, colour or features, counts. `null`
        /// leaves them out.
        #[range(0.01..=1e6)]
        #[serde(default)]
        pub feature_bandwidth: Option<f32>,
    }
}

impl Kernel {
    /// Weights by the noisy colour alone.
    pub const fn by_color(patch_radius: usize, bandwidth: f32) -> Self {
        Self { patch_radius, bandwidth, demodulate: false, feature_bandwidth: None }
    }

    /// The same with a bandwidth of colour that is `factor` times as wide.
    pub(crate) fn widened(self, factor: f32) -> Self {
        Self { bandwidth: factor * self.bandwidth, ..self }
    }

    /// By colour; by colour over albedo, where there is one, and features.
    const FAMILIES: [Self; 2] = {
        let color = Self::by_color(1, 1.0);
        [color, Self { demodulate: true, feature_bandwidth: Some(FEATURE_BANDWIDTH), ..color }]
    };
}

/// How the order of a fit is chosen from the risks ξ_k.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum OrderChoice {
    /// The order with the least risk (Moon et al. 2016).
    Hard,
    /// All orders, weighted by exp(−8 (ξ_k / ξ_min − 1)).
    Soft,
    /// Every orthonormal component is shrunk by its own signal-to-noise ratio; in the first stage, which has no pilot
    /// to tell it, as `Soft`.
    Shrink,
    /// The order with the least residual, no risk asked: the highest that the window's columns allow.
    Residual,
}

described! {
    /// Options of the outlier step.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct OutlierOptions {
        /// Take outliers out at all.
        pub enabled: bool,
        /// Radius of the neighbourhood that is the witness.
        #[range(1..=3)]
        pub radius: usize,
        /// Standard deviations of the neighbours by which an outlier sticks out; 3 in the paper. `[choice]` of 3, 8, 12
        /// and 20: relMSE at 16 spp ×1.8, ×1.002, ×0.997 and ×1 (five scenes), where 8 and 12 are ×1.022 and ×1.006 on
        /// thirteen others.
        #[range(0.0..=1e6)]
        pub deviations: f32,
        /// The share of the light of a fit's window that an outlier's excess must be more than. `[choice]` of 0.02,
        /// 0.05, 0.1 and 0.2: relMSE ×1.002, ×0.998, ×0.992, ×0.990 (five scenes) and ×0.987, ×0.976, ×0.962, ×0.958
        /// (thirteen others) of that at 0; caustics at 16 spp keep 97.1, 96.8, 96.1 and 94.9 % of their light.
        #[range(0.0..=1.0)]
        pub share: f32,
        /// Outliers of equal energy that the window Ω_o, to which an outlier's energy is given back, must be worth.
        /// `[choice]` in `denoise/gains.rs`.
        #[range(1.0..=1e6)]
        pub witnesses: f32,
    }
}

described! {
    /// Options of the feature prefilter (NLM, Rousselle, Knaus, Zwicker 2012).
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct PrefilterOptions {
        /// Filter features that come with a variance.
        pub enabled: bool,
        /// Radius of the search window.
        #[range(1..=15)]
        pub window_radius: usize,
        /// Radius of the patches.
        #[range(0..=3)]
        pub patch_radius: usize,
        /// Bandwidth k. `[choice]` 0.85 against 0.7: relMSE ×0.99 on thirteen scenes, ×1.00 on five others; 1 ×0.985
        /// and ×1.003.
        #[range(0.01..=1e6)]
        pub bandwidth: f32,
    }
}

impl Default for OutlierOptions {
    fn default() -> Self {
        Self { enabled: true, radius: 1, deviations: 20.0, share: 0.1, witnesses: 48.0 }
    }
}

impl Default for PrefilterOptions {
    fn default() -> Self {
        Self { enabled: true, window_radius: 5, patch_radius: 1, bandwidth: 0.85 }
    }
}

impl Default for Options {
    fn default() -> Self {
        let [color, albedo] = Kernel::FAMILIES;
        Self {
            window_radius: 7,
            center_spacing: 4,
            min_coverage: 8.0,
            pilot_coverage: 0.25,
            max_order: 3,
            order_choice: OrderChoice::Shrink,
            plain_first_stage: false,
            stages: vec![vec![albedo.widened(WIDER_PILOT)], vec![color, albedo]],
            bandwidths: vec![1.0],
            tolerance: 0.12,
            features: vec![FeatureKind::Normal, FeatureKind::Albedo, FeatureKind::Depth, FeatureKind::Other],
            outliers: OutlierOptions::default(),
            prefilter: PrefilterOptions::default(),
            noise_weight: 16.0,
            variance_radius: 1,
            risk_power: 0.5,
            taper_power: 1.0,
            dark_level: 0.4,
            albedo_floor: 0.003,
            coarse: true,
            restore: true,
        }
    }
}

impl Options {
    /// The method as published, where the paper decides: y for μ in the first stage, one bandwidth, the
    /// order with the least risk, plain overlap average, outliers by the neighbours' 3σ.
    pub fn published() -> Self {
        let kernels = vec![Kernel::by_color(3, 1.0)];
        Self {
            min_coverage: 1.0,
            pilot_coverage: 1.0,
            plain_first_stage: true,
            order_choice: OrderChoice::Hard,
            stages: vec![kernels.clone(), kernels],
            tolerance: 0.0,
            noise_weight: 0.0,
            risk_power: 0.0,
            taper_power: 0.0,
            coarse: false,
            restore: false,
            outliers: OutlierOptions {
                deviations: 3.0,
                share: 0.0,
                witnesses: 1.0,
                ..OutlierOptions::default()
            },
            ..Self::default()
        }
    }

    /// The presets by name, fastest first.
    pub const PRESETS: [(&'static str, Preset); 4] = [
        ("fast", Self::fast),
        ("balanced", Self::default),
        ("best", Self::best),
        ("published", Self::published),
    ];

    /// One kernel a stage on fewer centres, no cubic, no coarse picture: relMSE ×1.13 on five scenes, ×1.22 on thirteen
    /// others (16 to 256 spp) in 0.35 to 0.5 of the time, of which half is reading and writing.
    pub fn fast() -> Self {
        let [color, albedo] = Kernel::FAMILIES;
        Self {
            center_spacing: 10,
            min_coverage: 0.5,
            max_order: 2,
            coarse: false,
            stages: vec![vec![color], vec![albedo]],
            prefilter: PrefilterOptions { window_radius: 1, ..PrefilterOptions::default() },
            ..Self::default()
        }
    }

    /// The mean of a narrow and a wide last stage: relMSE ×0.989 on five scenes, ×0.999 on thirteen others, ×0.994 on
    /// seventeen (16 to 256 spp) in 1.5 times the time.
    pub fn best() -> Self {
        Self { bandwidths: vec![0.7, 1.5], ..Self::default() }
    }

    /// The radius of the largest patches that a kernel compares.
    pub fn largest_patch(&self) -> usize {
        self.stages.iter().flatten().map(|kernel| kernel.patch_radius).max().unwrap_or(0)
    }

    /// Every option with its value, by the names that [`Options::with`] takes.
    pub fn keys(&self) -> Vec<Key> {
        let (outliers, prefilter) = (self.outliers.fields("outliers."), self.prefilter.keys());
        let mut keys = self.fields("");
        keys.retain(|key| !["outliers", "prefilter"].contains(&key.name.as_str())); // groups of what follows
        keys.extend(outliers.into_iter().chain(prefilter));
        keys.extend(self.kernels().flat_map(|(name, kernel)| kernel.fields(&format!("{name}."))));
        keys
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](crate::ErrorKind::Usage) names the option, what it is and what it may be.
    pub fn check(&self) -> Result<()> {
        self.check_fields("")?;
        self.outliers.check_fields("outliers.")?;
        self.prefilter.check()?;
        check("number of stages", &self.stages.len(), &(1..=8))?;
        check("number of bandwidths", &self.bandwidths.len(), &(1..=8))?;
        let mut stages = self.stages.iter().enumerate();
        stages.try_for_each(|(i, kernels)| {
            check(&format!("number of kernels in stages.{i}"), &kernels.len(), &(1..=16))
        })?;
        let mut kernels = self.kernels();
        kernels.try_for_each(|(name, kernel)| kernel.check_fields(&format!("{name}.")))
    }

    /// All kernels with their names.
    fn kernels(&self) -> impl Iterator<Item = (String, &Kernel)> {
        self.stages.iter().enumerate().flat_map(|(stage, kernels)| {
            kernels.iter().enumerate().map(move |(n, kernel)| (format!("stages.{stage}.{n}"), kernel))
        })
    }
}

impl PrefilterOptions {
    /// As [`Options::keys`], for those that have them as a group of their own.
    pub(crate) fn keys(&self) -> Vec<Key> {
        self.fields("prefilter.")
    }

    /// As [`Options::check`].
    pub(crate) fn check(&self) -> Result<()> {
        self.check_fields("prefilter.")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;

    #[test]
    fn what_is_built_in_passes_its_own_check() {
        for (name, preset) in Options::PRESETS {
            assert_eq!(preset().check(), Ok(()), "{name}");
        }
    }

    #[test]
    fn windows_of_a_preset_overlap_by_a_third() {
        // Where they only touch, every window is a block that one sees, and hardly any error shows it.
        for (name, preset) in Options::PRESETS {
            let options = preset();
            assert!(3 * options.center_spacing <= 2 * (2 * options.window_radius + 1), "{name}");
        }
    }

    #[test]
    fn a_value_out_of_range_is_named() {
        let error = Options { window_radius: 99, ..Options::default() }.check().unwrap_err();
        assert_eq!(error.to_string(), "option 'window_radius' is 99; give 1 to 15");
        let error = Options { dark_level: f32::NAN, ..Options::default() }.check().unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
        let mut options = Options::default();
        options.stages[1][0].bandwidth = 0.0;
        let error = options.check().unwrap_err();
        assert_eq!(error.to_string(), "option 'stages.1.0.bandwidth' is 0; give 0.01 to 1000000");
        options.stages[1].clear();
        let error = options.check().unwrap_err();
        assert_eq!(error.to_string(), "option 'number of kernels in stages.1' is 0; give 1 to 16");
    }

    #[test]
    fn keys_are_those_that_options_are_replaced_by_and_their_meanings_name_every_word() {
        for key in Options::default().keys() {
            let value: serde_json::Value = serde_json::from_str(&key.value).unwrap();
            assert_eq!(Options::default().with(&key.name, value), Ok(Options::default()), "{}", key.name);
            assert!(!key.meaning.is_empty() && !key.meaning.contains(['|', '\n', '[']), "{}", key.meaning);
            let wrong = Options::default().with(&key.name, vec!["?"].into()).unwrap_err().to_string();
            let words = wrong.split_once("expected one of ").map_or("", |(_, rest)| rest);
            let words = words.split('`').skip(1).step_by(2);
            words
                .for_each(|word| assert!(key.meaning.contains(&format!("`{word}`")), "{}: {word}", key.name));
        }
    }

    #[test]
    fn options_survive_json_and_unknown_ones_are_refused() {
        let text = serde_json::to_string(&Options::default()).unwrap();
        assert_eq!(serde_json::from_str::<Options>(&text).unwrap(), Options::default());
        assert!(serde_json::from_str::<Options>("{\"window\": 3}").is_err());
    }
}
