//! Adaptive Polynomial Rendering (Moon, McDonagh, Mitchell, Gross, SIGGRAPH 2016): a denoiser for Monte
//! Carlo renders.
//!
//! A [`Frame`] goes in, a [`Denoised`] comes out, and [`denoise()`] is the pipeline:
//!
//! 1. repair NaN and infinities, bring the picture to a known exposure;
//! 2. take outliers out and remember their energy;
//! 3. estimate the noise where none is given, filter noisy features;
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
//! | colour | 3 planes | linear radiance, any scale; NaN, ±Inf and what is 1e27 times the typical are repaired and counted; negative values are kept and counted | not allowed |
//! | variance | 3 planes | of the *mean*, radiance², ≥ 0; others are repaired and counted | half buffers, else estimated from the picture |
//! | half buffers | 2 × 3 planes | means of two independent halves, their average is the colour | done without |
//! | features | any number of planes | any unit; NaN is repaired, and ±Inf but of depth and position, where what is beyond ±1e15 is moved there; constant ones are left out | done without |
//! | AOVs | 3 planes each | radiance; they go through the beauty's operator and are repaired where they or the colour are broken, which costs the colour nothing | none |
//!
//! Planes are row major, top row first, and all of the colour's size. What was repaired, left out or taken out is
//! told in the result's [`Summary`].
//!
//! ```
//! use apr::{Frame, Options, Plane, denoise};
//!
//! let (width, height) = (32, 18);
//! let grain = |x: usize, y: usize| 0.1 * ((x * 7919 + y * 104_729) % 13) as f32 / 13.0;
//! let color = std::array::from_fn(|_| Plane::from_fn(width, height, |x, y| 0.5 + grain(x, y)));
//! let variance = std::array::from_fn(|_| Plane::filled(width, height, 8e-4));
//! let frame = Frame::new(color)?.with_variance_of_mean(variance)?;
//! let result = denoise(frame, &Options::default())?; // or &frame, for a third more memory
//! assert_eq!(result.color[0].size(), (width, height));
//! let mse = result.mse.expect("the pipeline estimates its error");
//! assert!(mse.data().iter().all(|mse| *mse < 8e-4));
//! # Ok::<(), apr::Error>(())
//! ```
//!
//! # All that it can use
//!
//! ```
//! use apr::{Aov, Feature, FeatureKind, Frame, Motion, Neighbours, Options, Plane, Rgb, Silent, denoise_in_sequence};
//!
//! # let size = (24, 18);
//! # let grain = |x: usize, y: usize| 0.1 * ((x * 7919 + y * 104_729) % 13) as f32 / 13.0;
//! # let rgb = || -> Rgb { std::array::from_fn(|_| Plane::from_fn(size.0, size.1, |x, y| 0.5 + grain(x, y))) };
//! # let plane = |value: f32| Plane::filled(size.0, size.1, value);
//! # let step = || vec![Plane::from_fn(size.0, size.1, |x, _| if x < 9 { 2.0 } else { 5.0 })];
//! # let frame = || -> apr::Result<Frame> {
//! # let (color, variance, half_a, half_b, key) = (rgb(), rgb(), rgb(), rgb(), rgb());
//! # let (depth, depth_variance) = (step(), vec![plane(1e-3)]);
//! let depth = Feature::new("depth", FeatureKind::Depth, depth).with_variance_of_mean(depth_variance);
//! let motion = Motion { previous: Some([plane(-1.5), plane(0.0)]), next: None };
//! let frame = Frame::new(color)?
//!     .with_variance_of_mean(variance)?
//!     .with_halves([half_a, half_b])?
//!     .with_feature(depth)?
//!     .with_aov(Aov { name: "key".into(), color: key })?
//!     .with_motion(motion)?;
//! # Ok(frame) };
//! # let (frame, frame_before) = (frame()?, frame()?);
//! let neighbours = Neighbours { before: vec![&frame_before], after: vec![] };
//! let result = denoise_in_sequence(&frame, &neighbours, &Options::best(), &Silent)?;
//! # assert_eq!((result.aovs.len(), result.summary.beside.len()), (1, 1));
//! # apr::Result::Ok(())
//! ```
//!
//! - Files: [`io::Picture`] makes a frame of a renderer's EXR and writes the result back into all that the file held.
//! - Pictures that do not fit into memory, or one on many machines: [`denoise::denoise_part`] gives the pixels of a
//!   part the bits that they have in the whole, after [`denoise::Facts`] were gathered of it; [`io::Survey`] reads
//!   parts.
//! - Where a renderer should sample next: [`sampling`]. How right a result is: [`metrics`]. Other methods on the same
//!   frame: [`baseline`].
//! - Progress, and a way to stop a run: an [`Observer`]. The library prints nothing and reads no clock.
//!
//! # Threads
//!
//! The work is rayon's, on its global pool unless it is called in another one, and the bits of the result do not
//! depend on the number of threads:
//!
//! ```
//! # use apr::{Frame, Options, denoise};
//! # let frame = Frame::new(apr::image::black(8, 8))?;
//! let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
//! let result = pool.install(|| denoise(frame, &Options::default()))?;
//! # apr::Result::Ok(())
//! ```

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests hold what is ours against it"))]

#[cfg(feature = "trace")]
pub mod adaptive;
pub mod baseline;
pub mod denoise;
pub mod error;
pub mod frame;
pub mod image;
pub mod io;
mod likeness;
#[allow(clippy::disallowed_methods, reason = "judges pictures, makes none")]
pub mod metrics;
pub mod options;
#[cfg(feature = "report")]
#[allow(clippy::disallowed_methods, reason = "shows pictures, makes none")]
pub mod report;
#[allow(clippy::disallowed_methods, reason = "places samples, makes no pictures")]
pub mod sampling;
#[allow(clippy::disallowed_methods, reason = "shows pictures, makes none")]
pub mod tone;
#[cfg(feature = "trace")]
#[allow(clippy::disallowed_methods, reason = "renders, and promises no bits on other machines")]
pub mod trace;

pub use self::image::{Plane, Rgb};
pub use denoise::{Neighbours, Observer, Silent, denoise, denoise_in_sequence};
pub use error::{Error, ErrorKind, Result};
pub use frame::{Aov, Denoised, Feature, FeatureKind, Frame, Motion, Summary};
pub use options::{Kernel, Options};
