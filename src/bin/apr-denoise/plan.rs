//! What is to be done, frame by frame, settled and checked before any work.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use apr::error::{Error, ErrorKind, Result};
use apr::io::{self, RunFile};

use crate::arguments::{Arguments, Missing, is_printed};
use crate::frames::{FrameSet, counted};
use crate::made_of::Fingerprints;
use crate::parts::Region;
use crate::pattern::Pattern;
use crate::signature::Difference;
use crate::{replaced, signature};

/// The files of one frame.
#[derive(Debug, Clone)]
pub struct Job {
    /// Its number; none where a single picture is denoised.
    pub frame: Option<i32>,
    pub input: PathBuf,
    pub half: Option<PathBuf>,
    pub with: Vec<PathBuf>,
    pub output: PathBuf,
    pub report: Option<PathBuf>,
    pub sampling_map: Option<PathBuf>,
}

/// All frames of a run.
#[derive(Debug, Clone, Default)]
pub struct Plan {
    /// Those to denoise, in order.
    pub jobs: Vec<Job>,
    /// Those whose result is there already.
    pub finished: Vec<Job>,
    /// Those that have no input, each with the file that is not there.
    pub missing: Vec<(Job, PathBuf)>,
    /// Of those to denoise, the ones whose result is there and was made of what has changed since.
    stale: Vec<Job>,
    names: Names,
}

/// The files that the user named.
#[derive(Debug, Clone, Default)]
struct Names {
    input: Name,
    half: Option<Name>,
    with: Vec<Name>,
    output: Option<Name>,
    report: Option<Name>,
    sampling_map: Option<Name>,
}

impl Names {
    /// As they are given; patterns are those of a `sequence`.
    fn new(arguments: &Arguments, sequence: bool) -> Self {
        let name = |path: &PathBuf| Name::new(path, sequence);
        Self {
            input: name(&arguments.input),
            half: arguments.half.as_ref().map(name),
            with: arguments.with.iter().map(name).collect(),
            output: arguments.output.as_ref().map(name),
            report: arguments.report.as_ref().map(name),
            sampling_map: arguments.sampling_map.as_ref().map(name),
        }
    }

    /// The files of one frame.
    fn job(&self, frame: Option<i32>) -> Job {
        let of = |name: &Option<Name>| name.as_ref().map(|name| name.of(frame));
        Job {
            frame,
            input: self.input.of(frame),
            half: of(&self.half),
            with: self.with.iter().map(|with| with.of(frame)).collect(),
            output: of(&self.output).unwrap_or_default(),
            report: of(&self.report),
            sampling_map: of(&self.sampling_map),
        }
    }
}

/// A path that the user gave: one file, or one for each frame.
#[derive(Debug, Clone)]
enum Name {
    One(PathBuf),
    Each(Pattern),
}

impl Default for Name {
    fn default() -> Self {
        Self::One(PathBuf::new())
    }
}

impl Name {
    fn new(path: &Path, sequence: bool) -> Self {
        let pattern = Pattern::parse(path).filter(|_| sequence);
        pattern.map_or_else(|| Self::One(path.to_owned()), Self::Each)
    }

    fn of(&self, frame: Option<i32>) -> PathBuf {
        match (self, frame) {
            (Self::Each(pattern), Some(frame)) => pattern.path(frame),
            (Self::Each(pattern), None) => pattern.path(0),
            (Self::One(path), _) => path.clone(),
        }
    }
}

impl Plan {
    /// The frames that are asked for and the names of their files.
    ///
    /// # Errors
    /// `Unreadable` when a frame has no file and `--missing` does not say to skip it, or no frame is
    /// found at all; `Usage` when there are frames but no place for their number.
    pub fn new(arguments: &Arguments) -> Result<Self> {
        // A file of that very name is that file, whatever its name looks like.
        let literal = arguments.frames.is_none() && arguments.input.exists();
        let pattern = Pattern::parse(&arguments.input).filter(|_| !literal);
        let frames: Vec<Option<i32>> = match (&pattern, &arguments.frames) {
            (Some(pattern), given) => chosen(pattern, given.as_ref(), &arguments.input)?,
            (None, None) => vec![None],
            (None, Some(_)) => {
                return Err(usage("--frames wants an input with a place for the frame's number")
                    .remedy("write it as shot.####.exr, shot.%04d.exr, shot.$F4.exr or shot.<frame4>.exr")
                    .in_file(&arguments.input));
            }
        };
        let names = Names::new(arguments, pattern.is_some());
        if Pattern::parse(&arguments.input).is_none() {
            check_plain(arguments)?;
        }
        if let (Some(Name::One(path)), [_, _, ..]) = (&names.half, &frames[..]) {
            return Err(usage("--half is one file for many frames")
                .remedy("give it a place for the frame's number (####)")
                .in_file(path));
        }
        if arguments.temporal > 0 && pattern.is_none() {
            return Err(usage("--temporal wants a sequence")
                .remedy("write the input as shot.####.exr, and --frames 7 for one of its frames")
                .in_file(&arguments.input));
        }
        let jobs = frames.into_iter().map(|frame| names.job(frame)).collect();
        let mut plan = Self { jobs, names, ..Self::default() };
        if pattern.is_some() {
            plan.take_out_missing(arguments.missing)?;
        }
        Ok(plan)
    }

    /// All frames, whatever is to become of them.
    pub fn frames(&self) -> impl Iterator<Item = &Job> {
        self.jobs.iter().chain(&self.finished).chain(self.missing.iter().map(|(job, _)| job))
    }

    /// The frame `offset` after that of `job`, if all its files are there.
    pub fn beside(&self, job: &Job, offset: i32) -> Option<Job> {
        let beside = self.names.job(Some(job.frame?.checked_add(offset)?));
        let there = beside.sources().all(|source| source.path.exists());
        there.then_some(beside)
    }

    /// The frames up to `reach` before and after that of `job`, as far as there is no gap.
    fn all_beside(&self, job: &Job, reach: u8) -> Vec<Job> {
        let side =
            |sign: i32| (1..=i32::from(reach)).map_while(move |offset| self.beside(job, sign * offset));
        side(-1).chain(side(1)).collect()
    }

    fn take_out_missing(&mut self, policy: Missing) -> Result<()> {
        let mut there = Vec::new();
        for job in std::mem::take(&mut self.jobs) {
            let gone = job.sources().map(|source| source.path).find(|path| !path.exists());
            let gone = gone.map(Path::to_owned);
            match gone {
                Some(path) => self.missing.push((job, path)),
                None => there.push(job),
            }
        }
        self.jobs = there;
        match (&self.missing[..], policy) {
            ([], _) => Ok(()),
            (_, Missing::Skip) if !self.jobs.is_empty() => Ok(()),
            ([(_, first), ..], Missing::Skip) => {
                let frames: FrameSet = self.missing.iter().filter_map(|(job, _)| job.frame).collect();
                Err(Error::new(
                    ErrorKind::Unreadable,
                    format!("is missing, and none of the frames {frames} has a file"),
                )
                .remedy("check the name and its padding, and --frames")
                .in_file(first))
            }
            (missing @ [(_, first), ..], Missing::Error) => {
                let frames: FrameSet = missing.iter().filter_map(|(job, _)| job.frame).collect();
                let have = if missing.len() == 1 { "has" } else { "have" };
                let what =
                    format!("is missing; {} {have} no input: {frames}", counted(missing.len(), "frame"));
                Err(Error::new(ErrorKind::Unreadable, what)
                    .remedy("render them, check the name's padding, or leave them out by --missing skip")
                    .in_file(first))
            }
        }
    }

    /// Checks that every result has a place of its own, and sets those apart that are there already
    /// when `skip_existing`: they must have been made by the settings of `signature`. Those whose inputs have changed
    /// since, or beside which frames have come or gone, are done again.
    ///
    /// # Errors
    /// `Usage` when results would overwrite each other, an input that is still needed or a picture that this program
    /// did not write, or were made by other settings; `Misplaced` when a folder takes no file; `Unwritable` when the disk
    /// is at fault.
    pub fn settle_targets(&mut self, arguments: &Arguments, signature: &str) -> Result<()> {
        self.check_in_place(arguments)?;
        self.check_collisions(arguments)?;
        if arguments.skip_existing {
            self.take_out_finished(signature, arguments)?;
        }
        let mut seen = HashSet::new();
        let all = self.jobs.iter().flat_map(Job::targets).map(|target| target.path);
        for target in all.chain(arguments.sequence_report.as_deref()) {
            // Better now than after the work. One try in each folder is enough, if no link leads to another one.
            if seen.insert(target.parent()) || target.is_symlink() {
                io::check_target(target)?;
            } else {
                io::check_old(target)?;
            }
        }
        if arguments.overwrite {
            return Ok(());
        }
        replaced::check(&self.jobs, arguments)
    }

    /// Checks that no result takes the place of its input where that would lose something.
    fn check_in_place(&self, arguments: &Arguments) -> Result<()> {
        let why = match arguments.region {
            Some(_) => "the region alone would replace the whole picture",
            None if arguments.temporal > 0 => {
                "--temporal reads frames after their turn, and they would be denoised already"
            }
            None => return Ok(()),
        };
        let in_place = self.jobs.iter().find(|job| job.is_in_place());
        in_place.map_or(Ok(()), |job| {
            Err(usage(why).remedy("give the results names of their own").in_file(&job.output))
        })
    }

    /// In place a result takes its own input's name and nothing else.
    fn check_collisions(&self, arguments: &Arguments) -> Result<()> {
        self.check_places(arguments)?;
        let beside_of = |job| self.all_beside(job, arguments.temporal);
        let all_beside: Vec<Job> = self.jobs.iter().flat_map(beside_of).collect();
        let of_frames = self.frames().flat_map(|job| job.sources().skip(usize::from(job.is_in_place())));
        let options = arguments.options.iter().map(|path| file("the options", path));
        let beside = all_beside.iter().flat_map(Job::sources);
        let sequence_report = arguments.sequence_report.iter().map(|path| file("the sequence report", path));
        let targets = self.jobs.iter().flat_map(Job::targets).chain(sequence_report);
        io::check_apart(of_frames.chain(beside).chain(options), targets).map_err(|error| {
            error.remedy("give outputs and reports names of their own, each with a place for the frame's number (####); --sequence-report takes one file for all frames")
        })
    }

    /// Checks that the names of what is written for every frame have a place for its number, and that the report of all
    /// is a file.
    fn check_places(&self, arguments: &Arguments) -> Result<()> {
        if let Some(path) = arguments.sequence_report.as_deref().filter(|path| is_printed(path)) {
            return Err(usage("the report of all frames is not printed").remedy("name a file").in_file(path));
        }
        let each = |path: &&Path| Pattern::parse(path).is_some();
        if let Some(path) = arguments.sequence_report.as_deref().filter(each) {
            return Err(usage("has a place for the frame's number, and --sequence-report is one file for all frames")
                .remedy("name it without #, @@, %d, $F and <frame>, or give --report 'rep.####.json' for one of each frame")
                .in_file(path));
        }
        let Names { output, report, sampling_map, .. } = &self.names;
        let report = report.as_ref().filter(|name| !matches!(name, Name::One(path) if is_printed(path)));
        let one = |name: &&Name| matches!(name, Name::One(_));
        match [output.as_ref(), report, sampling_map.as_ref()].into_iter().flatten().find(one) {
            Some(Name::One(path)) if self.jobs.len() > 1 => {
                let what =
                    "several results would be written here: the name has no place for the frame's number";
                let remedy =
                    "give it one, as in den.####.exr; --sequence-report takes one file for all frames";
                Err(usage(what).remedy(remedy).in_file(path))
            }
            _ => Ok(()),
        }
    }

    fn take_out_finished(&mut self, signature: &str, arguments: &Arguments) -> Result<()> {
        let mut to_do = Vec::new();
        let mut by_others: Vec<(Job, String)> = Vec::new();
        let mut fingerprints = Fingerprints::default();
        for job in std::mem::take(&mut self.jobs) {
            match self.found(&job, signature, arguments, &mut fingerprints)? {
                Found::Nothing => to_do.push(job),
                Found::Finished => self.finished.push(job),
                Found::Stale => {
                    self.stale.push(job.clone());
                    to_do.push(job);
                }
                Found::Otherwise(_) if arguments.overwrite => to_do.push(job),
                Found::Otherwise(difference) => by_others.push((job, difference)),
            }
        }
        self.jobs = to_do;
        let Some((first, difference)) = by_others.first() else { return Ok(()) };
        let others = among_others(by_others.iter().map(|(job, _)| job));
        let remedy = if first.is_in_place() {
            "give the options that it was made with, or the render itself again, whose place it took"
        } else {
            "remove it, write elsewhere, run without --skip-existing, or add --overwrite to do it again"
        };
        Err(usage(&format!("was made otherwise: {difference}{others}")).remedy(remedy).in_file(&first.output))
    }

    /// What of `job` an earlier run has done.
    fn found(
        &self,
        job: &Job,
        signature: &str,
        arguments: &Arguments,
        fingerprints: &mut Fingerprints,
    ) -> Result<Found> {
        // What is no picture, such as the empty file by which some schedulers take a place, is no result.
        if !io::is_exr(&job.output) {
            return Ok(Found::Nothing);
        }
        let there = io::provenance(&job.output).unwrap_or_default(); // what cannot be read, nobody signed
        if there.signature.is_some() && !there.whole {
            return Ok(Found::Nothing);
        }
        // An input that cannot be read is told by whoever reads it.
        let Ok(made_of) = fingerprints.of(self, job, arguments) else { return Ok(Found::Nothing) };
        let region = arguments.region.map(Region::numbers);
        if there.signature.is_some() && region != there.region {
            let [there, wanted] = [there.region, region].map(words);
            return Ok(Found::Otherwise(format!("it holds {there} and not {wanted}")));
        }
        let in_place = job.is_in_place();
        if in_place && there.signature.is_none() {
            return Ok(Found::Nothing); // not denoised in place yet
        }
        let wanted = signature::of_frame(signature, &made_of);
        Ok(match signature::difference(there.signature.as_deref(), &wanted, in_place) {
            Difference::Settings(words) => Found::Otherwise(words),
            Difference::Content => Found::Stale,
            Difference::Nothing => match job.targets().find(|target| !target.path.exists()) {
                None if !in_place && job.report.as_deref().is_some_and(is_printed) => Found::Nothing,
                None => Found::Finished,
                Some(missing) if in_place => return Err(lost(missing)),
                Some(_) => Found::Nothing,
            },
        })
    }

    /// Tells that results are done again though they were there.
    pub fn note_of_stale(&self) -> Option<String> {
        let first = self.stale.first()?;
        Some(format!(
            "{}: is done again: its input, or a file or frame beside, is not what it was made of, as far as it tells{}",
            first.output.display(),
            among_others(&self.stale)
        ))
    }
}

/// What there is of a frame's results.
enum Found {
    /// Not all of them: the frame is to be done.
    Nothing,
    Finished,
    /// A result of what has changed since.
    Stale,
    /// A result of other settings; in words, what differs.
    Otherwise(String),
}

/// In words, that all these frames share what is said of the first.
fn among_others<'a>(jobs: impl IntoIterator<Item = &'a Job>) -> String {
    jobs.into_iter().filter_map(|job| job.frame).collect::<FrameSet>().among_others()
}

fn words(region: Option<[i64; 4]>) -> String {
    let numbers = |region: [i64; 4]| region.map(|number| number.to_string()).join(",");
    region.map_or("the whole picture".to_owned(), |region| format!("the region {}", numbers(region)))
}

/// The error of a file that would have to be made of an input which is denoised already.
fn lost(missing: RunFile) -> Error {
    usage(&format!("{} is missing, and its input was denoised in place", missing.role))
        .remedy("leave the option out, or denoise the render itself again")
        .in_file(missing.path)
}

impl Job {
    /// All files that are read for it, the input first.
    fn sources(&self) -> impl Iterator<Item = RunFile<'_>> {
        let half = self.half.iter().map(|path| file("the half", path));
        let with = self.with.iter().map(|path| file("a file of --with", path));
        std::iter::once(file("the input", &self.input)).chain(half).chain(with)
    }

    /// All files that are written for it.
    fn targets(&self) -> impl Iterator<Item = RunFile<'_>> {
        let report = self.report_file().map(|path| file("the report", path));
        let map = self.sampling_map.iter().map(|path| file("the sampling map", path));
        std::iter::once(file("the result", &self.output)).chain(report).chain(map)
    }

    /// Where its report goes, unless that is the standard output.
    pub fn report_file(&self) -> Option<&Path> {
        self.report.as_deref().filter(|path| !is_printed(path))
    }

    /// Whether the result replaces the input.
    pub fn is_in_place(&self) -> bool {
        io::is_same_file(&self.output, &self.input)
    }

    /// How messages call it.
    pub fn label(&self) -> String {
        self.frame.map_or_else(|| self.input.display().to_string(), |frame| format!("frame {frame}"))
    }
}

/// The frames that are given, else those that have a file.
fn chosen(pattern: &Pattern, given: Option<&FrameSet>, input: &Path) -> Result<Vec<Option<i32>>> {
    let found = given.cloned().unwrap_or_else(|| pattern.frames_on_disk());
    if found.is_empty() {
        let remedy = match pattern.other_padding() {
            Some((name, frames)) => format!("there is '{}' with frames {frames}", name.display()),
            None => {
                "check the name and its padding: #### stands for a number of at least four digits".to_owned()
            }
        };
        return Err(Error::new(ErrorKind::Unreadable, "no file has a name of this pattern")
            .remedy(remedy)
            .in_file(input));
    }
    Ok(found.iter().map(Some).collect())
}

/// Checks that no result of a single picture has a name with a place for a frame's number.
fn check_plain(arguments: &Arguments) -> Result<()> {
    let named = [&arguments.output, &arguments.report, &arguments.sampling_map].into_iter().flatten();
    let has_place =
        |path: &&PathBuf| path.file_name().is_some_and(|name| Pattern::parse(Path::new(name)).is_some());
    named.clone().find(has_place).map_or(Ok(()), |path| {
        Err(usage("has a place for the frame's number, and the input has none")
            .remedy(
                "write the input as shot.####.exr too, or name the result without #, @@, %d, $F and <frame>",
            )
            .in_file(path))
    })
}

fn file<'a>(role: &'a str, path: &'a Path) -> RunFile<'a> {
    RunFile { role, path }
}

fn usage(what: &str) -> Error {
    Error::new(ErrorKind::Usage, what)
}
