//! The method and its options from a file and from `--set`, whatever they are called.

use apr::baseline::{Denoiser, Method};
use apr::error::{Error, ErrorKind, Result};
use serde_json::Value;

use crate::arguments::Arguments;

const EXAMPLE: &str = "write a JSON object, such as {\"max_order\": 2}";

/// The method with its options: its own or the preset's, then the file's, then each `--set` in turn.
///
/// # Errors
/// `Usage` when an option is not known or out of its range, or a baseline is given a preset; `Unreadable`
/// when the file is.
pub fn denoiser(arguments: &Arguments) -> Result<Denoiser> {
    let method = arguments.method;
    let mut options = match arguments.preset {
        None => Denoiser::new(method),
        Some(preset) if method == Method::Apr => Denoiser::Apr(preset()),
        Some(_) => {
            let what = format!("the method {} has no presets", method.name());
            return Err(Error::new(ErrorKind::Usage, what).remedy("leave --preset or --method out"));
        }
    };
    if let Some(path) = &arguments.options {
        let text = std::fs::read_to_string(path).map_err(|error| {
            Error::new(ErrorKind::Unreadable, format!("cannot be read: {error}"))
                .remedy("--options takes the name of a JSON file: check it and who may read it")
                .in_file(path)
        })?;
        let given = serde_json::from_str(&text).map_err(|error| usage(&error).in_file(path))?;
        let Value::Object(given) = given else {
            return Err(Error::new(ErrorKind::Usage, "is no JSON object of options")
                .remedy(EXAMPLE)
                .in_file(path));
        };
        for (key, new) in given {
            options = options.with(&key, new).map_err(|error| error.in_file(path))?;
        }
    }
    for setting in &arguments.set {
        let (key, text) = setting.split_once('=').ok_or_else(|| {
            Error::new(ErrorKind::Usage, format!("'{setting}' sets nothing")).remedy("write --set KEY=VALUE")
        })?;
        // What is no JSON is a text without its quotes.
        let new = serde_json::from_str(text).unwrap_or_else(|_| Value::from(text));
        options = options.with(key, new)?;
    }
    options.check()?;
    if arguments.temporal > 0 && options.pipeline().is_none() {
        let what = format!("--temporal is not for the method {}", method.name());
        return Err(Error::new(ErrorKind::Usage, what).remedy("leave --method out"));
    }
    Ok(options)
}

fn usage(error: &serde_json::Error) -> Error {
    Error::new(ErrorKind::Usage, format!("the options make no sense: {error}")).remedy(EXAMPLE)
}
