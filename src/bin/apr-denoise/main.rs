//! `apr-denoise in.exr out.exr`: parse, check, run, export.

mod arguments;
mod clock;
mod failure;
mod inspect;
mod progress;
mod report;
mod sampling;
mod settings;
mod signals;

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use apr::error::{Error, ErrorKind, Result};
use apr::io::{self, Picture};
use clap::Parser;

use arguments::Arguments;
use clock::Clock;
use progress::Progress;
use report::Report;

/// Done, but the estimated error is above the target.
const TARGET_NOT_MET: u8 = 10;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    failure::told(|| run(&arguments))
}

fn run(arguments: &Arguments) -> Result<ExitCode> {
    signals::clean_up_when_stopped();
    if let Some(threads) = arguments.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.get());
        pool.build_global().map_err(|error| Error::new(ErrorKind::Internal, error.to_string()))?;
    }
    let options = settings::options(arguments)?;
    if arguments.inspect {
        let picture = Picture::read(&arguments.input, &arguments.read_options())?;
        print(&inspect::describe(&picture, &options, arguments.json)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    let Some(output) = &arguments.output else {
        return Err(Error::new(ErrorKind::Usage, "no output file is given")
            .remedy("name it after the input, or use --inspect"));
    };
    denoise(arguments, &options, output)
}

fn denoise(arguments: &Arguments, options: &apr::Options, output: &Path) -> Result<ExitCode> {
    let further = [arguments.report.as_deref(), arguments.sampling_map.as_deref()];
    for target in std::iter::once(output).chain(further.into_iter().flatten()) {
        io::check_target(target)?; // better now than after the work
    }
    let clock = Clock::new(Progress::new(arguments.quiet, options.stages.len()));
    clock.begin("read");
    let picture = Picture::read(&arguments.input, &arguments.read_options())?;
    for warning in picture.layout().warnings.iter().filter(|_| !arguments.quiet) {
        warn(warning);
    }
    let denoised = apr::denoise::denoise_observed(picture.frame(), options, &clock)?;
    clock.begin("write");
    let notes = picture.write(output, &denoised, arguments.aux)?;
    let stages = clock.finish();
    let sampling = sampling::Sampling::new(&picture, &denoised, arguments)?;
    let report = Report::new(&picture, options, &denoised, stages, notes, output, sampling.as_ref());
    if let Some(path) = &arguments.report {
        io::write_bytes(path, report.json()?.as_bytes())?;
    }
    if !arguments.quiet {
        sampling.as_ref().and_then(|sampling| sampling.line()).map_or(Ok(()), |line| print(&line))?;
        print(&report.line())?;
    }
    let unmet = sampling.is_some_and(|sampling| sampling.target_met == Some(false));
    Ok(if unmet { ExitCode::from(TARGET_NOT_MET) } else { ExitCode::SUCCESS })
}

/// Answers on the standard output; whoever closed it does not want to hear.
fn print(text: &str) -> Result<()> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::new(ErrorKind::Unwritable, format!("the standard output cannot be written: {error}")))
        }
        _ => Ok(()),
    }
}

#[expect(clippy::print_stderr, reason = "where this program warns")]
fn warn(warning: &str) {
    eprintln!("apr-denoise: warning: {warning}");
}
