//! What a result was made by and of, in an attribute of its file: so that a run that goes on by
//! `--skip-existing` never leaves a sequence of two kinds, and no result of what has changed since.

use apr::baseline::Denoiser;
use apr::error::Result;
use apr::report;
use serde_json::{Map, Value, json};

use crate::arguments::Arguments;
use crate::made_of::MadeOf;

/// Everything but the content of files that the result depends on, as one line of ASCII JSON.
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

/// The same of one frame: what its files hold changes the result too, and so do the frames beside.
pub fn of_frame(signature: &str, made_of: &MadeOf) -> String {
    let body = signature.strip_suffix('}').expect("a signature is a JSON object");
    let list = |numbers: &Vec<String>| format!("[\"{}\"]", numbers.join("\", \""));
    let lists =
        |frames: &Vec<Vec<String>>| format!("[{}]", frames.iter().map(list).collect::<Vec<_>>().join(", "));
    let beside = made_of.beside.as_ref().map_or_else(String::new, |[before, after]| {
        format!(",\"{BESIDE}\": [{}, {}]", lists(before), lists(after))
    });
    format!("{body},\"{INPUTS}\": {}{beside}}}", list(&made_of.inputs))
}

/// The keys of what stands for the content of files.
const INPUTS: &str = "inputs";
const BESIDE: &str = "beside";

/// How a result that was found differs from the one that is wanted.
#[derive(Debug, PartialEq, Eq)]
pub enum Difference {
    Nothing,
    /// It was made of files with another content, or of other frames beside.
    Content,
    /// In words, what else differs.
    Settings(String),
}

/// Holds the signature that was `found` against the one that is `wanted`. A result `in_place` has replaced what it was
/// made of.
pub fn difference(found: Option<&str>, wanted: &str, in_place: bool) -> Difference {
    let Some(found) = found else {
        return Difference::Settings("this program did not write it".to_owned());
    };
    let Some(keys) = keys_that_differ(found, wanted) else {
        return Difference::Settings("its settings are not legible".to_owned());
    };
    let is_content = |key: &str| [INPUTS, BESIDE].contains(&key.split('.').next().unwrap_or_default());
    let (content, settings): (Vec<&str>, Vec<&str>) =
        keys.iter().map(String::as_str).partition(|key| is_content(key));
    if !settings.is_empty() {
        let mut names: Vec<String> = settings.into_iter().map(named).collect();
        names.dedup();
        return Difference::Settings(format!("with another {}", names.join(", another ")));
    }
    let replaced = |key: &&str| in_place && [INPUTS, "inputs.0"].contains(key);
    match content.iter().find(|key| !replaced(key)) {
        None => Difference::Nothing,
        Some(_) if in_place => {
            Difference::Settings("a file of --half or --with has changed since".to_owned())
        }
        Some(_) => Difference::Content,
    }
}

/// What the user knows the setting of this key by.
fn named(key: &str) -> String {
    match (key.split_once('.').unwrap_or((key, "")), key) {
        (("options", option), _) if !option.is_empty() => format!("--set {option}"),
        (_, "program" | "version") => key.to_owned(),
        ((option, _), _) => format!("--{option}"),
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
        compare(&format!("{before}{key}"), found.get(key), wanted.get(key), keys);
    }
}

fn compare(key: &str, found: Option<&Value>, wanted: Option<&Value>, keys: &mut Vec<String>) {
    match (found, wanted) {
        (a, b) if a == b => {}
        (Some(Value::Object(a)), Some(Value::Object(b))) => collect(&format!("{key}."), a, b, keys),
        (Some(Value::Array(a)), Some(Value::Array(b))) if a.len() == b.len() => {
            let pairs = a.iter().zip(b).enumerate();
            pairs.for_each(|(n, (a, b))| compare(&format!("{key}.{n}"), Some(a), Some(b), keys));
        }
        _ => keys.push(key.to_owned()),
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
        let (a, b) = (
            r#"{"version": 1, "map": [1, 2], "temporal": 0, "options": {"x": 1, "y": [2, 3]}}"#,
            r#"{"version": 2, "map": [3, 4], "temporal": 1, "options": {"x": 2, "y": [2, 4], "z": 0}}"#,
        );
        let told = |found, wanted| match difference(found, wanted, false) {
            Difference::Settings(words) => words,
            other => panic!("{other:?}"),
        };
        let all =
            "--map, another --set x, another --set y.1, another --set z, another --temporal, another version";
        assert_eq!(told(Some(a), b), format!("with another {all}"));
        assert_eq!(told(None, b), "this program did not write it");
        assert_eq!(told(Some("?"), b), "its settings are not legible");
    }

    #[test]
    fn other_content_is_told_from_other_settings() {
        let frame = |run: &str, inputs: &[&str], beside: Option<[&[&str]; 2]>| {
            let numbers = |all: &[&str]| all.iter().map(|&number| number.to_owned()).collect::<Vec<_>>();
            let frames = |all: &[&str]| all.iter().map(|number| numbers(&[number])).collect::<Vec<_>>();
            of_frame(run, &MadeOf { inputs: numbers(inputs), beside: beside.map(|sides| sides.map(frames)) })
        };
        let run = r#"{"a": 1}"#;
        let (old, new) = (frame(run, &["1", "2"], None), frame(run, &["3", "2"], None));
        let half = frame(run, &["1", "4"], None);
        let compare = |found: &str, wanted: &str, in_place| difference(Some(found), wanted, in_place);
        assert_eq!(compare(&old, &old, false), Difference::Nothing);
        assert_eq!(compare(&old, &new, false), Difference::Content);
        assert_eq!(compare(run, &new, false), Difference::Content, "of an earlier version");
        assert_eq!(compare(&old, &new, true), Difference::Nothing, "it replaced its input");
        assert!(matches!(compare(&old, &half, true), Difference::Settings(_)));
        let [end, amid] = [&["5"][..], &["5", "6"]].map(|after| frame(run, &["1"], Some([&[], after])));
        assert_eq!(compare(&end, &amid, false), Difference::Content, "a frame has come");
        let other = frame(r#"{"a": 2}"#, &["1"], Some([&[], &[]]));
        assert!(matches!(compare(&end, &other, false), Difference::Settings(_)));
    }

    #[test]
    fn other_alphabets_are_escaped_and_read_again() {
        let text = ascii("{\"map\":\"Füße 🦶\"}");
        assert!(text.is_ascii());
        let read: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(read["map"], "Füße 🦶");
    }
}
