//! `--inspect`: what was found and what would be run.

use std::fmt::Write;

use apr::Options;
use apr::error::{Error, ErrorKind, Result};
use apr::io::{Layout, Picture, RoleLayout};
use serde::Serialize;

/// All that is known before the work begins.
#[derive(Serialize)]
struct Inspection<'a> {
    layout: &'a Layout,
    size: [usize; 2],
    would_run: Vec<&'static str>,
    options: &'a Options,
}

/// The answer to `--inspect`, as JSON or for people.
pub fn describe(picture: &Picture, options: &Options, json: bool) -> Result<String> {
    let frame = picture.frame();
    let would_run = would_run(picture);
    if json {
        let size = [frame.width(), frame.height()];
        let inspection = Inspection { layout: picture.layout(), size, would_run, options };
        return serde_json::to_string_pretty(&inspection)
            .map_err(|error| Error::new(ErrorKind::Internal, error.to_string()));
    }
    Ok(text(picture.layout(), (frame.width(), frame.height()), &would_run))
}

/// What of the pipeline this input calls for.
fn would_run(picture: &Picture) -> Vec<&'static str> {
    let frame = picture.frame();
    let variance = match (frame.color_var_of_mean(), frame.halves()) {
        (Some(_), _) => "fits weighted by the variance",
        (None, Some(_)) => "fits weighted by a variance estimated from the half buffers",
        (None, None) => "fits weighted by a variance estimated from the picture",
    };
    let halves = frame.halves().map(|_| "checks across half buffers");
    let features = match frame.features().is_empty() {
        false => "regression on the features",
        true => "regression on the pixel's position alone",
    };
    ["repair of NaN and infinities", "outlier removal"]
        .into_iter()
        .chain(halves)
        .chain([features, variance])
        .collect()
}

fn text(layout: &Layout, (width, height): (usize, usize), would_run: &[&str]) -> String {
    let mut text = String::new();
    let mut line = |words: String| writeln!(text, "{words}").expect("a string takes all");
    for file in &layout.files {
        line(file.path.clone());
        for part in &file.parts {
            let [x, y, w, h] = part.data_window;
            let name = part.name.as_deref().map_or(String::new(), |name| format!(" '{name}'"));
            let tiled = if part.tiled { ", tiled" } else { "" };
            line(format!(
                "  part{name}: {w}×{h} at {x},{y}, {}{tiled}, {} channels",
                part.compression,
                part.channels.len()
            ));
        }
    }
    layout.half.iter().for_each(|half| line(format!("{half}: the other half")));
    let how = if layout.forced { "as told" } else { "recognised" };
    let spp = layout.samples_per_pixel.map_or("unknown".to_owned(), |n| n.to_string());
    line(format!("renderer: {:?} ({how}); {width}×{height}; samples per pixel: {spp}", layout.renderer));
    line("roles:".to_owned());
    layout.roles.iter().for_each(|role| line(role_line(role)));
    if !layout.missing.is_empty() {
        line(format!("done without: {}", layout.missing.join(", ")));
    }
    line(format!("would run: {}", would_run.join("; ")));
    layout.notes.iter().for_each(|note| line(format!("note: {note}")));
    layout.warnings.iter().for_each(|warning| line(format!("warning: {warning}")));
    text.trim_end().to_owned()
}

fn role_line(role: &RoleLayout) -> String {
    let range = match (role.min, role.max) {
        (Some(min), Some(max)) => format!("{min} … {max}"),
        _ => "nothing finite".to_owned(),
    };
    let broken = match role.non_finite {
        0 => String::new(),
        n => format!(", {n} not finite"),
    };
    format!("  {:12} {:24} {:32} {range}{broken}", role.role, role.statistic, role.channels.join(", "))
}
