//! Options by their names, for command lines and bindings.

use serde_json::Value;

use super::Options;
use crate::error::{Error, ErrorKind, Result};

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
    let known = known_beside(&value, &path);
    let slot = value.pointer_mut(&format!("/{}", path.join("/")));
    let slot = slot.ok_or_else(|| usage(format!("there is no option '{key}'")).remedy(known))?;
    let given = new.to_string();
    *slot = new;
    parse(value).map_err(|error| {
        // Serde names types of Rust, which say little to others.
        let why = error.to_string().replace("expected usize", "expected a whole number");
        usage(format!("the options make no sense with {key}={given}: {why}"))
            .remedy("see the documentation of apr::Options and apr::baseline")
    })
}

/// In words, the options among which the one at `path` was looked for and not found.
fn known_beside(options: &Value, path: &[&str]) -> String {
    let (mut group, mut depth) = (options, 0);
    while let Some(inner) = path.get(depth).and_then(|name| group.pointer(&format!("/{name}"))) {
        (group, depth) = (inner, depth + 1);
    }
    let of = if depth == 0 { String::new() } else { format!(" of {}", path[..depth].join(".")) };
    match group {
        Value::Object(all) => {
            let names: Vec<&str> = all.keys().map(String::as_str).collect();
            format!("the options{of} are {}", names.join(", "))
        }
        Value::Array(all) if !all.is_empty() => format!("the options{of} are 0 to {}", all.len() - 1),
        _ => format!("there are no options{of}"),
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
        let inner = told("outliers.enabld", true.into());
        assert!(inner.contains("the options of outliers are ") && inner.contains("enabled"), "{inner}");
        assert!(!inner.contains("window_radius"), "{inner}");
        assert!(told("stages.9", true.into()).contains("the options of stages are 0 to "));
        assert!(told("coarse.x", true.into()).contains("there are no options of coarse"));
    }
}
