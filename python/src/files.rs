//! EXR files.

use std::path::{Path, PathBuf};

use apr::Feature;
use apr::denoise::denoise_observed;
use apr::io::{self, FrameHeader, Mapping, Picture, ReadOptions, Renderer, RunFile, VarianceKind};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};
use serde_json::json;

use crate::arrays::planes;
use crate::chosen;
use crate::errors::{in_python, raised, told, warn};
use crate::frame::{Given, from_json, items, keywords, kind, like_color, samples};
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
    motion: bool,
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
            motion: self.motion,
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
pub fn read_exr(py: Python<'_>, path: PathBuf, reading: Reading) -> PyResult<Bound<'_, PyDict>> {
    let picture = read(py, &path, reading)?;
    warn(py, picture.layout())?;
    keywords(py, picture.frame())
}

/// `inspect_exr` without Python's defaults.
#[pyfunction]
pub fn inspect_exr(py: Python<'_>, path: PathBuf, reading: Reading) -> PyResult<Bound<'_, PyAny>> {
    from_json(py, &told(read(py, &path, reading)?.layout()))
}

fn read(py: Python<'_>, path: &Path, reading: Reading) -> PyResult<Picture> {
    let options = reading.options()?;
    Threads::default().run(py, None, |_| Picture::read(path, &options))
}

/// Writes what ``read_exr`` gives, in the keywords of ``denoise``: ``color`` as R,G,B, everything else as layers of its
/// name that ``read_exr`` and the command line know, 32-bit floats, ZIP. Of ``halves`` and ``feature_halves`` the first
/// is written, which together with the mean tells the second.
///
/// layers: any other arrays by name, height × width (× channels).
/// spp: samples per pixel; seed: the render's, with which ``read_exr`` takes two renders apart.
///
/// The file appears whole or not at all. Raises OSError where it cannot be written.
#[expect(clippy::too_many_arguments, reason = "Python's keywords")]
#[pyfunction]
#[pyo3(signature = (path, color, *, variance=None, halves=None, albedo=None, normal=None, position=None, depth=None,
    visibility=None, features=None, feature_variance=None, feature_halves=None, aovs=None, motion_previous=None,
    motion_next=None, layers=None, spp=None, seed=None))]
pub fn write_exr<'py>(
    py: Python<'py>,
    path: PathBuf,
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
    layers: Option<&Bound<'py, PyMapping>>,
    spp: Option<f32>,
    seed: Option<u64>,
) -> PyResult<()> {
    io::check_ending(&path).map_err(raised)?;
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
    let mut frame = given.frame(|_| ())?;
    for (name, array) in items(layers)? {
        let what = format!("layers['{name}']");
        let planes = like_color(&what, planes(&what, &array)?, (frame.width(), frame.height()))?;
        frame = frame.with_feature(Feature::new(&name, kind(&name), planes)).map_err(raised)?;
    }
    let header = FrameHeader { seed, further: &[] };
    Threads::default().run(py, None, |_| io::write_frame(&path, &frame, &header))
}

/// The command line's work: reads, denoises and writes the file again.
#[expect(clippy::too_many_arguments, reason = "Python's keywords")]
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
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let options = chosen(preset, options)?;
    let reading = reading.options()?;
    let threads = Threads::new(threads)?;
    check_output(&input, &reading, &output).map_err(raised)?;
    let (survey, frame) = threads.run(py, None, |_| Picture::read(&input, &reading))?.into_frame();
    warn(py, survey.layout())?;
    // So that the command line knows a result from a render, which it does not replace.
    let by = json!({"program": "apr", "version": env!("CARGO_PKG_VERSION"), "options": options});
    survey.sign(by.to_string());
    let denoised = threads.run(py, progress, |watch| denoise_observed(frame, &options, watch))?;
    let written =
        threads.run(py, None, |_| Ok((survey.write(&output, &denoised, aux)?, survey.sums(&denoised)?)));
    let (notes, sums) = written?;
    let report = PyDict::new(py);
    report.set_item("layout", from_json(py, &told(survey.layout()))?)?;
    report.set_item("summary", from_json(py, &denoised.summary)?)?;
    report.set_item("sums", from_json(py, &sums)?)?;
    report.set_item("notes", notes.iter().map(|note| in_python(note)).collect::<Vec<_>>())?;
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
