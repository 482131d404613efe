//! Arbitrary bytes → EXR → frame → EXR.
#![no_main]

#[path = "../../tests/fuzzed/exr_to_frame.rs"]
mod exr_to_frame;

use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;
use tempfile::TempDir;

static FOLDER: OnceLock<TempDir> = OnceLock::new();

fuzz_target!(
    init: {
        // The library catches the decoder's panics; the fuzzer's own hook would end the run at each.
        // Whatever comes out of the target still does.
        std::panic::set_hook(Box::new(|_| {}));
    },
    |bytes: &[u8]| {
        let folder = FOLDER.get_or_init(|| tempfile::tempdir().unwrap());
        exr_to_frame::survives(bytes, folder.path());
    }
);
