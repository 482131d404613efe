//! `apr-trace scene.json out.exr`: renders a scene with everything the denoiser can use.

#![allow(clippy::print_stdout, clippy::print_stderr)] // a program talks to its user

#[path = "../apr-denoise/generate.rs"]
mod generate;
mod rounds;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use apr::adaptive::AdaptiveOptions;
use apr::io::{FrameHeader, check_target, read_rgb, write_bytes, write_frame};
use apr::trace::{AnimationFrame, FeatureMode, Plan, RenderOptions, Rendered, Renderer, Samples, Scene};
use apr::{Error, ErrorKind, Result};
use clap::{Parser, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};

/// Path tracer that makes the denoiser's inputs and references.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Args {
    /// The scene, a JSON file (fixtures/scenes/README.md describes every field).
    scene: PathBuf,
    /// The EXR file to write; not needed with --plan.
    #[arg(required_unless_present = "plan")]
    out: Option<PathBuf>,
    /// Samples per pixel.
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..))]
    spp: u32,
    /// Seed of the random numbers: the same seed gives the same bits.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Where features are recorded.
    #[arg(long, value_enum, default_value_t = Features::FirstHit)]
    features: Features,
    /// Also record what a glossy first surface shows (albedo2, normal2, depth2).
    #[arg(long)]
    second_hit: bool,
    /// Also write one layer for each light group; they sum to the colour.
    #[arg(long)]
    light_groups: bool,
    /// Render frame K of the M that the scene's motion is cut into, with noise of its own and motion vectors
    /// (layers motionPrevious and motionNext).
    #[arg(long, value_name = "K/M", value_parser = frame)]
    frame: Option<(u32, u32)>,
    /// The share of the frame's time during which the shutter is open.
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, requires = "frame")]
    shutter: f32,
    /// Samples of each pixel from the first channel of this EXR file, instead of --spp.
    #[arg(long, value_name = "EXR", conflicts_with = "reference")]
    spp_map: Option<PathBuf>,
    /// Render N samples per pixel in passes, keeping a checkpoint (OUT.checkpoint) from which a killed
    /// run goes on.
    #[arg(long, value_name = "N", conflicts_with = "spp", value_parser = clap::value_parser!(u32).range(1..))]
    reference: Option<u32>,
    /// Spend the samples where the picture needs them: a uniform round, then rounds by the estimated error
    /// of the denoised picture. Draws --spp samples per pixel on the average and writes their numbers as
    /// layer sampleCount. Keeps no checkpoint.
    #[arg(long, conflicts_with_all = ["reference", "spp_map"])]
    adaptive: bool,
    /// Rounds of --adaptive, the uniform one included.
    #[arg(long, default_value_t = AdaptiveOptions::default().rounds, requires = "adaptive",
          value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
    /// Stop --adaptive when the estimated mean relative squared error is at most E.
    #[arg(long, value_name = "E", requires = "adaptive", allow_negative_numbers = true)]
    target_error: Option<f32>,
    /// Seconds between checkpoints.
    #[arg(long, default_value_t = 30.0, requires = "reference")]
    checkpoint_every: f64,
    /// Threads to use; all cores by default. The picture does not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    threads: Option<u32>,
    /// Print which effects the scene calls for, and why, and stop.
    #[arg(long)]
    plan: bool,
    /// Write what was done, as JSON.
    #[arg(long, value_name = "JSON")]
    report: Option<PathBuf>,
    /// Print nothing but errors.
    #[arg(long)]
    quiet: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Features {
    /// Colour alone.
    None,
    /// At the first surface.
    FirstHit,
    /// At the first surface that is no perfect mirror or clear glass.
    FirstRough,
}

impl Args {
    fn options(&self) -> Result<RenderOptions> {
        let features = match self.features {
            Features::None => FeatureMode::None,
            Features::FirstHit => FeatureMode::FirstHit,
            Features::FirstRough => FeatureMode::FirstRough,
        };
        let frame = self.frame.map(|(number, count)| AnimationFrame::new(number, count, self.shutter));
        Ok(RenderOptions {
            spp: self.reference.unwrap_or(self.spp),
            seed: self.seed,
            features,
            second_hit: self.second_hit,
            light_groups: self.light_groups,
            frame: frame.transpose()?,
        })
    }
}

/// `K/M`.
fn frame(text: &str) -> std::result::Result<(u32, u32), String> {
    let numbers = text.split_once('/').and_then(|(k, m)| Some((k.parse().ok()?, m.parse().ok()?)));
    numbers.ok_or_else(|| "expected K/M, as in 3/24".to_owned())
}

fn main() -> ExitCode {
    let args = generate::parse::<Args>();
    match run(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.kind().exit_code())
        }
    }
}

fn run(args: &Args) -> Result<()> {
    let scene = Scene::load(&args.scene)?;
    let options = args.options()?;
    let Some(out) = args.out.as_ref().filter(|_| !args.plan) else {
        print_plan(&Plan::new(&scene, &options));
        return Ok(());
    };
    check_target(out)?; // before hours of work, not after
    let threads = args.threads.unwrap_or(0) as usize;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| Error::new(ErrorKind::Internal, format!("no threads: {error}")))?;
    let start = Instant::now();
    let mut renderer = Renderer::new(&scene, &options);
    let rounds = if args.adaptive {
        let adaptive = AdaptiveOptions {
            spp: args.spp,
            rounds: args.rounds,
            target_error: args.target_error,
            ..AdaptiveOptions::default()
        };
        Some(pool.install(|| rounds::run(&mut renderer, &adaptive, args.quiet))?)
    } else {
        pool.install(|| render(args, &options, &scene, &mut renderer))?;
        None
    };
    let rendered = renderer.finish()?;
    let counts = renderer.film().sample_map();
    let further = [("sampleCount.Y", &counts)];
    let further = if args.spp_map.is_some() || args.adaptive { &further[..] } else { &[] };
    write_frame(out, &rendered.frame, &FrameHeader { seed: Some(args.seed), further })?;
    finish(args, out, &rendered, rounds.as_ref(), start.elapsed())
}

fn print_plan(plan: &Plan) {
    for effect in &plan.effects {
        let mark = if effect.used { "yes" } else { "no" };
        println!("{:<14} {mark:<4} {}", effect.name, effect.reason);
    }
}

/// Draws all samples, in passes that the progress can be told between.
fn render(args: &Args, options: &RenderOptions, scene: &Scene, renderer: &mut Renderer) -> Result<()> {
    if let Some(path) = &args.spp_map {
        let map = read_rgb(path)?;
        let counts: Vec<u32> = map[0].data().iter().map(|&n| n.round().max(0.0) as u32).collect();
        return renderer.pass(Samples::Map(&counts)).map_err(|error| error.in_file(path));
    }
    let mut checkpoint = Checkpoint::new(args, options, scene);
    let mut done = checkpoint.restore(renderer)?;
    let mut progress = Progress::new(args.quiet, options.spp, done);
    // Few enough passes to cost nothing, enough of them for a progress to be seen.
    let pass = options.spp.div_ceil(50).max(1);
    while done < options.spp {
        let count = pass.min(options.spp - done);
        renderer.pass(Samples::Uniform(count))?;
        done += count;
        progress.set(done);
        if done < options.spp {
            checkpoint.save(renderer)?;
        }
    }
    checkpoint.remove();
    Ok(())
}

/// The state of a long render beside its output. None is kept of others.
struct Checkpoint {
    path: Option<PathBuf>,
    every: Duration,
    saved: Instant,
    /// What must be the same for a checkpoint to be continued.
    key: Vec<u8>,
}

impl Checkpoint {
    fn new(args: &Args, options: &RenderOptions, scene: &Scene) -> Self {
        let out = args.out.as_ref().filter(|_| args.reference.is_some());
        let path = out.map(|out| PathBuf::from(format!("{}.checkpoint", out.display())));
        let what = RenderOptions { spp: 0, ..options.clone() };
        let key = format!("apr-trace checkpoint 1\n{:016x}\n{what:?}\n", scene.fingerprint()).into_bytes();
        let every = Duration::from_secs_f64(args.checkpoint_every.max(0.0));
        Self { path, every, saved: Instant::now(), key }
    }

    /// Takes up the film of an earlier run, if there is one; samples per pixel done by it.
    fn restore(&self, renderer: &mut Renderer) -> Result<u32> {
        let Some(path) = self.path.as_ref().filter(|path| path.exists()) else { return Ok(0) };
        let unreadable = |what: String| {
            let error = Error::new(ErrorKind::Unreadable, what).in_file(path);
            error.remedy("remove it to start anew")
        };
        let bytes = std::fs::read(path).map_err(|error| unreadable(format!("cannot be read: {error}")))?;
        let film = bytes.strip_prefix(self.key.as_slice());
        let film = film.ok_or_else(|| unreadable("belongs to another scene, seed or options".into()))?;
        renderer
            .film_mut()
            .restore(film)
            .map_err(|error| error.in_file(path).remedy("remove it to start anew"))?;
        Ok(renderer.film().counts()[0].drawn)
    }

    fn save(&mut self, renderer: &Renderer) -> Result<()> {
        let Some(path) = self.path.as_ref().filter(|_| self.saved.elapsed() >= self.every) else {
            return Ok(());
        };
        write_bytes(path, &[self.key.clone(), renderer.film().to_bytes()].concat())?;
        self.saved = Instant::now();
        Ok(())
    }

    fn remove(&self) {
        if let Some(path) = &self.path {
            let _ = std::fs::remove_file(path); // there is none after a short run
        }
    }
}

/// A bar on a terminal, plain lines elsewhere.
struct Progress {
    bar: Option<ProgressBar>,
    quiet: bool,
    total: u32,
    told: u32,
}

impl Progress {
    fn new(quiet: bool, total: u32, done: u32) -> Self {
        let style = ProgressStyle::with_template("{bar:40} {pos}/{len} samples per pixel, {eta} left");
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| ProgressBar::new(total.into()));
        let bar = bar.and_then(|bar| Some(bar.with_style(style.ok()?).with_position(done.into())));
        Self { bar, quiet, total, told: 0 }
    }

    fn set(&mut self, done: u32) {
        let percent = (100 * u64::from(done) / u64::from(self.total)) as u32;
        match &self.bar {
            Some(bar) => bar.set_position(done.into()),
            None if !self.quiet && percent >= self.told + 5 => {
                println!("progress {percent}");
                self.told = percent;
            }
            None => {}
        }
    }
}

fn finish(
    args: &Args,
    out: &Path,
    rendered: &Rendered,
    rounds: Option<&rounds::Rounds>,
    elapsed: Duration,
) -> Result<()> {
    let seconds = elapsed.as_secs_f64();
    if rendered.dropped > 0 {
        eprintln!(
            "warning: {} of {} samples were not finite and were dropped",
            rendered.dropped, rendered.samples
        );
    }
    if !args.quiet {
        let rate = rendered.samples as f64 / seconds / 1e6;
        println!("{}: {} samples in {seconds:.2} s, {rate:.2} M/s", out.display(), rendered.samples);
    }
    let Some(path) = &args.report else { return Ok(()) };
    let report = serde_json::json!({
        "scene": args.scene,
        "output": out,
        "seed": args.seed,
        "samples": rendered.samples,
        "dropped": rendered.dropped,
        "seconds": seconds,
        "adaptive": rounds,
        "plan": rendered.plan,
        "constantFeatures": rendered.constant_features,
    });
    write_bytes(path, format!("{report:#}\n").as_bytes())
}
