//! The parts that a picture is denoised in: all of it at once, a region, or bands that keep to a bound of
//! memory. The bits are the same.

use std::str::FromStr;

use apr::baseline::Denoiser;
use apr::denoise::{Facts, Part, Silent, halo};
use apr::error::{Error, ErrorKind, Result};
use apr::image::Rect;
use apr::io::{Layout, ReadOptions, SumCheck, Survey};
use apr::{Denoised, Frame, Options};

use crate::arguments::Arguments;
use crate::clock::Clock;
use crate::plan::Job;
use crate::report::{ErrorSums, input_error};
use crate::shot::Shot;

/// Fewest rows of a band: less would be nearly nothing but halo.
const LEAST_ROWS: usize = 32;

/// Rows that outliers are looked for in at once: with some thirty on both sides fewer than any band is read with, and
/// many times those, which are read twice.
const OUTLIER_ROWS: usize = 256;

/// What the program holds besides planes: its code, blocks of files on their way, what the allocator keeps.
const FIXED_BYTES: usize = 350 << 20;

/// A region by x and y of its first pixel, width and height, in the file's pixel coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    at: (i32, i32),
    size: (usize, usize),
}

impl Region {
    /// As files tell it: x, y, width, height.
    pub fn numbers(self) -> [i64; 4] {
        let ((x, y), (width, height)) = (self.at, self.size);
        let length = |length: usize| i64::try_from(length).unwrap_or(i64::MAX); // no file is as large
        [x.into(), y.into(), length(width), length(height)]
    }
}

impl FromStr for Region {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong = || "expected x,y,width,height such as 0,540,1920,540".to_owned();
        let fields: Vec<&str> = text.split(',').map(str::trim).collect();
        let [x, y, width, height] = fields[..] else { return Err(wrong()) };
        let at = |text: &str| text.parse().map_err(|_| wrong());
        let length = |text: &str| text.parse().map_err(|_| wrong());
        Ok(Self { at: (at(x)?, at(y)?), size: (length(width)?, length(height)?) })
    }
}

/// A bound of memory in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryBound(usize);

impl FromStr for MemoryBound {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong = || "expected a number of bytes with K, M, G or T, such as 512M or 8G".to_owned();
        let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
        let (number, unit) = text.split_at(digits);
        let unit = unit.to_ascii_uppercase();
        let unit = unit.strip_suffix("IB").or_else(|| unit.strip_suffix('B')).unwrap_or(&unit);
        let power = ["", "K", "M", "G", "T"].iter().position(|known| *known == unit).ok_or_else(wrong)?;
        let number: f64 = number.parse().map_err(|_| wrong())?;
        Ok(Self((number * 1024f64.powi(power as i32)) as usize))
    }
}

/// A render that was read, or looked through and is read part by part.
pub enum Input {
    Whole(Shot),
    Parts(Box<Surveyed>),
}

/// What is left of a render that was denoised: all that it takes to write the result.
pub enum Used {
    /// With the planes as they were read, for those who have a use for them.
    Whole(Shot),
    /// The denoiser has used up the planes; the result is of a region of it.
    Survey(Box<Survey>, Option<Rect>),
}

/// A render that is denoised in parts.
pub struct Surveyed {
    survey: Survey,
    facts: Facts,
    /// The pixels that the result holds.
    target: Rect,
    /// They are a region that was asked for.
    is_region: bool,
    parts: Vec<Part>,
}

/// The result, and its error as far as it can be estimated.
pub struct Output {
    pub denoised: Denoised,
    pub error: ErrorSums,
    /// Bands that the picture was denoised in.
    pub parts: usize,
}

impl Input {
    /// Looks through what `job` reads where it is to be denoised in parts, signed; has it by `whole` else.
    pub fn read(
        job: &Job,
        arguments: &Arguments,
        denoiser: &Denoiser,
        signature: &str,
        frames: usize,
        whole: impl FnOnce() -> Result<Shot>,
    ) -> Result<Self> {
        if arguments.region.is_none() && arguments.memory.is_none() {
            return whole().map(Self::Whole);
        }
        let Some(options) = denoiser.pipeline() else {
            let what = format!("the method {} needs the whole picture", denoiser.method().name());
            return Err(Error::new(ErrorKind::Usage, what).remedy("leave --region and --memory out"));
        };
        let read = arguments.read_options(job);
        let mut surveyed = Surveyed::new(job, &read, arguments, options, frames)?;
        surveyed.survey.sign(signature);
        Ok(Self::Parts(Box::new(surveyed)))
    }

    pub fn layout(&self) -> &Layout {
        match self {
            Self::Whole(shot) => shot.picture.layout(),
            Self::Parts(surveyed) => surveyed.survey.layout(),
        }
    }

    /// Denoises it. The planes as they were read are given up, but where they are to be `kept` or other frames have a
    /// use for them.
    pub fn denoise(self, denoiser: &Denoiser, clock: &Clock, kept: bool) -> Result<(Used, Output)> {
        let shot = match self {
            Self::Parts(surveyed) => {
                let output = surveyed.denoise(denoiser, clock)?;
                let region = surveyed.is_region.then_some(surveyed.target);
                return Ok((Used::Survey(Box::new(surveyed.survey), region), output));
            }
            Self::Whole(shot) => shot,
        };
        let given = if kept { Err(shot) } else { shot.into_picture() };
        let (used, input, denoised) = match given {
            Ok(picture) => {
                let (survey, frame) = picture.into_frame();
                let input = input_error(&frame);
                (Used::Survey(Box::new(survey), None), input, denoiser.denoise(frame, clock)?)
            }
            Err(shot) => {
                let frame = shot.picture.frame();
                let denoised = denoiser.denoise_in_sequence(frame, &shot.neighbours(), clock)?;
                let input = input_error(frame);
                (Used::Whole(shot.alone()), input, denoised)
            }
        };
        let mut error = ErrorSums::default();
        error.add(input.as_ref(), Rect::whole(denoised.mse.size()), &denoised);
        Ok((used, Output { denoised, error, parts: 1 }))
    }
}

impl Used {
    pub fn layout(&self) -> &Layout {
        match self {
            Self::Whole(shot) => shot.picture.layout(),
            Self::Survey(survey, _) => survey.layout(),
        }
    }

    pub fn sums(&self, denoised: &Denoised) -> Vec<SumCheck> {
        match self {
            Self::Whole(shot) => shot.picture.sums(denoised),
            Self::Survey(survey, _) => survey.sums(denoised),
        }
    }

    pub fn write(&self, job: &Job, denoised: &Denoised, aux: bool) -> Result<Vec<String>> {
        match self {
            Self::Whole(shot) => {
                let mut notes = shot.picture.write(&job.output, denoised, aux)?;
                notes.extend(shot.note());
                Ok(notes)
            }
            Self::Survey(survey, None) => survey.write(&job.output, denoised, aux),
            Self::Survey(survey, Some(region)) => survey.write_region(&job.output, *region, denoised, aux),
        }
    }
}

impl Surveyed {
    fn new(
        job: &Job,
        read: &ReadOptions,
        arguments: &Arguments,
        options: &Options,
        frames: usize,
    ) -> Result<Self> {
        let (mut facts, mut planes) = (Facts::default(), Planes::default());
        let survey = Survey::open(&job.input, read, |rows| {
            facts.add(rows);
            planes = Planes::of(rows, options);
        })?;
        let target = match arguments.region {
            Some(region) => survey.locate(region.at, region.size)?,
            None => Rect::whole(survey.size()),
        };
        let rows = match arguments.memory {
            Some(bound) => planes.rows_within(bound, target, survey.size(), options, frames, &facts)?,
            None => target.height,
        };
        let bands = (0..target.height).step_by(rows).map(|y| Rect {
            y: target.y + y,
            height: rows.min(target.height - y),
            ..target
        });
        let parts = bands.map(|band| Part::new(band, survey.size(), options, &facts));
        let parts: Vec<Part> = parts.collect::<Result<_>>()?;
        let apart = parts.iter().any(|part| !part.is_whole());
        if apart && options.outliers.enabled && facts.has_noise() {
            let (width, height) = survey.size();
            for y in (0..height).step_by(OUTLIER_ROWS) {
                let rows = Rect { x: 0, y, width, height: OUTLIER_ROWS.min(height - y) };
                let part = Part::of_outliers(rows, survey.size(), options)?;
                facts.add_outliers(&survey.read(part.read())?, &part, options)?;
            }
        }
        Ok(Self { survey, facts, target, is_region: arguments.region.is_some(), parts })
    }

    fn denoise(&self, denoiser: &Denoiser, clock: &Clock) -> Result<Output> {
        let mut error = ErrorSums::default();
        let mut whole: Option<Denoised> = None;
        for (n, part) in self.parts.iter().enumerate() {
            if self.parts.len() > 1 {
                clock.begin(&format!("band {} of {}", n + 1, self.parts.len()));
            }
            let frame = self.survey.read(part.read())?;
            let input = input_error(&frame);
            let denoised = if self.parts.len() > 1 {
                denoiser.denoise_part(frame, part, &self.facts, &Silent)?
            } else {
                denoiser.denoise_part(frame, part, &self.facts, clock)?
            };
            error.add(input.as_ref(), part.within(), &denoised);
            match &mut whole {
                None if self.parts.len() == 1 => whole = Some(denoised),
                None => whole = Some(denoised.begin(self.target.size())),
                Some(whole) => whole.put(&denoised, (0, part.wanted().y - self.target.y)),
            }
        }
        let denoised = whole.expect("a picture has rows");
        Ok(Output { denoised, error, parts: self.parts.len() })
    }
}

/// How many planes a frame has.
#[derive(Debug, Clone, Copy, Default)]
struct Planes {
    all: usize,
    /// Of the features that fits read.
    features: usize,
    aovs: usize,
}

impl Planes {
    fn of(frame: &Frame, options: &Options) -> Self {
        let rgb = |there: bool| if there { 3 } else { 0 };
        let read = frame.features().iter().filter(|feature| options.features.contains(&feature.kind));
        let features = read.map(|feature| feature.planes.len()).sum();
        let all_features = frame.features().iter().map(|feature| {
            let halves = if feature.halves.is_some() { 2 } else { 0 };
            feature.planes.len() * (1 + usize::from(feature.var_of_mean.is_some()) + halves)
        });
        let aovs = 3 * frame.aovs().len();
        let color = 3 + rgb(frame.color_var_of_mean().is_some()) + 2 * rgb(frame.halves().is_some());
        Self { all: color + all_features.sum::<usize>() + aovs, features, aovs }
    }

    /// Bytes of the result.
    fn result(&self, target: Rect) -> usize {
        (5 + self.aovs) * size_of::<f32>() * target.width * target.height
    }

    /// Bytes for each pixel that is read, when most is held. That is while features are filtered: the planes as they
    /// were read, the filtered ones, the albedo, the variance and what is smoothed of it; or in the last stage: what fits
    /// read, the guides of colour, of colour over albedo and of the features, the pilot, the sums and their coverage; or,
    /// with many components, at its end: what fits read, the sums and the result. Of 31 channels it is 61 planes, measured,
    /// where this tells 66.
    fn per_pixel(&self) -> usize {
        let (albedo, variance, smoothed, guide, pilot, coverage, input_error) = (3, 3, 4, 8, 4, 1, 1);
        let targets = 3 + self.aovs;
        let (sums, result) = (targets + 4, targets + 2);
        let filtering = self.all + self.features + albedo + variance + smoothed;
        let read = targets + variance + smoothed + self.features + albedo;
        let fitting = read + 2 * guide + 2 * self.features + pilot + sums + coverage;
        let ending = read + sums + result;
        (filtering.max(fitting).max(ending) + input_error) * size_of::<f32>()
    }

    /// Rows of a band with which a run keeps to `bound`.
    fn rows_within(
        &self,
        MemoryBound(bound): MemoryBound,
        target: Rect,
        size: (usize, usize),
        options: &Options,
        frames: usize,
        facts: &Facts,
    ) -> Result<usize> {
        // Of a sequence one result is written while the next is made.
        let held = FIXED_BYTES + self.result(target) * frames.min(2);
        let halo = halo(options, facts);
        let row = target.grown(halo, size).width * self.per_pixel();
        let need = |rows: usize| held + row * (rows + 2 * halo).min(size.1);
        if need(target.height) <= bound {
            return Ok(target.height);
        }
        let least = need(LEAST_ROWS.min(target.height));
        if least > bound {
            const MIB: usize = 1 << 20;
            let given = if bound < MIB { format!("of {bound} bytes") } else { format!("{}M", bound / MIB) };
            let what = format!("--memory {given} is too little for this picture");
            let remedy = format!("give at least {}M", least.div_ceil(MIB));
            return Err(Error::new(ErrorKind::Usage, what).remedy(remedy));
        }
        let rows = (bound - held) / row - 2 * halo;
        // Bands of equal height: the last one should not be nearly nothing but halo.
        Ok(target.height.div_ceil(target.height.div_ceil(rows)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_regions_are_read_and_nonsense_is_refused() {
        for (text, bytes) in [("512M", 512 << 20), ("8G", 8 << 30), ("1.5GiB", 3 << 29), ("100", 100)] {
            assert_eq!(text.parse(), Ok(MemoryBound(bytes)), "{text}");
        }
        assert!(["", "G", "8X", "-1G"].iter().all(|text| text.parse::<MemoryBound>().is_err()));
        assert_eq!("-8, 0,16,9".parse(), Ok(Region { at: (-8, 0), size: (16, 9) }));
        assert!(["", "1,2,3", "1,2,3,-4", "1,2,3,4,5"].iter().all(|text| text.parse::<Region>().is_err()));
    }

    #[test]
    fn bands_fill_the_bound_and_too_small_a_bound_names_the_least() {
        let planes = Planes { all: 20, features: 7, aovs: 0 };
        let target = Rect::whole((7680, 4320));
        let (options, facts) = (Options::default(), Facts::default());
        let rows = |bound| planes.rows_within(MemoryBound(bound), target, target.size(), &options, 1, &facts);
        let need = |rows: usize| {
            let read = rows + 2 * halo(&options, &facts);
            FIXED_BYTES + planes.result(target) + planes.per_pixel() * 7680 * read
        };
        assert_eq!(rows(64 << 30), Ok(4320));
        let chosen = rows(4 << 30).unwrap();
        assert!(need(chosen) <= 4 << 30 && chosen >= LEAST_ROWS, "{chosen}");
        let error = rows(1 << 30).unwrap_err();
        let least = need(LEAST_ROWS);
        assert_eq!(error.kind(), ErrorKind::Usage);
        assert!(error.to_string().contains(&format!("{}M", least.div_ceil(1 << 20))), "{error}");
        assert_eq!(rows(least), Ok(LEAST_ROWS));
        assert!(rows(100).unwrap_err().to_string().starts_with("--memory of 100 bytes is too little"));
    }
}
