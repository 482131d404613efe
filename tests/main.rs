//! All tests of the library and its programs in one program: built in a fifth of the time of twenty.
//! `cargo test --test all regions::` runs those of one file.

#![allow(clippy::disallowed_methods, reason = "tests hold what is ours against it")]

mod ambiguous;
mod answers;
mod architecture;
mod baseline;
mod channel_map;
mod compare;
mod compat;
mod components;
mod convergence;
mod damaged;
mod denoise;
mod documents;
mod exr_files;
#[cfg(unix)]
mod faults;
mod found;
mod fuzzed;
mod generate;
mod not_finite;
mod parts;
mod pass_through;
mod program;
mod properties;
mod regions;
mod sequence;
#[cfg(unix)]
mod stopped;
mod sweep;
mod temporal;
mod trace;
