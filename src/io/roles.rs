//! Which layer plays which role: the channel map held against the layers of a file.
//!
//! Done in two steps, because Mitsuba's layers can only be told by their numbers: [`Casting`]
//! lists by name what may be of use, and [`settle`] decides once the planes are read.

use std::collections::{BTreeMap, BTreeSet};

use super::channels::{
    COMPANIONS, CompanionRow, Evidence, LAYERS, LayerRow, Matched, Of, Renderer, Role, Statistic,
    companion_names, match_layer,
};
use super::components::Component;
use super::evidence::Tally;
use super::layers::{Channel, Layer};
use super::mapping::{FEATURES, Target, same_slot};
use crate::frame::FeatureKind;

/// Channels with a role.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Choice {
    pub(super) target: Target,
    pub(super) channels: Vec<Channel>,
}

/// A layer that may play a role, with the statistics that are named after it.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    pub(super) mean: Choice,
    pub(super) companions: Vec<Choice>,
    pub(super) evidence: Evidence,
    /// The layer its channels are in.
    layer: usize,
    /// The layers around it, where the row leaves them open.
    around: String,
}

impl Candidate {
    /// The layers around it, with their dot; empty where they are not left open.
    pub(super) fn around(&self) -> &str {
        &self.around
    }
}

/// The layers, and the tables that are held against them.
pub(super) struct Casting<'a> {
    layers: &'a [Layer],
    renderer: Renderer,
    /// What the user maps; without channels where a role is to be done without.
    mapped: &'a [Choice],
    /// Layers by their name in small letters: hostile files have thousands.
    by_name: BTreeMap<String, Vec<usize>>,
    /// For each layer what is around it, where the renderer leaves that open for the colour.
    around: Vec<String>,
}

impl<'a> Casting<'a> {
    pub(super) fn new(layers: &'a [Layer], renderer: Renderer, mapped: &'a [Choice]) -> Self {
        let mut by_name: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (i, layer) in layers.iter().enumerate() {
            by_name.entry(layer.name.to_ascii_lowercase()).or_default().push(i);
        }
        let around = surroundings(layers, renderer);
        Self { layers, renderer, mapped, by_name, around }
    }

    /// The colour: what the user maps, or the first row that matches in the first file.
    pub(super) fn color(&self) -> Option<Candidate> {
        if let Some(mapped) = self.mapped(Role::Color, "", Statistic::Mean) {
            return self.candidate_of(mapped.clone());
        }
        self.rows(Role::Color).find_map(|row| {
            self.layers.iter().enumerate().find_map(|(i, layer)| {
                let matched = match_layer(row.layer, &layer.name)?;
                let channels = layer.pick_first(row.components)?;
                (channels[0].file == 0).then(|| self.candidate(i, row, &matched, channels))
            })
        })
    }

    /// The channels that are to hold the result: the colour itself, unless the renderer keeps the
    /// noisy picture beside the one that is shown.
    pub(super) fn beauty(&self, color: &Candidate) -> Vec<Channel> {
        let shown =
            self.rows(Role::Beauty).filter(|_| self.mapped(Role::Color, "", Statistic::Mean).is_none());
        let layers = || self.layers.iter().enumerate().filter(|&(i, _)| self.goes_with(i, color));
        let found = shown.into_iter().find_map(|row| {
            layers().find_map(|(_, layer)| {
                match_layer(row.layer, &layer.name).and_then(|_| layer.pick_first(row.components))
            })
        });
        found.filter(|channels| channels[0].file == 0).unwrap_or_else(|| color.mean.channels.clone())
    }

    /// All further layers that may be of use beside `color`, the likeliest first.
    pub(super) fn candidates(&self, color: &Candidate) -> Vec<Candidate> {
        let statistics = self.statistics();
        let mut found: Vec<Candidate> = self
            .mapped
            .iter()
            .filter(|mapped| mapped.target.role != Role::Color && mapped.target.statistic == Statistic::Mean)
            .filter(|mapped| !mapped.channels.is_empty())
            .filter_map(|mapped| self.candidate_of(mapped.clone()))
            .collect();
        for row in self.all_rows().filter(|row| !matches!(row.role, Role::Color | Role::Beauty)) {
            for (i, layer) in self.layers.iter().enumerate() {
                let usable = !statistics.contains(&i) && self.goes_with(i, color);
                let Some(matched) = match_layer(row.layer, &layer.name).filter(|_| usable) else { continue };
                let Some(channels) = layer.pick_first(row.components) else { continue };
                if channels.iter().any(|channel| color.mean.channels.contains(channel)) {
                    continue;
                }
                let candidate = self.candidate(i, row, &matched, channels);
                let target = &candidate.mean.target;
                if self.mapped(target.role, &target.feature, Statistic::Mean).is_none() {
                    found.push(candidate);
                }
            }
        }
        found
    }

    /// Whether a layer that holds a statistic of another one has such a name.
    pub(super) fn has_statistic(&self, is_meant: impl Fn(&str) -> bool) -> bool {
        self.statistics().iter().any(|&i| is_meant(&self.layers[i].name))
    }

    /// The channels that are features by their names, whether or not another one is preferred.
    pub(super) fn features(&self, color: &Candidate) -> BTreeSet<Channel> {
        let is_one = |found: &Candidate| matches!(found.mean.target.role, Role::Feature(_));
        let named = |found: &Candidate| is_one(found) && found.evidence == Evidence::Name;
        let found = self.candidates(color).into_iter().filter(named);
        found.flat_map(|found| found.mean.channels).collect()
    }

    /// The layers of the first file that go with `color` and could be a component of it: three channels,
    /// or one, that hold no statistic of another layer.
    pub(super) fn pictures(&self, color: &Candidate) -> impl Iterator<Item = Component> {
        let statistics = self.statistics();
        let layers = self.layers.iter().enumerate();
        layers.filter(move |&(i, _)| !statistics.contains(&i) && self.goes_with(i, color)).filter_map(
            |(_, layer)| {
                let only = || match layer.components.as_slice() {
                    [(_, only)] => Some(vec![*only]),
                    _ => None,
                };
                let channels = layer.pick_first(&[&["R", "G", "B"], &["X", "Y", "Z"]]).or_else(only)?;
                (channels[0].file == 0).then(|| Component { name: layer.name.clone(), channels })
            },
        )
    }

    /// Other pictures that could have been the colour: of the other eye, of another view layer.
    pub(super) fn other_colors(&self, color: &Candidate) -> Vec<String> {
        let named = |row: &LayerRow| {
            self.layers.iter().enumerate().filter(|&(i, layer)| {
                let fits = match_layer(row.layer, &layer.name).is_some()
                    && layer.pick_first(row.components).is_some();
                fits && !self.goes_with(i, color)
            })
        };
        let names = self.rows(Role::Color).flat_map(named).map(|(_, layer)| match &layer.view {
            Some(view) if layer.name.is_empty() => view.clone(),
            _ => layer.name.clone(),
        });
        names.collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// The view must be the colour's, and so must the layers around (Cycles' view layer).
    fn goes_with(&self, layer: usize, color: &Candidate) -> bool {
        self.same_view(layer, color.layer) && (color.around.is_empty() || self.around[layer] == color.around)
    }

    /// What has no view belongs to all of them.
    fn same_view(&self, a: usize, b: usize) -> bool {
        let (a, b) = (&self.layers[a].view, &self.layers[b].view);
        a.is_none() || b.is_none() || a == b
    }

    fn rows(&self, role: Role) -> impl Iterator<Item = &'static LayerRow> {
        self.all_rows().filter(move |row| row.role == role)
    }

    fn all_rows(&self) -> impl Iterator<Item = &'static LayerRow> + use<> {
        rows_of(self.renderer)
    }

    fn companion_rows(&self) -> impl Iterator<Item = &'static CompanionRow> + use<> {
        let renderer = self.renderer;
        let own =
            COMPANIONS.iter().filter(move |row| row.renderer == renderer && renderer != Renderer::Plain);
        own.chain(COMPANIONS.iter().filter(|row| row.renderer == Renderer::Plain))
    }

    fn mapped(&self, role: Role, feature: &str, statistic: Statistic) -> Option<&Choice> {
        self.mapped.iter().find(|mapped| {
            let target = &mapped.target;
            target.role == role && target.feature == feature && same_slot(target.statistic, statistic)
        })
    }

    /// Layers that hold a statistic of another one, and so no mean.
    fn statistics(&self) -> BTreeSet<usize> {
        let named = |(i, layer): (usize, &Layer)| {
            let rows = self.companion_rows();
            rows.flat_map(|row| companion_names(row, &layer.name))
                .flat_map(move |name| {
                    self.layers_named(&name).iter().copied().filter(move |&other| other != i)
                })
                .collect::<Vec<_>>()
        };
        self.layers.iter().enumerate().flat_map(named).collect()
    }

    fn layers_named(&self, name: &str) -> &[usize] {
        self.by_name.get(&name.to_ascii_lowercase()).map_or(&[], Vec::as_slice)
    }

    fn candidate(
        &self,
        layer: usize,
        row: &LayerRow,
        matched: &Matched,
        channels: Vec<Channel>,
    ) -> Candidate {
        let feature = match row.role {
            Role::Feature(kind) => format!("{}{}", feature_name(kind), matched.number),
            _ => String::new(),
        };
        let target = Target { role: row.role, feature, statistic: Statistic::Mean };
        let mean = Choice { target, channels };
        let companions = self.companions(layer, &mean);
        Candidate { mean, companions, evidence: row.evidence, layer, around: matched.around.to_owned() }
    }

    /// A mapped mean, with the companions of the layer it begins in.
    fn candidate_of(&self, mean: Choice) -> Option<Candidate> {
        let first = mean.channels.first()?;
        let holds = |layer: &Layer| layer.components.iter().any(|(_, channel)| channel == first);
        let layer = self.layers.iter().position(holds)?;
        let companions = self.companions(layer, &mean);
        let around = self.around[layer].clone();
        Some(Candidate { mean, companions, evidence: Evidence::Name, layer, around })
    }

    /// The statistics of `mean`, as mapped by the user or as named after its `layer`: as many channels as it has, the
    /// only one for all of them, unless the user maps another number.
    fn companions(&self, layer: usize, mean: &Choice) -> Vec<Choice> {
        let (role, feature) = (mean.target.role, mean.target.feature.as_str());
        let is_color = matches!(role, Role::Color | Role::ColorCopy | Role::ColorXyz);
        let target = |statistic| Target { role, feature: feature.to_owned(), statistic };
        let mut found: Vec<Choice> = Vec::new();
        for slot in [Statistic::Variance(super::VarianceKind::Mean), Statistic::HalfA, Statistic::HalfB] {
            if let Some(Choice { target, channels }) = self.mapped(role, feature, slot) {
                let channels = match channels.as_slice() {
                    [only] => vec![*only; mean.channels.len()],
                    several => several.to_vec(),
                };
                found.push(Choice { target: target.clone(), channels });
                continue;
            }
            let rows = self.companion_rows().filter(|row| {
                same_slot(row.statistic, slot) && row.of != if is_color { Of::Features } else { Of::Color }
            });
            let channels = rows.into_iter().find_map(|row| {
                let layers = companion_names(row, &self.layers[layer].name)
                    .into_iter()
                    .flat_map(|name| self.layers_named(&name).iter().copied());
                layers
                    .filter(|&other| other != layer && self.same_view(other, layer))
                    .find_map(|other| Some((row.statistic, self.pick_like(layer, mean, other)?)))
            });
            if let Some((statistic, channels)) = channels {
                found.push(Choice { target: target(statistic), channels });
            }
        }
        found.retain(|choice| !choice.channels.is_empty());
        found
    }

    /// The channels of `other` with the names that `mean` has in `layer`; or its only channel for
    /// all of them, as with a variance of the luminance.
    fn pick_like(&self, layer: usize, mean: &Choice, other: usize) -> Option<Vec<Channel>> {
        let components = &self.layers[layer].components;
        let name_of = |wanted: &Channel| {
            components.iter().find(|(_, channel)| channel == wanted).map(|(name, _)| name.as_str())
        };
        let names: Option<Vec<&str>> = mean.channels.iter().map(name_of).collect();
        let other = &self.layers[other];
        other.pick(&names?).or_else(|| match other.components.as_slice() {
            [(_, only)] => Some(vec![*only; mean.channels.len()]),
            _ => None,
        })
    }
}

/// The renderer's rows, then the plain ones.
fn rows_of(renderer: Renderer) -> impl Iterator<Item = &'static LayerRow> {
    let own = LAYERS.iter().filter(move |row| row.renderer == renderer && renderer != Renderer::Plain);
    own.chain(LAYERS.iter().filter(|row| row.renderer == Renderer::Plain))
}

/// For each layer what is around it: the longest start of its name that is around a layer with a role, so that
/// `A.001.Depth` is not of `A`. Empty where the renderer's colour has no open row.
fn surroundings(layers: &[Layer], renderer: Renderer) -> Vec<String> {
    let is_open = |row: &&LayerRow| row.layer.starts_with("*.");
    let open: Vec<&LayerRow> = rows_of(renderer).filter(is_open).collect();
    if open.iter().all(|row| row.role != Role::Color) {
        return vec![String::new(); layers.len()];
    }
    let around = |layer: &'_ Layer| {
        open.iter().find_map(|row| match_layer(row.layer, &layer.name).map(|m| m.around.to_owned()))
    };
    let known: BTreeSet<String> = layers.iter().filter_map(around).collect();
    let longest = |layer: &Layer| {
        let starts = layer.name.rmatch_indices('.').map(|(dot, _)| &layer.name[..=dot]);
        starts.into_iter().find(|start| known.contains(*start)).unwrap_or_default().to_owned()
    };
    layers.iter().map(longest).collect()
}

/// What the candidates come to.
pub(super) struct Cast {
    pub(super) choices: Vec<Choice>,
    pub(super) notes: Vec<String>,
}

/// Decides which candidates play, given for each what was seen of its planes.
pub(super) fn settle(color: &Candidate, candidates: &[Candidate], seen: &[Tally]) -> Cast {
    let mut cast = Cast { choices: vec![color.mean.clone()], notes: Vec::new() };
    let mut used: BTreeSet<Channel> = color.mean.channels.iter().copied().collect();
    cast.choices.extend(color.companions.iter().cloned());
    for (candidate, seen) in candidates.iter().zip(seen) {
        let target = &candidate.mean.target;
        let taken =
            cast.choices.iter().any(|c| c.target.role == target.role && c.target.feature == target.feature);
        if taken
            || candidate.mean.channels.iter().any(|channel| used.contains(channel))
            || !seen.holds(candidate.evidence)
        {
            continue;
        }
        used.extend(&candidate.mean.channels);
        match target.role {
            Role::ColorCopy => adopt_statistics(&mut cast.choices, &candidate.companions),
            Role::ColorXyz if !candidate.companions.is_empty() && !has_variance(&cast.choices) => {
                cast.notes.push(
                    "the second moments are those of CIE XYZ and say nothing about RGB: they are not used; \
                 in Mitsuba put `moment` around `aov`, not inside it"
                        .to_owned(),
                )
            }
            Role::ColorXyz => {}
            _ => {
                cast.choices.push(candidate.mean.clone());
                cast.choices.extend(candidate.companions.iter().cloned());
            }
        }
    }
    cast
}

/// Whether the colour has a variance of any kind.
pub(super) fn has_variance(choices: &[Choice]) -> bool {
    choices.iter().any(|choice| {
        choice.target.role == Role::Color && matches!(choice.target.statistic, Statistic::Variance(_))
    })
}

/// The statistics of a copy of the colour are the colour's, where it has none itself and as many channels.
fn adopt_statistics(choices: &mut Vec<Choice>, companions: &[Choice]) {
    let channels = choices[0].channels.len();
    for companion in companions.iter().filter(|companion| companion.channels.len() == channels) {
        let target = Target { role: Role::Color, ..companion.target.clone() };
        let there =
            |c: &Choice| c.target.role == Role::Color && same_slot(c.target.statistic, target.statistic);
        if !choices.iter().any(there) {
            choices.push(Choice { target, channels: companion.channels.clone() });
        }
    }
}

fn feature_name(kind: FeatureKind) -> &'static str {
    FEATURES.iter().find(|(_, k)| *k == kind).map_or("feature", |(name, _)| name)
}

/// The channels of the colour's mean, which every picture has.
pub(super) fn color_of(choices: &[Choice]) -> &[Channel] {
    let is_mean = |c: &&Choice| c.target.role == Role::Color && c.target.statistic == Statistic::Mean;
    choices.iter().find(is_mean).map_or(&[], |choice| &choice.channels)
}
