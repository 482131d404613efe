//! The channels of one or more files, gathered into layers.

use std::path::Path;

use exr::meta::header::Header;

use super::channels::{LAYERS, Renderer, Role};
use super::decode::ChannelAt;
use super::document::Document;
use super::siblings::is_buffer;

/// What stands between the words of a file's name.
const BETWEEN: [char; 3] = ['.', '_', '-'];

/// Names of parts that are no layers of their own: their channels are the picture's.
const NEUTRAL_PARTS: [&str; 7] = ["", "rgba", "rgb", "beauty", "main", "default", "color"];

/// Names without a dot that are components of the nameless layer, not layers of their own.
const BARE_COMPONENTS: &str = "RGBAXYZUVWTD";

/// A channel's place among all files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Channel {
    /// Which file; 0 is the one that will be rewritten.
    pub(super) file: usize,
    pub(super) at: ChannelAt,
}

/// Channels that belong together: one name, several components.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layer {
    /// Empty for the bare `R,G,B`.
    pub(super) name: String,
    /// What it may be called besides, where it has its name of a file.
    pub(super) other_names: Vec<String>,
    /// The view (`left`, `right`) of a stereo file's part.
    pub(super) view: Option<String>,
    /// Component names with their places, in the file's order.
    pub(super) components: Vec<(String, Channel)>,
}

impl Layer {
    /// The places of `names`, if all of them are there.
    pub(super) fn pick(&self, names: &[&str]) -> Option<Vec<Channel>> {
        let find = |wanted: &&str| {
            self.components.iter().find(|(name, _)| name.eq_ignore_ascii_case(wanted)).map(|(_, at)| *at)
        };
        names.iter().map(find).collect()
    }

    /// The places of the first of `sets` that is there in full.
    pub(super) fn pick_first(&self, sets: &[&[&str]]) -> Option<Vec<Channel>> {
        sets.iter().find_map(|names| self.pick(names))
    }

    /// All of them as their components are meant to follow each other: the file has them by the alphabet.
    pub(super) fn in_order(&self) -> Vec<Channel> {
        const ORDER: &str = "RGBXYZWUVA";
        let place = |(name, _): &&(String, Channel)| {
            ORDER.find(&name.to_ascii_uppercase()).filter(|_| name.len() == 1).unwrap_or(ORDER.len())
        };
        let mut ordered: Vec<&(String, Channel)> = self.components.iter().collect();
        ordered.sort_by_key(place);
        ordered.into_iter().map(|(_, channel)| *channel).collect()
    }
}

/// All layers of `documents`, in the files' order. The bare channels of a further file form a layer of the
/// file's name; with `one_file_per_buffer` those of the first do so too, less what all names have in common with it.
/// The channels of the first file's `main_part` belong to the picture, whatever the part is called.
pub(super) fn gather(
    documents: &[Document],
    one_file_per_buffer: Option<Renderer>,
    main_part: Option<usize>,
) -> Vec<Layer> {
    let mut layers: Vec<Layer> = Vec::new();
    let prefix = one_file_per_buffer.map(|renderer| buffer_prefix(&stem(documents[0].path()).0, renderer));
    for (file, document) in documents.iter().enumerate() {
        let is_layer = file > 0 || prefix.is_some();
        let names = if is_layer { file_names(document.path(), prefix.as_deref()) } else { vec![] };
        // A first file of a name that says nothing holds the picture.
        let unknown = if file > 0 { names.first() } else { None };
        let file_layer = known(&names, one_file_per_buffer.unwrap_or(Renderer::Plain)).or(unknown);
        for (part, header) in document.headers().iter().enumerate() {
            let in_words = has_colors_in_words(header);
            let view = header.own_attributes.view_name.as_ref().map(ToString::to_string);
            let part_layer = match (file, Some(part)) == (0, main_part) {
                true => String::new(),
                false => part_layer(document.headers().len(), header, view.as_deref()),
            };
            for (channel, description) in header.channels.list.iter().enumerate() {
                let (layer, component) = split_name(&description.name.to_string(), in_words);
                let (mut name, mut other_names) = (join(&part_layer, &layer), vec![]);
                if name.is_empty() {
                    (name, other_names) = (file_layer.cloned().unwrap_or_default(), names.clone());
                }
                let at = (component, Channel { file, at: ChannelAt { part, channel } });
                let same = |layer: &&mut Layer| {
                    let first = layer.components[0].1;
                    layer.name == name && (first.file, first.at.part) == (file, part)
                };
                match layers.iter_mut().rev().find(same) {
                    Some(layer) => layer.components.push(at),
                    None => {
                        let view = view.clone();
                        layers.push(Layer { name, other_names, view, components: vec![at] });
                    }
                }
            }
        }
    }
    layers
}

/// The first part that has channels R, G and B without a layer.
pub(super) fn first_with_rgb(document: &Document) -> Option<usize> {
    document.headers().iter().position(|header| {
        let has = |name: &str| header.channels.list.iter().any(|channel| channel.name == *name);
        has("R") && has("G") && has("B")
    })
}

/// The file's name without folder and ending, and what of it is the number of a frame at its end: `albedo` and `.0001`.
pub(super) fn stem(path: &Path) -> (String, String) {
    /// As few digits are a frame's without anything before them: `albedo2` is that of the second hit.
    const PADDED: usize = 3;
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let word = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let digits = name.len() - word.len();
    let bare = word.trim_end_matches(BETWEEN);
    let is_frame = !bare.is_empty() && digits > 0 && (bare.len() < word.len() || digits >= PADDED);
    let (stem, number) = name.split_at(if is_frame { bare.len() } else { name.len() });
    (stem.to_owned(), number.to_owned())
}

/// What the layer of a file's bare channels may be called: what follows `prefix`, the file's name without the number of
/// a frame at its end, what follows each sign in that, and the whole name.
fn file_names(path: &Path, prefix: Option<&str>) -> Vec<String> {
    let (stem, number) = stem(path);
    let after = prefix.and_then(|prefix| stem.strip_prefix(prefix)).map(str::to_owned);
    let ends = stem.match_indices(BETWEEN).map(|(sign, _)| stem[sign + 1..].to_owned());
    let mut names: Vec<String> = after.into_iter().chain([stem.clone()]).chain(ends).collect();
    names.push(stem.clone() + &number);
    names
}

/// The first of `names` that the channel map knows.
fn known(names: &[String], renderer: Renderer) -> Option<&String> {
    names.iter().find(|name| [renderer, Renderer::Plain].iter().any(|of| is_buffer(name, *of)))
}

/// What stands in the first file's name before the renderer's name of the colour.
pub(super) fn buffer_prefix(stem: &str, renderer: Renderer) -> String {
    let rows = LAYERS.iter().filter(|row| row.renderer == renderer && row.role == Role::Color);
    let cut = rows.filter_map(|row| {
        let start = stem.len().checked_sub(row.layer.len())?;
        stem.get(start..)?.eq_ignore_ascii_case(row.layer).then(|| &stem[..start])
    });
    cut.min_by_key(|prefix| prefix.len()).unwrap_or_default().to_owned()
}

/// The layer that a part stands for.
fn part_layer(parts: usize, header: &Header, view: Option<&str>) -> String {
    let Some(name) = header.own_attributes.layer_name.as_ref().filter(|_| parts > 1) else {
        return String::new();
    };
    let mut name = name.to_string();
    if let Some(base) = view.and_then(|view| name.strip_suffix(view)) {
        name = base.trim_end_matches(['.', '_', '-']).to_owned();
    }
    if NEUTRAL_PARTS.iter().any(|neutral| name.eq_ignore_ascii_case(neutral)) { String::new() } else { name }
}

/// Components that Nuke writes out.
const WORDS: [(&str, &str); 4] = [("red", "R"), ("green", "G"), ("blue", "B"), ("alpha", "A")];

/// The component that a word stands for.
fn of_word(word: &str) -> Option<String> {
    WORDS.iter().find(|(known, _)| word.eq_ignore_ascii_case(known)).map(|(_, letter)| (*letter).to_owned())
}

/// Whether the part has channels `red`, `green` and `blue` without a layer: one of them alone may be a mask.
fn has_colors_in_words(header: &Header) -> bool {
    let has = |word: &str| {
        header.channels.list.iter().any(|channel| channel.name.to_string().eq_ignore_ascii_case(word))
    };
    WORDS[..3].iter().all(|(word, _)| has(word))
}

/// A channel's name as layer and component, which may be a word; without a layer only where the part has its
/// colours `in_words`.
fn split_name(name: &str, in_words: bool) -> (String, String) {
    match name.rsplit_once('.') {
        Some((layer, component)) => {
            (layer.to_owned(), of_word(component).unwrap_or_else(|| component.to_owned()))
        }
        None if in_words && of_word(name).is_some() => (String::new(), of_word(name).unwrap_or_default()),
        None if name.len() == 1 && BARE_COMPONENTS.contains(&name.to_uppercase()) => {
            (String::new(), name.to_owned())
        }
        None => (name.to_owned(), String::new()),
    }
}

/// The part's layer in front of the channel's own, unless that begins with it.
fn join(part: &str, layer: &str) -> String {
    let begins = layer.get(..part.len()).is_some_and(|start| start.eq_ignore_ascii_case(part));
    match (part.is_empty() || begins, layer.is_empty()) {
        (true, _) => layer.to_owned(),
        (false, true) => part.to_owned(),
        (false, false) => format!("{part}.{layer}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_split_at_the_last_dot_and_parts_stand_in_front() {
        let split = |name| {
            let (layer, component) = split_name(name, false);
            format!("{layer}|{component}")
        };
        assert_eq!(split("ViewLayer.Noisy Image.R"), "ViewLayer.Noisy Image|R");
        assert_eq!(split("Z"), "|Z");
        assert_eq!((split("rgba.red"), split("red")), ("rgba|R".to_owned(), "red|".to_owned()));
        assert_eq!(split_name("Green", true), (String::new(), "G".to_owned()));
        assert_eq!(split("zfiltered"), "zfiltered|");
        assert_eq!(join("ViewLayer.Combined", ""), "ViewLayer.Combined");
        assert_eq!(join("ViewLayer", "Combined"), "ViewLayer.Combined");
        assert_eq!(join("forward", "forward"), "forward");
        assert_eq!(join("", "N"), "N");
    }

    #[test]
    fn files_are_called_by_their_words_and_not_by_their_frames() {
        let of = |name: &str| {
            let names = file_names(Path::new(name), None);
            (known(&names, Renderer::Plain).unwrap_or(&names[0]).clone(), stem(Path::new(name)).1)
        };
        for (file, name, number) in [
            ("albedo.exr", "albedo", ""),
            ("a/albedo.0001.exr", "albedo", ".0001"),
            ("shot_010_albedo.-005.exr", "albedo", ".-005"),
            ("shot.0001.diffuse_albedo.exr", "diffuse_albedo", ""),
            ("albedo2.7.exr", "albedo2", ".7"),
            ("albedo0007.exr", "albedo", "0007"),
            ("shot_albedoVariance_0007.exr", "albedoVariance", "_0007"),
            ("key_light.0007.exr", "key_light", ".0007"),
            ("0007.exr", "0007", ""),
        ] {
            assert_eq!(of(file), (name.to_owned(), number.to_owned()), "{file}");
        }
    }

    #[test]
    fn buffers_are_named_after_what_follows_the_common_start() {
        assert_eq!(buffer_prefix("color", Renderer::Tungsten), "");
        assert_eq!(buffer_prefix("shot_010_Color", Renderer::Tungsten), "shot_010_");
        assert_eq!(buffer_prefix("a_RGB_IMAGEPIPELINE", Renderer::LuxCore), "a_");
        assert_eq!(buffer_prefix("render", Renderer::LuxCore), "");
    }
}
