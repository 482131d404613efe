//! EXR files.

use std::path::{Path, PathBuf};

use apr::io::{self, FrameHeader, Mapping, Picture, ReadOptions, Renderer, RunFile, VarianceKind};
use apr::{Aov, Frame};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};
use serde_json::json;

use crate::arrays::{planes, rgb};
use crate::chosen;
use crate::errors::raised;
use crate::frame::{from_json, items, keywords, samples};
use crate::threads::Threads;

/// How to understand a file: the keywords that `read_exr` and `denoise_exr` share.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Reading {
    profile: Option<String>,
    #[pyo3(item("map"))]
    roles: Vec<(String, String)>,
    features: Vec<(String, String)>,
    variance_kind: Option<String>,
    spp: Option<f32>,
    half: Option<PathBuf>,
    further: Vec<PathBuf>,
    aovs: Vec<String>,
}

impl Reading {
    fn options(self) -> PyResult<ReadOptions> {
        Ok(ReadOptions {
            profile: self.profile.map(|name| one_of("profile", &Renderer::NAMES, &name)).transpose()?,
            map: mappings(self.roles)?,
            features: mappings(self.features)?,
            variance_kind: self
                .variance_kind
                .map(|name| one_of("variance_kind", &VarianceKind::NAMES, &name))
                .transpose()?,
            spp: self.spp.map(samples).transpose()?,
            half: self.half,
            with: self.further,
            aovs: self.aovs,
            motion: false,
        })
    }
}

/// In their order, as on the command line: bits depend on it.
fn mappings(given: Vec<(String, String)>) -> PyResult<Vec<Mapping>> {
    given.into_iter().map(|(name, channels)| format!("{name}={channels}").parse().map_err(raised)).collect()
}

fn one_of<T: Copy>(what: &str, names: &[(&str, T)], wanted: &str) -> PyResult<T> {
    let found = names.iter().find(|(name, _)| *name == wanted).map(|(_, value)| *value);
    found.ok_or_else(|| {
        let known: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
        PyValueError::new_err(format!("there is no {what} '{wanted}'; use one of {}", known.join(", ")))
    })
}

/// `read_exr` without Python's defaults, which `package/apr/__init__.py` has.
#[pyfunction]
pub fn read_exr<'py>(
    py: Python<'py>,
    path: PathBuf,
    reading: Reading,
) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyAny>)> {
    let options = reading.options()?;
    let picture = py.detach(|| Threads::default().run(|| Picture::read(&path, &options)))?.map_err(raised)?;
    Ok((keywords(py, picture.frame())?, from_json(py, picture.layout())?))
}

/// Writes ``color`` as R,G,B and every layer (1 or 3 channels) under its name, 32-bit floats, ZIP.
///
/// The file appears whole or not at all. Raises OSError where it cannot be written.
#[pyfunction]
#[pyo3(signature = (path, color, *, layers=None, spp=None, seed=None))]
pub fn write_exr(
    py: Python<'_>,
    path: PathBuf,
    color: &Bound<'_, PyAny>,
    layers: Option<&Bound<'_, PyMapping>>,
    spp: Option<f32>,
    seed: Option<u64>,
) -> PyResult<()> {
    io::check_ending(&path).map_err(raised)?;
    let mut frame = Frame::new(rgb("color", color)?).map_err(raised)?;
    let mut further = Vec::new();
    for (name, array) in items(layers)? {
        let planes = planes(&format!("layers['{name}']"), &array)?;
        match <[_; 3]>::try_from(planes) {
            Ok(color) => frame = frame.with_aov(Aov { name, color }).map_err(raised)?,
            Err(planes) if planes.len() == 1 => further.push((format!("{name}.Y"), planes)),
            Err(planes) => {
                let what =
                    format!("layers['{name}'] has {} channels where 1 or 3 were expected", planes.len());
                return Err(PyValueError::new_err(what));
            }
        }
    }
    if let Some(spp) = spp {
        frame = frame.with_spp(samples(spp)?);
    }
    let further: Vec<_> = further.iter().map(|(name, planes)| (name.as_str(), &planes[0])).collect();
    let header = FrameHeader { seed, further: &further };
    py.detach(|| Threads::default().run(|| io::write_frame(&path, &frame, &header)))?.map_err(raised)
}

/// The command line's work: reads, denoises and writes the file again.
#[pyfunction]
pub fn denoise_exr<'py>(
    py: Python<'py>,
    input: PathBuf,
    output: PathBuf,
    reading: Reading,
    preset: &str,
    options: Option<&Bound<'py, PyMapping>>,
    aux: bool,
    threads: Option<i64>,
) -> PyResult<Bound<'py, PyDict>> {
    let options = chosen(preset, options)?;
    let reading = reading.options()?;
    let threads = Threads::new(threads)?;
    let work = || -> apr::Result<_> {
        check_output(&input, &reading, &output)?;
        let picture = Picture::read(&input, &reading)?;
        // So that the command line knows a result from a render, which it does not replace.
        let by = json!({"program": "apr", "version": env!("CARGO_PKG_VERSION"), "options": options});
        picture.sign(by.to_string());
        let denoised = apr::denoise(picture.frame(), &options)?;
        let notes = picture.write(&output, &denoised, aux)?;
        let sums = picture.sums(&denoised)?;
        Ok((picture, denoised, sums, notes))
    };
    let (picture, denoised, sums, notes) = py.detach(|| threads.run(work))?.map_err(raised)?;
    let report = PyDict::new(py);
    report.set_item("layout", from_json(py, picture.layout())?)?;
    report.set_item("summary", from_json(py, &denoised.summary)?)?;
    report.set_item("sums", from_json(py, &sums)?)?;
    report.set_item("notes", notes)?;
    Ok(report)
}

/// Checks before the work that the result can be written and costs no file that is read, but the input itself.
fn check_output(input: &Path, reading: &ReadOptions, output: &Path) -> apr::Result<()> {
    let file = |role: &'static str| move |path| RunFile { role, path };
    let in_place = io::is_same_file(input, output);
    let input = Some(input).filter(|_| !in_place).map(file("the input"));
    let half = reading.half.as_deref().map(file("the half"));
    let further = reading.with.iter().map(PathBuf::as_path).map(file("a file of further"));
    io::check_apart(input.into_iter().chain(half).chain(further), [file("the result")(output)])
        .map_err(|error| error.remedy("give the result a name of its own"))?;
    io::check_ending(output)?;
    io::check_target(output)
}
