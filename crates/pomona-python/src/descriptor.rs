//! Constellations and their codes.

use crate::cloud::points;
use crate::threads::detached;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pomona::nalgebra::Point3;
use pomona::paper::constellation::constellations;
use pomona::paper::descriptor::{Described, describe_all};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

type Arrays<'py> = (Bound<'py, PyArray2<i64>>, Bound<'py, PyArray2<f64>>);

/// Members (M, k) in canonical order and codes (M, 3k - 7) of a cloud's constellations.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn describe<'py>(
    py: Python<'py>,
    positions: PyReadonlyArray2<'py, f64>,
    k: usize,
    n: usize,
) -> PyResult<Arrays<'py>> {
    let positions = points(&positions)?;
    if let Some(row) = positions.iter().position(|p| !p.coords.iter().all(|x| x.is_finite())) {
        return Err(PyValueError::new_err(format!("positions: row {row} is NaN or infinite, expected finite numbers")));
    }
    match k {
        4 => arrays::<4, 5>(py, &positions, n),
        5 => arrays::<5, 8>(py, &positions, n),
        6 => arrays::<6, 11>(py, &positions, n),
        7 => arrays::<7, 14>(py, &positions, n),
        _ => Err(PyValueError::new_err(format!("k: found {k}, expected 4 to 7"))),
    }
}

fn arrays<'py, const K: usize, const D: usize>(
    py: Python<'py>,
    positions: &[Point3<f64>],
    n: usize,
) -> PyResult<Arrays<'py>> {
    let described: Described<K, D> = detached(py, || describe_all(positions, &constellations::<K>(positions, n)))?;
    let members = PyArray1::from_iter(py, described.members.iter().flatten().map(|&row| i64::from(row)));
    let codes = PyArray1::from_iter(py, described.codes.iter().flatten().copied());
    let rows = described.codes.len();
    Ok((members.reshape([rows, K])?, codes.reshape([rows, D])?))
}
