//! A rectified pair to the disparity of fruits.

use crate::camera::Calibration;
use crate::cloud::points;
use crate::lifting::boxes;
use crate::threads::detached;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pomona::stereo::alignment::{fitted, reach_px};
use pomona::stereo::exposure::{Channels, gains, tables};
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
    let found =
        detached(py, || read(Picture::new(left, camera.width), Picture::new(right, camera.width), &boxes, &rig))?;
    let numbers = found
        .fruits
        .iter()
        .flat_map(|fruit| fruit.map_or([f64::NAN; 3], |fruit| [fruit.centre_px, fruit.sigma_px, fruit.support]));
    let numbers = PyArray1::from_iter(py, numbers).reshape([boxes.len(), 3])?;
    Ok((PyArray1::from_vec(py, found.depth_m).reshape([camera.height, camera.width])?, numbers))
}

fn channels<'a>(picture: &'a PyReadonlyArray3<'_, u8>) -> PyResult<Channels<'a>> {
    let (width, count) = (picture.shape()[1], picture.shape()[2]);
    Ok(Channels { values: picture.as_slice()?, width, count })
}

fn both<'a>(
    picture: &'a PyReadonlyArray3<'_, u8>,
    reference: &'a PyReadonlyArray3<'_, u8>,
) -> PyResult<(Channels<'a>, Channels<'a>)> {
    if picture.shape()[2] != reference.shape()[2] {
        return Err(PyValueError::new_err("expected two pictures with as many channels"));
    }
    Ok((channels(picture)?, channels(reference)?))
}

/// For each channel the factor that brings a picture (H, W, C) to the exposure of another one.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn exposure_gains(
    py: Python<'_>,
    picture: PyReadonlyArray3<'_, u8>,
    reference: PyReadonlyArray3<'_, u8>,
) -> PyResult<Vec<f64>> {
    let (picture, reference) = both(&picture, &reference)?;
    detached(py, || gains(picture, reference))
}

/// For each channel (C, 256) what its values become in the exposure of another picture, None where both are alike.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn exposure_tables<'py>(
    py: Python<'py>,
    picture: PyReadonlyArray3<'py, u8>,
    reference: PyReadonlyArray3<'py, u8>,
) -> PyResult<Option<Bound<'py, PyArray2<u8>>>> {
    let (picture, reference) = both(&picture, &reference)?;
    let Some(tables) = detached(py, || tables(picture, reference))? else { return Ok(None) };
    let values = PyArray1::from_iter(py, tables.iter().flatten().copied());
    Ok(Some(values.reshape([tables.len(), 256])?))
}

/// How the right picture lies to the left one, by corners (N, 3): lower by so many pixels, turned by so many radians,
/// whether that is to be told, whether it is small enough to be taken out; None where nothing says.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn row_alignment(
    py: Python<'_>,
    corners: PyReadonlyArray2<'_, f64>,
    centre_px: [f64; 2],
) -> PyResult<Option<(f64, f64, bool, bool)>> {
    let corners: Vec<_> = points(&corners)?.into_iter().map(|corner| corner.coords).collect();
    let found = detached(py, || fitted(&corners, centre_px))?;
    Ok(found.map(|found| (found.lower_px, found.turned_rad, found.is_off(), found.is_correctable())))
}

/// Rows above and below that hold the match of a corner, in pictures of this width.
#[pyfunction]
pub fn row_reach_px(width: usize) -> usize {
    reach_px(width)
}
