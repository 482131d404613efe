//! Adaptive Polynomial Rendering (Moon, McDonagh, Mitchell, Gross, SIGGRAPH 2016): a denoiser for Monte
//! Carlo renders.
//!
//! A [`Frame`] goes in, a [`Denoised`] comes out, and [`denoise()`] is the pipeline:
//!
//! 1. repair NaN and infinities, bring the picture to a known exposure, estimate its noise where none is given;
//! 2. take outliers out and remember their energy;
//! 3. filter noisy features;
//! 4. around sparse centres fit a polynomial in pixel position plus a linear function of the features, by
//!    weights that compare noisy colours and features; judge every order by its estimated risk;
//! 5. average the overlapping fits by that risk;
//! 6. again, with the result as the witness of bias (every stage fits the noisy data), and once more at half the
//!    resolution, for blotches as large as a window;
//! 7. restore what the residual shows to be lost, give the outliers' energy back.
//!
//! The features of this crate are `cli` (the three programs, on by default), `report` (pictures and pages about
//! results) and `trace` (the path tracer, adaptive rendering); it denoises without any of them.
//!
//! # The input contract
//!
//! | what | shape | unit and range | missing |
//! |---|---|---|---|
//! | colour | 3 planes | linear radiance, any scale; NaN and ±Inf are repaired and counted | not allowed |
//! | variance | 3 planes | of the *mean*, radiance², ≥ 0; others are repaired and counted | half buffers, else estimated from the picture |
//! | half buffers | 2 × 3 planes | means of two independent halves, their average is the colour | done without |
//! | features | any number of planes | any unit; NaN is repaired; constant ones are left out | done without |
//! | AOVs | 3 planes each | radiance; they go through the beauty's operator | none |
//!
//! Planes are row major, top row first, and all of the colour's size.
//!
//! ```
//! use apr::image::Plane;
//! use apr::{Frame, Options, denoise};
//!
//! let (width, height) = (32, 18);
//! let grain = |x: usize, y: usize| 0.1 * ((x * 7919 + y * 104_729) % 13) as f32 / 13.0;
//! let color = std::array::from_fn(|_| Plane::from_fn(width, height, |x, y| 0.5 + grain(x, y)));
//! let variance = std::array::from_fn(|_| Plane::filled(width, height, 8e-4));
//! let frame = Frame::new(color)?.with_variance_of_mean(variance)?;
//! let result = denoise(frame, &Options::default())?; // or &frame, for a third more memory
//! assert_eq!(result.color[0].size(), (width, height));
//! assert!(result.mse.data().iter().all(|mse| *mse < 8e-4));
//! # Ok::<(), apr::Error>(())
//! ```

#[cfg(feature = "trace")]
pub mod adaptive;
pub mod baseline;
pub mod denoise;
pub mod error;
pub mod frame;
pub mod image;
pub mod io;
mod likeness;
pub mod metrics;
pub mod options;
#[cfg(feature = "report")]
pub mod report;
pub mod sampling;
pub mod tone;
#[cfg(feature = "trace")]
pub mod trace;

pub use denoise::{Neighbours, denoise, denoise_in_sequence};
pub use error::{Error, ErrorKind, Result};
pub use frame::{Aov, Denoised, Feature, FeatureKind, Frame, Motion, Summary};
pub use options::Options;
