//! Pictures and pages about results, as bytes or text; writing them to disk is [`crate::io`]'s work.

pub mod png;

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
