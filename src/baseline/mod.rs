//! The methods that this work stands on and is measured against, each on the same [`Frame`].
//!
//! | name | publication |
//! |---|---|
//! | `apr` | the pipeline of [`crate::denoise()`] |
//! | [`nlm`] | Rousselle, Knaus, Zwicker: Adaptive Rendering with Non-Local Means Filtering, 2012 |
//! | [`lp`] | Moon, Iglesias-Guitian, Yoon, Mitchell: Adaptive Rendering with Linear Predictions, 2015 |
//! | [`wavelet`] | Overbeck, Donner, Ramamoorthi: Adaptive Wavelet Rendering, 2009 |
//! | [`nfor`] | Bitterli et al.: Nonlinearly Weighted First-order Regression, 2016 |
//! | [`student`] | the version that this project grew from |
//!
//! Every method repairs the frame as the pipeline does, takes the same planes, gives the same bits on any
//! number of threads, and returns a [`Denoised`]. Constants are the publications'; where a publication
//! leaves one open the choice is tagged `[choice]`.

mod input;
pub mod lp;
pub mod nfor;
pub mod nlm;
mod patches;
pub mod student;
pub mod wavelet;

use crate::denoise::{Facts, Neighbours, Observer, Part, denoise_in_sequence, denoise_part};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{Denoised, FeatureKind, Frame};
use crate::options::{Key, Options, replaced};
use serde::{Deserialize, Deserializer, Serialize};
use std::borrow::Cow;

/// A way to denoise a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Method {
    /// Adaptive polynomial rendering, [`crate::denoise()`].
    Apr,
    /// [`nlm`].
    Nlm,
    /// [`lp`].
    Lp,
    /// [`wavelet`].
    Wavelet,
    /// [`nfor`].
    Nfor,
    /// [`student`].
    Student,
}

impl Method {
    /// Every method by its name.
    pub const NAMES: [(&'static str, Method); 6] = [
        ("apr", Method::Apr),
        ("nlm", Method::Nlm),
        ("lp", Method::Lp),
        ("wavelet", Method::Wavelet),
        ("nfor", Method::Nfor),
        ("student", Method::Student),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        let named = Self::NAMES.iter().find(|(_, method)| *method == self);
        named.expect("every method has a name").0
    }

    /// Its publication.
    pub fn publication(self) -> &'static str {
        match self {
            Method::Apr => "Moon, McDonagh, Mitchell, Gross: Adaptive Polynomial Rendering (2016), improved",
            Method::Nlm => {
                "Rousselle, Knaus, Zwicker: Adaptive Rendering with Non-Local Means Filtering (2012)"
            }
            Method::Lp => {
                "Moon, Iglesias-Guitian, Yoon, Mitchell: Adaptive Rendering with Linear Predictions (2015)"
            }
            Method::Wavelet => "Overbeck, Donner, Ramamoorthi: Adaptive Wavelet Rendering (2009)",
            Method::Nfor => "Bitterli et al.: Nonlinearly Weighted First-order Regression (2016)",
            Method::Student => "the student's version of Adaptive Polynomial Rendering",
        }
    }
}

/// A method together with its options.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Denoiser {
    /// [`Method::Apr`].
    Apr(Options),
    /// [`Method::Nlm`].
    Nlm(nlm::Options),
    /// [`Method::Lp`].
    Lp(lp::Options),
    /// [`Method::Wavelet`].
    Wavelet(wavelet::Options),
    /// [`Method::Nfor`].
    Nfor(nfor::Options),
    /// [`Method::Student`].
    Student(Options),
}

impl Denoiser {
    /// `method` with its defaults.
    pub fn new(method: Method) -> Self {
        match method {
            Method::Apr => Self::Apr(Options::default()),
            Method::Nlm => Self::Nlm(nlm::Options::default()),
            Method::Lp => Self::Lp(lp::Options::default()),
            Method::Wavelet => Self::Wavelet(wavelet::Options::default()),
            Method::Nfor => Self::Nfor(nfor::Options::default()),
            Method::Student => Self::Student(student::options()),
        }
    }

    /// `method` with the options that `source` holds. What it leaves out has its default: for the student's
    /// version, whose options are the pipeline's, the pipeline's.
    ///
    /// # Errors
    /// When an option is not known or of another type.
    pub fn deserialize<'de, D: Deserializer<'de>>(
        method: Method,
        source: D,
    ) -> std::result::Result<Self, D::Error> {
        Ok(match method {
            Method::Apr => Self::Apr(Deserialize::deserialize(source)?),
            Method::Nlm => Self::Nlm(Deserialize::deserialize(source)?),
            Method::Lp => Self::Lp(Deserialize::deserialize(source)?),
            Method::Wavelet => Self::Wavelet(Deserialize::deserialize(source)?),
            Method::Nfor => Self::Nfor(Deserialize::deserialize(source)?),
            Method::Student => Self::Student(Deserialize::deserialize(source)?),
        })
    }

    /// The denoiser with the option called `key` replaced, as [`Options::with`] does it.
    ///
    /// # Errors
    /// `Usage` when there is no such option or `new` is of another type.
    pub fn with(self, key: &str, new: serde_json::Value) -> Result<Self> {
        replaced(&self, key, new, |value| Self::deserialize(self.method(), value))
    }

    /// The method.
    pub fn method(&self) -> Method {
        match self {
            Self::Apr(_) => Method::Apr,
            Self::Nlm(_) => Method::Nlm,
            Self::Lp(_) => Method::Lp,
            Self::Wavelet(_) => Method::Wavelet,
            Self::Nfor(_) => Method::Nfor,
            Self::Student(_) => Method::Student,
        }
    }

    /// The pipeline's options, where the method is the pipeline under some options.
    pub fn pipeline(&self) -> Option<&Options> {
        match self {
            Self::Apr(options) | Self::Student(options) => Some(options),
            _ => None,
        }
    }

    /// Whether the method looks at features of this kind.
    pub fn fits(&self, kind: FeatureKind) -> bool {
        match self {
            Self::Apr(options) | Self::Student(options) => options.features.contains(&kind),
            Self::Lp(_) | Self::Nfor(_) => input::kinds().contains(&kind),
            Self::Nlm(_) | Self::Wavelet(_) => false,
        }
    }

    /// Whether half buffers are of use beside a variance: each half is filtered by the other.
    pub fn crosses_halves(&self) -> bool {
        matches!(self, Self::Nlm(_) | Self::Nfor(_))
    }

    /// Every option with its value, by the names that [`Denoiser::with`] takes.
    pub fn keys(&self) -> Vec<Key> {
        match self {
            Self::Apr(options) | Self::Student(options) => options.keys(),
            Self::Nlm(options) => options.keys(),
            Self::Lp(options) => options.keys(),
            Self::Wavelet(options) => options.keys(),
            Self::Nfor(options) => options.keys(),
        }
    }

    /// Checks every option's range.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] names the option, what it is and what it may be.
    pub fn check(&self) -> Result<()> {
        match self {
            Self::Apr(options) | Self::Student(options) => options.check(),
            Self::Nlm(options) => options.check(),
            Self::Lp(options) => options.check(),
            Self::Wavelet(options) => options.check(),
            Self::Nfor(options) => options.check(),
        }
    }

    /// Denoises `frame`; of the methods only the pipeline tells `observer` how it goes on, and is stopped by it.
    ///
    /// # Errors
    /// When an option is out of its range, or the observer stops the run.
    pub fn denoise<'a>(&self, frame: impl Into<Cow<'a, Frame>>, observer: &dyn Observer) -> Result<Denoised> {
        self.denoise_in_sequence(frame, &Neighbours::default(), observer)
    }

    /// As [`Denoiser::denoise`], with the samples of the frames beside `frame`; of the methods only the
    /// pipeline has a use for them.
    ///
    /// # Errors
    /// As [`Denoiser::denoise`].
    pub fn denoise_in_sequence<'a>(
        &self,
        frame: impl Into<Cow<'a, Frame>>,
        neighbours: &Neighbours<'_>,
        observer: &dyn Observer,
    ) -> Result<Denoised> {
        match self {
            Self::Apr(options) => denoise_in_sequence(frame, neighbours, options, observer),
            Self::Nlm(options) => nlm::denoise(&frame.into(), options),
            Self::Lp(options) => lp::denoise(&frame.into(), options),
            Self::Wavelet(options) => wavelet::denoise(&frame.into(), options),
            Self::Nfor(options) => nfor::denoise(&frame.into(), options),
            Self::Student(options) => {
                let mut denoised = denoise_in_sequence(frame, neighbours, options, observer)?;
                denoised.summary.method = Method::Student.name();
                Ok(denoised)
            }
        }
    }

    /// Denoises a part of a picture, as [`denoise_part`] does it.
    ///
    /// # Errors
    /// As [`denoise_part`]; when the method is not the pipeline and needs the whole picture.
    pub fn denoise_part<'a>(
        &self,
        frame: impl Into<Cow<'a, Frame>>,
        part: &Part,
        facts: &Facts,
        observer: &dyn Observer,
    ) -> Result<Denoised> {
        let Some(options) = self.pipeline() else {
            let what = format!("the method {} needs the whole picture", self.method().name());
            return Err(Error::new(ErrorKind::Usage, what));
        };
        let mut denoised = denoise_part(frame, part, facts, options, observer)?;
        denoised.summary.method = self.method().name();
        Ok(denoised)
    }
}
