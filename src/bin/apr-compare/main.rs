//! `apr-compare RESULT REFERENCE [MORE…]`: how far results are from their reference;
//! `apr-compare sweep INPUT… --reference REF`: what accuracy costs in time.

#[path = "../apr-denoise/answer.rs"]
mod answer;
mod compare;
#[path = "../apr-denoise/failure.rs"]
mod failure;
#[path = "../apr-denoise/foreign.rs"]
mod foreign;
#[path = "../apr-denoise/generate.rs"]
mod generate;
mod noise;
#[path = "../apr-denoise/numbers.rs"]
mod numbers;
mod processor;
mod sweep;
#[path = "../apr-denoise/threads.rs"]
mod threads;
mod variants;

use std::process::ExitCode;

use clap::Parser;

/// `apr-denoise`'s, so that a sweep's seconds are its seconds.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Compare denoised pictures with a reference.
///
/// Prints RMSE, relMSE (epsilon 0.01), relMSE without the worst 0.1 % of the pixels, SMAPE, SSIM of
/// the tone-mapped luminance, and the difference in energy; and relMSE less the reference's own noise,
/// where the reference has half buffers or a variance. A pixel that is NaN or infinite is an error. Where data windows differ, as after --region, the pixels that all files have are compared.
#[derive(Parser)]
#[command(name = "apr-compare", version, after_help = EXIT_CODES)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
struct CommandLine {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    compare: Option<compare::CompareArguments>,
    /// Use this many threads, but no more than there are cores, or than 8 where those are fewer [default: one per core].
    /// No number but the seconds depends on it.
    #[arg(long, value_name = "N", global = true, value_parser = clap::value_parser!(u32).range(1..))]
    threads: Option<u32>,
}

#[derive(clap::Subcommand)]
enum Command {
    Sweep(sweep::SweepArguments),
}

const EXIT_CODES: &str = "Exit codes:
  0    done
  2    usage: an option or argument makes no sense, or a file would be lost that this program did not write
  3    an input is missing, damaged, or uses a feature that is not supported
  4    the pictures cannot be compared: no pixel in common, no such channels, pixels that are not finite
  5    the result cannot be written
  70   a defect of this program";

fn main() -> ExitCode {
    let arguments = generate::parse::<CommandLine>(&[]);
    failure::told(|| {
        threads::start(arguments.threads).and_then(|()| match (&arguments.command, &arguments.compare) {
            (Some(Command::Sweep(sweep)), _) => answer::print(sweep::run(sweep)?.trim_end()),
            (None, Some(compare)) => answer::print(compare::run(compare)?.trim_end()),
            (None, None) => unreachable!("clap asks for one of them"),
        })
    })
}
