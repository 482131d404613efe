//! The command line.

use std::path::{Path, PathBuf};

use apr::baseline::Method;
use apr::io::{Mapping, ReadOptions, Renderer, VarianceKind};
use apr::options::Preset;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::budget::MemoryBound;
use crate::frames::FrameSet;
use crate::numbers::positive;
use crate::parts::Region;
use crate::plan::Job;
use crate::progress::Style;

/// Denoise a Monte Carlo render.
///
/// Reads an OpenEXR file of any renderer, denoises its beauty with whatever variances, half buffers
/// and features it finds, and writes the file again: only the beauty's channels change, those that --aov names,
/// and --aux adds layers.
///
/// A sequence is denoised by names with a place for the frame's number, such as shot.####.exr,
/// shot.%04d.exr, shot.$F4.exr or shot.<frame4>.exr (in quotes, so that the shell leaves them alone).
#[derive(Debug, Parser)]
#[command(name = "apr-denoise", version, after_help = EXIT_CODES)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(args_override_self = true)] // scripts give options before those of their users
#[expect(rustdoc::invalid_html_tags, reason = "help for people, not for rustdoc")]
pub struct CommandLine {
    #[command(subcommand)]
    pub command: Option<Command>,
    #[command(flatten)]
    pub denoise: Option<Arguments>,
}

/// What this program does besides denoising.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Put the regions of a picture (see --region) together: the very file, to the byte, that denoising the
    /// whole picture writes.
    Merge {
        /// Where the picture goes (EXR). Appears whole or not at all.
        output: PathBuf,
        /// Replace a picture at OUTPUT that this program did not write.
        #[arg(long)]
        overwrite: bool,
        /// Print nothing but errors.
        #[arg(long, short)]
        quiet: bool,
        /// The regions' files, in any order: all of one picture, by the same options.
        #[arg(required = true)]
        regions: Vec<PathBuf>,
    },
}

/// Whether a report of this name goes to the standard output.
pub fn is_printed(report: &Path) -> bool {
    report == "-"
}

/// Denoise one picture or a sequence.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The render (EXR), or the renders of a sequence: 'shot.####.exr'.
    pub input: PathBuf,
    /// Where the result goes (EXR); may be the input. Appears whole or not at all. Replaces an earlier result, but no
    /// other picture (see --overwrite).
    #[arg(required_unless_present = "inspect")]
    pub output: Option<PathBuf>,
    /// What the shell makes of shot.*.exr.
    #[arg(hide = true)]
    pub further: Vec<PathBuf>,

    /// Print what was found and what would be run, and stop.
    #[arg(long)]
    pub inspect: bool,
    /// With --inspect: print JSON.
    #[arg(long, requires = "inspect")]
    pub json: bool,
    /// Write a report of the run; of a sequence one for each frame: 'report.####.json'. The name - has it printed, and
    /// nothing else beside it. Replaces an earlier report, but no other file (see --overwrite).
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Do nothing where all that is to be written is there already and whole, of inputs that have not changed since
    /// (told by their headers, lengths and samples). The result must have been made by the same options and version, of the
    /// same region, else the run stops before any work, or does it again with --overwrite.
    #[arg(long, conflicts_with_all = ["inspect", "target_error"])]
    pub skip_existing: bool,
    /// Replace pictures and reports that this program did not write, too; and denoise those pictures again, in their own
    /// place, that it has denoised already. With --skip-existing: do again what was made by other options.
    #[arg(long)]
    pub overwrite: bool,
    /// Add the layers apr.mse (estimated squared error, where the method has an estimate) and apr.order (polynomial
    /// order).
    #[arg(long)]
    pub aux: bool,
    /// Write the density of samples that the next pass of the renderer should have (EXR, one float channel
    /// density.Y, 1 on the average): multiply it by the pass's samples per pixel.
    #[arg(long, value_name = "FILE.exr")]
    pub sampling_map: Option<PathBuf>,
    /// Tell how many samples, placed as --sampling-map asks, are still needed for this mean relative squared error,
    /// estimated, and end with 10 where there are any. The result is written all the same.
    #[arg(long, value_name = "E", value_parser = positive::<f32>, allow_negative_numbers = true)]
    pub target_error: Option<f32>,
    /// Print nothing but errors: no answer, no warnings and notes, and no progress.
    #[arg(long, short)]
    pub quiet: bool,
    /// How to tell the progress: by a bar, which only a terminal shows (the standard error), or by lines `progress NN`
    /// (per cent) on the standard output, one a second at most and `progress 100` at the end; auto is the bar where there
    /// is a terminal, else the lines.
    #[arg(long, value_name = "HOW", value_enum, default_value_t = Style::Auto)]
    pub progress: Style,
    /// Use this many threads, but no more than there are cores, or than 8 where those are fewer [default: one per core].
    /// The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub threads: Option<u32>,
    /// Denoise this region alone: x and y of its first pixel, width and height, in the file's pixel
    /// coordinates. Reads and computes no more than it needs; the result is a file of the region, and
    /// `apr-denoise merge` puts such files together.
    #[arg(long, value_name = "X,Y,W,H", allow_hyphen_values = true)]
    #[arg(conflicts_with_all = ["inspect", "sampling_map", "target_error", "temporal"])]
    pub region: Option<Region>,
    /// Use no more memory than this (such as 8G or 512M): the picture is denoised in bands, to the same bits.
    #[arg(long, value_name = "SIZE", conflicts_with_all = ["sampling_map", "target_error", "temporal"])]
    pub memory: Option<MemoryBound>,

    /// Frames of the sequence, such as 1-100:2,140 [default: all that are found].
    #[arg(long, value_name = "RANGES", allow_hyphen_values = true, help_heading = "Sequences")]
    pub frames: Option<FrameSet>,
    /// What to do when a frame has no file: stop before any work and name all of them, or leave them out.
    #[arg(
        long,
        value_name = "POLICY",
        value_enum,
        default_value_t = Missing::Error,
        help_heading = "Sequences"
    )]
    pub missing: Missing,
    /// Go on with the other frames when one fails; the exit code is that of the first that failed.
    #[arg(long, help_heading = "Sequences")]
    pub keep_going: bool,
    /// Let the samples of up to N frames before and N after join each frame's: less noise, less flicker.
    /// They are found by motion vectors where the files have them, otherwise surfaces are assumed still.
    /// Neighbouring frames without a file are left out.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        value_parser = clap::value_parser!(u8).range(0..=8),
        help_heading = "Sequences"
    )]
    pub temporal: u8,
    /// Write one report for all frames, also of a run that is told to stop. One that stops before any work writes none.
    #[arg(long, value_name = "FILE.json", help_heading = "Sequences")]
    pub sequence_report: Option<PathBuf>,

    /// The renderer that wrote the file [default: recognised by attributes and channel names].
    #[arg(long, value_name = "NAME", value_parser = renderer(), help_heading = "Channels")]
    pub profile: Option<Renderer>,
    /// Give channels a role, against what the channel map says. ROLE is color, variance, halfA, halfB,
    /// sampleCount, albedo, normal, position, depth, visibility, motionPrevious, motionNext, motionCycles, or a
    /// feature's name followed by Variance, HalfA or HalfB. CHANNELS is a list of channels, a layer, a part or a
    /// view, or the end of one such name after a dot; or none.
    #[arg(long, value_name = "ROLE=CHANNELS", help_heading = "Channels")]
    pub map: Vec<Mapping>,
    /// Add a further feature.
    #[arg(long, value_name = "NAME=CHANNELS", help_heading = "Channels")]
    pub feature: Vec<Mapping>,
    /// Read further layers from this file (or pattern); its bare channels form a layer of the file's name
    /// without the frame's number: shot_albedo.0001.exr holds an albedo.
    #[arg(long, value_name = "FILE", help_heading = "Channels")]
    pub with: Vec<PathBuf>,
    /// Denoise these components of the beauty too (AOVs, light groups), by the operator that the beauty
    /// chose, so that what summed before sums after. NAMES are layers, separated by commas, * at the end
    /// for any end; auto takes those that are known to sum to the beauty.
    #[arg(long, value_name = "NAMES|auto", value_delimiter = ',', help_heading = "Channels")]
    pub aov: Vec<String>,
    /// The same frame (or pattern) rendered with another seed: both become the halves of one render.
    #[arg(long, value_name = "FILE", help_heading = "Channels")]
    pub half: Option<PathBuf>,
    /// What variance buffers hold; overrides what the renderer's names say.
    #[arg(long, value_name = "KIND", value_parser = variance_kind(), help_heading = "Channels")]
    pub variance_kind: Option<VarianceKind>,
    /// Samples per pixel; overrides the header.
    #[arg(long, value_name = "N", value_parser = positive::<f32>, allow_negative_numbers = true, help_heading = "Channels")]
    pub spp: Option<f32>,

    /// Denoise by this method: apr is this program's own, the others are those that it is measured against.
    #[arg(long, value_name = "NAME", value_parser = method(), default_value = "apr", help_heading = "Denoiser")]
    pub method: Method,
    /// Start from this set of options; published is the method as its paper has it.
    #[arg(long, value_name = "NAME", value_parser = preset(), help_heading = "Denoiser")]
    pub preset: Option<Preset>,
    /// Set one option of the method; VALUE is JSON, KEY may go into depth with dots, as in
    /// outliers.deviations=10. --preset comes first, then --options, then --set in its order. --generate options
    /// lists all with their defaults and ranges.
    #[arg(long, value_name = "KEY=VALUE", help_heading = "Denoiser")]
    pub set: Vec<String>,
    /// Read options of the method from a JSON object.
    #[arg(long, value_name = "FILE.json", help_heading = "Denoiser")]
    pub options: Option<PathBuf>,
}

/// What to do about frames that have no file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Missing {
    /// Stop before any work and name all of them.
    Error,
    /// Leave them out.
    Skip,
}

const EXIT_CODES: &str = "Exit codes:
  0    done
  2    usage: an option or argument makes no sense, a result cannot go where it is to go (there is no such folder,
       it is a folder or write-protected), a file would be lost, --memory is too little
  3    an input is missing, damaged, or uses a feature that is not supported
  4    the input lacks what is needed: no colour, sizes that differ, regions that do not fit together; or it is
       denoised already, in its own place
  5    the result cannot be written: the disk is full, or its server is away
  10   done, but the estimated error is above --target-error
  70   a defect of this program
  129  hung up (SIGHUP)
  130  interrupted (SIGINT)
  143  told to stop (SIGTERM): ended by the signal, as shells tell it";

impl Arguments {
    /// Whether the standard output is for people: nobody wants silence, nor a report there.
    pub fn answers(&self) -> bool {
        !self.quiet && !self.report.as_deref().is_some_and(is_printed)
    }

    /// How to understand the input of `job`.
    pub fn read_options(&self, job: &Job) -> ReadOptions {
        ReadOptions {
            profile: self.profile,
            map: self.map.clone(),
            features: self.feature.clone(),
            variance_kind: self.variance_kind,
            spp: self.spp,
            half: job.half.clone(),
            with: job.with.clone(),
            aovs: self.aov.clone(),
            motion: self.temporal > 0,
        }
    }
}

fn one_of<T>(names: &'static [(&'static str, T)]) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    PossibleValuesParser::new(names.iter().map(|(name, _)| *name)).map(|chosen| {
        let found = names.iter().find(|(name, _)| *name == chosen);
        found.expect("the parser lets only these names through").1
    })
}

fn renderer() -> impl TypedValueParser<Value = Renderer> {
    one_of(&Renderer::NAMES)
}

fn variance_kind() -> impl TypedValueParser<Value = VarianceKind> {
    one_of(&VarianceKind::NAMES)
}

fn method() -> impl TypedValueParser<Value = Method> {
    one_of(&Method::NAMES)
}

fn preset() -> impl TypedValueParser<Value = Preset> {
    one_of(&apr::Options::PRESETS)
}
