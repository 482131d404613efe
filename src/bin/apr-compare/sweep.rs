//! The sweep: every variant on every input, timed and judged.

use std::path::{Path, PathBuf};
use std::time::Instant;

use apr::denoise::Silent;
use apr::image::Rgb;
use apr::io::{self, Picture, ReadOptions, RunFile};
use apr::metrics;
use apr::report::sweep::{Input, Layer, Run, Sweep};
use apr::report::{self, page, png};
use apr::{Error, ErrorKind, Frame, Result};
use serde::Deserialize;

use crate::answer::complain;
use crate::foreign;
use crate::numbers::positive;
use crate::variants::{Variant, read_text, variants};
use crate::{noise, processor};

/// Show what accuracy costs in time: run many settings on renders of one scene, and write a page.
///
/// Writes index.html (complete in itself), sweep.json, the charts as SVG and the pictures as PNG.
#[derive(clap::Args)]
pub struct SweepArguments {
    /// Renders of one scene with different numbers of samples (EXR).
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// The same scene with so many samples that its own noise does not matter (EXR).
    #[arg(long, value_name = "FILE")]
    reference: PathBuf,
    /// The folder for the page; made when missing.
    #[arg(long, value_name = "FOLDER", default_value = "report")]
    out: PathBuf,
    /// Settings to try instead of the built-in ones: a JSON array of {"name": …, "method": …,
    /// "preset": …, "options": {…}}; all but the name may be left out.
    #[arg(long, value_name = "FILE.json")]
    variants: Option<PathBuf>,
    /// Results of other denoisers: a JSON array of {"name": …, "input": …, "picture": …, "seconds": …,
    /// "processor_seconds": …}; input one of those given here (others are left out and named), picture an EXR (relative to the JSON), both kinds of
    /// seconds may be left out.
    #[arg(long, value_name = "FILE.json")]
    rivals: Option<PathBuf>,
    /// Run each setting this often; the fastest run counts.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
    /// What one more sample of every pixel takes the renderer, for the table of equal times.
    #[arg(long, value_name = "SECONDS", value_parser = positive::<f64>, allow_negative_numbers = true)]
    sample_seconds: Option<f64>,
    /// Samples per pixel, where a single input's header lacks it.
    #[arg(long, value_name = "N", value_parser = positive::<f32>, allow_negative_numbers = true)]
    spp: Option<f32>,
    /// Replace files of these names in the folder that this program did not write, too.
    #[arg(long)]
    overwrite: bool,
}

/// Another denoiser's result.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Rival {
    name: String,
    input: PathBuf,
    picture: PathBuf,
    seconds: Option<f64>,
    processor_seconds: Option<f64>,
}

/// Runs the sweep, writes the page and answers with a short table.
///
/// # Errors
/// When an input cannot be read, a variant makes no sense, or the folder cannot be written.
pub fn run(arguments: &SweepArguments) -> Result<String> {
    let variants = variants(arguments.variants.as_deref())?;
    let rivals = rivals(arguments.rivals.as_deref())?;
    check_files(arguments, &variants, &rivals)?;
    tell_of_strangers(arguments, &rivals);
    make_folder(&arguments.out)?; // before hours of work, not after
    let reference_file = Picture::read(&arguments.reference, &ReadOptions::default())?;
    let reference = reference_file.frame().color();
    let read = ReadOptions { spp: arguments.spp, ..ReadOptions::default() };
    let inputs = names(&arguments.inputs)
        .zip(&arguments.inputs)
        .map(|(name, path)| {
            let picture = Picture::read(path, &read)?;
            let trial = Trial { name, path, frame: picture.frame(), reference };
            trial.input(&variants, &rivals, arguments.repeat).map_err(|error| error.in_file(path))
        })
        .collect::<Result<Vec<_>>>()?;
    let sweep = Sweep {
        reference: arguments.reference.display().to_string(),
        reference_noise: noise::of(reference_file.frame())?,
        inputs,
        sample_seconds: arguments.sample_seconds,
    };
    write(&sweep, &arguments.out)?;
    Ok(summary(&sweep, &arguments.out))
}

/// The inputs' file names, or their whole paths where two names are equal.
fn names(paths: &[PathBuf]) -> impl Iterator<Item = String> {
    let stems: Vec<_> = paths.iter().map(|path| path.file_stem().unwrap_or_default()).collect();
    let differ = stems.iter().enumerate().all(|(i, stem)| !stems[..i].contains(stem));
    let name = move |(path, stem): (&PathBuf, &std::ffi::OsStr)| {
        if differ { stem.to_string_lossy().into_owned() } else { path.display().to_string() }
    };
    paths.iter().zip(stems).map(name)
}

/// One input on trial.
struct Trial<'a> {
    name: String,
    path: &'a Path,
    frame: &'a Frame,
    reference: &'a Rgb,
}

impl Trial<'_> {
    fn input(&self, variants: &[Variant], rivals: &[Rival], repeat: u32) -> Result<Input> {
        let noisy = metrics::scores(self.frame.color(), self.reference)?;
        let layer = |name: &str, png| Layer { name: name.to_string(), png };
        let mut layers = vec![
            layer("reference", png::side_by_side(&[self.reference])?),
            layer("noisy", png::side_by_side(&[self.frame.color()])?),
        ];
        let mut runs = vec![];
        for variant in variants {
            runs.push(self.variant(variant, repeat, &mut layers)?);
        }
        for rival in rivals.iter().filter(|rival| io::is_same_file(&rival.input, self.path)) {
            let color = io::read_rgb(&rival.picture)?;
            let scores =
                metrics::scores(&color, self.reference).map_err(|error| error.in_file(&rival.picture))?;
            self.look(&rival.name, &color, &mut layers)?;
            let Rival { seconds, processor_seconds, .. } = *rival;
            runs.push(Run {
                name: rival.name.clone(),
                seconds,
                processor_seconds,
                scores,
                calibration: None,
            });
        }
        Ok(Input { name: self.name.clone(), spp: self.frame.spp().map(f64::from), noisy, runs, layers })
    }

    fn variant(&self, variant: &Variant, repeat: u32, layers: &mut Vec<Layer>) -> Result<Run> {
        let (mut seconds, mut processor_seconds) = (f64::INFINITY, None::<f64>);
        let mut denoised = None;
        for _ in 0..repeat {
            let (start, before) = (Instant::now(), processor::seconds());
            denoised = Some(variant.denoiser.denoise(self.frame, &Silent)?);
            seconds = seconds.min(start.elapsed().as_secs_f64());
            let spent = before.zip(processor::seconds()).map(|(before, after)| after - before);
            processor_seconds = [processor_seconds, spent].into_iter().flatten().reduce(f64::min);
        }
        let denoised = denoised.expect("every setting runs at least once");
        let calibrate = |mse| metrics::calibration(mse, &denoised.color, self.reference);
        let calibration = denoised.mse.as_ref().map(calibrate).transpose()?;
        self.look(&variant.name, &denoised.color, layers)?;
        let mut add = |what: &str, png| layers.push(Layer { name: format!("{}: {what}", variant.name), png });
        if let Some(mse) = &denoised.mse {
            let estimate = metrics::relative_mean(mse, self.reference);
            add("estimated error", png::heat_maps(&[&estimate])?);
        }
        if variant.denoiser.pipeline().is_some() {
            add("order", png::order_map(&denoised.order)?);
        }
        Ok(Run {
            name: variant.name.clone(),
            seconds: Some(seconds),
            processor_seconds,
            scores: metrics::scores(&denoised.color, self.reference)?,
            calibration,
        })
    }

    /// The layers that every result has.
    fn look(&self, name: &str, color: &Rgb, layers: &mut Vec<Layer>) -> Result<()> {
        let truth = metrics::rel_mse(color, self.reference)?.plane;
        let mut add = |name: String, png| layers.push(Layer { name, png });
        add(name.to_string(), png::side_by_side(&[color])?);
        add(format!("{name}: signed error"), png::signed_error(color, self.reference)?);
        add(format!("{name}: true error"), png::heat_maps(&[&truth])?);
        Ok(())
    }
}

fn rivals(path: Option<&Path>) -> Result<Vec<Rival>> {
    let Some(path) = path else { return Ok(vec![]) };
    let mut rivals: Vec<Rival> = serde_json::from_str(&read_text(path)?)
        .map_err(|e| Error::new(ErrorKind::Usage, format!("no list of rivals: {e}")).in_file(path))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    rivals.iter_mut().for_each(|rival| rival.picture = folder.join(&rival.picture));
    Ok(rivals)
}

/// Names the rivals that are of no input of this sweep: one list may be of many scenes, or a name mistaken.
fn tell_of_strangers(arguments: &SweepArguments, rivals: &[Rival]) {
    let is_stranger =
        |rival: &&Rival| !arguments.inputs.iter().any(|input| io::is_same_file(&rival.input, input));
    for Rival { name, input, .. } in rivals.iter().filter(is_stranger) {
        let list = arguments.rivals.as_deref().unwrap_or(Path::new("")).display();
        let input = input.display();
        complain(&format!(
            "note: {list}: rival '{name}' is left out: its input {input} is none of this sweep's; name it as on the \
             command line"
        ));
    }
}

/// Checks that the page, its charts and its pictures, whose names follow from those of inputs, variants and rivals,
/// replace nothing that is read, nothing of somebody else's, and not one another.
fn check_files(arguments: &SweepArguments, variants: &[Variant], rivals: &[Rival]) -> Result<()> {
    let is_twice = |(n, input): &(usize, &PathBuf)| {
        arguments.inputs[..*n].iter().any(|other| io::is_same_file(other, input))
    };
    if let Some((_, input)) = arguments.inputs.iter().enumerate().find(is_twice) {
        let error = Error::new(ErrorKind::Usage, "is given twice among the inputs").in_file(input);
        return Err(error.remedy("name every render once; --repeat runs every setting several times"));
    }
    let charts = names(&arguments.inputs)
        .flat_map(|name| ["time", "calibration"].map(|chart| format!("{chart}-{}.svg", plain(&name))));
    let pages = ["index.html", "sweep.json", "samples.svg"].map(str::to_owned);
    let written = charts.chain(pages).map(|name| ("a part of the page".to_owned(), name));
    let written = written.chain(pictures(arguments, variants, rivals));
    let written: Vec<_> = written.map(|(role, name)| (role, arguments.out.join(name))).collect();
    let files = arguments.inputs.iter().chain([&arguments.reference]).chain(&arguments.variants);
    let read = files.chain(&arguments.rivals).chain(rivals.iter().map(|rival| &rival.picture));
    io::check_apart(
        read.map(|path| RunFile { role: "what the sweep reads", path }),
        written.iter().map(|(role, path)| RunFile { role, path }),
    )
    .map_err(|error| {
        error.remedy(
            "give inputs, variants and rivals names that differ in letters or numbers, and the page a folder of its own \
             by --out",
        )
    })?;
    if arguments.overwrite {
        return Ok(());
    }
    written.iter().try_for_each(|(_, path)| foreign::check(path))
}

/// What the pictures that show each render and result are called, and their files.
fn pictures(arguments: &SweepArguments, variants: &[Variant], rivals: &[Rival]) -> Vec<(String, String)> {
    let of_input = |(input, path): (String, &PathBuf)| {
        let rivals = rivals.iter().filter(|rival| io::is_same_file(&rival.input, path));
        let results = variants.iter().map(|variant| &variant.name).chain(rivals.map(|rival| &rival.name));
        let shown = ["reference", "noisy"].into_iter().chain(results.map(String::as_str));
        let picture = |name: &str| (format!("the picture of '{name}'"), picture_file(&input, name));
        shown.map(picture).collect::<Vec<_>>()
    };
    names(&arguments.inputs).zip(&arguments.inputs).flat_map(of_input).collect()
}

fn picture_file(input: &str, layer: &str) -> String {
    format!("pictures/{}-{}.png", plain(input), plain(layer))
}

/// Makes the page's folder and the one of its pictures, where they are missing, and tries whether they take files.
fn make_folder(folder: &Path) -> Result<()> {
    let pictures = folder.join("pictures");
    std::fs::create_dir_all(&pictures).map_err(|error| {
        let error = Error::new(ErrorKind::Misplaced, format!("the folder cannot be made: {error}"));
        error.remedy("name another one by --out").in_file(&pictures)
    })?;
    [folder.join("index.html"), pictures.join("any.png")].iter().try_for_each(io::check_target)
}

fn write(sweep: &Sweep, folder: &Path) -> Result<()> {
    let put = |name: &str, text: &str| io::write_bytes(folder.join(name), text.as_bytes());
    put("index.html", &page::page(sweep))?;
    put("sweep.json", &report::report(sweep)?)?;
    put("samples.svg", &page::spp_chart(sweep).svg())?;
    let charts = page::time_charts(sweep).into_iter().zip(page::calibration_charts(sweep));
    for (input, (time, calibration)) in sweep.inputs.iter().zip(charts) {
        let name = plain(&input.name);
        put(&format!("time-{name}.svg"), &time.svg())?;
        put(&format!("calibration-{name}.svg"), &calibration.svg())?;
        for layer in &input.layers {
            io::write_bytes(folder.join(picture_file(&input.name, &layer.name)), &layer.png)?;
        }
    }
    Ok(())
}

/// `name` with `-` for whatever file names do not bear.
fn plain(name: &str) -> String {
    name.chars().map(|letter| if letter.is_alphanumeric() { letter } else { '-' }).collect()
}

fn summary(sweep: &Sweep, folder: &Path) -> String {
    let mut text = String::new();
    for input in &sweep.inputs {
        text += &format!("{}: relMSE {:.6} before\n", input.name, input.noisy.rel_mse);
        for (run, front) in input.runs.iter().zip(input.pareto_front()) {
            let seconds = run.seconds.map_or("        –".to_string(), |s| format!("{s:8.3}s"));
            let calibration = run.calibration.as_ref().map_or(String::new(), |c| {
                format!("  estimated/true {:.2}  rank correlation {:.2}", c.ratio, c.rank_correlation)
            });
            let mark = if front { '*' } else { ' ' };
            text += &format!(
                "{mark} {:24}  {seconds}  relMSE {:.6}{calibration}\n",
                run.name, run.scores.rel_mse
            );
        }
    }
    text + &format!("the page is {}\n", folder.join("index.html").display())
}
