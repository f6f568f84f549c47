//! Fruit clouds from arrays.

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pomona::nalgebra::{Matrix3, Point3};
use pomona::{FruitCloud, Views};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The arrays of one cloud, as Python passes them.
#[derive(FromPyObject)]
pub struct Arrays<'py> {
    #[pyo3(item)]
    positions: PyReadonlyArray2<'py, f64>,
    #[pyo3(item)]
    covariances: Option<PyReadonlyArray3<'py, f64>>,
    #[pyo3(item)]
    diameters_m: Option<PyReadonlyArray1<'py, f64>>,
    #[pyo3(item)]
    view_frames: Option<PyReadonlyArray1<'py, i64>>,
    #[pyo3(item)]
    view_fruits: Option<PyReadonlyArray1<'py, i64>>,
}

impl Arrays<'_> {
    /// Copies the arrays into a cloud of the core.
    pub fn to_cloud(&self) -> PyResult<FruitCloud> {
        let covariances = self.covariances.as_ref().map(matrices).transpose()?;
        let views = match (&self.view_frames, &self.view_fruits) {
            (Some(frames), Some(fruits)) => Some(Views {
                frames: frames.as_array().to_vec(),
                fruits: fruits
                    .as_array()
                    .iter()
                    .map(|&fruit| usize::try_from(fruit))
                    .collect::<Result<_, _>>()
                    .map_err(|_| PyValueError::new_err("views: a fruit's row is negative"))?,
            }),
            _ => None,
        };
        Ok(FruitCloud {
            positions: points(&self.positions)?,
            covariances,
            diameters_m: self.diameters_m.as_ref().map(|all| all.as_array().to_vec()),
            ids: None,
            views,
        })
    }
}

/// Rows of an (N, 3) array.
pub fn points(rows: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Point3<f64>>> {
    let rows = rows.as_array();
    if rows.ncols() != 3 {
        let found = rows.ncols();
        return Err(PyValueError::new_err(format!("positions: found {found} columns, expected 3 (x, y, z)")));
    }
    Ok(rows.outer_iter().map(|p| Point3::new(p[0], p[1], p[2])).collect())
}

/// Matrices of an (N, 3, 3) array.
pub fn matrices(all: &PyReadonlyArray3<'_, f64>) -> PyResult<Vec<Matrix3<f64>>> {
    if all.shape()[1..] != [3, 3] {
        return Err(PyValueError::new_err("covariances: expected an array of shape (N, 3, 3)"));
    }
    Ok(all.as_array().outer_iter().map(|one| Matrix3::from_fn(|row, column| one[[row, column]])).collect())
}

/// Rows that an (N,) array names.
pub fn rows(name: &str, rows: &PyReadonlyArray1<'_, i64>) -> PyResult<Vec<usize>> {
    let rows: Result<_, _> = rows.as_array().iter().map(|&row| usize::try_from(row)).collect();
    rows.map_err(|_| PyValueError::new_err(format!("{name}: a row is negative")))
}
