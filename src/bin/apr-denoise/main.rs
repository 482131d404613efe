//! `apr-denoise in.exr out.exr`: parse, check, run, export.

mod arguments;
mod clock;
mod failure;
mod inspect;
mod progress;
mod report;
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

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    failure::told(|| run(&arguments))
}

fn run(arguments: &Arguments) -> Result<()> {
    signals::clean_up_when_stopped();
    if let Some(threads) = arguments.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.get());
        pool.build_global().map_err(|error| Error::new(ErrorKind::Internal, error.to_string()))?;
    }
    let options = settings::options(arguments)?;
    if arguments.inspect {
        let picture = Picture::read(&arguments.input, &arguments.read_options())?;
        return print(&inspect::describe(&picture, &options, arguments.json)?);
    }
    let Some(output) = &arguments.output else {
        return Err(Error::new(ErrorKind::Usage, "no output file is given")
            .remedy("name it after the input, or use --inspect"));
    };
    denoise(arguments, &options, output)
}

fn denoise(arguments: &Arguments, options: &apr::Options, output: &Path) -> Result<()> {
    for target in std::iter::once(output).chain(arguments.report.as_deref()) {
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
    let report = Report::new(&picture, options, &denoised, stages, notes, output);
    if let Some(path) = &arguments.report {
        io::write_bytes(path, report.json()?.as_bytes())?;
    }
    if arguments.quiet { Ok(()) } else { print(&report.line()) }
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
