//! Files: the only module that opens pictures, and the only one that knows OpenEXR.
//!
//! [`Picture::read`] makes a [`Frame`](crate::Frame) of whatever a renderer wrote, by the channel map
//! in `channels.rs`; [`Picture::write`] puts the denoised beauty and its components back and passes
//! everything else through. [`write_frame`] writes a frame under this project's own names.
//!
//! ```no_run
//! use apr::io::{Picture, ReadOptions};
//!
//! let picture = Picture::read("render.exr", &ReadOptions::default())?;
//! let denoised = apr::denoise(picture.frame(), &apr::Options::default())?;
//! picture.write("denoised.exr", &denoised, false)?;
//! # apr::Result::Ok(())
//! ```
//!
//! Pixels pass through block by block: what is held in memory is the frame, not the file. Headers are
//! held against fixed limits ([`MAX_PIXELS`], [`MAX_BLOCK_BYTES`], [`MAX_CHANNELS`], [`MAX_PARTS`]) and
//! against the length of the file before anything is allocated for them.

mod assemble;
mod atomic;
mod attributes;
mod beauty;
mod bounds;
mod by_name;
mod canvas;
mod channels;
mod components;
mod counts;
mod decode;
mod document;
mod doubts;
mod encode;
mod evidence;
mod halves;
mod kept;
mod layers;
mod layout;
mod limits;
mod mapping;
mod merge;
mod names;
mod ordered;
mod own;
mod picture;
mod pixels;
mod places;
mod provenance;
mod recognize;
mod region;
mod rewrite;
mod roles;
mod siblings;
mod source;
mod statistics;
mod sums;
mod survey;
mod variance;
mod zip;

pub use atomic::{abandon_temporaries, check_old, check_target, write_bytes};
pub use beauty::{Beauty, read_rgb};
pub use bounds::bound_feature;
pub use by_name::holds_result;
pub use channels::{Renderer, VarianceKind};
pub use counts::{DENSITY, SampleMap, read_sample_map};
pub use layout::{FileLayout, Layout, PartLayout, RoleLayout};
pub use limits::{MAX_BLOCK_BYTES, MAX_CHANNELS, MAX_PARTS, MAX_PIXELS, MAX_PLANE_BYTES};
pub use mapping::Mapping;
pub use merge::merge;
pub use own::{FrameHeader, write_frame, write_plane};
pub use picture::{Picture, ReadOptions};
pub use places::{RunFile, check_apart, check_ending, check_ending_of, is_same_file};
pub use provenance::{Provenance, check_replaced, fingerprints, is_exr, provenance};
pub use sums::{Deviation, SumCheck};
pub use survey::Survey;
