//! Disparities of points by search along the row.

use numpy::{PyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pomona::row_search::{Grey, RowSearch, disparity};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Whole-pixel disparities (N,) of points (N, 2), whole columns and rows of the left picture; NaN where there is none.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn search_rows<'py>(
    py: Python<'py>,
    left: PyReadonlyArray2<'py, u8>,
    right: PyReadonlyArray2<'py, u8>,
    points: PyReadonlyArray2<'py, f64>,
    farthest_px: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    if left.shape() != right.shape() || points.shape()[1] != 2 {
        return Err(PyValueError::new_err("expected two pictures of one size and points of shape (N, 2)"));
    }
    let width = left.shape()[1];
    let (left, right) = (Grey { pixels: left.as_slice()?, width }, Grey { pixels: right.as_slice()?, width });
    let places: Vec<_> = points.as_array().outer_iter().map(|p| (p[0] as usize, p[1] as usize)).collect();
    let search = RowSearch { farthest_px, ..RowSearch::default() };
    let found: Vec<f64> = py.detach(|| {
        let each = places.iter().map(|&place| disparity(left, right, place, &search));
        each.map(|found| found.map_or(f64::NAN, |found| found as f64)).collect()
    });
    Ok(PyArray1::from_vec(py, found))
}
