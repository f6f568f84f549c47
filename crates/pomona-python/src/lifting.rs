//! Boxes and depth to fruits; many sightings to one.

use crate::camera::Calibration;
use crate::cloud::{matrices, points, rows};
use crate::pose::poses;
use crate::threads::detached;
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pomona::Pose;
use pomona::camera::DepthPicture;
use pomona::lifting::fruits::FruitSightings;
use pomona::lifting::{self, LiftedFruit, Refusal, Source};
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
    let lifted = detached(py, || lifting::lift(DepthPicture::new(depth, camera.width), &boxes, &sources, &camera))?;
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

/// Sightings of fruits, as Python passes them.
#[derive(FromPyObject)]
pub struct SightingArrays<'py> {
    #[pyo3(item)]
    frames: PyReadonlyArray1<'py, i64>,
    #[pyo3(item)]
    fruits: PyReadonlyArray1<'py, i64>,
    #[pyo3(item)]
    centres_in_camera: PyReadonlyArray2<'py, f64>,
    #[pyo3(item)]
    covariances: PyReadonlyArray3<'py, f64>,
    #[pyo3(item)]
    diameters_m: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    diameter_sigmas_m: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    hidden: PyReadonlyArray1<'py, f64>,
}

/// Centres (N, 3), covariances (N, 3, 3), diameters and their sigmas (N,) of fruits.
type Fused<'py> =
    (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Every fruit out of its sightings; `session_from_camera` (F, 4, 4) are the poses of the frames.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn fuse_fruits<'py>(
    py: Python<'py>,
    sightings: SightingArrays<'py>,
    session_from_camera: PyReadonlyArray3<'py, f64>,
) -> PyResult<Fused<'py>> {
    let poses = poses("session_from_camera", &session_from_camera, Pose::from_exact_matrix)?;
    let numbers = |values: &PyReadonlyArray1<'py, f64>| values.as_array().to_vec();
    let (frames, fruits) = (rows("frames", &sightings.frames)?, rows("fruits", &sightings.fruits)?);
    let (centres, covariances) = (points(&sightings.centres_in_camera)?, matrices(&sightings.covariances)?);
    let (diameters_m, hidden) = (numbers(&sightings.diameters_m), numbers(&sightings.hidden));
    let diameter_sigmas_m = numbers(&sightings.diameter_sigmas_m);
    let sightings = FruitSightings {
        frames: &frames,
        fruits: &fruits,
        centres_in_camera: &centres,
        covariances: &covariances,
        diameters_m: &diameters_m,
        diameter_sigmas_m: &diameter_sigmas_m,
        hidden: &hidden,
    };
    let found = detached(py, || lifting::fruits::fuse_fruits(&sightings, &poses))?;
    let found = found.map_err(|error| PyValueError::new_err(error.to_string()))?;
    let n = found.centres.len();
    let centres = PyArray1::from_iter(py, found.centres.iter().flat_map(|one| one.coords.iter().copied()));
    // Row by row.
    let covariances = found.covariances.iter().flat_map(|one| one.transpose().iter().copied().collect::<Vec<_>>());
    Ok((
        centres.reshape([n, 3])?,
        PyArray1::from_iter(py, covariances).reshape([n, 3, 3])?,
        PyArray1::from_vec(py, found.diameters_m),
        PyArray1::from_vec(py, found.diameter_sigmas_m),
    ))
}
