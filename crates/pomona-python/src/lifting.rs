//! Boxes and depth to fruits; many sightings to one.

use crate::camera::Calibration;
use crate::cloud::{matrices, points};
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pomona::camera::DepthPicture;
use pomona::lifting::fusion::{self, MeasuredCentre, MeasuredDiameter};
use pomona::lifting::{self, LiftedFruit, Refusal, Source};
use pomona::nalgebra::Matrix3;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// What became of each box, centres, covariances, and four numbers of each fruit.
type Lifted<'py> =
    (Bound<'py, PyArray1<u8>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>, Bound<'py, PyArray2<f64>>);

/// Lifts boxes. Gives the outcome of each box (0 lifted, 1 cut, 2 without depth, 3 unmatched), and of those lifted the
/// centres (M, 3), covariances (M, 3, 3) and (M, 4) diameter, its sigma, hidden part, support.
///
/// `sources` (D, 3) are `sigma_d / (f B)`, depth of the centre and support of each box: without the depth, pixels vote;
/// without any, the box is unmatched.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn lift<'py>(
    py: Python<'py>,
    depth_m: PyReadonlyArray2<'py, f32>,
    boxes_px: PyReadonlyArray2<'py, f64>,
    sources: PyReadonlyArray2<'py, f64>,
    camera: Calibration,
) -> PyResult<Lifted<'py>> {
    let camera = camera.to_camera()?;
    if depth_m.shape() != [camera.height, camera.width] {
        return Err(PyValueError::new_err("depth_m: expected the size of the camera's pictures"));
    }
    let boxes = boxes(&boxes_px)?;
    if sources.shape() != [boxes.len(), 3] {
        return Err(PyValueError::new_err("sources: expected three numbers per box"));
    }
    let sources: Vec<Source> = sources.as_array().outer_iter().map(|one| source(one[0], one[1], one[2])).collect();
    let depth = depth_m.as_slice()?;
    let lifted = py.detach(|| lifting::lift(DepthPicture::new(depth, camera.width), &boxes, &sources, &camera));
    let outcomes = PyArray1::from_iter(py, lifted.iter().map(outcome));
    let found: Vec<&LiftedFruit> = lifted.iter().flatten().collect();
    let centres = PyArray1::from_iter(py, found.iter().flat_map(|one| one.centre.coords.iter().copied()));
    let covariances = PyArray1::from_iter(py, found.iter().flat_map(|one| one.covariance.iter().copied()));
    let numbers = PyArray1::from_iter(
        py,
        found.iter().flat_map(|one| [one.diameter_m, one.diameter_sigma_m, one.hidden, one.support]),
    );
    let count = found.len();
    Ok((outcomes, centres.reshape([count, 3])?, covariances.reshape([count, 3, 3])?, numbers.reshape([count, 4])?))
}

fn outcome(lifted: &Result<LiftedFruit, Refusal>) -> u8 {
    match lifted {
        Ok(_) => 0,
        Err(Refusal::Cut) => 1,
        Err(Refusal::NoDepth) => 2,
        Err(Refusal::Unmatched) => 3,
    }
}

fn source(sigma_per_m2: f64, depth_m: f64, support: f64) -> Source {
    if sigma_per_m2.is_nan() {
        Source::Unmatched
    } else if depth_m.is_nan() {
        Source::Votes { sigma_per_m2 }
    } else {
        Source::Match { depth_m, sigma_per_m2, support }
    }
}

/// Rows (D, 4) of boxes.
pub fn boxes(rows: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<[f64; 4]>> {
    let rows = rows.as_array();
    if rows.ncols() != 4 {
        let found = rows.ncols();
        return Err(PyValueError::new_err(format!("boxes_px: found {found} columns, expected 4")));
    }
    Ok(rows.outer_iter().map(|one| [one[0], one[1], one[2], one[3]]).collect())
}

type Centre<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// One centre (3,) and covariance (3, 3) out of many, each with the ray along which it was seen.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn fuse_centres<'py>(
    py: Python<'py>,
    centres: PyReadonlyArray2<'py, f64>,
    covariances: PyReadonlyArray3<'py, f64>,
    rays: PyReadonlyArray2<'py, f64>,
) -> PyResult<Centre<'py>> {
    let (centres, covariances, rays) = (points(&centres)?, matrices(&covariances)?, points(&rays)?);
    if centres.len() != covariances.len() || centres.len() != rays.len() {
        return Err(PyValueError::new_err("centres, covariances, rays: expected the same length"));
    }
    let measured: Vec<MeasuredCentre> = (centres.into_iter().zip(covariances).zip(rays))
        .map(|((centre, covariance), ray)| MeasuredCentre { centre, covariance, ray: ray.coords })
        .collect();
    let (centre, covariance) = fusion::fuse_centres(&measured).ok_or_else(|| {
        PyValueError::new_err("expected at least one sighting, each with a positive definite covariance")
    })?;
    let rows: Matrix3<f64> = covariance.transpose();
    let covariance = PyArray1::from_iter(py, rows.iter().copied()).reshape([3, 3])?;
    Ok((PyArray1::from_iter(py, centre.coords.iter().copied()), covariance))
}

/// One diameter and its sigma out of many.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn fuse_diameters(
    diameters_m: PyReadonlyArray1<'_, f64>,
    sigmas_m: PyReadonlyArray1<'_, f64>,
    hidden: PyReadonlyArray1<'_, f64>,
) -> PyResult<(f64, f64)> {
    let (diameters_m, sigmas_m, hidden) = (diameters_m.as_array(), sigmas_m.as_array(), hidden.as_array());
    if diameters_m.len() != sigmas_m.len() || diameters_m.len() != hidden.len() {
        return Err(PyValueError::new_err("diameters_m, sigmas_m, hidden: expected the same length"));
    }
    let measured: Vec<MeasuredDiameter> = (diameters_m.iter().zip(sigmas_m).zip(hidden))
        .map(|((&diameter_m, &sigma_m), &hidden)| MeasuredDiameter { diameter_m, sigma_m, hidden })
        .collect();
    fusion::fuse_diameters(&measured).ok_or_else(|| PyValueError::new_err("diameters_m: expected at least one"))
}
