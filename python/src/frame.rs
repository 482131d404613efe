//! Keywords to a frame, and a result to a dictionary.

use std::collections::BTreeMap;

use apr::image::Plane;
use apr::io::bound_feature;
use apr::{Aov, Denoised, Feature, FeatureKind, Frame, Motion};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping, PyTuple};
use serde::Serialize;

use crate::arrays::{from_plane, from_planes, planes, rgb};
use crate::errors::raised;

/// The features that have a keyword of their own.
const SURFACES: [&str; 5] = ["albedo", "normal", "position", "depth", "visibility"];

/// What `denoise` is given, and `write_exr`.
pub struct Given<'a, 'py> {
    pub color: &'a Bound<'py, PyAny>,
    pub variance: Option<&'a Bound<'py, PyAny>>,
    pub halves: Option<&'a Bound<'py, PyAny>>,
    /// Of every one of [`SURFACES`], in their order.
    pub surfaces: [Option<Bound<'py, PyAny>>; SURFACES.len()],
    pub features: Option<&'a Bound<'py, PyMapping>>,
    pub feature_variance: Option<&'a Bound<'py, PyMapping>>,
    pub feature_halves: Option<&'a Bound<'py, PyMapping>>,
    pub aovs: Option<&'a Bound<'py, PyMapping>>,
    /// Into the frame before and the one after.
    pub motion: [Option<&'a Bound<'py, PyAny>>; 2],
    pub spp: Option<f32>,
}

impl<'py> Given<'_, 'py> {
    /// The frame, every feature as `prepare` leaves it.
    pub fn frame(self, mut prepare: impl FnMut(&mut Feature)) -> PyResult<Frame> {
        let mut frame = Frame::new(rgb("color", self.color)?).map_err(raised)?;
        let size = (frame.width(), frame.height());
        let rgb = |name: &str, array: &Bound<'py, PyAny>| like_color(name, rgb(name, array)?, size);
        let planes = |name: &str, array: &Bound<'py, PyAny>| like_color(name, planes(name, array)?, size);
        if let Some(variance) = self.variance {
            frame = frame.with_variance_of_mean(rgb("variance", variance)?).map_err(raised)?;
        }
        if let Some(halves) = self.halves {
            let [a, b] = pair("halves", halves)?;
            let halves = [rgb("halves[0]", &a)?, rgb("halves[1]", &b)?];
            frame = frame.with_halves(halves).map_err(raised)?;
        }
        for (name, array) in self.all_features()? {
            let mut feature = Feature::new(&name, kind(&name), planes(&name, &array)?);
            if let Some(variance) = item(self.feature_variance, &name)? {
                feature.var_of_mean = Some(planes(&format!("feature_variance['{name}']"), &variance)?);
            }
            if let Some(halves) = item(self.feature_halves, &name)? {
                let what = format!("feature_halves['{name}']");
                let [a, b] = pair(&what, &halves)?;
                feature.halves = Some([planes(&what, &a)?, planes(&what, &b)?]);
            }
            // The frame tells what is wrong with others.
            if is_of_one_kind(&feature) {
                prepare(&mut feature);
            }
            frame = frame.with_feature(feature).map_err(raised)?;
        }
        for (name, array) in items(self.aovs)? {
            let color = rgb(&format!("aovs['{name}']"), &array)?;
            frame = frame.with_aov(Aov { name, color }).map_err(raised)?;
        }
        let vectors = |name: &str, array: &Bound<'py, PyAny>| {
            let [columns, rows] = planes(name, array)?.try_into().map_err(|other: Vec<Plane>| {
                PyValueError::new_err(format!(
                    "{name} has {} channels where 2 were expected: columns to the right, rows down",
                    other.len()
                ))
            })?;
            Ok::<_, PyErr>([columns, rows])
        };
        let [previous, next] = self.motion;
        let previous = previous.map(|array| vectors("motion_previous", array)).transpose()?;
        let next = next.map(|array| vectors("motion_next", array)).transpose()?;
        if previous.is_some() || next.is_some() {
            frame = frame.with_motion(Motion { previous, next }).map_err(raised)?;
        }
        if let Some(spp) = self.spp {
            frame = frame.with_spp(samples(spp)?);
        }
        Ok(frame)
    }

    /// The features by keyword, then those of the dictionary, in its order.
    fn all_features(&self) -> PyResult<Vec<(String, Bound<'py, PyAny>)>> {
        let by_keyword = SURFACES
            .iter()
            .zip(&self.surfaces)
            .filter_map(|(name, array)| Some(((*name).to_owned(), array.clone()?)));
        let mut all: Vec<(String, Bound<PyAny>)> = by_keyword.collect();
        for (name, array) in items(self.features)? {
            if all.iter().any(|(other, _)| *other == name) {
                return Err(PyValueError::new_err(format!("the feature '{name}' is given twice")));
            }
            all.push((name, array));
        }
        for (what, given) in [("variance", self.feature_variance), ("halves", self.feature_halves)] {
            for (name, _) in items(given)? {
                if all.iter().all(|(other, _)| *other != name) {
                    return Err(PyValueError::new_err(format!(
                        "feature_{what}['{name}'] belongs to no feature; give features['{name}'] too"
                    )));
                }
            }
        }
        Ok(all)
    }
}

/// The frames beside one, as dictionaries of the keywords that `read_exr` gives.
pub fn beside<'py>(side: &str, frames: Option<Vec<Bound<'py, PyMapping>>>) -> PyResult<Vec<Frame>> {
    let frames = frames.unwrap_or_default();
    let read = frames.iter().enumerate().map(|(i, keywords)| {
        let py = keywords.py();
        one_beside(keywords).map_err(|error| {
            let what = format!("{side}[{i}]: {}", error.value(py));
            PyErr::from_type(error.get_type(py), what)
        })
    });
    read.collect()
}

fn one_beside(keywords: &Bound<'_, PyMapping>) -> PyResult<Frame> {
    let mut left: BTreeMap<String, Bound<PyAny>> =
        items(Some(keywords))?.into_iter().filter(|(_, value)| !value.is_none()).collect();
    let mut take = |name: &str| left.remove(name);
    let color = take("color").ok_or_else(|| PyValueError::new_err("there is no color"))?;
    let (variance, halves, surfaces) = (take("variance"), take("halves"), SURFACES.map(&mut take));
    let motion = ["motion_previous", "motion_next"].map(&mut take);
    let spp = take("spp").map(|spp| spp.extract()).transpose()?;
    let mappings = ["features", "feature_variance", "feature_halves", "aovs"]
        .map(|name| take(name).map(|given| Ok::<_, PyErr>(given.cast_into::<PyMapping>()?)).transpose());
    let [features, feature_variance, feature_halves, aovs] = mappings;
    let (features, feature_variance) = (features?, feature_variance?);
    let (feature_halves, aovs) = (feature_halves?, aovs?);
    if let Some(name) = left.keys().next() {
        return Err(PyValueError::new_err(format!(
            "'{name}' is no keyword of a frame, as read_exr gives them"
        )));
    }
    let given = Given {
        color: &color,
        variance: variance.as_ref(),
        halves: halves.as_ref(),
        surfaces,
        features: features.as_ref(),
        feature_variance: feature_variance.as_ref(),
        feature_halves: feature_halves.as_ref(),
        aovs: aovs.as_ref(),
        motion: motion.each_ref().map(Option::as_ref),
        spp,
    };
    given.frame(|feature| drop(bound_feature(feature)))
}

/// Names and values of any mapping, in its order.
pub fn items<'py>(of: Option<&Bound<'py, PyMapping>>) -> PyResult<Vec<(String, Bound<'py, PyAny>)>> {
    of.map_or(Ok(vec![]), |of| of.items()?.extract())
}

fn item<'py>(of: Option<&Bound<'py, PyMapping>>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
    match of {
        Some(of) if of.contains(name)? => of.get_item(name).map(Some),
        _ => Ok(None),
    }
}

/// Two arrays: a tuple or list of them, or an array of both.
fn pair<'py>(what: &str, value: &Bound<'py, PyAny>) -> PyResult<[Bound<'py, PyAny>; 2]> {
    let arrays = value.try_iter().and_then(Iterator::collect::<PyResult<Vec<_>>>).unwrap_or_default();
    arrays.try_into().map_err(|_| PyTypeError::new_err(format!("{what} is no pair of arrays")))
}

/// Samples per pixel that can be.
pub fn samples(spp: f32) -> PyResult<f32> {
    if can_be(&spp) {
        return Ok(spp);
    }
    Err(PyValueError::new_err(format!("spp is {spp} where a number above 0 was expected")))
}

fn can_be(spp: &f32) -> bool {
    *spp > 0.0 && spp.is_finite()
}

/// Tells of half buffers that are not the colour's: their difference says nothing about its noise.
pub fn other_halves(frame: &Frame) -> Option<String> {
    /// Half floats, and halves of which one has a sample more, deviate by less.
    const TOLERANCE: f64 = 0.05;
    let [a, b] = frame.halves()?;
    let (mut error, mut energy) = (0.0, 0.0);
    for (color, (a, b)) in frame.color().iter().zip(a.iter().zip(b)) {
        for (color, (a, b)) in color.data().iter().zip(a.data().iter().zip(b.data())) {
            let [color, a, b] = [color, a, b].map(|value| f64::from(*value));
            let squares = [(0.5 * (a + b) - color).powi(2), color.powi(2)];
            if squares.iter().all(|square| square.is_finite()) {
                error += squares[0];
                energy += squares[1];
            }
        }
    }
    let deviation = (error / energy.max(f64::MIN_POSITIVE)).sqrt();
    (deviation > TOLERANCE).then(|| {
        format!(
            "the average of halves differs from color by {:.0} % (RMS): their difference is taken for its noise; \
             give the means of the two halves of its own samples",
            100.0 * deviation
        )
    })
}

/// The planes of the array `name`, which must have the colour's `size`.
pub fn like_color<P: AsRef<[Plane]>>(name: &str, planes: P, size: (usize, usize)) -> PyResult<P> {
    let shape = |(width, height): (usize, usize)| format!("({height}, {width})");
    match planes.as_ref().iter().map(Plane::size).find(|other| *other != size) {
        None => Ok(planes),
        Some(other) => Err(PyValueError::new_err(format!(
            "{name} is {} where color is {}, both as (height, width)",
            shape(other),
            shape(size)
        ))),
    }
}

/// Whether all arrays of a feature have as many channels.
fn is_of_one_kind(feature: &Feature) -> bool {
    let mut beside = feature.var_of_mean.iter().chain(feature.halves.iter().flatten());
    beside.all(|planes| planes.len() == feature.planes.len())
}

/// What a feature describes, by its name less a number at its end (`albedo2`).
pub fn kind(name: &str) -> FeatureKind {
    match name.trim_end_matches(|c: char| c.is_ascii_digit()) {
        "albedo" => FeatureKind::Albedo,
        "normal" => FeatureKind::Normal,
        "position" => FeatureKind::Position,
        "depth" => FeatureKind::Depth,
        "visibility" => FeatureKind::Visibility,
        _ => FeatureKind::Other,
    }
}

/// A result as a dictionary of arrays.
pub fn result(py: Python<'_>, denoised: Denoised) -> PyResult<Bound<'_, PyDict>> {
    let result = PyDict::new(py);
    result.set_item("color", from_planes(py, &denoised.color)?)?;
    let aovs = PyDict::new(py);
    for aov in denoised.aovs {
        aovs.set_item(aov.name, from_planes(py, &aov.color)?)?;
    }
    result.set_item("aovs", aovs)?;
    result.set_item("mse", denoised.mse.map(|mse| from_plane(py, mse)).transpose()?)?;
    result.set_item("order", from_plane(py, denoised.order)?)?;
    result.set_item("summary", from_json(py, &denoised.summary)?)?;
    Ok(result)
}

/// A frame as the keywords of `denoise`.
pub fn keywords<'py>(py: Python<'py>, frame: &Frame) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    let array = |planes: &[Plane]| from_planes(py, planes);
    all.set_item("color", array(frame.color())?)?;
    all.set_item("variance", frame.color_var_of_mean().map(|variance| array(variance)).transpose()?)?;
    let halves = frame.halves().map(|[a, b]| PyTuple::new(py, [array(a)?, array(b)?])).transpose()?;
    all.set_item("halves", halves)?;
    let (features, variances, halves, aovs) =
        (PyDict::new(py), PyDict::new(py), PyDict::new(py), PyDict::new(py));
    for feature in frame.features() {
        features.set_item(&feature.name, array(&feature.planes)?)?;
        if let Some(variance) = &feature.var_of_mean {
            variances.set_item(&feature.name, array(variance)?)?;
        }
        if let Some([a, b]) = &feature.halves {
            halves.set_item(&feature.name, PyTuple::new(py, [array(a)?, array(b)?])?)?;
        }
    }
    for aov in frame.aovs() {
        aovs.set_item(&aov.name, array(&aov.color)?)?;
    }
    all.set_item("features", features)?;
    all.set_item("feature_variance", variances)?;
    all.set_item("feature_halves", halves)?;
    all.set_item("aovs", aovs)?;
    if let Some(Motion { previous, next }) = frame.motion() {
        all.set_item("motion_previous", previous.as_ref().map(|vectors| array(vectors)).transpose()?)?;
        all.set_item("motion_next", next.as_ref().map(|vectors| array(vectors)).transpose()?)?;
    }
    all.set_item("spp", frame.spp().filter(can_be))?;
    Ok(all)
}

/// Anything that can be serialised as Python's own types.
pub fn from_json<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(|error| PyValueError::new_err(error.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// Python's own types, and numpy's, as JSON.
pub fn to_json(value: &Bound<'_, PyAny>) -> PyResult<serde_json::Value> {
    let py = value.py();
    let value = if value.hasattr("tolist")? { &value.call_method0("tolist")? } else { value };
    let strict = PyDict::new(py);
    strict.set_item("allow_nan", false)?; // which is no JSON
    let text: String = py.import("json")?.call_method("dumps", (value,), Some(&strict))?.extract()?;
    serde_json::from_str(&text).map_err(|error| PyValueError::new_err(error.to_string()))
}
