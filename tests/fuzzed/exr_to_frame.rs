//! Arbitrary bytes as an EXR file: read as a frame, and written again if that can be done.

use std::path::Path;

use apr::io::{Picture, ReadOptions, read_rgb};
use apr::{Denoised, ErrorKind, Result, Summary};

/// Reads `bytes` as a file in `folder`, and writes it again if it can be read.
///
/// # Errors
/// What the library says to the file.
pub fn read_and_write(bytes: &[u8], folder: &Path) -> Result<()> {
    let path = folder.join("arbitrary.exr");
    std::fs::write(&path, bytes).unwrap();
    drop(read_rgb(&path));
    let picture = Picture::read(&path, &ReadOptions::default())?;
    let color = picture.frame().color().clone();
    let (mse, order) = (Some(color[0].clone()), color[1].clone());
    let denoised =
        Denoised { color, aovs: vec![], mse, order, sampling_priority: None, summary: Summary::default() };
    picture.write(folder.join("out.exr"), &denoised, true)?;
    Ok(())
}

/// Whatever the bytes are: no panic, a file that can be written can be read again, an error is the
/// file's fault, and nothing but the two files is left.
pub fn survives(bytes: &[u8], folder: &Path) {
    match read_and_write(bytes, folder) {
        Ok(()) => {
            let again = Picture::read(folder.join("out.exr"), &ReadOptions::default());
            again.expect("what was written can be read");
            std::fs::remove_file(folder.join("out.exr")).unwrap();
        }
        Err(error) => {
            let kinds = [ErrorKind::Unreadable, ErrorKind::Lacking];
            assert!(kinds.contains(&error.kind()), "{error}");
        }
    }
    let left = std::fs::read_dir(folder).unwrap().count();
    assert_eq!(left, 1, "a stray file was left");
}
