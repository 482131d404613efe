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

/// The same of one frame in a run that looks at `reach` frames on both sides, of which so many `[before, after]` it
/// helped: they change the result too.
pub fn of_frame(signature: &str, reach: u8, [before, after]: [usize; 2]) -> String {
    if reach == 0 {
        return signature.to_owned();
    }
    let body = signature.strip_suffix('}').expect("a signature is a JSON object");
    format!("{body},\"{BESIDE}\": [{before}, {after}]}}")
}

/// The key of the frames beside.
const BESIDE: &str = "beside";

/// Whether `found` differs from `wanted` by nothing but the frames beside: some have come or gone since.
pub fn only_neighbours_differ(found: &str, wanted: &str) -> bool {
    keys_that_differ(found, wanted).is_some_and(|keys| keys == [BESIDE])
}

/// In words, where `found` differs from `wanted`.
pub fn difference(found: Option<&str>, wanted: &str) -> String {
    let Some(found) = found else { return "this program did not write it".to_owned() };
    match keys_that_differ(found, wanted) {
        Some(mut keys) => {
            keys.retain(|key| key != BESIDE); // it is no setting
            format!("its {} differed", keys.join(", "))
        }
        None => "its settings are not legible".to_owned(),
    }
}

/// None where one of both is not legible.
fn keys_that_differ(found: &str, wanted: &str) -> Option<Vec<String>> {
    let (Value::Object(found), Value::Object(wanted)) =
        (serde_json::from_str(found).ok()?, serde_json::from_str(wanted).ok()?)
    else {
        return None;
    };
    let mut keys = Vec::new();
    collect("", &found, &wanted, &mut keys);
    Some(keys)
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
    fn frames_that_have_come_are_told_from_other_settings() {
        let run = r#"{"a": 1, "temporal": 2}"#;
        let (end, amid) = (of_frame(run, 2, [2, 0]), of_frame(run, 2, [2, 2]));
        assert!(only_neighbours_differ(&end, &amid) && !only_neighbours_differ(&end, &end));
        assert!(!only_neighbours_differ(&end, &of_frame(r#"{"a": 2, "temporal": 2}"#, 2, [2, 2])));
        assert!(!only_neighbours_differ("?", &amid));
    }

    #[test]
    fn other_alphabets_are_escaped_and_read_again() {
        let text = ascii("{\"map\":\"Füße 🦶\"}");
        assert!(text.is_ascii());
        let read: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(read["map"], "Füße 🦶");
    }
}
