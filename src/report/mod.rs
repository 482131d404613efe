//! Pictures and pages about results, as bytes or text; writing them to disk is [`crate::io`]'s work.

pub mod chart;
pub mod page;
pub mod png;
pub mod sweep;

use crate::error::{Error, ErrorKind, Result};

/// `value` as indented JSON with a closing line break; numbers that are not finite become `null`.
///
/// # Errors
/// When the value cannot be expressed, such as a map whose keys are no strings.
pub fn json(value: &impl serde::Serialize) -> Result<String> {
    serde_json::to_string_pretty(value)
        .map(|text| text + "\n")
        .map_err(|error| Error::new(ErrorKind::Internal, format!("the JSON cannot be made: {error}")))
}

/// `words` as text of HTML or XML.
fn escape(words: &str) -> String {
    let mut escaped = String::with_capacity(words.len());
    for letter in words.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            other => escaped.push(other),
        }
    }
    escaped
}
