//! Adaptive Polynomial Rendering (Moon et al. 2016): a denoiser for Monte Carlo renders.

pub mod denoise;
pub mod error;
pub mod frame;
pub mod image;
pub mod io;
pub mod metrics;
pub mod options;
pub mod report;
pub mod tone;
pub mod trace;

pub use denoise::denoise;
pub use error::{Error, ErrorKind, Result};
pub use frame::{Aov, Denoised, Feature, FeatureKind, Frame, Summary};
pub use options::Options;
