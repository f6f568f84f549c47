//! Poses from and to arrays: (4, 4) float64 one, (F, 4, 4) float64 many.

use numpy::ndarray::{ArrayView2, Axis};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pomona::Pose;
use pomona::nalgebra::Matrix4;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A matrix to a pose: [`Pose::from_matrix`] where files and users give it, [`Pose::from_exact_matrix`] where we do.
type Reading = fn(&Matrix4<f64>) -> pomona::Result<Pose>;

/// One pose.
pub fn pose(name: &str, matrix: &PyReadonlyArray2<'_, f64>, reading: Reading) -> PyResult<Pose> {
    if matrix.shape() != [4, 4] {
        let found = matrix.shape();
        return Err(PyValueError::new_err(format!("{name}: found an array of shape {found:?}, expected (4, 4)")));
    }
    read(&matrix.as_array(), reading)
}

/// Many poses.
pub fn poses(name: &str, all: &PyReadonlyArray3<'_, f64>, reading: Reading) -> PyResult<Vec<Pose>> {
    if all.shape()[1..] != [4, 4] {
        let found = all.shape();
        return Err(PyValueError::new_err(format!("{name}: found an array of shape {found:?}, expected (F, 4, 4)")));
    }
    all.as_array().axis_iter(Axis(0)).map(|one| read(&one, reading)).collect()
}

fn read(matrix: &ArrayView2<'_, f64>, reading: Reading) -> PyResult<Pose> {
    let matrix = Matrix4::from_fn(|row, column| matrix[[row, column]]);
    reading(&matrix).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// One pose for Python.
pub fn pose_array<'py>(py: Python<'py>, pose: &Pose) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_iter(py, numbers(pose)).reshape([4, 4])
}

/// Many poses for Python.
pub fn pose_arrays<'py>(py: Python<'py>, poses: &[Pose]) -> PyResult<Bound<'py, PyArray3<f64>>> {
    PyArray1::from_iter(py, poses.iter().flat_map(numbers)).reshape([poses.len(), 4, 4])
}

/// Row by row.
fn numbers(pose: &Pose) -> Vec<f64> {
    pose.to_matrix().transpose().as_slice().to_vec()
}
