//! Arbitrary bytes → EXR → frame → EXR.
#![no_main]

#[path = "../../tests/fuzzed/exr_to_frame.rs"]
mod exr_to_frame;

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind, set_hook};
use std::sync::{Mutex, OnceLock};

use libfuzzer_sys::fuzz_target;
use tempfile::TempDir;

static FOLDER: OnceLock<TempDir> = OnceLock::new();
static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

fuzz_target!(
    init: {
        // The library catches the decoder's panics; the fuzzer's own hook would end the run at each.
        set_hook(Box::new(|panic| *LAST_PANIC.lock().unwrap() = panic.to_string()));
    },
    |bytes: &[u8]| {
        let folder = FOLDER.get_or_init(|| tempfile::tempdir().unwrap());
        if let Err(panic) = catch_unwind(AssertUnwindSafe(|| exr_to_frame::survives(bytes, folder.path()))) {
            eprintln!("{}", LAST_PANIC.lock().unwrap());
            resume_unwind(panic);
        }
    }
);
