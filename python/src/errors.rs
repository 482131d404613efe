//! The library's errors and warnings as Python's, in Python's words.

use std::ffi::CString;

use apr::error::{Error, ErrorKind};
use apr::io::Layout;
use pyo3::create_exception;
use pyo3::exceptions::{PyKeyboardInterrupt, PyOSError, PyRuntimeError, PyUserWarning, PyValueError};
use pyo3::prelude::*;

create_exception!(
    apr,
    LayoutWarning,
    PyUserWarning,
    "What was found in a file makes the result worse than it could be; the message has a remedy."
);

/// `Usage` and `Lacking` are `ValueError`, files that cannot be read, or written where they are to go, `OSError` (by the
/// system's number the fitting one, such as `FileNotFoundError`), defects `RuntimeError`.
pub fn raised(error: Error) -> PyErr {
    let message = in_python(&error.to_string());
    match error.kind() {
        ErrorKind::Usage | ErrorKind::Lacking => PyValueError::new_err(message),
        ErrorKind::Unreadable | ErrorKind::Misplaced | ErrorKind::Unwritable => {
            match (error.system(), error.file()) {
                (Some(number), Some(file)) => {
                    // Python itself adds the file.
                    let what = message.strip_prefix(&format!("{}: ", file.display())).unwrap_or(&message);
                    PyOSError::new_err((number, what.to_owned(), file.as_os_str().to_owned()))
                }
                _ => PyOSError::new_err(message),
            }
        }
        ErrorKind::Stopped => PyKeyboardInterrupt::new_err(message),
        _ => PyRuntimeError::new_err(message),
    }
}

/// Tells what a file's layout warns of, as of the line that called the package's function.
pub fn warn(py: Python<'_>, layout: &Layout) -> PyResult<()> {
    const CALLER: i32 = 2;
    let category = py.get_type::<LayoutWarning>();
    layout
        .warnings
        .iter()
        .try_for_each(|warning| PyErr::warn(py, &category, &CString::new(in_python(warning))?, CALLER))
}

/// A layout whose remarks name keywords.
pub fn told(layout: &Layout) -> Layout {
    let remarks = |all: &[String]| all.iter().map(|remark| in_python(remark)).collect();
    let mut told = layout.clone();
    (told.notes, told.warnings) = (remarks(&layout.notes), remarks(&layout.warnings));
    told
}

/// The options of the command line that messages name, and what they are called here.
const KEYWORDS: [(&str, &str); 9] = [
    ("--aov", "aovs"),
    ("--feature", "features"),
    ("--half", "half"),
    ("--inspect", "apr.inspect_exr"),
    ("--map", "map"),
    ("--profile", "profile"),
    ("--spp", "spp"),
    ("--variance-kind", "variance_kind"),
    ("--with", "further"),
];

/// `words` with keywords where they name options.
pub fn in_python(words: &str) -> String {
    let named = |word: &str| {
        let rest =
            |option: &str| word.strip_prefix(option).filter(|rest| !rest.starts_with(char::is_alphanumeric));
        KEYWORDS.iter().find_map(|(option, keyword)| Some(format!("{keyword}{}", rest(option)?)))
    };
    let words = words.replace("apr-denoise --inspect", "--inspect");
    // An option begins a word: `--` within the name of a file does not.
    let all = words.split_inclusive([' ', '(', '\'', '`']);
    all.map(|word| named(word).unwrap_or_else(|| word.to_owned())).collect()
}
