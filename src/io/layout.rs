//! What was found in a file, for people and for programs.

use serde::Serialize;

use super::channels::{Renderer, Role, Statistic, VarianceKind};
use super::document::Document;
use super::mapping::{FEATURES, FLOWS};
use super::roles::Choice;
use super::statistics::Statistics;
use super::sums::SumCheck;
use crate::frame::{FeatureKind, Frame};

/// What was found, and what it means for the denoiser.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Layout {
    /// The file, and those read beside it.
    pub files: Vec<FileLayout>,
    /// The second half of the samples.
    pub half: Option<String>,
    /// Who wrote it.
    pub renderer: Renderer,
    /// Whether the user said so.
    pub forced: bool,
    /// Samples per pixel, the mean where they differ.
    pub samples_per_pixel: Option<f32>,
    /// The channels that play a role; all others pass through.
    pub roles: Vec<RoleLayout>,
    /// Roles that nothing plays, which is done without; see [`Self::wanting`].
    pub missing: Vec<String>,
    /// Components of the beauty that ought to sum to it, and whether they do before anything is denoised.
    pub sums: Vec<SumCheck>,
    /// Things that were done to the input on the way.
    pub notes: Vec<String>,
    /// Things that make the result worse than it could be, each with a remedy.
    pub warnings: Vec<String>,
}

/// A file's parts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct FileLayout {
    /// Where it is.
    pub path: String,
    /// Its parts, in order.
    pub parts: Vec<PartLayout>,
}

/// A part's encoding and channels.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct PartLayout {
    /// Its name, where it has one.
    pub name: Option<String>,
    /// x and y of the data window's first pixel, its width and height.
    pub data_window: [i64; 4],
    /// The same of the display window.
    pub display_window: [i64; 4],
    /// How it is compressed.
    pub compression: String,
    /// Whether it is stored in tiles.
    pub tiled: bool,
    /// Its channels, as `name: type`.
    pub channels: Vec<String>,
}

/// Channels that play a role.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RoleLayout {
    /// The role, under the names that `--map` takes.
    pub role: String,
    /// What the numbers are: the mean, a half, or which kind of variance.
    pub statistic: String,
    /// The channels, in the components' order.
    pub channels: Vec<String>,
    /// Least finite value as stored.
    pub min: Option<f32>,
    /// Largest finite value as stored.
    pub max: Option<f32>,
    /// Samples that are NaN or infinite.
    pub non_finite: usize,
    /// Of those, NaN.
    pub nan: usize,
}

impl Default for Layout {
    fn default() -> Self {
        Self {
            files: Vec::new(),
            half: None,
            renderer: Renderer::Plain,
            forced: false,
            samples_per_pixel: None,
            roles: Vec::new(),
            missing: Vec::new(),
            sums: Vec::new(),
            notes: Vec::new(),
            warnings: Vec::new(),
        }
    }
}

impl Layout {
    /// The same with only that named as missing which would be used: features of the kinds that are `fitted`, and halves
    /// beside a variance where the method `crosses` them.
    #[must_use]
    pub fn wanting(&self, fitted: impl Fn(FeatureKind) -> bool, crosses: bool) -> Self {
        let has_variance = !self.missing.iter().any(|name| name == "variance");
        let kind = |name: &str| FEATURES.iter().find(|(known, _)| *known == name).map(|(_, kind)| *kind);
        let helps = |name: &String| match kind(name) {
            Some(kind) => fitted(kind),
            None => crosses || name != "halves" || !has_variance,
        };
        let missing = self.missing.iter().filter(|name| helps(name)).cloned().collect();
        Self { missing, ..self.clone() }
    }

    /// Adds what `frame`, which came of it all, has and lacks.
    pub(super) fn complete(&mut self, frame: &Frame) {
        self.samples_per_pixel = frame.spp();
        if frame.color_var_of_mean().is_none() {
            self.missing.push("variance".to_owned());
        }
        if frame.color_var_of_mean().is_none() && frame.halves().is_none() {
            self.warnings.push(
                "no variance of the colour is there: it will be estimated from the picture itself; render \
                 with variance, or twice with different seeds (--half), for a better result"
                    .to_owned(),
            );
        }
        if frame.halves().is_none() {
            self.missing.push("halves".to_owned());
        }
        for (name, kind) in FEATURES {
            if !frame.features().iter().any(|feature| feature.kind == kind) {
                self.missing.push(name.to_owned());
            }
        }
    }
}

impl FileLayout {
    pub(super) fn of(document: &Document) -> Self {
        let part = |(index, header): (usize, &exr::meta::header::Header)| {
            let window = |bounds: exr::meta::attribute::IntegerBounds| {
                let (position, size) = (bounds.position, bounds.size);
                [position.x().into(), position.y().into(), size.width() as i64, size.height() as i64]
            };
            PartLayout {
                name: document.part_name(index),
                data_window: window(header.data_window()),
                display_window: window(header.shared_attributes.display_window),
                compression: header.compression.to_string(),
                tiled: header.blocks.has_tiles(),
                channels: header
                    .channels
                    .list
                    .iter()
                    .map(|channel| format!("{}: {:?}", channel.name, channel.sample_type))
                    .collect(),
            }
        };
        Self {
            path: document.path().display().to_string(),
            parts: document.headers().iter().enumerate().map(part).collect(),
        }
    }
}

impl RoleLayout {
    /// Whether it is a feature's.
    pub fn is_feature(&self) -> bool {
        let other = ["color", "aov", "sampleCount"].contains(&self.role.as_str());
        !other && FLOWS.iter().all(|(name, _)| *name != self.role)
    }

    pub(super) fn new<'s>(
        choice: &Choice,
        channels: Vec<String>,
        statistics: impl Iterator<Item = &'s Statistics>,
    ) -> Self {
        let (mut range, mut non_finite, mut nan) = (None::<(f32, f32)>, 0, 0);
        for of in statistics {
            non_finite += of.non_finite;
            nan += of.nan;
            range = match (range, of.range()) {
                (Some((a, b)), Some((low, high))) => Some((a.min(low), b.max(high))),
                (known, new) => known.or(new),
            };
        }
        let target = &choice.target;
        Self {
            role: match target.role {
                Role::SampleCount => "sampleCount".to_owned(),
                Role::Feature(_) => target.feature.clone(),
                Role::Aov => "aov".to_owned(),
                Role::Motion(flow) => super::mapping::flow_name(flow).to_owned(),
                _ => "color".to_owned(),
            },
            statistic: match target.statistic {
                Statistic::Mean => "mean",
                Statistic::Variance(VarianceKind::Mean) => "variance of the mean",
                Statistic::Variance(VarianceKind::Sample) => "variance of one sample",
                Statistic::Variance(VarianceKind::M2) => "second moment",
                Statistic::Variance(VarianceKind::Stddev) => "standard deviation of the mean",
                Statistic::Variance(VarianceKind::Halves) => "variance from halves",
                Statistic::HalfA => "half A",
                Statistic::HalfB => "half B",
            }
            .to_owned(),
            channels,
            min: range.map(|(min, _)| min),
            max: range.map(|(_, max)| max),
            non_finite,
            nan,
        }
    }
}
