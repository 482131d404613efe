//! The parts that a picture is denoised in: all of it at once, a region, or bands that keep to a [budget](Budget) of
//! memory. The bits are the same.

use std::str::FromStr;

use apr::baseline::Denoiser;
use apr::denoise::{Facts, Part, Silent, halo};
use apr::error::{Error, ErrorKind, Result};
use apr::image::Rect;
use apr::io::{Layout, ReadOptions, SumCheck, Survey};
use apr::{Denoised, Options};

use crate::arguments::Arguments;
use crate::budget::{self, Budget, Fixed, Halos, Planes};
use crate::clock::Clock;
use crate::plan::Job;
use crate::report::{ErrorSums, input_error};
use crate::shot::Shot;

/// A region by x and y of its first pixel, width and height, in the file's pixel coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    at: (i32, i32),
    size: (usize, usize),
}

impl Region {
    /// Pixels of it, and those around it up to `reach` of them away.
    fn pixels_around(self, reach: usize) -> usize {
        let along = |length: usize| length.saturating_add(2 * reach);
        along(self.size.0).saturating_mul(along(self.size.1))
    }

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
    budget: Budget,
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
        let surveyed = Surveyed::new(job, &read, arguments, options, frames)?;
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
        error.add(input.as_ref(), Rect::whole(denoised.color[0].size()), &denoised);
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
        let sums = match self {
            Self::Whole(shot) => shot.picture.sums(denoised),
            Self::Survey(survey, _) => survey.sums(denoised),
        };
        sums.expect("the result is of this picture")
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
        let pixels = arguments.region.map_or(0, |region| region.pixels_around(halo(options, &facts)));
        let survey =
            Survey::open(&job.input, read, budget::before(arguments.memory, pixels, frames), |rows| {
                facts.add(rows);
                planes = Planes::of(rows, options);
            })?;
        let size = survey.size();
        let target = match arguments.region {
            Some(region) => survey.locate(region.at, region.size)?,
            None => Rect::whole(size),
        };
        let bytes = budget::fixed(rayon::current_num_threads(), survey.block_bytes());
        let fixed = Fixed { bytes, band: survey.band_bytes() };
        let outliers = options.outliers.enabled && facts.has_noise();
        let stripe = |y: usize, height: usize| {
            Part::of_outliers(Rect { x: 0, y, width: size.0, height }, size, options)
        };
        let around = if outliers { Some(stripe(0, 1)?.read().height - 1) } else { None };
        let halos = Halos { part: halo(options, &facts), outliers: around };
        let budget = Budget::new(arguments.memory, (fixed, planes), target, size, halos, frames);
        let rows = budget.rows()?;
        let bands = (0..target.height).step_by(rows).map(|y| Rect {
            y: target.y + y,
            height: rows.min(target.height - y),
            ..target
        });
        let parts = bands.map(|band| Part::new(band, size, options, &facts));
        let parts: Vec<Part> = parts.collect::<Result<_>>()?;
        let apart = parts.iter().any(|part| !part.is_whole());
        if apart && outliers {
            let rows = budget.outlier_rows();
            for y in (0..size.1).step_by(rows) {
                let part = stripe(y, rows.min(size.1 - y))?;
                survey.keep(budget.beside_stages(part.read()));
                facts.add_outliers(survey.read(part.read())?, &part, options)?;
            }
        }
        Ok(Self { survey, facts, target, is_region: arguments.region.is_some(), parts, budget })
    }

    fn denoise(&self, denoiser: &Denoiser, clock: &Clock) -> Result<Output> {
        let mut error = ErrorSums::default();
        let mut whole: Option<Denoised> = None;
        for (n, part) in self.parts.iter().enumerate() {
            if self.parts.len() > 1 {
                clock.begin(&format!("band {} of {}", n + 1, self.parts.len()));
            }
            self.survey.keep(self.budget.beside_planes(part.read()));
            let frame = self.survey.read(part.read())?;
            self.survey.keep(self.budget.beside_stages(part.read()));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_are_read_and_nonsense_is_refused() {
        assert_eq!("-8, 0,16,9".parse(), Ok(Region { at: (-8, 0), size: (16, 9) }));
        assert!(["", "1,2,3", "1,2,3,-4", "1,2,3,4,5"].iter().all(|text| text.parse::<Region>().is_err()));
    }
}
