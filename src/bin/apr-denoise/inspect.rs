//! `--inspect`: what was found and what would be run.

use std::collections::BTreeMap;
use std::fmt::Write;

use apr::baseline::Denoiser;
use apr::error::{Error, ErrorKind, Result};
use apr::io::{Deviation, Layout, PartLayout, Picture, ReadOptions, Renderer, RoleLayout, SumCheck};
use serde::Serialize;

use crate::arguments::Arguments;
use crate::frames::{FrameSet, counted};
use crate::plan::Plan;

/// All that is known before the work begins.
#[derive(Serialize)]
struct Inspection<'a> {
    /// The sequence; the rest is that of its first frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    sequence: Option<Sequence>,
    layout: &'a Layout,
    size: [usize; 2],
    would_run: Vec<String>,
    method: &'static str,
    options: &'a Denoiser,
}

/// The frames that were found.
#[derive(Serialize)]
struct Sequence {
    count: usize,
    frames: String,
    missing: String,
}

/// The answer to `--inspect`, as JSON or for people.
///
/// # Errors
/// When the first frame cannot be read.
pub fn describe(plan: &Plan, arguments: &Arguments, denoiser: &Denoiser) -> Result<String> {
    let Some(job) = plan.jobs.first() else {
        return Err(Error::new(ErrorKind::Unreadable, "no frame has an input").in_file(&arguments.input));
    };
    let sequence = job.frame.map(|_| Sequence {
        count: plan.jobs.len(),
        frames: plan.jobs.iter().filter_map(|job| job.frame).collect::<FrameSet>().to_string(),
        missing: plan.missing.iter().filter_map(|(job, _)| job.frame).collect::<FrameSet>().to_string(),
    });
    // What there is, whether or not this run has a use for it.
    let picture = Picture::read(&job.input, &ReadOptions { motion: true, ..arguments.read_options(job) })?;
    let layout = &wanting(picture.layout(), denoiser);
    let frame = picture.frame();
    let would_run = would_run(&picture, denoiser);
    let (width, height) = (frame.width(), frame.height());
    if arguments.json {
        let (size, method) = ([width, height], denoiser.method().name());
        let inspection = Inspection { sequence, layout, size, would_run, method, options: denoiser };
        return Ok(apr::report::json(&inspection)?.trim_end().to_owned());
    }
    let frames = sequence.map_or_else(String::new, |Sequence { count, frames, missing }| {
        let missing = if missing.is_empty() { missing } else { format!("; missing: {missing}") };
        format!("{}: {frames}{missing}\n", counted(count, "frame"))
    });
    Ok(frames + &text(layout, (width, height), &would_run))
}

/// `layout` with only that named as missing which the method would use.
pub fn wanting(layout: &Layout, denoiser: &Denoiser) -> Layout {
    layout.wanting(|kind| denoiser.fits(kind), denoiser.crosses_halves())
}

/// What of the pipeline this input and these options call for.
fn would_run(picture: &Picture, denoiser: &Denoiser) -> Vec<String> {
    let Some(options) = denoiser.pipeline() else {
        let method = denoiser.method();
        let method = format!("{}: {}", method.name(), method.publication());
        return vec!["repair of NaN and infinities".to_owned(), method];
    };
    let frame = picture.frame();
    let variance = match (frame.color_var_of_mean(), frame.halves()) {
        (Some(_), _) => "the variance of the file",
        (None, Some(_)) => "a variance estimated from the half buffers",
        (None, None) => "a variance estimated from the picture",
    };
    let used = frame.features().iter().filter(|feature| options.features.contains(&feature.kind));
    let features: Vec<&str> =
        std::iter::once("the pixel's position").chain(used.map(|feature| feature.name.as_str())).collect();
    let components = frame.aovs().len();
    let mut steps = vec!["repair of NaN and infinities".to_owned()];
    if options.outliers.enabled {
        steps.push("outlier removal".to_owned());
    }
    steps.push(format!(
        "{} stages of regression on {} with {variance}",
        options.stages.len(),
        features.join(", ")
    ));
    if options.coarse {
        steps.push("the same of the picture at half its resolution, for what it knows better".to_owned());
    }
    if components > 0 {
        steps.push(format!("the same operator on {components} components of the beauty"));
    }
    steps
}

/// How well components sum to the beauty, in one line.
pub fn sum_line(sum: &SumCheck) -> String {
    let told = |of: &Deviation| {
        let broken = match of.not_finite {
            0 => String::new(),
            n => format!(", {n} samples not finite"),
        };
        format!("{:.2e} (relative RMS {:.2e}{broken})", of.largest, of.relative_rms)
    };
    let after = sum.after.as_ref().map_or(String::new(), |after| format!(" -> {}", told(after)));
    let layers = sum.layers.join(" + ");
    format!("{}: {layers} less the beauty, largest deviation {}{after}", sum.set, told(&sum.before))
}

fn text(layout: &Layout, (width, height): (usize, usize), would_run: &[String]) -> String {
    let mut text = String::new();
    let mut line = |words: String| writeln!(text, "{words}").expect("a string takes all");
    for file in &layout.files {
        line(file.path.clone());
        for part in &file.parts {
            let [x, y, w, h] = part.data_window;
            let name = part.name.as_deref().map_or(String::new(), |name| format!(" '{name}'"));
            let tiled = if part.tiled { ", tiled" } else { "" };
            line(format!(
                "  part{name}: {w}×{h} at {x},{y}, {}{tiled}, {}",
                part.compression,
                counted(part.channels.len(), "channel")
            ));
            layers_of(part).into_iter().for_each(|layer| line(format!("    {layer}")));
        }
    }
    layout.half.iter().for_each(|half| line(format!("{half}: the other half")));
    let renderer = match (layout.renderer, layout.forced) {
        (renderer, true) => format!("{renderer:?} (as told)"),
        (Renderer::Plain, false) => "none recognised, channels by their usual names".to_owned(),
        (renderer, false) => format!("{renderer:?} (recognised)"),
    };
    let spp = layout.samples_per_pixel.map_or("unknown".to_owned(), |n| n.to_string());
    line(format!("renderer: {renderer}; {width}×{height}; samples per pixel: {spp}"));
    line("roles:".to_owned());
    layout.roles.iter().for_each(|role| line(role_line(role)));
    layout.sums.iter().for_each(|sum| line(sum_line(sum)));
    if !layout.missing.is_empty() {
        line(format!("done without: {}", layout.missing.join(", ")));
    }
    line(format!("would run: {}", would_run.join("; ")));
    layout.notes.iter().for_each(|note| line(format!("note: {note}")));
    layout.warnings.iter().for_each(|warning| line(format!("warning: {warning}")));
    text.trim_end().to_owned()
}

/// A part's channels, those of a layer in one line.
fn layers_of(part: &PartLayout) -> Vec<String> {
    let (mut layers, mut places) = (Vec::<(&str, Vec<&str>)>::new(), BTreeMap::new());
    for channel in &part.channels {
        let name = channel.rsplit_once(": ").map_or(channel.as_str(), |(name, _)| name);
        let (layer, component) = name.rsplit_once('.').unwrap_or(("", name));
        let place = *places.entry(layer).or_insert(layers.len());
        if place == layers.len() {
            layers.push((layer, Vec::new()));
        }
        layers[place].1.push(component);
    }
    let line = |(layer, components): (&str, Vec<&str>)| match (layer, components.join(", ")) {
        ("", names) => names,
        (layer, names) => format!("{layer}: {names}"),
    };
    layers.into_iter().map(line).collect()
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
