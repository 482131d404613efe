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
    let known = value.as_object().map(|all| all.keys().cloned().collect::<Vec<_>>().join(", "));
    let pointer = format!("/{}", key.trim().replace('.', "/"));
    let slot = value.pointer_mut(&pointer).ok_or_else(|| {
        usage(format!("there is no option '{key}'"))
            .remedy(format!("the options are {}", known.unwrap_or_default()))
    })?;
    *slot = new;
    parse(value).map_err(|error| {
        usage(format!("the options make no sense: {error}"))
            .remedy("see the documentation of apr::Options and apr::baseline")
    })
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
    }
}
