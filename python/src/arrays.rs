//! Arrays to planes and back. Arrays of 32-bit floats are read where they lie, others converted once; the
//! denoiser's planes are one channel each, so that H×W×3 is taken apart on the way in and put together on
//! the way out.

use apr::image::{Plane, Rgb};
use numpy::ndarray::{ArrayView2, ArrayViewD, Axis, Ix2, s};
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// The channels of an array H×W×C, or H×W for one.
pub fn planes(name: &str, array: &Bound<'_, PyAny>) -> PyResult<Vec<Plane>> {
    let array = floats(name, array)?;
    let view: ArrayViewD<f32> = array.as_array();
    match view.ndim() {
        2 => Ok(vec![plane(view.view().into_dimensionality::<Ix2>().expect("it has two axes"))]),
        3 if view.len_of(Axis(2)) > 0 => (0..view.len_of(Axis(2)))
            .map(|c| Ok(plane(view.slice(s![.., .., c]).into_dimensionality::<Ix2>().expect("two are left"))))
            .collect(),
        _ => Err(PyValueError::new_err(format!(
            "{name} has the shape {} where (height, width) or (height, width, channels) was expected",
            shape(&array)
        ))),
    }
}

/// The three channels of an array H×W×3.
pub fn rgb(name: &str, array: &Bound<'_, PyAny>) -> PyResult<Rgb> {
    let floats = floats(name, array)?;
    if floats.ndim() != 3 || floats.shape()[2] != 3 {
        let alpha = floats.ndim() == 3 && floats.shape()[2] == 4;
        let remedy = if alpha { "; leave the alpha out by [..., :3]" } else { "" };
        return Err(PyValueError::new_err(format!(
            "{name} has the shape {} where (height, width, 3) was expected{remedy}",
            shape(&floats)
        )));
    }
    let planes = planes(name, floats.as_any())?;
    Ok(planes.try_into().expect("the last axis is 3"))
}

/// `array` as 32-bit floats: itself, or a conversion of any array of numbers.
fn floats<'py>(name: &str, array: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f32>> {
    if let Ok(array) = array.cast::<PyArrayDyn<f32>>() {
        return Ok(array.readonly());
    }
    let numpy = array.py().import("numpy")?;
    let any = numpy.call_method1("asarray", (array,))?;
    let kind: String = any.getattr("dtype")?.getattr("kind")?.extract()?;
    if !["f", "i", "u", "b"].contains(&kind.as_str()) {
        return Err(PyTypeError::new_err(format!(
            "{name} is {} (dtype {}) where an array of real numbers was expected",
            array.get_type().name()?,
            any.getattr("dtype")?
        )));
    }
    let converted = numpy.call_method1("asarray", (any, numpy.getattr("float32")?))?;
    Ok(converted.cast::<PyArrayDyn<f32>>().map_err(PyErr::from)?.readonly())
}

fn shape(array: &PyReadonlyArrayDyn<'_, f32>) -> String {
    let axes: Vec<String> = array.shape().iter().map(usize::to_string).collect();
    format!("({})", axes.join(", "))
}

/// The GIL is held meanwhile: without it others might write to the array.
fn plane(view: ArrayView2<'_, f32>) -> Plane {
    let (height, width) = view.dim();
    let mut data = Vec::with_capacity(width * height);
    for row in view.rows() {
        row.for_each(|value| data.push(*value)); // many times quicker than an iterator over both axes
    }
    Plane::from_vec(width, height, data).expect("one number for each pixel")
}

/// An array H×W that takes over the plane's memory.
pub fn from_plane(py: Python<'_>, plane: Plane) -> PyResult<Bound<'_, PyAny>> {
    let (width, height) = plane.size();
    Ok(PyArray1::from_vec(py, plane.into_vec()).reshape([height, width])?.into_any())
}

/// An array H×W×C of C planes of one size; H×W for one.
pub fn from_planes<'py>(py: Python<'py>, planes: &[Plane]) -> PyResult<Bound<'py, PyAny>> {
    let (width, height) = planes[0].size();
    let array = PyArray1::from_vec(py, py.detach(|| mixed(planes)));
    match planes.len() {
        1 => Ok(array.reshape([height, width])?.into_any()),
        channels => Ok(array.reshape([height, width, channels])?.into_any()),
    }
}

/// The planes' samples, pixel by pixel.
fn mixed(planes: &[Plane]) -> Vec<f32> {
    let channels = planes.len();
    let mut mixed = vec![0.0; channels * planes[0].data().len()];
    for (c, plane) in planes.iter().enumerate() {
        mixed.chunks_exact_mut(channels).zip(plane.data()).for_each(|(pixel, value)| pixel[c] = *value);
    }
    mixed
}
