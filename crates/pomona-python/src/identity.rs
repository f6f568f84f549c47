//! Who is who over all visits, and where in a map a visit lies.

use crate::cloud::{points, rows};
use crate::threads::detached;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pomona::FruitCloud;
use pomona::identity::{self, Evidence};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

fn wrong(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Rows of an (N, 2) array.
fn pairs(name: &str, all: &PyReadonlyArray2<'_, i64>) -> PyResult<Vec<[usize; 2]>> {
    if all.shape()[1] != 2 {
        return Err(wrong(format!("{name}: expected an array of shape (N, 2)")));
    }
    let row = |at: i64| usize::try_from(at).map_err(|_| wrong(format!("{name}: a row is negative")));
    all.as_array().outer_iter().map(|pair| Ok([row(pair[0])?, row(pair[1])?])).collect()
}

#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn contracted<'py>(
    py: Python<'py>,
    visits: PyReadonlyArray1<'py, i64>,
    n_visits: usize,
    links: PyReadonlyArray2<'py, i64>,
    log_odds: PyReadonlyArray1<'py, f64>,
    matched: PyReadonlyArray2<'py, i64>,
    against: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<i64>>> {
    let visits = rows("visits", &visits)?;
    let (links, matched) = (pairs("links", &links)?, pairs("matched", &matched)?);
    let [log_odds, against] = [log_odds, against].map(|nats| nats.as_array().to_vec());
    let evidence = Evidence {
        visits: &visits,
        n_visits,
        links: &links,
        log_odds: &log_odds,
        matched: &matched,
        against: &against,
    };
    let labels = detached(py, || identity::contracted(&evidence))?.map_err(wrong)?;
    Ok(labels.into_iter().map(|label| label as i64).collect::<Vec<_>>().into_pyarray(py))
}

/// The pose as a 4x4 matrix by rows, and how many fruits meet under it.
type Found = ([[f64; 4]; 4], usize);

#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn whereabouts<'py>(
    py: Python<'py>,
    map: PyReadonlyArray2<'py, f64>,
    visit: PyReadonlyArray2<'py, f64>,
) -> PyResult<Option<Found>> {
    let [map, visit] = [points(&map)?, points(&visit)?].map(FruitCloud::from_positions);
    let found = detached(py, || identity::whereabouts(&map, &visit))?.map_err(wrong)?;
    Ok(found.map(|found| {
        let matrix = found.map_from_visit.to_matrix();
        (std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)])), found.n_met)
    }))
}
