//! Options by their names, for command lines and bindings.

use serde_json::Value;

use super::Options;
use crate::error::{Error, ErrorKind, Result};
use crate::likeness::by_likeness;

/// Where all options stand with their ranges.
const ALL_TOLD: &str = "docs/OPTIONS.md (apr-denoise --generate options) lists all";

impl Options {
    /// The options with the one called `key` replaced, whose dots go into depth (`outliers.enabled`,
    /// `stages.0.1.patch_radius`). Ranges are not looked at: that is [`Options::check`]'s.
    ///
    /// # Errors
    /// `Usage` when there is no such option or `new` is of another type.
    pub fn with(self, key: &str, new: Value) -> Result<Self> {
        replaced(&self, key, new, serde_json::from_value)
    }
}

/// `options` as JSON with the one called `key` replaced, made into options again by `parse`.
///
/// # Errors
/// `Usage` when there is no such option or `parse` refuses.
pub(crate) fn replaced<T: serde::Serialize>(
    options: &T,
    key: &str,
    new: Value,
    parse: impl FnOnce(Value) -> serde_json::Result<T>,
) -> Result<T> {
    let usage = |what: String| Error::new(ErrorKind::Usage, what);
    let mut value =
        serde_json::to_value(options).map_err(|error| Error::new(ErrorKind::Internal, error.to_string()))?;
    let path: Vec<&str> = key.trim().split('.').collect();
    let known = likest(key.trim(), &value);
    let slot = value.pointer_mut(&format!("/{}", path.join("/")));
    let slot = slot.ok_or_else(|| usage(format!("there is no option '{key}'")).remedy(known))?;
    let given = new.to_string();
    *slot = new;
    parse(value).map_err(|error| {
        // Serde names types of Rust, which say little to others.
        let why = error.to_string().replace("expected usize", "expected a whole number");
        usage(format!("the options make no sense with {key}={given}: {why}")).remedy(ALL_TOLD)
    })
}

/// In words, the options of `all` whose names are the likest to `wanted`.
fn likest(wanted: &str, all: &Value) -> String {
    const TOLD: usize = 3;
    let mut names = Vec::new();
    collect("", all, &mut names);
    let mut sorted = by_likeness(wanted, names);
    sorted.truncate(TOLD);
    format!("the likest are '{}'; {ALL_TOLD}", sorted.join("', '"))
}

/// The names of everything in `group`, whose own name, with its dot, is `before`.
fn collect(before: &str, group: &Value, names: &mut Vec<String>) {
    let mut add = |key: &str, inner: &Value| {
        names.push(format!("{before}{key}"));
        collect(&format!("{before}{key}."), inner, names);
    };
    match group {
        Value::Object(all) => all.iter().for_each(|(key, inner)| add(key, inner)),
        Value::Array(all) => all.iter().enumerate().for_each(|(i, inner)| add(&i.to_string(), inner)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_replaced_in_depth_and_nonsense_is_refused() {
        let options = Options::default().with("outliers.enabled", Value::Bool(false)).unwrap();
        assert!(!options.outliers.enabled && options.restore == Options::default().restore);
        for (key, new) in
            [("magic", Value::Null), ("max_order", "two".into()), ("outliers.enable", true.into())]
        {
            assert_eq!(Options::default().with(key, new).unwrap_err().kind(), ErrorKind::Usage, "{key}");
        }
        let told = |key: &str, new: Value| Options::default().with(key, new).unwrap_err().to_string();
        let fraction = told("window_radius", 7.5.into());
        assert!(fraction.contains("window_radius=7.5") && fraction.contains("a whole number"), "{fraction}");
        for (key, likest) in [
            ("outliers.enabld", "outliers.enabled"),
            ("windowradius", "window_radius"),
            ("witnesses", "outliers.witnesses"),
            ("stages.9", "stages.0"),
            ("coarse.x", "coarse"),
        ] {
            let told = told(key, true.into());
            assert!(told.contains(&format!("the likest are '{likest}', ")), "{told}");
        }
    }
}
