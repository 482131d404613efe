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
    // By way of text, which has single precision's numbers as people write them.
    let text = serde_json::to_string(options);
    let mut value: Value = text
        .and_then(|text| serde_json::from_str(&text))
        .map_err(|error| Error::new(ErrorKind::Internal, error.to_string()))?;
    let path: Vec<&str> = key.trim().split('.').collect();
    let known = likest(key.trim(), &value);
    let slot = value.pointer_mut(&format!("/{}", path.join("/")));
    let slot = slot.ok_or_else(|| usage(format!("there is no option '{key}'")).remedy(known))?;
    let given = new.to_string();
    let old = std::mem::replace(slot, new);
    parse(value).map_err(|error| {
        let why = error.to_string();
        // Serde knows the names that may be there, but of types it knows only Rust's.
        let is_name = ["unknown", "missing", "duplicate"].iter().any(|start| why.starts_with(start));
        let why = if is_name { why } else { format!("{} was expected, such as {key}={old}", kind(&old)) };
        usage(format!("the options make no sense with {key}={given}: {why}")).remedy(ALL_TOLD)
    })
}

/// In words, what an option is that has been `value` so far.
fn kind(value: &Value) -> &'static str {
    match value {
        Value::Bool(_) => "true or false",
        Value::Number(number) if number.is_u64() => "a whole number",
        Value::Number(_) => "a number",
        Value::String(_) => "a name",
        Value::Array(_) => "a list",
        Value::Object(_) => "a group of options",
        Value::Null => "another value",
    }
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
        for (key, new, words) in [
            ("window_radius", "two".into(), "a whole number was expected, such as window_radius=7"),
            ("window_radius", Value::from(-1), "a whole number was expected"),
            ("tolerance", "two".into(), "a number was expected, such as tolerance=0.12"),
            ("coarse", Value::from(1), "true or false was expected, such as coarse=true"),
            ("bandwidths", Value::from(0.7), "a list was expected, such as bandwidths=[1.0]"),
            ("outliers", Value::from(0.7), "a group of options was expected, such as outliers={"),
            ("order_choice", Value::from(1), "a name was expected, such as order_choice=\"shrink\""),
            ("features", "albedo".into(), "a list was expected, such as features=[\"normal\","),
            ("features", Value::from(vec!["hue"]), "unknown variant `hue`, expected one of"),
        ] {
            let told = told(key, new);
            assert!(told.contains(words) && told.ends_with(ALL_TOLD), "{told}");
        }
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
