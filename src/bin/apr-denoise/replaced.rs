//! What a result may replace: what this program wrote, and its own input once. Any other picture is somebody's render, and
//! a report replaces reports alone.

use std::path::Path;

use apr::error::{Error, ErrorKind, Result};
use apr::io::{self, Provenance};

use crate::arguments::Arguments;
use crate::foreign;
use crate::frames::FrameSet;
use crate::plan::Job;

/// Checks that no picture is lost which this program did not write, and that none is denoised in its own place again: a
/// requeued job would leave frames of two kinds. What the file holds besides, such as the other eye, is no hindrance.
///
/// # Errors
/// `Usage` when a result, a sampling map or a report would take its place, `Lacking` when an input is such a result.
pub fn check(jobs: &[Job], arguments: &Arguments) -> Result<()> {
    let (in_place, elsewhere): (Vec<&Job>, Vec<&Job>) = jobs.iter().partition(|job| job.is_in_place());
    let inputs = in_place.into_iter().map(|job| (job, job.input.as_path()));
    let is_done = |(job, input): &(&Job, &Path)| {
        // What is cut off is told by whoever reads it, and so is what lacks the channels that are asked for.
        io::provenance(input).is_ok_and(|found| found.whole && is_result(&found))
            && io::holds_result(input, &arguments.read_options(job)).unwrap_or(false)
    };
    refuse(again, inputs.filter(is_done))?;
    let outputs = elsewhere.into_iter().map(|job| (job, job.output.as_path()));
    refuse(lost, outputs.filter(|(_, output)| is_strange(output, is_result)))?;
    let maps = jobs.iter().filter_map(|job| Some((job, job.sampling_map.as_deref()?)));
    refuse(lost, maps.filter(|(_, map)| is_strange(map, is_sampling_map)))?;
    let reports = jobs.iter().filter_map(|job| Some((job, job.report_file()?)));
    refuse(lost, reports.filter(|(_, report)| foreign::is_foreign(report)))?;
    arguments.sequence_report.as_deref().map_or(Ok(()), foreign::check)
}

/// The same of the picture of regions.
///
/// # Errors
/// As [`check`]; and when it would take the place of a region.
pub fn check_merged(output: &Path) -> Result<()> {
    let region = io::provenance(output).is_ok_and(|found| is_result(&found) && found.region.is_some());
    if region {
        return Err(Error::new(ErrorKind::Usage, "is a region itself, and the picture would take its place")
            .remedy("name the picture first, as in `apr-denoise merge whole.exr top.exr bottom.exr`, or give --overwrite")
            .in_file(output));
    }
    if is_strange(output, is_result) { Err(lost(output, "")) } else { Ok(()) }
}

/// The error of the first of these files, which tells the frames of all.
fn refuse<'a>(
    error: fn(&Path, &str) -> Error,
    mut files: impl Iterator<Item = (&'a Job, &'a Path)>,
) -> Result<()> {
    let Some((first, path)) = files.next() else { return Ok(()) };
    let frames: FrameSet = files.map(|(job, _)| job).chain([first]).filter_map(|job| job.frame).collect();
    Err(error(path, &frames.among_others()))
}

fn again(path: &Path, frames: &str) -> Error {
    let what =
        format!("is denoised already by this program, and would be once more in its own place{frames}");
    Error::new(ErrorKind::Lacking, what)
        .remedy("give --skip-existing to leave it and go on with the others, the render itself, or --overwrite to denoise it again")
        .in_file(path)
}

fn lost(path: &Path, frames: &str) -> Error {
    Error::new(ErrorKind::Usage, format!("is there already, and this program did not write it{frames}"))
        .remedy("name the result otherwise, or give --overwrite to lose what is there; a sequence is written 'shot.####.exr', in quotes")
        .in_file(path)
}

/// Whether a picture is there and is none of this program's `own`.
fn is_strange(path: &Path, own: fn(&Provenance) -> bool) -> bool {
    io::check_replaced(path, own).is_err()
}

fn is_result(found: &Provenance) -> bool {
    found.signature.is_some()
}

fn is_sampling_map(found: &Provenance) -> bool {
    found.channels == [io::DENSITY]
}
