//! Results against their reference.

use std::path::{Path, PathBuf};

use apr::Result;
use apr::image::Rgb;
use apr::io::{self, RunFile};
use apr::metrics::{self, Scores};
use apr::report::png;

/// What to compare, and how to show it.
#[derive(clap::Args)]
pub struct CompareArguments {
    /// The picture to judge (EXR).
    result: PathBuf,
    /// What it should be (EXR).
    reference: PathBuf,
    /// Further pictures to judge, against the same reference.
    more: Vec<PathBuf>,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
    /// Write a heat map of each result's relMSE, left to right, on a logarithmic scale from 1e-5
    /// (black) to 10 (pale yellow).
    #[arg(long, value_name = "FILE.png")]
    heatmap: Option<PathBuf>,
    /// Write the results and, rightmost, the reference. Tone map: cut to 0…1, sRGB curve.
    #[arg(long, value_name = "FILE.png")]
    side_by_side: Option<PathBuf>,
}

/// Compares and answers with the table or the JSON.
///
/// # Errors
/// When a picture cannot be read, compared or written.
pub fn run(arguments: &CompareArguments) -> Result<String> {
    check_files(arguments)?;
    let reference = io::read_rgb(&arguments.reference)?;
    metrics::finite(&reference, "the reference").map_err(|e| e.in_file(&arguments.reference))?;
    let paths: Vec<&Path> =
        std::iter::once(&arguments.result).chain(&arguments.more).map(PathBuf::as_path).collect();
    let results = paths.iter().map(io::read_rgb).collect::<Result<Vec<_>>>()?;
    let scores = paths
        .iter()
        .zip(&results)
        .map(|(path, result)| metrics::scores(result, &reference).map_err(|e| e.in_file(path)))
        .collect::<Result<Vec<_>>>()?;
    if let Some(path) = &arguments.heatmap {
        io::write_bytes(path, &heat_maps(&results, &reference)?)?;
    }
    if let Some(path) = &arguments.side_by_side {
        let pictures: Vec<&Rgb> = results.iter().chain([&reference]).collect();
        io::write_bytes(path, &png::side_by_side(&pictures)?)?;
    }
    if arguments.json { json(arguments, &paths, &scores) } else { Ok(table(&paths, &scores)) }
}

/// Checks, before any work, that pictures can be written and destroy nothing.
fn check_files(arguments: &CompareArguments) -> Result<()> {
    let results = std::iter::once(&arguments.result).chain(&arguments.more);
    let read = results.map(|path| RunFile { role: "a result", path });
    let read = read.chain([RunFile { role: "the reference", path: &arguments.reference }]);
    let heat_map = arguments.heatmap.iter().map(|path| RunFile { role: "the heat map", path });
    let side_by_side =
        arguments.side_by_side.iter().map(|path| RunFile { role: "the picture of --side-by-side", path });
    let written: Vec<RunFile> = heat_map.chain(side_by_side).collect();
    io::check_apart(read, written.iter().copied())
        .map_err(|error| error.remedy("give what is written a name of its own"))?;
    written.iter().try_for_each(|file| io::check_target(file.path))
}

fn heat_maps(results: &[Rgb], reference: &Rgb) -> Result<Vec<u8>> {
    let errors =
        results.iter().map(|result| metrics::rel_mse(result, reference)).collect::<Result<Vec<_>>>()?;
    png::heat_maps(&errors.iter().map(|measure| &measure.plane).collect::<Vec<_>>())
}

fn table(paths: &[&Path], scores: &[Scores]) -> String {
    let names: Vec<String> = paths.iter().map(|path| shown(path)).collect();
    let width = names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max("result".len());
    let mut text = format!(
        "{:width$}  {:>11}  {:>11}  {:>12}  {:>9}  {:>8}  {:>9}\n",
        "result", "RMSE", "relMSE", "rel. trimmed", "SMAPE", "SSIM", "energy"
    );
    for (name, s) in names.iter().zip(scores) {
        text += &format!(
            "{name:width$}  {:11.6}  {:11.6}  {:12.6}  {:9.5}  {:8.5}  {:+8.3}%\n",
            s.rmse,
            s.rel_mse,
            s.trimmed_rel_mse,
            s.smape,
            s.ssim,
            100.0 * s.energy
        );
    }
    text
}

fn json(arguments: &CompareArguments, paths: &[&Path], scores: &[Scores]) -> Result<String> {
    #[derive(serde::Serialize)]
    struct Row {
        result: String,
        #[serde(flatten)]
        scores: Scores,
    }
    #[derive(serde::Serialize)]
    struct Answer {
        reference: String,
        results: Vec<Row>,
    }
    let results =
        paths.iter().zip(scores).map(|(path, &scores)| Row { result: shown(path), scores }).collect();
    apr::report::json(&Answer { reference: shown(&arguments.reference), results })
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}
