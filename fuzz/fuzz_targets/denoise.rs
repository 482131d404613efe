//! Arbitrary bits → frame and options → denoised.
#![no_main]

#[path = "../../tests/fuzzed/denoise.rs"]
mod denoise;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| denoise::survives(bytes));
