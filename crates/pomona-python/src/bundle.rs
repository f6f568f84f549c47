//! Bundle adjustment of a session.

use crate::cloud::{points, rows};
use crate::pose::{pose_arrays, poses};
use crate::threads::detached;
use numpy::{
    Element, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pomona::bundle::{Measured, PointView, Problem, RelativePose, Settings, State, adjust as adjust_bundle};
use pomona::nalgebra::{Matrix3, Matrix6};
use pomona::{Camera, Pose};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

pub fn wrong(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Sightings, as Python passes them: which pose sees which point at which place, and how surely.
#[derive(FromPyObject)]
pub struct Seen<'py> {
    #[pyo3(item)]
    poses: PyReadonlyArray1<'py, i64>,
    #[pyo3(item)]
    points: PyReadonlyArray1<'py, i64>,
    #[pyo3(item)]
    values: PyReadonlyArray2<'py, f64>,
    #[pyo3(item)]
    whitenings: PyReadonlyArray3<'py, f64>,
}

impl Seen<'_> {
    fn to_observations(&self) -> PyResult<Vec<PointView>> {
        let (poses, seen) = (rows("poses", &self.poses)?, rows("points", &self.points)?);
        let values = points(&self.values)?;
        let whitenings = matrices(&self.whitenings)?;
        if poses.len() != values.len() || seen.len() != values.len() || whitenings.len() != values.len() {
            return Err(wrong("observations: found arrays of different lengths"));
        }
        let rows = poses.into_iter().zip(seen).zip(values.into_iter().zip(whitenings));
        Ok(rows
            .map(|((pose, point), (value, whitening))| PointView {
                pose,
                point,
                measured: Measured::Place(value.coords),
                whitening,
            })
            .collect())
    }
}

/// Relative poses, as Python passes them.
#[derive(FromPyObject)]
pub struct Between<'py> {
    #[pyo3(item)]
    first: PyReadonlyArray1<'py, i64>,
    #[pyo3(item)]
    second: PyReadonlyArray1<'py, i64>,
    #[pyo3(item)]
    first_from_second: PyReadonlyArray3<'py, f64>,
    #[pyo3(item)]
    information: PyReadonlyArray3<'py, f64>,
    #[pyo3(item)]
    doubtful: PyReadonlyArray1<'py, bool>,
}

impl Between<'_> {
    fn to_relative_poses(&self) -> PyResult<Vec<RelativePose>> {
        let (first, second) = (rows("first", &self.first)?, rows("second", &self.second)?);
        let transforms = poses("first_from_second", &self.first_from_second, Pose::from_exact_matrix)?;
        let information: Vec<Matrix6<f64>> =
            squares::<6>(&self.information)?.map(|block| Matrix6::from_fn(|row, column| block[row][column])).collect();
        let doubtful = self.doubtful.as_array();
        let lengths = [second.len(), transforms.len(), information.len(), doubtful.len()];
        if lengths.iter().any(|&length| length != first.len()) {
            return Err(wrong("relative poses: found arrays of different lengths"));
        }
        let pairs = first.into_iter().zip(second).zip(transforms.into_iter().zip(information)).zip(doubtful);
        Ok(pairs
            .map(|(((first, second), (first_from_second, information)), &doubtful)| RelativePose {
                first,
                second,
                first_from_second,
                information,
                doubtful,
            })
            .collect())
    }
}

/// Poses (K, 4, 4), points (P, 3), covariances of the points (P, 3, 3), squared errors of the sightings (M,) and of the
/// relative poses (R,), and, where asked for and held, covariances of the poses (K, 6, 6).
type Adjusted<'py> = (
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Option<Bound<'py, PyArray3<f64>>>,
);

/// The poses and points of a session that explain best what was measured.
#[pyfunction]
#[pyo3(signature = (poses, fixed, points, *, places, relative_poses, pose_covariances=false))]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn adjust<'py>(
    py: Python<'py>,
    poses: PyReadonlyArray3<'py, f64>,
    fixed: PyReadonlyArray1<'py, bool>,
    points: PyReadonlyArray2<'py, f64>,
    places: Seen<'py>,
    relative_poses: Option<Between<'py>>,
    pose_covariances: bool,
) -> PyResult<Adjusted<'py>> {
    let relative_poses = relative_poses.map_or(Ok(Vec::new()), |between| between.to_relative_poses())?;
    let initial =
        State { poses: self::poses("poses", &poses, Pose::from_exact_matrix)?, points: self::points(&points)? };
    let (fixed, observations) = (fixed.as_array().to_vec(), places.to_observations()?);
    // Sightings are places; there are no pictures to project into.
    let problem = Problem { camera: Camera::UNIT, fixed, observations, relative_poses };
    let adjust = || {
        let found = adjust_bundle(&problem, initial, &Settings::after_drift())?;
        let of_poses = if pose_covariances { found.pose_covariances() } else { None };
        Ok::<_, pomona::Error>((found, of_poses))
    };
    let (found, of_poses) = detached(py, adjust)?.map_err(wrong)?;
    Ok((
        pose_arrays(py, &found.state.poses)?,
        array(py, found.state.points.iter().flat_map(|p| [p.x, p.y, p.z]).collect(), [found.state.points.len(), 3])?,
        blocks(py, found.point_covariances.iter().copied())?,
        PyArray1::from_vec(py, found.squared_errors),
        PyArray1::from_vec(py, found.relative_squared_errors),
        of_poses.map(|of_poses| blocks(py, of_poses.into_iter())).transpose()?,
    ))
}

/// Square blocks of an (N, D, D) array.
fn squares<'a, const D: usize>(
    all: &'a PyReadonlyArray3<'_, f64>,
) -> PyResult<impl Iterator<Item = [[f64; D]; D]> + use<'a, D>> {
    if all.shape()[1..] != [D, D] {
        return Err(wrong(format!("found an array of shape {:?}, expected (N, {D}, {D})", all.shape())));
    }
    let block = |n: usize| std::array::from_fn(|row| std::array::from_fn(|column| all.as_array()[[n, row, column]]));
    Ok((0..all.shape()[0]).map(block))
}

pub fn matrices(all: &PyReadonlyArray3<'_, f64>) -> PyResult<Vec<Matrix3<f64>>> {
    Ok(squares::<3>(all)?.map(|block| Matrix3::from_fn(|row, column| block[row][column])).collect())
}

pub fn array<T: Element, const D: usize>(
    py: Python<'_>,
    values: Vec<T>,
    shape: [usize; D],
) -> PyResult<Bound<'_, numpy::PyArray<T, numpy::ndarray::Dim<[usize; D]>>>>
where
    [usize; D]: numpy::ndarray::IntoDimension<Dim = numpy::ndarray::Dim<[usize; D]>>,
    numpy::ndarray::Dim<[usize; D]>: numpy::ndarray::Dimension,
{
    PyArray1::from_vec(py, values).reshape(shape)
}

/// Symmetric blocks as (N, D, D).
pub fn blocks<const D: usize>(
    py: Python<'_>,
    all: impl Iterator<Item = pomona::nalgebra::SMatrix<f64, D, D>>,
) -> PyResult<Bound<'_, PyArray3<f64>>> {
    let values: Vec<f64> = all.flat_map(|block| block.as_slice().to_vec()).collect();
    let n = values.len() / (D * D);
    array(py, values, [n, D, D])
}
