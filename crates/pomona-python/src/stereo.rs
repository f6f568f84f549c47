//! A rectified pair to the disparity of fruits.

use crate::camera::Calibration;
use crate::lifting::boxes;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pomona::stereo::{Picture, Rig, read};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

type Reading<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<f64>>);

/// Depth (H, W) around the fruits, and (D, 3) disparity of each fruit's centre, its sigma, support; NaN where unmatched.
#[pyfunction]
#[pyo3(signature = (left, right, boxes_px, camera, *, nearest_m))]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn read_pair<'py>(
    py: Python<'py>,
    left: PyReadonlyArray3<'py, u8>,
    right: PyReadonlyArray3<'py, u8>,
    boxes_px: PyReadonlyArray2<'py, f64>,
    camera: Calibration,
    nearest_m: f64,
) -> PyResult<Reading<'py>> {
    let camera = camera.to_stereo_camera()?;
    let expected = [camera.height, camera.width, 3];
    if left.shape() != expected || right.shape() != expected {
        return Err(PyValueError::new_err("left, right: expected colour pictures of the camera's size"));
    }
    if !(nearest_m.is_finite() && nearest_m > 0.0) {
        return Err(PyValueError::new_err(format!("nearest_m: found {nearest_m}, expected a finite number above 0")));
    }
    let boxes = boxes(&boxes_px)?;
    let rig = Rig { camera, nearest_m };
    let (left, right) = (left.as_slice()?, right.as_slice()?);
    let found = py.detach(|| read(Picture::new(left, camera.width), Picture::new(right, camera.width), &boxes, &rig));
    let numbers = found
        .fruits
        .iter()
        .flat_map(|fruit| fruit.map_or([f64::NAN; 3], |fruit| [fruit.centre_px, fruit.sigma_px, fruit.support]));
    let numbers = PyArray1::from_iter(py, numbers).reshape([boxes.len(), 3])?;
    Ok((PyArray1::from_vec(py, found.depth_m).reshape([camera.height, camera.width])?, numbers))
}
