//! How much of boxes looks like fruit.

use crate::lifting::boxes;
use crate::threads::detached;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pomona::look;
use pomona::stereo::Picture;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

type Looked<'py> =
    (Bound<'py, PyArray2<u8>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Median colours (D, 3), fruitness (D,) and pixels that look like fruit (D,) of boxes, fruitness of places without one.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn look_of<'py>(
    py: Python<'py>,
    picture: PyReadonlyArray3<'py, u8>,
    boxes_px: PyReadonlyArray2<'py, f64>,
) -> PyResult<Looked<'py>> {
    let boxes = boxes(&boxes_px)?;
    let &[_, width, channels] = picture.shape() else {
        return Err(PyValueError::new_err("picture: expected an array of shape (H, W, 3)"));
    };
    if channels != 3 {
        return Err(PyValueError::new_err(format!("picture: found {channels} channels, expected 3")));
    }
    let values = picture.as_slice()?;
    let found = detached(py, || look::look_of(Picture::new(values, width), &boxes))?;
    let given = |values| PyArray1::from_vec(py, values);
    let colours = PyArray1::from_iter(py, found.colours.into_iter().flatten()).reshape([boxes.len(), channels])?;
    Ok((colours, given(found.fruitness), given(found.fruit_px), given(found.elsewhere)))
}
