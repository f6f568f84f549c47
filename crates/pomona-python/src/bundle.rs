//! Bundle adjustment and the pose of a picture among known points.

use crate::camera::Calibration;
use crate::cloud::{points, rows};
use crate::pose::{pose, pose_array, pose_arrays, poses};
use numpy::{
    Element, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pomona::bundle::{
    Adjustment, KnownPoints, LocateSettings, Measured, PointView, Problem, RelativePose, Settings, State,
    adjust as adjust_bundle, locate as locate_picture,
};
use pomona::nalgebra::{Matrix3, Matrix6, Vector2, Vector3};
use pomona::{Camera, Pose};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

fn wrong(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Observations, as Python passes them: which pose sees which point where, and how surely.
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
    fn append(&self, measured: fn(Vector3<f64>) -> Measured, all: &mut Vec<PointView>) -> PyResult<()> {
        let (poses, seen) = (rows("poses", &self.poses)?, rows("points", &self.points)?);
        let values = points(&self.values)?;
        let whitenings = matrices(&self.whitenings)?;
        if poses.len() != values.len() || seen.len() != values.len() || whitenings.len() != values.len() {
            return Err(wrong("observations: found arrays of different lengths"));
        }
        for (((pose, point), value), whitening) in poses.into_iter().zip(seen).zip(values).zip(whitenings) {
            all.push(PointView { pose, point, measured: measured(value.coords), whitening });
        }
        Ok(())
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
}

impl Between<'_> {
    fn to_relative_poses(&self) -> PyResult<Vec<RelativePose>> {
        let (first, second) = (rows("first", &self.first)?, rows("second", &self.second)?);
        let transforms = poses("first_from_second", &self.first_from_second, Pose::from_exact_matrix)?;
        let information: Vec<Matrix6<f64>> =
            squares::<6>(&self.information)?.map(|block| Matrix6::from_fn(|row, column| block[row][column])).collect();
        if first.len() != second.len() || transforms.len() != first.len() || information.len() != first.len() {
            return Err(wrong("relative poses: found arrays of different lengths"));
        }
        let pairs = first.into_iter().zip(second).zip(transforms.into_iter().zip(information));
        Ok(pairs
            .map(|((first, second), (first_from_second, information))| RelativePose {
                first,
                second,
                first_from_second,
                information,
            })
            .collect())
    }
}

/// Poses (K, 4, 4), points (P, 3), covariances of the points (P, 3, 3), squared errors of pictures, then places (M,),
/// information of the wanted pairs (Q, 6, 6), zeros where there is none.
type Adjusted<'py> = (
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray3<f64>>,
);

/// The poses and points that explain best what was measured.
#[pyfunction]
#[pyo3(signature = (camera, poses, fixed, points, *, pictures, places, relative_poses, wanted, max_steps, first_scale))]
#[expect(clippy::needless_pass_by_value, clippy::too_many_arguments, reason = "arguments arrive by value from Python")]
pub fn adjust<'py>(
    py: Python<'py>,
    camera: Option<Calibration>,
    poses: PyReadonlyArray3<'py, f64>,
    fixed: PyReadonlyArray1<'py, bool>,
    points: PyReadonlyArray2<'py, f64>,
    pictures: Option<Seen<'py>>,
    places: Option<Seen<'py>>,
    relative_poses: Option<Between<'py>>,
    wanted: Vec<(usize, usize)>,
    max_steps: Option<usize>,
    first_scale: Option<f64>,
) -> PyResult<Adjusted<'py>> {
    let camera = match (&camera, &pictures) {
        (Some(camera), _) => camera.to_stereo_camera()?,
        (None, None) => Camera::UNIT,
        (None, Some(_)) => return Err(wrong("camera: found none, expected that of the pictures")),
    };
    let mut observations = Vec::new();
    if let Some(pictures) = &pictures {
        pictures.append(Measured::Picture, &mut observations)?;
    }
    if let Some(places) = &places {
        places.append(Measured::Place, &mut observations)?;
    }
    let relative_poses = relative_poses.map_or(Ok(Vec::new()), |between| between.to_relative_poses())?;
    let initial =
        State { poses: self::poses("poses", &poses, Pose::from_exact_matrix)?, points: self::points(&points)? };
    let n_poses = initial.poses.len();
    if wanted.iter().any(|&(first, second)| first.max(second) >= n_poses) {
        return Err(wrong(format!("wanted: expected rows below {n_poses}")));
    }
    let problem = Problem { camera, fixed: fixed.as_array().to_vec(), observations, relative_poses };
    let defaults = Settings::default();
    let settings = Settings {
        max_steps: max_steps.unwrap_or(defaults.max_steps),
        first_scale: first_scale.unwrap_or(defaults.first_scale),
        ..defaults
    };
    let run = || {
        let found = adjust_bundle(&problem, initial, &settings)?;
        let information = if wanted.is_empty() { Vec::new() } else { found.relative_information(&wanted) };
        Ok((found, information))
    };
    let (found, information): (Adjustment, _) = py.detach(run).map_err(|error: pomona::Error| wrong(error))?;
    Ok((
        pose_arrays(py, &found.state.poses)?,
        array(py, found.state.points.iter().flat_map(|p| [p.x, p.y, p.z]).collect(), [found.state.points.len(), 3])?,
        blocks(py, found.point_covariances.iter().copied())?,
        PyArray1::from_vec(py, found.squared_errors),
        blocks(py, information.iter().map(|block| block.unwrap_or_else(Matrix6::zeros)))?,
    ))
}

/// Pose (4, 4), information (6, 6), which matches agree (N,).
type Place<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<bool>>);

/// The pose of one picture among known points, or None where fewer than four matches agree.
#[pyfunction]
#[pyo3(signature = (camera, known, covariances, pixels, expected, *, sigma_px))]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn locate<'py>(
    py: Python<'py>,
    camera: Calibration,
    known: PyReadonlyArray2<'py, f64>,
    covariances: PyReadonlyArray3<'py, f64>,
    pixels: PyReadonlyArray2<'py, f64>,
    expected: PyReadonlyArray2<'py, f64>,
    sigma_px: f64,
) -> PyResult<Option<Place<'py>>> {
    if pixels.shape()[1] != 2 {
        return Err(wrong("pixels: expected an array of shape (N, 2)"));
    }
    let known = KnownPoints {
        points: points(&known)?,
        covariances: matrices(&covariances)?,
        pixels: pixels.as_array().outer_iter().map(|row| Vector2::new(row[0], row[1])).collect(),
    };
    let settings = LocateSettings { sigma_px, ..LocateSettings::default() };
    let camera = camera.to_stereo_camera()?;
    let expected = pose("expected", &expected, Pose::from_exact_matrix)?;
    let found = py.detach(|| locate_picture(&camera, &known, &expected, &settings)).map_err(wrong)?;
    let Some(found) = found else { return Ok(None) };
    Ok(Some((
        pose_array(py, &found.pose)?,
        PyArray1::from_slice(py, found.information.as_slice()).reshape([6, 6])?,
        PyArray1::from_vec(py, found.inliers),
    )))
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

fn matrices(all: &PyReadonlyArray3<'_, f64>) -> PyResult<Vec<Matrix3<f64>>> {
    Ok(squares::<3>(all)?.map(|block| Matrix3::from_fn(|row, column| block[row][column])).collect())
}

fn array<T: Element, const D: usize>(
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
fn blocks<const D: usize>(
    py: Python<'_>,
    all: impl Iterator<Item = pomona::nalgebra::SMatrix<f64, D, D>>,
) -> PyResult<Bound<'_, PyArray3<f64>>> {
    let values: Vec<f64> = all.flat_map(|block| block.as_slice().to_vec()).collect();
    let n = values.len() / (D * D);
    array(py, values, [n, D, D])
}
