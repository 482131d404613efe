//! What the user says about channels: `ROLE=CHANNELS`.

use std::str::FromStr;

use super::channels::{Flow, Role, Statistic, VarianceKind, match_layer};
use super::layers::{Channel, Layer};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::FeatureKind;

/// A name and the channels that are to have it: `ROLE=CHANNEL[,CHANNEL…]`, `ROLE=LAYER` for all
/// channels of a layer, or `ROLE=none` to do without.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mapping {
    /// The role, or the name of a new feature.
    pub name: String,
    /// Channels or layers in the components' order; empty to do without.
    pub channels: Vec<String>,
}

impl FromStr for Mapping {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || {
            Error::new(ErrorKind::Usage, format!("'{text}' is no mapping"))
                .remedy("write ROLE=CHANNELS, as in albedo=diffuse.R,diffuse.G,diffuse.B or albedo=diffuse")
        };
        let (name, channels) = text.split_once('=').ok_or_else(wrong)?;
        let channels: Vec<String> = channels.split(',').map(|channel| channel.trim().to_owned()).collect();
        if name.trim().is_empty() || channels.iter().any(String::is_empty) {
            return Err(wrong());
        }
        let channels = if channels == ["none"] { Vec::new() } else { channels };
        Ok(Self { name: name.trim().to_owned(), channels })
    }
}

/// What a mapping's name means.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Target {
    pub(super) role: Role,
    /// The feature's name, number included; empty for the other roles.
    pub(super) feature: String,
    pub(super) statistic: Statistic,
}

/// The features that have a role, and their names.
pub(super) const FEATURES: [(&str, FeatureKind); 5] = [
    ("albedo", FeatureKind::Albedo),
    ("normal", FeatureKind::Normal),
    ("position", FeatureKind::Position),
    ("depth", FeatureKind::Depth),
    ("visibility", FeatureKind::Visibility),
];

/// The motion vectors that have a role, and their names.
pub(super) const FLOWS: [(&str, Flow); 3] =
    [("motionPrevious", Flow::Previous), ("motionNext", Flow::Next), ("motionCycles", Flow::Cycles)];

/// The name of a kind of motion vectors.
pub(super) fn flow_name(flow: Flow) -> &'static str {
    FLOWS.iter().find(|(_, known)| *known == flow).map_or("motion", |(name, _)| name)
}

const SUFFIXES: [(&str, Statistic); 4] = [
    ("Variance", Statistic::Variance(VarianceKind::Mean)),
    ("HalfA", Statistic::HalfA),
    ("HalfB", Statistic::HalfB),
    ("", Statistic::Mean),
];

/// Understands a mapping's name; `further` are the names of the user's own features.
///
/// # Errors
/// `Usage` when there is no such role.
pub(super) fn target(name: &str, further: &[String]) -> Result<Target> {
    if name.eq_ignore_ascii_case("sampleCount") {
        return Ok(Target { role: Role::SampleCount, feature: String::new(), statistic: Statistic::Mean });
    }
    for (known, flow) in FLOWS {
        if name.eq_ignore_ascii_case(known) {
            let role = Role::Motion(flow);
            return Ok(Target { role, feature: String::new(), statistic: Statistic::Mean });
        }
    }
    SUFFIXES
        .iter()
        .find_map(|&(suffix, statistic)| {
            let start = name.len().checked_sub(suffix.len())?;
            let base = name.get(start..)?.eq_ignore_ascii_case(suffix).then(|| &name[..start])?;
            let (role, feature) = base_role(base, further)?;
            (role != Role::Color || base.is_empty() != (statistic == Statistic::Mean)).then_some(Target {
                role,
                feature,
                statistic,
            })
        })
        .ok_or_else(|| {
            Error::new(ErrorKind::Usage, format!("there is no role '{name}'")).remedy(
            "use color, variance, halfA, halfB, sampleCount, albedo, normal, position, depth, visibility, \
             motionPrevious, motionNext, motionCycles, or a feature's name followed by Variance, HalfA or HalfB",
        )
        })
}

fn base_role(base: &str, further: &[String]) -> Option<(Role, String)> {
    if base.is_empty() || ["color", "colour"].iter().any(|color| base.eq_ignore_ascii_case(color)) {
        return Some((Role::Color, String::new()));
    }
    if let Some(name) = further.iter().find(|name| name.eq_ignore_ascii_case(base)) {
        return Some((Role::Feature(FeatureKind::Other), name.clone()));
    }
    let base = if base.eq_ignore_ascii_case("texture") { "albedo" } else { base };
    FEATURES.iter().find_map(|&(name, kind)| {
        let matched = match_layer(&format!("{name}#"), base)?;
        Some((Role::Feature(kind), format!("{name}{}", matched.number)))
    })
}

/// Finds the channels that a mapping names: full channel names, `PART.CHANNEL`, or layers.
///
/// # Errors
/// `Lacking` when there is none of that name.
pub(super) fn find(
    mapping: &Mapping,
    layers: &[Layer],
    full_name: impl Fn(Channel) -> Vec<String>,
) -> Result<Vec<Channel>> {
    let all = || layers.iter().flat_map(|layer| &layer.components).map(|(_, channel)| *channel);
    let mut found = Vec::new();
    for wanted in &mapping.channels {
        if let Some(channel) = all().find(|&channel| full_name(channel).contains(wanted)) {
            found.push(channel);
        } else if let Some(layer) = layers.iter().find(|layer| layer.name.eq_ignore_ascii_case(wanted)) {
            let ordered = layer.pick_first(&[&["R", "G", "B"], &["X", "Y", "Z"]]);
            let in_file_order = || layer.components.iter().map(|(_, channel)| *channel).collect();
            found.extend(ordered.unwrap_or_else(in_file_order));
        } else {
            return Err(Error::new(
                ErrorKind::Lacking,
                format!("is not there, but '{}' is mapped to it", mapping.name),
            )
            .in_channel(wanted)
            .remedy("list the names with --inspect"));
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mappings_are_read_and_nonsense_is_refused() {
        let mapping: Mapping = "albedo = a b.R, a b.G,a b.B".parse().unwrap();
        assert_eq!((mapping.name.as_str(), mapping.channels.len()), ("albedo", 3));
        assert_eq!("depth=none".parse::<Mapping>().unwrap().channels, Vec::<String>::new());
        for nonsense in ["albedo", "=R", "albedo=", "albedo=R,,B"] {
            assert_eq!(nonsense.parse::<Mapping>().unwrap_err().kind(), ErrorKind::Usage, "{nonsense}");
        }
    }

    #[test]
    fn names_of_roles_are_those_of_the_own_layers() {
        let further = ["curvature".to_owned()];
        let of = |name| target(name, &further).map(|t| (t.role, t.feature, t.statistic));
        let variance = Statistic::Variance(VarianceKind::Mean);
        assert_eq!(of("colour").unwrap(), (Role::Color, String::new(), Statistic::Mean));
        assert_eq!(of("variance").unwrap(), (Role::Color, String::new(), variance));
        assert_eq!(of("halfB").unwrap(), (Role::Color, String::new(), Statistic::HalfB));
        let albedo = Role::Feature(FeatureKind::Albedo);
        assert_eq!(of("texture").unwrap(), (albedo, "albedo".into(), Statistic::Mean));
        assert_eq!(of("albedo2Variance").unwrap(), (albedo, "albedo2".into(), variance));
        let other = Role::Feature(FeatureKind::Other);
        assert_eq!(of("CurvatureHalfA").unwrap(), (other, "curvature".into(), Statistic::HalfA));
        assert_eq!(of("shininess").unwrap_err().kind(), ErrorKind::Usage);
        assert_eq!(of("").unwrap_err().kind(), ErrorKind::Usage);
    }
}
