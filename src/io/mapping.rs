//! What the user says about channels, `ROLE=CHANNELS`, and which of the files' channels that means.

use std::collections::{BTreeMap, BTreeSet};
use std::str::FromStr;

use super::channels::{Flow, Role, Statistic, VarianceKind, match_layer};
use super::document::Document;
use super::layers::{Channel, Layer};
use super::names::full_names;
use super::picture::ReadOptions;
use super::roles::Choice;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::FeatureKind;
use crate::likeness::by_likeness;

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

impl Target {
    /// Whether something can have only one of the two: variances of any kind are one slot.
    pub(super) fn excludes(&self, other: &Self) -> bool {
        (self.role, &self.feature) == (other.role, &other.feature)
            && same_slot(self.statistic, other.statistic)
    }
}

/// Whether two statistics exclude each other: variances of any kind do.
pub(super) fn same_slot(a: Statistic, b: Statistic) -> bool {
    matches!((a, b), (Statistic::Variance(_), Statistic::Variance(_))) || a == b
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

/// Finds the channels that a mapping names: full channel names, `PART.CHANNEL`, layers, parts, or views; or the end of
/// one name of a layer, or of a channel with its layer, after a dot.
///
/// # Errors
/// `Lacking` when there is none of that name, with those that are like it, or several end so.
pub(super) fn find(
    mapping: &Mapping,
    layers: &[Layer],
    full_name: impl Fn(Channel) -> Vec<String>,
    part_name: impl Fn(Channel) -> Option<String>,
) -> Result<Vec<Channel>> {
    let all = || layers.iter().flat_map(|layer| &layer.components).map(|(_, channel)| *channel);
    let channels = |name: &str| {
        let channel = all().find(|&channel| full_name(channel).iter().any(|full| full == name));
        let layer = || layer_named(name, layers, &part_name);
        let ordered = |layer: &Layer| {
            let picked = layer.pick_first(&[&["R", "G", "B"], &["X", "Y", "Z"]]);
            picked.unwrap_or_else(|| layer.in_order())
        };
        channel.map(|channel| vec![channel]).or_else(|| layer().map(ordered))
    };
    let mut found = Vec::new();
    for wanted in &mapping.channels {
        let part = |layer: &Layer| part_name(layer.components[0].1);
        let of_layer = |layer: &Layer| [Some(layer.name.clone()), layer.view.clone(), part(layer)];
        let names = || layers.iter().flat_map(of_layer).flatten().chain(all().flat_map(&full_name));
        if let Some(channels) = channels(wanted) {
            found.extend(channels);
            continue;
        }
        // A channel has several names.
        let ends: BTreeMap<Vec<Channel>, String> = names()
            .filter(|name| ends_in(name, wanted))
            .filter_map(|name| Some((channels(&name)?, name)))
            .collect();
        let refuse = |what: &str, remedy: String| {
            let what = format!("{what}, but '{}' is mapped to it", mapping.name);
            Err(Error::new(ErrorKind::Lacking, what).in_channel(wanted).remedy(remedy))
        };
        match ends.len() {
            0 => return refuse("is not there", likest(wanted, names())),
            1 => found.extend(ends.into_keys().flatten()),
            _ => return refuse("is the end of several names", likest(wanted, ends.into_values())),
        }
    }
    Ok(found)
}

/// Whether `name` is `end` after a dot. A component alone, which every layer may have, is no end.
fn ends_in(name: &str, end: &str) -> bool {
    let start = name.len().checked_sub(end.len()).filter(|start| *start > 0);
    let is_end = |start: usize| name.get(start..).is_some_and(|rest| rest.eq_ignore_ascii_case(end));
    end.len() > 1 && start.is_some_and(|start| is_end(start) && name[..start].ends_with('.'))
}

/// The layer of this name; or that of the part, or the picture of the view, which is called so.
fn layer_named<'l>(
    wanted: &str,
    layers: &'l [Layer],
    part_name: &impl Fn(Channel) -> Option<String>,
) -> Option<&'l Layer> {
    let is = |name: &str| name.eq_ignore_ascii_case(wanted);
    let in_part = || {
        let is_in_it = |layer: &&Layer| part_name(layer.components[0].1).is_some_and(|name| is(&name));
        let is_picture = |layer: &&Layer| layer.pick(&["R", "G", "B"]).is_some();
        let here = || layers.iter().filter(is_in_it);
        here().find(is_picture).or_else(|| here().next())
    };
    let of_view = |layer: &&Layer| layer.name.is_empty() && layer.view.as_deref().is_some_and(is);
    let named = layers.iter().find(|layer| is(&layer.name));
    let of_file = || layers.iter().find(|layer| layer.other_names.iter().any(|name| is(name)));
    named.or_else(in_part).or_else(of_file).or_else(|| layers.iter().find(of_view))
}

/// What to do about a name that is not there: the names that are, where they are few, else the likest ones.
pub(super) fn likest(wanted: &str, names: impl Iterator<Item = String>) -> String {
    /// So many fit into a message.
    const FEW: usize = 12;
    const LIKEST: usize = 3;
    let names: BTreeSet<String> = names.filter(|name| !name.is_empty()).collect();
    let (told, count) = if names.len() <= FEW { ("there are", FEW) } else { ("the likest are", LIKEST) };
    let mut sorted = by_likeness(wanted, names.into_iter().collect());
    sorted.truncate(count);
    format!("{told} '{}'; apr-denoise --inspect without --map lists all", sorted.join("', '"))
}

/// What the user maps by `options`, role by role.
pub(super) fn mapped_choices(
    options: &ReadOptions,
    documents: &[Document],
    layers: &[Layer],
) -> Result<Vec<Choice>> {
    let further: Vec<String> = options.features.iter().map(|feature| feature.name.clone()).collect();
    let mappings = options.map.iter().chain(&options.features);
    let mut choices: Vec<Choice> = Vec::new();
    for mapping in mappings {
        let target = target(&mapping.name, &further)?;
        if choices.iter().any(|choice| choice.target.excludes(&target)) {
            return Err(Error::new(ErrorKind::Usage, format!("'{}' is mapped twice", mapping.name))
                .remedy("give every role once"));
        }
        choices.push(mapped_choice(mapping, target, documents, layers)?);
    }
    Ok(choices)
}

/// What `mapping` gives the role that it means by its name.
pub(super) fn mapped_choice(
    mapping: &Mapping,
    target: Target,
    documents: &[Document],
    layers: &[Layer],
) -> Result<Choice> {
    let names = |channel| full_names(documents, channel);
    let part = |channel: Channel| documents[channel.file].part_name(channel.at.part);
    let channels = find(mapping, layers, names, part)?;
    check_color(mapping, &target, channels.len())?;
    let is_color = target.role == Role::Color && target.statistic == Statistic::Mean;
    let elsewhere = |channel: &Channel| channel.file != 0 || channel.at.part != channels[0].at.part;
    if is_color && channels.iter().any(elsewhere) {
        return Err(Error::new(ErrorKind::Usage, "the colour must lie in one part of the first file")
            .remedy("name the file that is to be written again first"));
    }
    Ok(Choice { target, channels })
}

/// Refuses colours of two channels, and of more than three.
fn check_color(mapping: &Mapping, target: &Target, count: usize) -> Result<()> {
    let is_color = matches!(target.role, Role::Color | Role::Feature(FeatureKind::Albedo));
    if !is_color || matches!(count, 0 | 1 | 3) {
        return Ok(());
    }
    let what = format!("'{}' is mapped to {count} channels where 3 (or 1) were expected", mapping.name);
    Err(Error::new(ErrorKind::Lacking, what).remedy(format!("name them by --map {}=R,G,B", mapping.name)))
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
    fn ends_of_names_follow_a_dot() {
        assert!(ends_in("View.Noisy Image", "noisy image") && ends_in("View.Noisy Image.R", "Noisy Image.R"));
        for (name, end) in
            [("View.Depth.Z", "Z"), ("View.albedo", "bedo"), ("albedo", "albedo"), ("é.a", "\u{a9}.a")]
        {
            assert!(!ends_in(name, end), "{name}, {end}");
        }
    }

    #[test]
    fn the_likest_names_are_told() {
        let of = |names: &[&str]| likest("albdo.R", names.iter().map(|name| (*name).to_owned()));
        assert!(of(&["N.X", "Albedo.R"]).starts_with("there are 'Albedo.R', 'N.X'; apr-denoise --inspect"));
        let many: Vec<String> = (0..20).map(|i| format!("layer{i}.Y")).collect();
        let many: Vec<&str> = many.iter().map(String::as_str).chain(["albedo.R", "albedo.G"]).collect();
        assert!(of(&many).starts_with("the likest are 'albedo.R', 'albedo.G', "), "{}", of(&many));
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
