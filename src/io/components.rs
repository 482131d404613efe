//! Which layers are components of the beauty: AOVs and light groups that sum to it.
//!
//! One table, [`SETS`], and how it is held against a file. A component goes through the operator that the
//! beauty chose, so only what *adds* to the beauty is taken by itself: Cycles' `DiffDir`, `DiffInd` and the
//! like sum only after a product with `DiffCol`, and V-Ray's raw elements with their filters, so they have
//! no row. What the user names is taken in any case.

use std::collections::BTreeSet;

use super::channels::{Renderer, Role, Statistic, match_layer};
use super::layers::Channel;
use super::mapping::{Target, likest};
use super::roles::{Candidate, Cast, Casting, Choice};
use super::sums::{Deviation, SUM_TOLERANCE};
use crate::error::{Error, ErrorKind, Result};

/// The name that asks for the sets of the table.
const AUTO: &str = "auto";

/// [choice] Layers without a role are held against the beauty by their numbers only where there are so few:
/// all of them must be read.
const MOST_BY_NUMBER: usize = 16;

/// Components that sum to the beauty. Each addend is a list of patterns as in the channel map: the layer
/// itself, then what it is split into, which is summed where the layer itself is not there. A `*` at the
/// end stands for the name of a light group.
struct SetRow {
    renderer: Renderer,
    name: &'static str,
    addends: &'static [&'static [&'static str]],
}

const fn set(renderer: Renderer, name: &'static str, addends: &'static [&'static [&'static str]]) -> SetRow {
    SetRow { renderer, name, addends }
}

/// The sets of every renderer; the plain ones are tried where those of the detected one find nothing.
#[rustfmt::skip]
const SETS: &[SetRow] = &[
    set(Renderer::Cycles, "light groups", &[&["*.Combined_*"]]),
    set(Renderer::Arnold, "light groups", &[&["RGBA_*"]]),
    // Arnold's user guide, "Composing the Beauty AOV".
    set(Renderer::Arnold, "lobes", &[
        &["diffuse", "diffuse_direct", "diffuse_indirect"],
        &["specular", "specular_direct", "specular_indirect"],
        &["coat", "coat_direct", "coat_indirect"],
        &["sheen", "sheen_direct", "sheen_indirect"],
        &["transmission", "transmission_direct", "transmission_indirect"],
        &["sss", "sss_direct", "sss_indirect"],
        &["volume", "volume_direct", "volume_indirect"],
        &["emission"], &["background"],
    ]),
    set(Renderer::Arnold, "direct and indirect", &[&["direct"], &["indirect"], &["emission"], &["background"]]),
    set(Renderer::RenderMan, "light groups", &[&["Ci_*"], &["C_*"]]),
    // `diffuse` and `specular` as its denoiser wants them, with all that is not specular in the first.
    set(Renderer::RenderMan, "diffuse and specular", &[&["diffuse"], &["specular"]]),
    set(Renderer::RenderMan, "lobes", &[
        &["directDiffuse"], &["indirectDiffuse"], &["directSpecular"], &["indirectSpecular"],
        &["subsurface"], &["transmissive"], &["emissive", "emission"],
    ]),
    // Chaos' documentation, "Back to Beauty".
    set(Renderer::VRay, "back to beauty", &[
        &["lighting"], &["GI"], &["reflect"], &["refract"], &["specular"], &["SSS"], &["selfIllum"],
        &["caustics"], &["atmosphere"], &["background"],
    ]),
    set(Renderer::VRay, "back to beauty", &[
        &["VRayLighting"], &["VRayGlobalIllumination"], &["VRayReflection"], &["VRayRefraction"],
        &["VRaySpecular"], &["VRaySSS2", "VRaySSS"], &["VRaySelfIllumination"], &["VRayCaustics"],
        &["VRayAtmosphere"], &["VRayBackground"],
    ]),
    set(Renderer::VRay, "light selects", &[&["LightSelect*", "VRayLightSelect*"]]),
    // Corona's documentation: these seven and no others make the beauty.
    set(Renderer::Corona, "essential elements", &[&["CESSENTIAL_*"]]),
    set(Renderer::Corona, "light selects", &[&["CShading_LightSelect*"]]),

    set(Renderer::Plain, "light groups", &[
        &["lightgroup_*"], &["light_*"], &["*.Combined_*"], &["RGBA_*"], &["C_*"],
    ]),
    set(Renderer::Plain, "lobes", &[
        &["diffuse", "diffuse_direct", "diffuse_indirect"],
        &["specular", "specular_direct", "specular_indirect"],
        &["transmission"], &["sss"], &["volume"], &["emission"], &["background"],
    ]),
    set(Renderer::Plain, "direct and indirect", &[&["direct"], &["indirect"], &["emission"], &["background"]]),
];

/// A layer that may go through the beauty's operator.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Component {
    pub(super) name: String,
    /// One or three.
    pub(super) channels: Vec<Channel>,
}

/// Components that ought to sum to the beauty.
#[derive(Debug, Clone, PartialEq)]
struct Set {
    name: &'static str,
    components: Vec<Component>,
    /// Of those, the ones whose sum is to be checked: none of them is part of another.
    addends: Vec<usize>,
}

/// A set by the places of its addends among the frame's AOVs.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sum {
    pub(super) name: &'static str,
    pub(super) addends: Vec<usize>,
    /// Whether it is there because it ought to sum, not because the user named it.
    pub(super) by_itself: bool,
}

/// What is to be denoised with the beauty, before the numbers are known.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Asked {
    named: Vec<Component>,
    sets: Vec<Set>,
    /// Layers without a role by name, which the numbers may show to sum.
    further: Vec<Component>,
}

impl Asked {
    /// What `names` ask for among the layers that go with `color`; `writable` tells whether a channel has
    /// the colour's pixels, `beauty` holds the result.
    ///
    /// # Errors
    /// `Lacking` when a layer is not there or not `writable`, `Usage` when it is the beauty itself.
    pub(super) fn find(
        names: &[String],
        casting: &Casting,
        renderer: Renderer,
        color: &Candidate,
        beauty: &[Channel],
        writable: impl Fn(&Channel) -> bool,
    ) -> Result<Self> {
        let is_beauty = |component: &Component| {
            component.channels.iter().any(|c| beauty.contains(c) || color.mean.channels.contains(c))
        };
        let mut asked = Self::default();
        for name in names.iter().map(|name| name.trim()).filter(|name| !name.eq_ignore_ascii_case(AUTO)) {
            let found: Vec<Component> =
                casting.pictures(color).filter(|component| names_layer(name, &component.name)).collect();
            if found.is_empty() && casting.has_statistic(|layer| names_layer(name, layer)) {
                return Err(Error::new(
                    ErrorKind::Usage,
                    "is a variance or a half, and no component of the beauty",
                )
                .in_channel(name)
                .remedy("leave it out of --aov"));
            }
            if found.is_empty() {
                let what = "no layer of this name with three channels, or one, is in the first file";
                let names = casting.pictures(color).map(|component| component.name);
                return Err(Error::new(ErrorKind::Lacking, what)
                    .in_channel(name)
                    .remedy(likest(name, names)));
            }
            for component in found {
                if is_beauty(&component) {
                    return Err(Error::new(ErrorKind::Usage, "is the beauty itself")
                        .in_channel(component.name)
                        .remedy("leave it out of --aov"));
                }
                if !component.channels.iter().all(&writable) {
                    return Err(Error::new(ErrorKind::Lacking, "its data window is not the colour's")
                        .in_channel(component.name)
                        .remedy("leave it out of --aov"));
                }
                asked.named.push(component);
            }
        }
        if names.iter().any(|name| name.trim().eq_ignore_ascii_case(AUTO)) {
            let features = casting.features(color); // V-Ray's `diffuse` is its albedo
            let has_role = |component: &Component| component.channels.iter().any(|c| features.contains(c));
            let pictures: Vec<Component> = casting
                .pictures(color)
                .filter(|component| component.channels.len() == 3 && !is_beauty(component))
                .filter(|component| !has_role(component))
                .filter(|component| component.channels.iter().all(&writable))
                .collect();
            asked.sets = sets(&pictures, renderer);
            asked.further = pictures;
        }
        Ok(asked)
    }

    /// In words, that `sums` have none that were found by themselves, where `names` ask for those.
    pub(super) fn note(sums: &[Sum], names: &[String]) -> Option<String> {
        let auto = names.iter().any(|name| name.trim().eq_ignore_ascii_case(AUTO));
        (auto && !sums.iter().any(|sum| sum.by_itself)).then(|| {
            "--aov auto: no components that sum to the beauty were found; name those that are to be denoised with it by \
             --aov NAMES"
                .to_owned()
        })
    }

    /// The channels whose numbers are needed.
    pub(super) fn channels(&self) -> impl Iterator<Item = Channel> {
        let further = if self.by_number() { &self.further[..] } else { &[] };
        let sets = self.sets.iter().flat_map(|set| &set.components);
        self.named.iter().chain(sets).chain(further).flat_map(|component| component.channels.clone())
    }

    /// The names of what [`Self::settle`] would take by its name, where the channels `used` play other roles.
    pub(super) fn automatic(&self, used: &BTreeSet<Channel>) -> Vec<String> {
        let free = |component: &&Component| component.channels.iter().all(|channel| !used.contains(channel));
        let components = self.sets.iter().flat_map(|set| &set.components).filter(free);
        components.map(|component| component.name.clone()).collect()
    }

    fn by_number(&self) -> bool {
        self.sets.is_empty() && (1..=MOST_BY_NUMBER).contains(&self.further.len())
    }

    /// Adds the components to the `cast`, less those that turned out to play another role, and returns
    /// what ought to sum. `deviation` tells how far the sum of pictures is from another one.
    ///
    /// # Errors
    /// What `deviation` fails with.
    pub(super) fn settle(
        self,
        cast: &mut Cast,
        deviation: impl Fn([Channel; 3], &[[Channel; 3]]) -> Result<Deviation>,
    ) -> Result<Vec<Sum>> {
        let color: Vec<Channel> = cast.choices[0].channels.clone();
        let used: BTreeSet<Channel> =
            cast.choices.iter().flat_map(|choice| choice.channels.clone()).collect();
        let free = |component: &Component| component.channels.iter().all(|channel| !used.contains(channel));
        let by_number = self.by_number();
        let mut sets = self.sets;
        if by_number {
            let components: Vec<Component> = self.further.into_iter().filter(free).collect();
            let rgb = |channels: &[Channel]| [0, 1, 2].map(|c| channels[c % channels.len()]);
            let addends: Vec<_> = components.iter().map(|component| rgb(&component.channels)).collect();
            if !components.is_empty() && deviation(rgb(&color), &addends)?.relative_rms < SUM_TOLERANCE {
                let addends = (0..components.len()).collect();
                sets.push(Set { name: "layers that sum to the beauty", components, addends });
            }
        }
        let mut taken: Vec<Component> = Vec::new();
        let mut sums = Vec::new();
        for set in sets {
            let here: Vec<usize> = set.addends.into_iter().filter(|&i| free(&set.components[i])).collect();
            let places: Vec<usize> = here.iter().map(|&i| place(&mut taken, &set.components[i])).collect();
            for component in set.components.iter().filter(|component| free(component)) {
                place(&mut taken, component);
            }
            if !places.is_empty() {
                sums.push(Sum { name: set.name, addends: places, by_itself: true });
            }
        }
        let named: Vec<usize> = self.named.iter().map(|component| place(&mut taken, component)).collect();
        let in_set = named.iter().all(|i| sums.iter().any(|sum: &Sum| sum.addends.contains(i)));
        if !in_set {
            sums.push(Sum { name: "named", addends: named, by_itself: false });
        }
        cast.choices.extend(taken.into_iter().map(|component| Choice {
            target: Target { role: Role::Aov, feature: component.name, statistic: Statistic::Mean },
            channels: component.channels,
        }));
        Ok(sums)
    }
}

/// The component's place among those taken, which it joins where it is new.
fn place(taken: &mut Vec<Component>, component: &Component) -> usize {
    taken.iter().position(|other| other.channels == component.channels).unwrap_or_else(|| {
        taken.push(component.clone());
        taken.len() - 1
    })
}

/// Whether the user means `layer` by `name`: in full, or without the layers around it.
fn names_layer(name: &str, layer: &str) -> bool {
    match_layer(name, layer).is_some() || match_layer(&format!("*.{name}"), layer).is_some()
}

/// The sets among `pictures`. The plain ones would find sums in a part of the renderer's own.
fn sets(pictures: &[Component], renderer: Renderer) -> Vec<Set> {
    let own = sets_of(pictures, renderer);
    if own.is_empty() { sets_of(pictures, Renderer::Plain) } else { own }
}

/// The sets of `renderer` alone. One of named lobes needs two of them: a lone `diffuse` sums to nothing.
fn sets_of(pictures: &[Component], renderer: Renderer) -> Vec<Set> {
    let mut sets: Vec<Set> = Vec::new();
    for row in SETS.iter().filter(|row| row.renderer == renderer) {
        let mut set = Set { name: row.name, components: Vec::new(), addends: Vec::new() };
        for (whole, parts) in row.addends.iter().filter_map(|addend| addend.split_first()) {
            let mut add = |pattern: &str, is_addend: bool| {
                let before = set.components.len();
                for picture in pictures.iter().filter(|p| match_layer(pattern, &p.name).is_some()) {
                    let place = place(&mut set.components, picture);
                    if is_addend && !set.addends.contains(&place) {
                        set.addends.push(place);
                    }
                }
                set.components.len() > before
            };
            let has_whole = add(whole, true);
            for part in parts {
                add(part, !has_whole);
            }
        }
        let open = row.addends.iter().any(|addend| addend[0].ends_with('*'));
        let known = set.components.iter().all(|c| sets.iter().any(|other| other.components.contains(c)));
        if set.addends.len() >= if open { 1 } else { 2 } && !known {
            sets.push(set);
        }
    }
    sets
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::decode::ChannelAt;

    fn components(names: &[&str]) -> Vec<Component> {
        let channels = |i: usize| {
            (3 * i..3 * i + 3)
                .map(|channel| Channel { file: 0, at: ChannelAt { part: 0, channel } })
                .collect()
        };
        names
            .iter()
            .enumerate()
            .map(|(i, name)| Component { name: (*name).into(), channels: channels(i) })
            .collect()
    }

    /// Every set as its name and its addends.
    fn found(renderer: Renderer, names: &[&str]) -> Vec<String> {
        let sets = sets(&components(names), renderer);
        let addends =
            |set: &Set| set.addends.iter().map(|&i| set.components[i].name.clone()).collect::<Vec<_>>();
        sets.iter().map(|set| format!("{}: {}", set.name, addends(set).join(" + "))).collect()
    }

    #[test]
    fn light_groups_are_found_and_products_are_not() {
        let names =
            ["View.Combined_key", "View.Combined_rim", "View.DiffDir", "View.DiffInd", "View.DiffCol"];
        assert_eq!(found(Renderer::Cycles, &names), ["light groups: View.Combined_key + View.Combined_rim"]);
        assert!(found(Renderer::Cycles, &names[2..]).is_empty());
        assert_eq!(found(Renderer::Arnold, &["RGBA_key", "N"]), ["light groups: RGBA_key"]);
    }

    #[test]
    fn a_lobe_that_is_there_whole_is_not_summed_with_its_parts() {
        let names = ["diffuse", "diffuse_direct", "diffuse_indirect", "specular_direct", "specular_indirect"];
        assert_eq!(found(Renderer::Arnold, &names), ["lobes: diffuse + specular_direct + specular_indirect"]);
        assert_eq!(sets(&components(&names), Renderer::Arnold)[0].components.len(), 5, "all are denoised");
        assert!(found(Renderer::Arnold, &["diffuse"]).is_empty(), "one lobe sums to nothing");
    }

    #[test]
    fn the_plain_sets_are_no_part_of_a_renderers_own() {
        let names = ["lighting", "GI", "specular", "SSS", "selfIllum"];
        let own = "back to beauty: lighting + GI + specular + SSS + selfIllum";
        assert_eq!(found(Renderer::VRay, &names), [own]);
        assert_eq!(found(Renderer::VRay, &["lightgroup_a", "N"]), ["light groups: lightgroup_a"]);
    }

    #[test]
    fn names_are_taken_in_full_without_what_is_around_and_open() {
        assert!(names_layer("view.combined_key", "View.Combined_key"));
        assert!(names_layer("Combined_key", "View.Combined_key"));
        assert!(names_layer("Combined_*", "View.Combined_key"));
        assert!(!names_layer("key", "View.Combined_key"));
    }
}
