//! `apr-trace scene.json out.exr`: renders a scene with everything the denoiser can use.

#[path = "../apr-denoise/answer.rs"]
mod answer;
mod checkpoint;
#[path = "../apr-denoise/failure.rs"]
mod failure;
#[path = "../apr-denoise/foreign.rs"]
mod foreign;
#[path = "../apr-denoise/frames.rs"]
#[allow(dead_code, reason = "the place for one frame's number is all that is wanted here")]
mod frames;
#[path = "../apr-denoise/generate.rs"]
mod generate;
#[path = "../apr-denoise/pattern.rs"]
#[allow(dead_code, reason = "the place for one frame's number is all that is wanted here")]
mod pattern;
mod progress;
mod rounds;
#[path = "../apr-denoise/signals.rs"]
mod signals;
mod stop;
#[path = "../apr-denoise/threads.rs"]
mod threads;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use answer::{complain, print};
use apr::adaptive::AdaptiveOptions;
use apr::error::{Error, ErrorKind, Result, TARGET_NOT_MET};
use apr::io::{
    FrameHeader, RunFile, SampleMap, check_apart, check_ending, check_replaced, check_target,
    read_sample_map, write_bytes, write_frame,
};
use apr::sampling::counts;
use apr::trace::{AnimationFrame, FeatureMode, Plan, RenderOptions, Rendered, Renderer, Samples, Scene};
use checkpoint::Checkpoint;
use clap::{Parser, ValueEnum};
use pattern::Pattern;
use progress::Progress;

/// Path tracer that makes the denoiser's inputs and references.
#[derive(Debug, Parser)]
#[command(name = "apr-trace", version, after_help = EXIT_CODES)]
struct Args {
    /// The scene, a JSON file (docs/SCENES.md describes every field).
    scene: PathBuf,
    /// The EXR file to write; not needed with --plan. Replaces an earlier render, but no other picture (see --overwrite).
    #[arg(required_unless_present = "plan")]
    out: Option<PathBuf>,
    /// Samples per pixel [default: 16].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
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
    /// (layers motionPrevious and motionNext). K takes the place of #### in the names of what is written.
    #[arg(long, value_name = "K/M", value_parser = frame)]
    frame: Option<(u32, u32)>,
    /// The share of the frame's time during which the shutter is open.
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, requires = "frame")]
    shutter: f32,
    /// Samples of each pixel from this EXR file. Their numbers, instead of --spp, are its channel sampleCount.Y, its only
    /// channel, or R; a density.Y, as apr-denoise --sampling-map writes it, is multiplied by --spp. A pixel of 0 samples
    /// is NaN.
    #[arg(long, value_name = "EXR", conflicts_with = "reference")]
    spp_map: Option<PathBuf>,
    /// Render N samples per pixel in passes, keeping a checkpoint (OUT.checkpoint) from which a killed
    /// run goes on; one that is told to stop keeps all its samples.
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
    /// Stop --adaptive when the estimated mean relative squared error is at most E, and end with 10 where it is not.
    #[arg(long, value_name = "E", requires = "adaptive", allow_negative_numbers = true)]
    target_error: Option<f32>,
    /// Seconds between checkpoints, as near as a pass over all pixels allows.
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, requires = "reference")]
    checkpoint_every: f64,
    /// Use this many threads, but no more than there are cores, or than 8 where those are fewer [default: one per core].
    /// The picture does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    threads: Option<u32>,
    /// Print which effects the scene calls for, and why, and stop.
    #[arg(long)]
    plan: bool,
    /// Write what was done, as JSON.
    #[arg(long, value_name = "JSON")]
    report: Option<PathBuf>,
    /// Replace pictures and reports that this program did not write, too.
    #[arg(long)]
    overwrite: bool,
    /// Print nothing but errors.
    #[arg(long, short)]
    quiet: bool,
}

/// Samples per pixel where none are asked for.
const SPP: u32 = 16;

const EXIT_CODES: &str = "Exit codes:
  0    done
  2    usage: an option or argument makes no sense, the picture cannot go where it is to go (there is no such folder,
       it is a folder or write-protected), a picture would be lost
  3    the scene, a file of it, the map of samples or the checkpoint is missing, damaged, or not supported
  4    the map of samples lacks what is needed
  5    the picture or the report cannot be written: the disk is full, or its server is away
  10   done, but the estimated error is above --target-error
  70   a defect of this program
  129  hung up (SIGHUP)
  130  interrupted (SIGINT)
  143  told to stop (SIGTERM)";

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
    /// Gives the names of what is written the frame's number.
    ///
    /// # Errors
    /// `Usage` when they have a place for it and there is none.
    fn put_frame_in(&mut self) -> Result<()> {
        for path in [&mut self.out, &mut self.report].into_iter().flatten() {
            let Some(pattern) = Pattern::parse(path) else { continue };
            let Some((frame, _)) = self.frame else {
                let what = "has a place for the frame's number, and there is none";
                let error = Error::new(ErrorKind::Usage, what).in_file(path);
                return Err(error.remedy("give --frame K/M, or name it without #, @@, %d, $F and <frame>"));
            };
            *path = pattern.path(i32::try_from(frame).unwrap_or(i32::MAX));
        }
        Ok(())
    }

    fn options(&self) -> Result<RenderOptions> {
        let features = match self.features {
            Features::None => FeatureMode::None,
            Features::FirstHit => FeatureMode::FirstHit,
            Features::FirstRough => FeatureMode::FirstRough,
        };
        let frame = self.frame.map(|(number, count)| AnimationFrame::new(number, count, self.shutter));
        Ok(RenderOptions {
            spp: self.reference.or(self.spp).unwrap_or(SPP),
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
    let mut args = generate::parse::<Args>(&[]);
    signals::clean_up_when_stopped();
    failure::told(|| {
        args.put_frame_in()?;
        run(&args)
    })
}

fn run(args: &Args) -> Result<ExitCode> {
    let scene = Scene::load(&args.scene)?;
    let options = args.options()?;
    let Some(out) = args.out.as_ref().filter(|_| !args.plan) else {
        return print_plan(&Plan::new(&scene, &options)).map(|()| ExitCode::SUCCESS);
    };
    check_files(args, &scene, out)?; // before hours of work, not after
    threads::start(args.threads)?;
    let start = Instant::now();
    let mut renderer = Renderer::new(&scene, &options)?;
    let (rounds, taken_up) = if args.adaptive {
        let adaptive = AdaptiveOptions {
            spp: options.spp,
            rounds: args.rounds,
            target_error: args.target_error,
            ..AdaptiveOptions::default()
        };
        (Some(rounds::run(&mut renderer, &adaptive, args.quiet)?), 0)
    } else {
        (None, render(args, &options, &scene, &mut renderer)?)
    };
    let rendered = renderer.finish()?;
    let counts = renderer.film().sample_map();
    let further = [("sampleCount.Y", &counts)];
    let further = if args.spp_map.is_some() || args.adaptive { &further[..] } else { &[] };
    write_frame(out, &rendered.frame, &FrameHeader { seed: Some(args.seed), further })?;
    checkpoint::remove(args);
    let drawn = Drawn { all: rendered.samples, now: rendered.samples - taken_up, time: start.elapsed() };
    finish(args, out, &rendered, rounds.as_ref(), &drawn)?;
    let missed = rounds.is_some_and(|rounds| rounds.target_met == Some(false));
    Ok(if missed { ExitCode::from(TARGET_NOT_MET) } else { ExitCode::SUCCESS })
}

/// Checks that every file can be written and destroys nothing that is read, nor another one.
fn check_files(args: &Args, scene: &Scene, out: &Path) -> Result<()> {
    check_ending(out)?;
    let file = |role| move |path| RunFile { role, path };
    let checkpoint = checkpoint::path(args);
    let read = std::iter::once(&args.scene).map(|path| file("the scene")(path.as_path()));
    let read = read.chain(scene.files().iter().map(|path| file("a file of the scene")(path)));
    let read = read.chain(args.spp_map.as_deref().map(file("the map of samples")));
    let report = args.report.as_deref().map(file("the report"));
    let beside = report.into_iter().chain(checkpoint.as_deref().map(file("the checkpoint")));
    let written: Vec<RunFile> = std::iter::once(file("the picture")(out)).chain(beside).collect();
    check_apart(read, written.iter().copied())
        .map_err(|error| error.remedy("give what is written a name of its own"))?;
    if !args.overwrite {
        // What is no checkpoint of this render is refused by whoever takes it up.
        check_replaced(out, |found| found.is_traced).map_err(|error| {
            error.remedy("name what is written otherwise, or give --overwrite to lose what is there")
        })?;
        args.report.as_deref().map_or(Ok(()), foreign::check)?;
    }
    written.iter().try_for_each(|file| check_target(file.path))
}

fn print_plan(plan: &Plan) -> Result<()> {
    plan.effects.iter().try_for_each(|effect| {
        let mark = if effect.used { "yes" } else { "no" };
        print(&format!("{:<14} {mark:<4} {}", effect.name, effect.reason))
    })
}

/// Draws all samples, in passes that the progress can be told between. How many an earlier run had drawn.
fn render(args: &Args, options: &RenderOptions, scene: &Scene, renderer: &mut Renderer) -> Result<u64> {
    if let Some(path) = &args.spp_map {
        renderer.pass(Samples::Map(&mapped(path, args.spp, scene)?))?;
        return Ok(0);
    }
    let mut checkpoint = Checkpoint::new(args, options, scene);
    let mut done = checkpoint.restore(renderer, options.spp)?;
    let taken_up = renderer.film().drawn();
    let mut progress = Progress::new(args.quiet, options.spp, done);
    // Few enough passes to cost nothing, enough of them for a progress to be seen and for checkpoints at their times.
    let (mut pass, most) = (1, options.spp.div_ceil(50));
    while done < options.spp {
        let (count, start) = (pass.min(options.spp - done), Instant::now());
        renderer.pass(Samples::Uniform(count))?;
        done += count;
        progress.set(done);
        pass = next_pass(pass, start.elapsed(), checkpoint.pass_time()).min(most);
        if done < options.spp {
            checkpoint.save_at_times(renderer);
        }
    }
    checkpoint.save(renderer); // a picture that cannot be written costs no second render then
    Ok(taken_up)
}

/// The samples of each pixel that the map at `path` asks for.
fn mapped(path: &Path, spp: Option<u32>, scene: &Scene) -> Result<Vec<u32>> {
    let refuse = |what: &str, remedy: &str| {
        Err(Error::new(ErrorKind::Usage, what).in_file(path).remedy(remedy.to_owned()))
    };
    match (read_sample_map(path, scene.size())?, spp) {
        (SampleMap::Counts(counts), None) => Ok(counts),
        (SampleMap::Counts(_), Some(_)) => refuse(
            "holds the numbers of samples themselves",
            "leave --spp out, or call the channel density.Y",
        ),
        (SampleMap::Density(density), Some(spp)) => {
            counts(&density, spp).map_err(|error| error.in_file(path))
        }
        (SampleMap::Density(_), None) => refuse(
            "holds a density of samples, 1 on the average, and not their numbers",
            "give the samples per pixel of this pass by --spp N: the density is multiplied by it",
        ),
    }
}

/// Samples of the next pass after one of `count` that `took` this long: twice as many until a pass takes the time that
/// is `wanted`.
fn next_pass(count: u32, took: Duration, wanted: Duration) -> u32 {
    match took {
        _ if took < wanted / 2 => count.saturating_mul(2),
        _ if took > wanted => (count / 2).max(1),
        _ => count,
    }
}

/// Samples over all pixels, and what those of this run took.
struct Drawn {
    all: u64,
    now: u64,
    time: Duration,
}

fn finish(
    args: &Args,
    out: &Path,
    rendered: &Rendered,
    rounds: Option<&rounds::Rounds>,
    drawn: &Drawn,
) -> Result<()> {
    let seconds = drawn.time.as_secs_f64();
    if rendered.dropped > 0 {
        let (dropped, all) = (rendered.dropped, rendered.samples);
        complain(&format!("warning: {dropped} of {all} samples were not finite and were dropped"));
    }
    if let Some(path) = &args.report {
        let report = serde_json::json!({
            "program": apr::report::PROGRAM,
            "scene": args.scene.display().to_string(),
            "output": out.display().to_string(),
            "seed": args.seed,
            "samples": drawn.all,
            "samplesOfThisRun": drawn.now,
            "dropped": rendered.dropped,
            "seconds": seconds,
            "adaptive": rounds,
            "plan": rendered.plan,
            "constantFeatures": rendered.constant_features,
        });
        write_bytes(path, format!("{report:#}\n").as_bytes())?;
    }
    if args.quiet {
        return Ok(());
    }
    let rate = drawn.now as f64 / seconds / 1e6;
    let before = match drawn.all - drawn.now {
        0 => String::new(),
        before => format!(" after {before} of an earlier run"),
    };
    print(&format!("{}: {} samples in {seconds:.2} s{before}, {rate:.2} M/s", out.display(), drawn.now))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_come_to_the_time_that_is_wanted_whatever_a_sample_takes() {
        let wanted = Duration::from_secs(4);
        for sample in [Duration::from_micros(3), Duration::from_millis(700), Duration::from_secs(60)] {
            let after = (0..40).fold(1, |count, _| next_pass(count, count * sample, wanted));
            assert!(
                after == 1 || after * sample <= wanted && after * sample >= wanted / 2,
                "{after} of {sample:?}"
            );
        }
        assert_eq!(next_pass(8, Duration::from_secs(9), wanted), 4);
    }
}
