//! What a result was made by, in an attribute of its file: so that a run that goes on by
//! `--skip-existing` never leaves a sequence of two kinds.

use apr::baseline::Denoiser;
use apr::error::Result;
use apr::report;
use serde_json::{Map, Value, json};

use crate::arguments::Arguments;

/// Everything but the input's own content that the result depends on, as one line of ASCII JSON.
///
/// # Errors
/// When a value cannot be expressed as JSON.
pub fn of(arguments: &Arguments, denoiser: &Denoiser) -> Result<String> {
    let mapping = |mapping: &apr::io::Mapping| format!("{}={}", mapping.name, mapping.channels.join(","));
    let text = report::json(&json!({
        "program": env!("CARGO_PKG_NAME"),
        "version": env!("CARGO_PKG_VERSION"),
        "method": denoiser.method().name(),
        "options": denoiser,
        "profile": arguments.profile,
        "map": arguments.map.iter().map(mapping).collect::<Vec<_>>(),
        "feature": arguments.feature.iter().map(mapping).collect::<Vec<_>>(),
        "variance-kind": arguments.variance_kind,
        "spp": arguments.spp,
        "aov": arguments.aov,
        "half": arguments.half.is_some(),
        "with": arguments.with.len(),
        "aux": arguments.aux,
        "temporal": arguments.temporal,
    }))?;
    let one_line: String = text.lines().map(str::trim).collect();
    Ok(ascii(&one_line))
}

/// In words, where `found` differs from `wanted`.
pub fn difference(found: Option<&str>, wanted: &str) -> String {
    let Some(found) = found else { return "this program did not write it".to_owned() };
    match (serde_json::from_str(found), serde_json::from_str(wanted)) {
        (Ok(Value::Object(found)), Ok(Value::Object(wanted))) => {
            let mut keys = Vec::new();
            collect("", &found, &wanted, &mut keys);
            format!("its {} differed", keys.join(", "))
        }
        _ => "its settings are not legible".to_owned(),
    }
}

fn collect(before: &str, found: &Map<String, Value>, wanted: &Map<String, Value>, keys: &mut Vec<String>) {
    for key in found.keys().chain(wanted.keys().filter(|key| !found.contains_key(*key))) {
        match (found.get(key), wanted.get(key)) {
            (a, b) if a == b => {}
            (Some(Value::Object(a)), Some(Value::Object(b))) => {
                collect(&format!("{before}{key}."), a, b, keys);
            }
            _ => keys.push(format!("{before}{key}")),
        }
    }
}

/// JSON with every other letter escaped: attributes of EXR files hold no more.
fn ascii(json: &str) -> String {
    let mut units = [0; 2];
    let letter = |c: char| match c {
        c if c.is_ascii() => c.to_string(),
        c => c.encode_utf16(&mut units).iter().map(|unit| format!("\\u{unit:04x}")).collect(),
    };
    json.chars().map(letter).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_named_by_their_keys() {
        let (a, b) = (r#"{"a": 1, "o": {"x": 1, "y": [2]}}"#, r#"{"a": 1, "o": {"x": 2, "y": [2], "z": 0}}"#);
        assert_eq!(difference(Some(a), b), "its o.x, o.z differed");
        assert_eq!(difference(None, b), "this program did not write it");
        assert_eq!(difference(Some("?"), b), "its settings are not legible");
    }

    #[test]
    fn other_alphabets_are_escaped_and_read_again() {
        let text = ascii("{\"map\":\"Füße 🦶\"}");
        assert!(text.is_ascii());
        let read: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(read["map"], "Füße 🦶");
    }
}
