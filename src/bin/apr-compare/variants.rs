//! The settings of the denoiser that a sweep tries.

use std::path::Path;

use apr::Options;
use apr::error::{Error, ErrorKind, Result};
use serde::Deserialize;
use serde_json::{Map, Value};

/// What is tried when the user names nothing else.
const DEFAULT: &str = include_str!("variants.json");

/// A setting with a name.
pub struct Variant {
    /// The name in tables and charts.
    pub name: String,
    /// The setting.
    pub options: Options,
}

/// A variant as it stands in a file: the options that differ from those it starts from.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    #[serde(default)]
    base: Base,
    #[serde(default)]
    options: Map<String, Value>,
}

/// What a variant starts from.
#[derive(Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Base {
    /// [`Options::default`].
    #[default]
    Default,
    /// [`Options::published`].
    Published,
}

/// The variants of the JSON file at `path`, an array of `{"name": …, "base": …, "options": {…}}` where
/// the options are those of [`Options`] that differ from the base's; the built-in ones without a path.
///
/// # Errors
/// When the file cannot be read, is not of that form, or names an unknown option.
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
    let usage = |error: &serde_json::Error, what: &str| {
        Error::new(ErrorKind::Usage, format!("{what}: {error}")).remedy(
            "write an array of {\"name\": …, \"base\": \"default\" or \"published\", \"options\": {…}}",
        )
    };
    let entries: Vec<Entry> = serde_json::from_str(text).map_err(|e| usage(&e, "no list of variants"))?;
    let build = |entry: Entry| {
        let base = match entry.base {
            Base::Default => Options::default(),
            Base::Published => Options::published(),
        };
        let options =
            overlay(&base, entry.options).map_err(|e| usage(&e, &format!("variant '{}'", entry.name)))?;
        Ok(Variant { name: entry.name, options })
    };
    entries.into_iter().map(build).collect()
}

/// `base` with `changes` laid over it.
fn overlay(base: &Options, changes: Map<String, Value>) -> serde_json::Result<Options> {
    let mut options = serde_json::to_value(base)?;
    if let Value::Object(fields) = &mut options {
        fields.extend(changes);
    }
    serde_json::from_value(options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_variants_are_valid_and_start_from_the_default() {
        let all = parse(DEFAULT).unwrap();
        assert_eq!(all[0].options, Options::default());
        let mut names: Vec<_> = all.iter().map(|variant| &variant.name).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), all.len());
        assert!(all.iter().all(|variant| variant.options.check().is_ok()));
        assert!(all[1..].iter().all(|variant| variant.options != all[0].options));
    }

    #[test]
    fn an_unknown_option_is_named_with_its_variant() {
        let error = parse(r#"[{"name": "odd", "options": {"windou": 3}}]"#).err().unwrap().to_string();
        assert!(error.contains("odd") && error.contains("windou"), "{error}");
    }
}
