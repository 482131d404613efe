//! `apr` for Python: numpy arrays in, numpy arrays out. `apr/__init__.py` is the door, `apr/_apr.pyi` says
//! what everything is; this module only translates.

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
    let denoised = py.detach(|| on_threads(threads, || apr::denoise(&frame, &options)))?.map_err(raised)?;
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
