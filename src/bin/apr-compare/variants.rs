//! The methods and settings that a sweep tries.

use std::path::Path;

use apr::Options;
use apr::baseline::{Denoiser, Method};
use apr::error::{Error, ErrorKind, Result};
use serde::Deserialize;
use serde_json::{Map, Value};

/// What is tried when the user names nothing else.
const DEFAULT: &str = include_str!("variants.json");

/// A method, or a setting of the denoiser, with a name.
pub struct Variant {
    /// The name in tables and charts.
    pub name: String,
    /// The method and its options.
    pub denoiser: Denoiser,
}

/// A variant as it stands in a file: the options that differ from those it starts from.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    /// One of [`Method::NAMES`].
    method: Option<String>,
    /// One of [`Options::PRESETS`], for the method apr alone.
    preset: Option<String>,
    #[serde(default)]
    options: Map<String, Value>,
}

/// The variants of the JSON file at `path`, an array of `{"name": …, "method": …, "preset": …, "options":
/// {…}}`, of which only the name must be there and the options are those that differ from the preset's or the
/// method's defaults; the built-in ones without a path.
///
/// # Errors
/// When the file cannot be read, is not of that form, or names an unknown method, preset or option.
pub fn variants(path: Option<&Path>) -> Result<Vec<Variant>> {
    match path {
        None => parse(DEFAULT),
        Some(path) => parse(&read_text(path)?).map_err(|error| error.in_file(path)),
    }
}

/// The text of the file at `path`.
///
/// # Errors
/// When it cannot be read.
pub fn read_text(path: &Path) -> Result<String> {
    std::fs::read_to_string(path)
        .map_err(|error| Error::new(ErrorKind::Unreadable, format!("cannot be read: {error}")).in_file(path))
}

fn parse(text: &str) -> Result<Vec<Variant>> {
    let entries: Vec<Entry> =
        serde_json::from_str(text).map_err(|error| usage(format!("no list of variants: {error}")))?;
    entries.into_iter().map(build).collect()
}

fn usage(what: String) -> Error {
    Error::new(ErrorKind::Usage, what)
        .remedy("write an array of {\"name\": …, \"method\": …, \"preset\": …, \"options\": {…}}")
}

fn build(entry: Entry) -> Result<Variant> {
    let wrong = |error: String| usage(format!("variant '{}': {error}", entry.name));
    let method =
        entry.method.as_deref().map_or(Ok(Method::Apr), |name| named("method", name, &Method::NAMES));
    let method = method.map_err(wrong)?;
    let start = match (&entry.preset, method) {
        (None, _) => Denoiser::new(method),
        (Some(name), Method::Apr) => {
            Denoiser::Apr(named("preset", name, &Options::PRESETS).map_err(wrong)?())
        }
        (Some(_), _) => return Err(wrong(format!("the method {} has no presets", method.name()))),
    };
    let denoiser = overlay(&start, entry.options.clone()).map_err(|error| wrong(error.to_string()))?;
    denoiser.check().map_err(|error| wrong(error.to_string()))?;
    Ok(Variant { name: entry.name, denoiser })
}

/// What `name` names in `list`.
fn named<T: Copy>(what: &str, name: &str, list: &[(&str, T)]) -> std::result::Result<T, String> {
    let found = list.iter().find(|(known, _)| *known == name);
    let all = || list.iter().map(|(known, _)| *known).collect::<Vec<_>>().join(", ");
    found.map(|(_, value)| *value).ok_or_else(|| format!("there is no {what} '{name}', only {}", all()))
}

/// `start` with `changes` laid over it.
fn overlay(start: &Denoiser, changes: Map<String, Value>) -> serde_json::Result<Denoiser> {
    let mut options = serde_json::to_value(start)?;
    if let Value::Object(fields) = &mut options {
        fields.extend(changes);
    }
    Denoiser::deserialize(start.method(), options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_variants_are_valid_and_start_from_the_default() {
        let all = parse(DEFAULT).unwrap();
        assert_eq!(all[0].denoiser, Denoiser::new(Method::Apr));
        let mut names: Vec<_> = all.iter().map(|variant| &variant.name).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), all.len());
        assert!(all[1..].iter().all(|variant| variant.denoiser != all[0].denoiser));
        for (name, preset) in Options::PRESETS {
            assert!(all.iter().any(|v| v.denoiser == Denoiser::Apr(preset())), "{name} is not tried");
        }
        for (name, method) in Method::NAMES {
            assert!(all.iter().any(|v| v.denoiser == Denoiser::new(method)), "{name} is not tried");
        }
    }

    #[test]
    fn an_unknown_option_is_named_with_its_variant() {
        let error = parse(r#"[{"name": "odd", "options": {"windou": 3}}]"#).err().unwrap().to_string();
        assert!(error.contains("odd") && error.contains("windou"), "{error}");
        let error = parse(r#"[{"name": "odd", "method": "nml"}]"#).err().unwrap().to_string();
        assert!(error.contains("'nml', only apr, nlm"), "{error}");
        let error =
            parse(r#"[{"name": "odd", "method": "nlm", "preset": "best"}]"#).err().unwrap().to_string();
        assert!(error.contains("nlm has no presets"), "{error}");
    }
}
