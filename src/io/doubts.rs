//! What of a picture says nothing, does not fit the rest or may not be what the user means: refused, left out or told.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use exr::meta::attribute::IntegerBounds;

use super::assemble::Remarks;
use super::bounds;
use super::channels::{Renderer, Role, Statistic, VarianceKind};
use super::document::Document;
use super::layers::{Channel, buffer_prefix, stem};
use super::names::{full_names, told_name};
use super::picture::ReadOptions;
use super::region::{numbers, told};
use super::roles::{Choice, color_of};
use super::siblings::{buffers_beside, is_buffer};
use super::statistics::Statistics;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::FeatureKind;

/// Refuses a further file that leaves pixels of the colour without a value: 0 would pass for one.
pub(super) fn check_windows(documents: &[Document], choices: &[Choice], window: IntegerBounds) -> Result<()> {
    let channels = choices.iter().flat_map(|choice| &choice.channels).filter(|channel| channel.file > 0);
    for channel in channels {
        let other = documents[channel.file].headers()[channel.at.part].data_window();
        if !covers(other, window) {
            let [other, window] = [other, window].map(told);
            let what = format!("its data window {other} does not cover that of the picture, {window}");
            return Err(Error::new(ErrorKind::Lacking, what)
                .remedy("give a file of the same frame and region")
                .in_channel(full_names(documents, *channel).swap_remove(0))
                .in_file(documents[channel.file].path()));
        }
    }
    Ok(())
}

/// Whether `outer` has all pixels of `inner`.
fn covers(outer: IntegerBounds, inner: IntegerBounds) -> bool {
    let ([x, y, width, height], [ix, iy, inner_width, inner_height]) = (numbers(outer), numbers(inner));
    x <= ix && y <= iy && x + width >= ix + inner_width && y + height >= iy + inner_height
}

/// Does without variances that say nothing, and names them: those of which no value can be one, and the colour's
/// where it is 0 at every pixel though the picture is not the same everywhere. That a renderer writes who was not
/// asked for one; believed, it would keep all noise.
pub(super) fn leave_out_variances(
    choices: &mut Vec<Choice>,
    documents: &[Document],
    statistics: &BTreeMap<Channel, Statistics>,
    remarks: &mut Remarks,
) {
    let range = |channel: &Channel| statistics[channel].range();
    let varies = color_of(choices).iter().filter_map(range).any(|(least, most)| least < most);
    let says_nothing = |choice: &Choice| {
        let most = || choice.channels.iter().filter_map(range).map(|(_, most)| most);
        let is_variance = matches!(choice.target.statistic, Statistic::Variance(_));
        let all_zero = choice.target.role == Role::Color && varies && most().all(|most| most <= 0.0);
        is_variance && (most().any(|most| most < 0.0) || (all_zero && most().next().is_some()))
    };
    let (left_out, kept): (Vec<_>, _) = std::mem::take(choices).into_iter().partition(says_nothing);
    *choices = kept;
    for choice in left_out {
        let negative = choice.channels.iter().filter_map(range).any(|(_, most)| most < 0.0);
        let mut names: Vec<String> =
            choice.channels.iter().map(|channel| told_name(documents, *channel)).collect();
        names.dedup();
        let why =
            if negative { "below 0 at every pixel" } else { "0 at every pixel though the colour varies" };
        let names = names.join(", ");
        remarks.warnings.push(format!("{names}: {why}: no variance, it is done without"));
    }
}

/// Names the further files of which nothing is used; `documents` are those and the first.
pub(super) fn warn_of_useless(documents: &[Document], useful: &BTreeSet<usize>, remarks: &mut Remarks) {
    for (_, document) in documents.iter().enumerate().skip(1).filter(|(file, _)| !useful.contains(file)) {
        remarks.warnings.push(format!(
            "{}: none of its layers plays a role; give it one by --map, or leave the file out of --with",
            document.path().display()
        ));
    }
}

/// Tells of what the user says about variances where there is none to say it of.
pub(super) fn warn_of_needless(options: &ReadOptions, choices: &[Choice], remarks: &mut Remarks) {
    let has = |is: fn(&Statistic) -> bool| choices.iter().any(|choice| is(&choice.target.statistic));
    let variances = has(|statistic| matches!(statistic, Statistic::Variance(_)));
    let needless = match options.variance_kind {
        None => false,
        Some(VarianceKind::Halves) => {
            !has(|it| matches!(it, Statistic::HalfA | Statistic::HalfB)) && options.half.is_none()
        }
        Some(_) => !variances,
    };
    if needless {
        remarks.warnings.push(
            "--variance-kind is of no use: nothing that it could be said of was found; name it by --map variance=… or \
             --map halfA=…"
                .to_owned(),
        );
    }
    if options.spp.is_some() && !variances {
        remarks
            .notes
            .push("--spp changes no variance: none was found; name it by --map variance=…".to_owned());
    }
}

/// Names the channels that say nothing. Infinite depths and positions are misses and say something.
pub(super) fn warn_of_broken(
    choices: &[Choice],
    documents: &[Document],
    statistics: &BTreeMap<Channel, Statistics>,
    remarks: &mut Remarks,
) {
    let misses = |choice: &Choice| {
        matches!(choice.target.role, Role::Feature(FeatureKind::Depth | FeatureKind::Position))
            && matches!(choice.target.statistic, Statistic::Mean | Statistic::HalfA | Statistic::HalfB)
    };
    let mut broken = BTreeSet::new();
    for choice in choices {
        let says_nothing = |channel: &&Channel| {
            let statistics = &statistics[channel];
            statistics.range().is_none() && !(misses(choice) && statistics.misses > 0)
        };
        broken.extend(choice.channels.iter().filter(says_nothing));
    }
    if broken.is_empty() {
        return;
    }
    let names: Vec<String> = broken.iter().map(|channel| told_name(documents, *channel)).collect();
    remarks.warnings.push(format!(
        "{}: NaN or infinite at every pixel; a channel of the colour or a component becomes black, all else is \
         done without",
        names.join(", ")
    ));
}

/// A wrong layer that is taken for the colour looks like this; so does a black frame.
pub(super) fn warn_of_darkness(
    choices: &[Choice],
    documents: &[Document],
    statistics: &BTreeMap<Channel, Statistics>,
    remarks: &mut Remarks,
) {
    let color = color_of(choices);
    let ranges: Option<Vec<_>> = color.iter().map(|channel| statistics[channel].range()).collect();
    if ranges.is_none_or(|ranges| ranges.iter().any(|(_, most)| *most > 0.0)) {
        return;
    }
    let names: Vec<String> = color.iter().map(|channel| told_name(documents, *channel)).collect();
    remarks.warnings.push(format!(
        "{}: nowhere above 0, and taken for the colour: if the picture is not black, name its channels by --map color=…",
        names.join(", ")
    ));
}

/// Tells which roles come from a part whose pixels are not the colour's.
pub(super) fn note_windows(
    documents: &[Document],
    choices: &[Choice],
    window: IntegerBounds,
    remarks: &mut Remarks,
) {
    for choice in choices {
        let other =
            |channel: &&Channel| documents[channel.file].headers()[channel.at.part].data_window() != window;
        if let Some(channel) = choice.channels.iter().find(other) {
            remarks.notes.push(format!(
                "{}: its data window is not the colour's; 0 stands where it does not reach",
                told_name(documents, *channel)
            ));
        }
    }
}

pub(super) fn note_bounds(
    choices: &[Choice],
    statistics: &BTreeMap<Channel, Statistics>,
    remarks: &mut Remarks,
) {
    for choice in choices.iter().filter(|choice| choice.target.statistic == Statistic::Mean) {
        let Role::Feature(kind) = choice.target.role else { continue };
        let statistics: Vec<Statistics> = choice.channels.iter().map(|channel| statistics[channel]).collect();
        remarks.notes.extend(bounds::told(&choice.target.feature, kind, &statistics));
    }
}

pub(super) fn note_components(found: &[String], remarks: &mut Remarks) {
    if !found.is_empty() {
        let mut told = BTreeSet::new(); // one may be of several sums
        let names: Vec<&str> = found.iter().map(String::as_str).filter(|name| told.insert(*name)).collect();
        remarks.notes.push(format!(
            "passing through as they are: '{}'; --aov auto denoises them with the beauty, so that what sums to it still does",
            names.join("', '")
        ));
    }
}

pub(super) fn note_other_colors(others: &[String], remarks: &mut Remarks) {
    if !others.is_empty() {
        remarks.notes.push(format!(
            "'{}' could be the colour as well and passes through; choose it by --map color=…",
            others.join("', '")
        ));
    }
}

/// A renderer that writes one file per buffer leaves no mark, but its other files may lie there.
pub(super) fn note_buffers_beside(path: &Path, remarks: &mut Remarks) {
    let (name, _) = stem(path);
    for (profile, renderer) in Renderer::NAMES.iter().filter(|(_, r)| r.writes_one_file_per_buffer()) {
        let prefix = buffer_prefix(&name, *renderer);
        let is_color = name.len() > prefix.len() && is_buffer(&name[prefix.len()..], *renderer);
        if is_color && !buffers_beside(path, *renderer).is_empty() {
            remarks
                .notes
                .push(format!("further buffers lie beside the file: --profile {profile} reads them"));
        }
    }
}
