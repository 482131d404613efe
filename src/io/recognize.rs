//! Who wrote a file, which layers it has, and how many samples: what its header tells.

use exr::meta::attribute::AttributeValue;
use exr::meta::header::Header;

use super::channels::{COUNTS, CountAs, MARKS, Mark, Renderer, match_layer};
use super::document::Document;
use super::layers::{Layer, first_with_rgb, gather};
use super::roles::Casting;

/// All layers. Where none has a name that a colour may have, the first part with R, G and B is the
/// picture's own, whatever it is called.
pub(super) fn layers(documents: &[Document], one_file_per_buffer: Option<Renderer>) -> Vec<Layer> {
    let named = gather(documents, one_file_per_buffer, None);
    let renderer = one_file_per_buffer.unwrap_or_else(|| detect(&documents[0], &named));
    let found = Casting::new(&named, renderer, &[]).color().is_some();
    match first_with_rgb(&documents[0]).filter(|_| !found) {
        Some(part) => gather(documents, one_file_per_buffer, Some(part)),
        None => named,
    }
}

/// Who wrote the file, by the marks of the channel map.
pub(super) fn detect(document: &Document, layers: &[Layer]) -> Renderer {
    let header = &document.headers()[0];
    let attributes = || header.own_attributes.other.iter();
    let marked = |mark: Mark| {
        match mark {
        Mark::Attribute(start) => attributes().any(|(name, _)| name.to_string().starts_with(start)),
        Mark::Text(wanted, start) => attributes().any(|(name, value)| {
            matches!(value, AttributeValue::Text(text) if *name == *wanted && text.to_string().starts_with(start))
        }),
        Mark::Layer(pattern) => layers.iter().any(|layer| match_layer(pattern, &layer.name).is_some()),
    }
    };
    MARKS.iter().find(|(_, mark)| marked(*mark)).map_or(Renderer::Plain, |(renderer, _)| *renderer)
}

/// Samples per pixel according to the header; where it tells them for each of several layers, those of the one
/// that is `around` the colour (with its dot), else of the first by name.
pub(super) fn samples_in(header: &Header, around: &str) -> Option<f32> {
    let number = |value: &AttributeValue| match value {
        AttributeValue::I32(n) => Some(*n as f32),
        AttributeValue::F32(n) => Some(*n),
        AttributeValue::F64(n) => Some(*n as f32),
        AttributeValue::Text(text) => text.to_string().trim().parse().ok(),
        _ => None,
    };
    COUNTS.iter().find_map(|&(start, end, count_as)| {
        let told = header.own_attributes.other.iter().filter_map(|(name, value)| {
            let name = name.to_string();
            let layer = name.strip_prefix(start)?.strip_suffix(end)?;
            let n = number(value).filter(|n| (!end.is_empty() || layer.is_empty()) && *n > 0.0)?;
            let other = around.strip_suffix('.') != Some(layer);
            Some((other, name, if count_as == CountAs::Root { n * n } else { n }))
        });
        // A header's attributes have no order of their own.
        told.min_by(|a, b| (a.0, &a.1).cmp(&(b.0, &b.1))).map(|(_, _, n)| n)
    })
}
