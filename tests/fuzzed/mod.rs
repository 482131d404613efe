//! What the fuzzers run: each target turns any bytes into a run and asserts what must hold of it.

pub mod denoise;
pub mod exr_to_frame;
