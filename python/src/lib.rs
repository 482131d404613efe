//! `apr` for Python: numpy arrays in, numpy arrays out. `package/apr/__init__.py` is the door, `_apr.pyi` beside
//! it has the types; what is written here on functions is Python's `help`. This module only translates.

mod arrays;
mod errors;
mod files;
mod frame;

use apr::Options;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use errors::raised;
use frame::Given;

#[pymodule]
fn _apr(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add_function(wrap_pyfunction!(denoise, m)?)?;
    m.add_function(wrap_pyfunction!(files::read_exr, m)?)?;
    m.add_function(wrap_pyfunction!(files::write_exr, m)?)?;
    m.add_function(wrap_pyfunction!(files::denoise_exr, m)?)
}

/// Denoises arrays.
///
/// color: height × width × 3, linear radiance of any scale; NaN and infinities are repaired and counted.
/// variance: of the colour's *mean* (the expected squared error of the stored pixel), height × width × 3.
/// halves: the means of two independent halves of the samples; their average is ``color``. Without either
///     the noise is estimated from the picture, which is the weakest of all sources.
/// albedo, normal, position, depth, visibility: what the pixel sees, height × width (× channels).
/// features: further ones by name; ``albedo2``, ``normal2``, … are taken for what their name says.
/// feature_variance, feature_halves: statistics of features, by the features' names.
/// aovs: components of the beauty, height × width × 3, that go through its operator: what sums to ``color``
///     sums to the result.
/// spp: samples per pixel; ``read_exr`` gives it, and it changes no bit of the result.
/// preset: fast, balanced, best or published; options: any option by name, dots go into depth.
/// threads: one per core by default; the result does not depend on it.
///
/// Returns a dictionary: ``color``, height × width × 3; ``aovs``, by their names; ``mse``, the estimated mean
///     squared error of ``color`` over its channels, and ``order``, the polynomial order chosen, 0 to 3, both
///     height × width; ``summary``, counts of repaired pixels, outliers and fits, and notes.
///
/// Raises ValueError for shapes that do not fit and options that make no sense, TypeError for what is no
/// array of real numbers.
#[expect(clippy::too_many_arguments, reason = "Python's keywords")]
#[pyfunction]
#[pyo3(signature = (color, *, variance=None, halves=None, albedo=None, normal=None, position=None, depth=None,
    visibility=None, features=None, feature_variance=None, feature_halves=None, aovs=None, spp=None,
    preset="balanced", options=None, threads=None))]
fn denoise<'py>(
    py: Python<'py>,
    color: &Bound<'py, PyAny>,
    variance: Option<&Bound<'py, PyAny>>,
    halves: Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>,
    albedo: Option<Bound<'py, PyAny>>,
    normal: Option<Bound<'py, PyAny>>,
    position: Option<Bound<'py, PyAny>>,
    depth: Option<Bound<'py, PyAny>>,
    visibility: Option<Bound<'py, PyAny>>,
    features: Option<&Bound<'py, PyDict>>,
    feature_variance: Option<&Bound<'py, PyDict>>,
    feature_halves: Option<&Bound<'py, PyDict>>,
    aovs: Option<&Bound<'py, PyDict>>,
    spp: Option<f32>,
    preset: &str,
    options: Option<&Bound<'py, PyDict>>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyDict>> {
    let options = chosen(preset, options)?;
    let named = [
        ("albedo", albedo),
        ("normal", normal),
        ("position", position),
        ("depth", depth),
        ("visibility", visibility),
    ];
    let given =
        Given { color, variance, halves, named, features, feature_variance, feature_halves, aovs, spp };
    let (frame, notes) = given.frame()?;
    // Nothing of Python is touched from here on: others may run meanwhile.
    let denoised = py.detach(|| on_threads(threads, || apr::denoise(frame, &options)))?.map_err(raised)?;
    let result = frame::result(py, denoised)?;
    let summary = result.get_item("summary")?.expect("it has just been put there");
    for note in notes {
        summary.get_item("notes")?.call_method1("append", (note,))?;
    }
    Ok(result)
}

/// The preset's options with those replaced that `options` names.
fn chosen(preset: &str, options: Option<&Bound<'_, PyDict>>) -> PyResult<Options> {
    let names = || Options::PRESETS.map(|(name, _)| name).join(", ");
    let preset = Options::PRESETS.iter().find(|(name, _)| *name == preset).ok_or_else(|| {
        PyValueError::new_err(format!("there is no preset '{preset}'; use one of {}", names()))
    })?;
    let mut chosen = (preset.1)();
    for (key, value) in options.into_iter().flatten() {
        chosen = chosen.with(&key.extract::<String>()?, frame::to_json(&value)?).map_err(raised)?;
    }
    chosen.check().map_err(raised)?;
    Ok(chosen)
}

/// Runs `work` on so many threads, or on one per core.
fn on_threads<T: Send>(threads: Option<usize>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    match threads {
        None => Ok(work()),
        Some(0) => Err(PyValueError::new_err("threads must be 1 or more, or None for one per core")),
        Some(n) => {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build();
            let pool = pool.map_err(|error| pyo3::exceptions::PyRuntimeError::new_err(error.to_string()))?;
            Ok(pool.install(work))
        }
    }
}
