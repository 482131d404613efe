//! Pictures and pages about results, as bytes or text; writing them to disk is [`crate::io`]'s work.

pub mod chart;
pub mod page;
pub mod png;
pub mod sweep;

use serde::Serialize;
use serde_json::Value;

use crate::error::{Error, ErrorKind, Result};

/// What everything made here says that it was made by, so that it is known again.
pub const PROGRAM: &str = env!("CARGO_PKG_NAME");

/// Whether `bytes` are a picture, a page, a chart or a report of this project.
pub fn is_own(bytes: &[u8]) -> bool {
    /// Marks stand before anything that may be long.
    const HEAD: usize = 1024;
    let head = &bytes[..bytes.len().min(HEAD)];
    let bears = |mark: &str| head.windows(mark.len()).any(|window| window == mark.as_bytes());
    let is_report = || serde_json::from_slice::<Value>(bytes).is_ok_and(|json| json["program"] == PROGRAM);
    [png::MARK, page::MARK, chart::MARK].into_iter().any(bears) || is_report()
}

/// The JSON of `value`, an object, that bears the program's name.
///
/// # Errors
/// As [`json`].
pub fn report(value: &impl Serialize) -> Result<String> {
    #[derive(Serialize)]
    struct Marked<'a, T> {
        program: &'static str,
        #[serde(flatten)]
        value: &'a T,
    }
    json(&Marked { program: PROGRAM, value })
}

/// `value` as indented JSON with a closing line break; numbers that are not finite become `null`.
///
/// # Errors
/// When the value cannot be expressed, such as a map whose keys are no strings.
pub fn json(value: &impl Serialize) -> Result<String> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Plane;

    #[test]
    fn what_is_made_here_is_known_again_and_nothing_else() {
        let png = png::order_map(&Plane::filled(3, 2, 1.0)).unwrap();
        let sweep = sweep::Sweep {
            reference: "r".into(),
            reference_noise: None,
            inputs: vec![],
            sample_seconds: None,
        };
        let (page, chart) = (page::page(&sweep), page::spp_chart(&sweep).svg());
        let (report, plain) = (report(&sweep).unwrap(), json(&sweep).unwrap());
        for own in [&png[..], page.as_bytes(), chart.as_bytes(), report.as_bytes()] {
            assert!(is_own(own) && !is_own(&own[1024.min(own.len() / 2)..]));
        }
        let mut foreign = Vec::new();
        let picture = image::RgbImage::new(3, 2);
        picture.write_to(&mut std::io::Cursor::new(&mut foreign), image::ImageFormat::Png).unwrap();
        for other in [&foreign[..], b"", plain.as_bytes(), b"<!doctype html><html>", b"<svg></svg>"] {
            assert!(!is_own(other), "{}", String::from_utf8_lossy(other));
        }
    }
}
