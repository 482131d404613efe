//! `apr` for Python: numpy arrays in, numpy arrays out. `package/apr/__init__.py` is the door, `_apr.pyi` beside
//! it has the types; what is written here on functions is Python's `help`. This module only translates.

mod arrays;
mod errors;
mod files;
mod frame;
mod threads;

use apr::io::bound_feature;
use apr::{Neighbours, Options, denoise_in_sequence};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};

use errors::raised;
use frame::{Given, items, other_halves};
use threads::Threads;

#[pymodule]
fn _apr(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add("LayoutWarning", m.py().get_type::<errors::LayoutWarning>())?;
    m.add_function(wrap_pyfunction!(denoise, m)?)?;
    m.add_function(wrap_pyfunction!(files::inspect_exr, m)?)?;
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
/// before, after: the frames beside it in a sequence, the nearest first and without gaps, each a dictionary of the
///     keywords from ``color`` to ``spp``: their samples join this frame's (``--temporal``).
/// motion_previous, motion_next: where what a pixel shows is in the frame before and the one after, height × width × 2:
///     columns to the right and rows down from the pixel. Without, surfaces are taken for still.
/// spp: samples per pixel; ``read_exr`` gives it, and it changes no bit of the result.
/// preset: fast, balanced, best or published; options: any option by name, dots go into depth.
/// threads: 1 to 1024, one per core by default; the result does not depend on it.
/// progress: called with the share that is done, 0 to 1, some times a second; what it raises stops the run, as Ctrl-C
///     does, and is raised again.
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
    visibility=None, features=None, feature_variance=None, feature_halves=None, aovs=None, motion_previous=None,
    motion_next=None, spp=None, before=None, after=None, preset="balanced", options=None, threads=None, progress=None))]
fn denoise<'py>(
    py: Python<'py>,
    color: &Bound<'py, PyAny>,
    variance: Option<&Bound<'py, PyAny>>,
    halves: Option<&Bound<'py, PyAny>>,
    albedo: Option<Bound<'py, PyAny>>,
    normal: Option<Bound<'py, PyAny>>,
    position: Option<Bound<'py, PyAny>>,
    depth: Option<Bound<'py, PyAny>>,
    visibility: Option<Bound<'py, PyAny>>,
    features: Option<&Bound<'py, PyMapping>>,
    feature_variance: Option<&Bound<'py, PyMapping>>,
    feature_halves: Option<&Bound<'py, PyMapping>>,
    aovs: Option<&Bound<'py, PyMapping>>,
    motion_previous: Option<&Bound<'py, PyAny>>,
    motion_next: Option<&Bound<'py, PyAny>>,
    spp: Option<f32>,
    before: Option<Vec<Bound<'py, PyMapping>>>,
    after: Option<Vec<Bound<'py, PyMapping>>>,
    preset: &str,
    options: Option<&Bound<'py, PyMapping>>,
    threads: Option<i64>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let options = chosen(preset, options)?;
    let threads = Threads::new(threads)?;
    let surfaces = [albedo, normal, position, depth, visibility];
    let motion = [motion_previous, motion_next];
    let given = Given {
        color,
        variance,
        halves,
        surfaces,
        features,
        feature_variance,
        feature_halves,
        aovs,
        motion,
        spp,
    };
    let mut notes = vec![];
    let frame = given.frame(|feature| notes.extend(py.detach(|| bound_feature(feature))))?;
    notes.extend(py.detach(|| other_halves(&frame)));
    let (before, after) = (frame::beside("before", before)?, frame::beside("after", after)?);
    let neighbours = Neighbours { before: before.iter().collect(), after: after.iter().collect() };
    let denoised =
        threads.run(py, progress, |watch| denoise_in_sequence(frame, &neighbours, &options, watch))?;
    let result = frame::result(py, denoised)?;
    let summary = result.get_item("summary")?.expect("it has just been put there");
    for note in notes {
        summary.get_item("notes")?.call_method1("append", (note,))?;
    }
    Ok(result)
}

/// The preset's options with those replaced that `options` names.
fn chosen(preset: &str, options: Option<&Bound<'_, PyMapping>>) -> PyResult<Options> {
    let names = || Options::PRESETS.map(|(name, _)| name).join(", ");
    let preset = Options::PRESETS.iter().find(|(name, _)| *name == preset).ok_or_else(|| {
        PyValueError::new_err(format!("there is no preset '{preset}'; use one of {}", names()))
    })?;
    let mut chosen = (preset.1)();
    for (name, value) in items(options)? {
        let json = frame::to_json(&value)
            .map_err(|error| PyValueError::new_err(format!("options['{name}'] is {value}: {error}")))?;
        chosen = chosen.with(&name, json).map_err(raised)?;
    }
    chosen.check().map_err(raised)?;
    Ok(chosen)
}
