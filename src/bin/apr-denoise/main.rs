//! `apr-denoise in.exr out.exr`: parse, check, run, export. `apr-denoise merge out.exr region.exr…` puts
//! regions together.

mod answer;
mod arguments;
mod budget;
mod clock;
mod failure;
mod foreign;
mod frames;
mod generate;
mod inspect;
mod made_of;
mod numbers;
mod parts;
mod pattern;
mod plan;
mod progress;
mod reference;
mod remarks;
mod replaced;
mod report;
mod run;
mod sampling;
mod sequence_report;
mod settings;
mod shot;
mod signals;
mod signature;
mod threads;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use apr::error::{Error, ErrorKind, Result, TARGET_NOT_MET};
use apr::io::{self, RunFile};

use arguments::{Arguments, Command, CommandLine};
use frames::counted;
use pattern::Pattern;
use plan::Plan;

/// Large pages, and blocks that begin at whole cache lines: fits take 0.9 of the time that they take with glibc's.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Of `--generate`.
const OPTIONS: generate::Page = ("options", "the options of --set (Markdown)", reference::page);

/// The command, as it is given.
const MERGE: &str = "merge";

fn main() -> ExitCode {
    let CommandLine { command, denoise: arguments } = generate::parse(&[OPTIONS]);
    signals::clean_up_when_stopped();
    failure::told(|| match (&command, &arguments) {
        (Some(Command::Merge { output, regions, overwrite, quiet }), _) => {
            merge(output, regions, *overwrite, *quiet)
        }
        (None, Some(arguments)) => denoise(arguments),
        (None, None) => unreachable!("clap asks for one of them"),
    })
}

fn merge(output: &Path, regions: &[PathBuf], overwrite: bool, quiet: bool) -> Result<ExitCode> {
    let not_there = regions.iter().map(PathBuf::as_path).filter(|path| !path.exists());
    not_there.chain([output]).try_for_each(check_no_pattern)?;
    let read = regions.iter().map(|path| RunFile { role: "a region", path });
    io::check_apart(read, [RunFile { role: "the picture", path: output }])
        .map_err(|error| error.remedy("give the picture a name of its own"))?;
    io::check_ending(output)?;
    io::check_target(output)?;
    if !overwrite {
        replaced::check_merged(output)?;
    }
    io::merge(output, regions)?;
    if !quiet {
        answer::print(&format!(
            "{}: put together from {}",
            output.display(),
            counted(regions.len(), "region")
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Checks that a file of `merge`, which makes one picture, is not named as those of a sequence are.
fn check_no_pattern(path: &Path) -> Result<()> {
    let Some(_) = Pattern::parse(path) else { return Ok(()) };
    let what = "has a place for the frame's number, and one picture is merged";
    let remedy =
        "merge frame by frame, as in `apr-denoise merge whole.0001.exr top.0001.exr bottom.0001.exr`";
    Err(Error::new(ErrorKind::Usage, what).remedy(remedy).in_file(path))
}

fn denoise(arguments: &Arguments) -> Result<ExitCode> {
    if arguments.input == Path::new(MERGE) && !arguments.input.exists() {
        return Err(Error::new(ErrorKind::Usage, "options stand before the command `merge`").remedy(
            "write `apr-denoise merge OUTPUT REGIONS…` with its options behind: --overwrite and --quiet",
        ));
    }
    threads::start(arguments.threads)?;
    if let Some(third) = arguments.further.first() {
        let what = "is a third name where an input and a result were expected";
        return Err(Error::new(ErrorKind::Usage, what)
            .remedy("write a sequence as 'shot.####.exr' 'den.####.exr', in quotes so that the shell leaves it alone")
            .in_file(third));
    }
    let denoiser = settings::denoiser(arguments)?;
    let mut plan = Plan::new(arguments)?;
    if arguments.inspect {
        answer::print(&inspect::describe(&plan, arguments, &denoiser)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    if arguments.output.is_none() {
        return Err(Error::new(ErrorKind::Usage, "no output file is given")
            .remedy("name it after the input, or use --inspect"));
    }
    let pictures = arguments.output.iter().chain(&arguments.sampling_map);
    pictures.into_iter().try_for_each(io::check_ending)?;
    let signature = signature::of(arguments, &denoiser)?;
    plan.settle_targets(arguments, &signature)?;
    let target_met = run::run(&plan, arguments, &denoiser, &signature)?;
    Ok(if target_met { ExitCode::SUCCESS } else { ExitCode::from(TARGET_NOT_MET) })
}
