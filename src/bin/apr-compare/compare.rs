//! Results against their reference.

use std::path::{Path, PathBuf};

use apr::error::{Error, ErrorKind, Result};
use apr::image::Rgb;
use apr::io::{self, Beauty, Mapping, Picture, ReadOptions, RunFile};
use apr::metrics::{self, Scores};
use apr::report::png;

use crate::answer::complain;
use crate::{foreign, noise};

/// What to compare, and how to show it.
#[derive(clap::Args)]
pub struct CompareArguments {
    /// The picture to judge (EXR).
    result: PathBuf,
    /// What it should be (EXR).
    reference: PathBuf,
    /// Further pictures to judge, against the same reference.
    more: Vec<PathBuf>,
    /// Compare these channels instead of the colour that is recognised: those of color in every file, those of reference
    /// in the reference. CHANNELS is a list of channels, a layer, a part or a view.
    #[arg(long, value_name = "color|reference=CHANNELS")]
    map: Vec<Mapping>,
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
    /// Replace pictures that this program did not write, too.
    #[arg(long)]
    overwrite: bool,
}

/// What is compared, in the window that all files have.
struct Compared {
    window: [i64; 4],
    reference: Beauty,
    results: Vec<Beauty>,
}

/// Compares and answers with the table or the JSON.
///
/// # Errors
/// When a picture cannot be read, compared or written.
pub fn run(arguments: &CompareArguments) -> Result<String> {
    check_files(arguments)?;
    let paths: Vec<&Path> =
        std::iter::once(&arguments.result).chain(&arguments.more).map(PathBuf::as_path).collect();
    let compared = Compared::new(arguments, &paths)?;
    compared.notes(arguments, &paths).iter().for_each(|note| complain(&format!("note: {note}")));
    let (reference, noise) = compared.reference(arguments)?;
    let read = |result: &Beauty| result.read(compared.window);
    let results = compared.results.iter().map(read).collect::<Result<Vec<_>>>()?;
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
    if arguments.json {
        json(arguments, &paths, &compared, &scores, noise)
    } else {
        Ok(table(&paths, &scores, noise))
    }
}

impl Compared {
    fn new(arguments: &CompareArguments, paths: &[&Path]) -> Result<Self> {
        let [of_results, of_reference] = mapped(&arguments.map)?;
        let reference = Beauty::find(&arguments.reference, REFERENCE, of_reference.or(of_results))?;
        let found = paths.iter().map(|path| Beauty::find(path, COLOR, of_results));
        let results = found.collect::<Result<Vec<_>>>()?;
        let window = results
            .iter()
            .try_fold(reference.window(), |window, result| result.shared(&reference, window))?;
        Ok(Self { window, reference, results })
    }

    /// The reference's picture, and what its own noise adds to relMSE: none where it does not tell, or other pixels or
    /// channels are compared than it is read by, or it is a result itself, whose noise is no longer what it tells.
    fn reference(&self, arguments: &CompareArguments) -> Result<(Rgb, Option<f64>)> {
        let path = &arguments.reference;
        let plain = self.window == self.reference.window() && self.reference.noisy().is_empty();
        let denoised = || io::provenance(path).is_ok_and(|found| found.signature.is_some());
        let tells = plain && arguments.map.is_empty() && !denoised();
        // What is wrong with other channels than the colour's is no hindrance: then it is read alone.
        let whole = tells.then(|| Picture::read(path, &ReadOptions::default()).ok()).flatten();
        let frame = whole.map(|picture| picture.into_frame().1);
        let color = match &frame {
            Some(frame) => frame.color().clone(),
            None => self.reference.read(self.window)?,
        };
        metrics::finite(&color, "the reference").map_err(|e| e.in_file(path))?;
        let noise = frame.as_ref().map_or(Ok(None), noise::of)?;
        Ok((color, noise))
    }

    /// What is compared where that is not plain.
    fn notes(&self, arguments: &CompareArguments, paths: &[&Path]) -> Vec<String> {
        let results = paths.iter().zip(&self.results).map(|(&path, result)| (path, result, COLOR));
        let reference = (arguments.reference.as_path(), &self.reference, REFERENCE);
        let files: Vec<_> = results.chain([reference]).collect();
        let larger = files.iter().filter(|(_, file, _)| file.window() != self.window);
        let larger: Vec<String> =
            larger.map(|(path, file, _)| format!("{} has {}", path.display(), text(file.window()))).collect();
        let window = (!larger.is_empty()).then(|| {
            format!(
                "only the pixels that all have are compared, {}: {}",
                text(self.window),
                larger.join(", ")
            )
        });
        let unsure =
            files.iter().filter(|(_, file, _)| arguments.map.is_empty() && !file.others().is_empty());
        let unsure = unsure.map(|(path, file, role)| {
            let (channels, others) = (file.channels().join(", "), file.others().join("', '"));
            let path = path.display();
            format!("{path}: {channels} are compared; '{others}' could be the colour as well: choose by --map {role}=…")
        });
        let denoised =
            files.iter().filter(|(_, file, _)| arguments.map.is_empty() && !file.noisy().is_empty());
        let denoised = denoised.map(|(path, file, role)| {
            let (channels, noisy) = (file.channels().join(", "), file.noisy().join(","));
            let other = if *role == COLOR { REFERENCE } else { COLOR };
            format!(
                "{}: {channels} are compared, which the renderer may have denoised: the noisy picture is in {noisy}; \
                 compare it in a run of its own by --map {role}='{noisy}' --map {other}=…",
                path.display()
            )
        });
        window.into_iter().chain(unsure).chain(denoised).collect()
    }
}

/// What `--map` calls the picture of the results, and that of the reference.
const COLOR: &str = "color";
const REFERENCE: &str = "reference";

/// The channels that are mapped in all files, and those in the reference alone.
fn mapped(map: &[Mapping]) -> Result<[Option<&[String]>; 2]> {
    let mut found = [None; 2];
    for Mapping { name, channels } in map {
        let refuse = |what: &str, remedy: &str| {
            Err(Error::new(ErrorKind::Usage, format!("--map: '{name}' {what}")).remedy(remedy))
        };
        let is = |known: &str| name.eq_ignore_ascii_case(known);
        let Some(n) = [is(COLOR) || is("colour"), is(REFERENCE)].iter().position(|is| *is) else {
            return refuse(
                "is nothing that is compared",
                "give color=CHANNELS, as in color=albedo, and reference=CHANNELS where the reference calls them otherwise",
            );
        };
        if found[n].replace(channels.as_slice()).is_some() {
            return refuse("is mapped twice", "give each once");
        }
    }
    Ok(found)
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
    written.iter().try_for_each(|file| {
        io::check_ending_of(file.path, "png", "PNG")?;
        if !arguments.overwrite {
            foreign::check(file.path)?;
        }
        io::check_target(file.path)
    })
}

fn heat_maps(results: &[Rgb], reference: &Rgb) -> Result<Vec<u8>> {
    let errors =
        results.iter().map(|result| metrics::rel_mse(result, reference)).collect::<Result<Vec<_>>>()?;
    png::heat_maps(&errors.iter().map(|measure| &measure.plane).collect::<Vec<_>>())
}

fn table(paths: &[&Path], scores: &[Scores], noise: Option<f64>) -> String {
    let names: Vec<String> = paths.iter().map(|path| shown(path)).collect();
    let width = names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max("result".len());
    let mut text = format!(
        "{:width$}  {:>11}  {:>11}  {:>12}  {:>9}  {:>8}  {:>9}{}\n",
        "result",
        "RMSE",
        "relMSE",
        "rel. trimmed",
        "SMAPE",
        "SSIM",
        "energy",
        if noise.is_some() { "  relMSE less the reference's noise" } else { "" }
    );
    for (name, s) in names.iter().zip(scores) {
        text += &format!(
            "{name:width$}  {:11.6}  {:11.6}  {:12.6}  {:9.5}  {:8.5}  {:+8.3}%{}\n",
            s.rmse,
            s.rel_mse,
            s.trimmed_rel_mse,
            s.smape,
            s.ssim,
            100.0 * s.energy,
            noise.map_or_else(String::new, |noise| format!("  {:33.6}", s.rel_mse - noise))
        );
    }
    text
}

fn json(
    arguments: &CompareArguments,
    paths: &[&Path],
    compared: &Compared,
    scores: &[Scores],
    reference_noise: Option<f64>,
) -> Result<String> {
    #[derive(serde::Serialize)]
    struct Row<'a> {
        result: String,
        channels: &'a [String],
        #[serde(flatten)]
        scores: Scores,
    }
    #[derive(serde::Serialize)]
    struct Answer<'a> {
        reference: String,
        channels: &'a [String],
        /// x, y, width and height of what is compared.
        window: [i64; 4],
        /// What the reference's own noise adds to every `rel_mse`, where it tells.
        reference_noise: Option<f64>,
        results: Vec<Row<'a>>,
    }
    let rows = paths.iter().zip(&compared.results).zip(scores);
    let results = rows.map(|((path, result), &scores)| Row {
        result: shown(path),
        channels: result.channels(),
        scores,
    });
    apr::report::json(&Answer {
        reference: shown(&arguments.reference),
        channels: compared.reference.channels(),
        window: compared.window,
        reference_noise,
        results: results.collect(),
    })
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// A window as `--region` has it.
fn text(window: [i64; 4]) -> String {
    window.map(|number| number.to_string()).join(",")
}
