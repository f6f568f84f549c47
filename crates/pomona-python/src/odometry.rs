//! Where the camera went; what the pictures show is asked of Python.

use crate::bundle::{array, blocks, matrices, wrong};
use crate::camera::Calibration;
use crate::cloud::points;
use crate::config::parsed;
use crate::pose::{pose, pose_array, pose_arrays};
use crate::threads::detached;
use numpy::{
    PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pomona::Pose;
use pomona::nalgebra::{Vector2, Vector3};
use pomona::odometry::{
    Eyes, FoundAgain, Lens, Motion, Odometry, Passage, PicturesConfig, Places, corners, disparities, follow, rejoined,
};
use pomona::row_search::Grey;
use pyo3::prelude::*;

/// What goes wrong in Python, or in the core.
struct Failure(PyErr);

impl From<pomona::Error> for Failure {
    fn from(error: pomona::Error) -> Self {
        Self(wrong(error))
    }
}

impl From<PyErr> for Failure {
    fn from(error: PyErr) -> Self {
        Self(error)
    }
}

/// An object of Python with the methods `follow`, `find_again` and `measure`.
struct PyEyes<'a>(&'a Py<PyAny>);

impl Eyes for PyEyes<'_> {
    type Error = Failure;

    fn follow(
        &mut self,
        from_px: &[Vector2<f64>],
        expected_px: &[Vector2<f64>],
    ) -> Result<Vec<Option<Vector2<f64>>>, Failure> {
        Python::attach(|py| {
            let arguments = (pixels(py, from_px)?, pixels(py, expected_px)?);
            let found = self.0.bind(py).call_method1("follow", arguments)?;
            let (places, kept): (PyReadonlyArray2<'_, f64>, PyReadonlyArray1<'_, bool>) = found.extract()?;
            let places = columns::<2>("follow", &places)?;
            if places.len() != from_px.len() || kept.len() != from_px.len() {
                return Err(
                    wrong(format!("follow: expected {} places and whether each was found", from_px.len())).into()
                );
            }
            let place = |(place, &kept): ([f64; 2], &bool)| kept.then(|| Vector2::from(place));
            Ok(places.into_iter().zip(kept.as_array()).map(place).collect())
        })
    }

    fn find_again(&mut self) -> Result<Vec<FoundAgain>, Failure> {
        Python::attach(|py| {
            let found = self.0.bind(py).call_method0("find_again")?;
            let (seen, there): (PyReadonlyArray2<'_, f64>, PyReadonlyArray2<'_, f64>) = found.extract()?;
            let (seen, there) = (columns::<3>("find_again", &seen)?, columns::<2>("find_again", &there)?);
            Ok(seen.into_iter().map(Vector3::from).zip(there.into_iter().map(Vector2::from)).collect())
        })
    }

    fn measure(
        &mut self,
        known_px: &[Vector2<f64>],
        expected_disparities_px: &[f64],
        per_cell: usize,
    ) -> Result<Vec<Vector3<f64>>, Failure> {
        Python::attach(|py| {
            let expected = PyArray1::from_slice(py, expected_disparities_px);
            let found = self.0.bind(py).call_method1("measure", (pixels(py, known_px)?, expected, per_cell))?;
            let seen = columns::<3>("measure", &found.extract::<PyReadonlyArray2<'_, f64>>()?)?;
            if seen.len() < known_px.len() {
                return Err(wrong(format!("measure: expected at least {} rows", known_px.len())).into());
            }
            Ok(seen.into_iter().map(Vector3::from).collect())
        })
    }
}

/// Where a picture shows points, and which were found, (N, 2) and (N,).
type Followed<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<bool>>);

/// Pose (4, 4) or None, part, broken, lost, inliers, keyframe.
type Told<'py> = (Option<Bound<'py, PyArray2<f64>>>, usize, Option<String>, Option<String>, usize, bool);

/// Frames (F,), parts (F,), poses (F, 4, 4), first (M,), second (M,), motions (M, 4, 4), information (M, 6, 6), median
/// disparity.
type Way<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray3<f64>>,
    f64,
);

/// Looks for points in pictures.
#[pyclass(name = "Looking", module = "pomona._core", frozen)]
pub struct PyLooking(PicturesConfig);

#[pymethods]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
impl PyLooking {
    #[new]
    fn new(config: &str) -> PyResult<Self> {
        Ok(Self(parsed(config)?.odometry.pictures))
    }

    /// The table `odometry.pictures` as JSON.
    #[getter]
    fn settings(&self) -> PyResult<String> {
        serde_json::to_string(&self.0).map_err(wrong)
    }

    /// Corners (N, 2), the strongest of each cell, none near those already taken; the latter count, too. Pictures with
    /// their halvings.
    fn corners<'py>(
        &self,
        py: Python<'py>,
        pictures: Vec<PyReadonlyArray2<'py, u8>>,
        taken: PyReadonlyArray2<'py, f64>,
        per_cell: usize,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let taken: Vec<_> = columns::<2>("taken", &taken)?.into_iter().map(Vector2::from).collect();
        let pictures = greys(&pictures)?;
        pixels(py, &detached(py, || corners(&pictures, &taken, per_cell, &self.0))?)
    }

    /// Disparities (N,) of points (N, 2) of the left picture, to some pixels, NaN where there is none; pictures with
    /// their halvings.
    fn disparities<'py>(
        &self,
        py: Python<'py>,
        left: Vec<PyReadonlyArray2<'py, u8>>,
        right: Vec<PyReadonlyArray2<'py, u8>>,
        points: PyReadonlyArray2<'py, f64>,
        farthest_px: f64,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let points: Vec<_> = columns::<2>("points", &points)?.into_iter().map(Vector2::from).collect();
        let (left, right) = (greys(&left)?, greys(&right)?);
        let size = |one: &Grey<'_>| (one.width, one.pixels.len());
        if left.iter().map(size).ne(right.iter().map(size)) {
            return Err(wrong("left, right: expected pictures of the same sizes"));
        }
        let found = detached(py, || disparities(&left, &right, &points, farthest_px, &self.0))?;
        Ok(PyArray1::from_iter(py, found.into_iter().map(|found| found.unwrap_or(f64::NAN))))
    }

    /// Points (N, 2) of the first picture in the second one, expected at (N, 2); pictures with their halvings.
    fn follow<'py>(
        &self,
        py: Python<'py>,
        first: Vec<PyReadonlyArray2<'py, u8>>,
        second: Vec<PyReadonlyArray2<'py, u8>>,
        points: PyReadonlyArray2<'py, f64>,
        expected: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Followed<'py>> {
        let [points, expected] = [columns::<2>("points", &points)?, columns::<2>("expected", &expected)?]
            .map(|rows| rows.into_iter().map(Vector2::from).collect::<Vec<_>>());
        if points.len() != expected.len() {
            return Err(wrong(format!("expected: found {} rows, expected {}", expected.len(), points.len())));
        }
        let (first, second) = (greys(&first)?, greys(&second)?);
        let found = detached(py, || follow(&first, &second, &points, &expected, &self.0))?;
        let places: Vec<_> = found.iter().map(|place| place.unwrap_or_default()).collect();
        Ok((pixels(py, &places)?, PyArray1::from_iter(py, found.iter().map(Option::is_some))))
    }
}

/// Motion of a camera, frame by frame.
#[pyclass(name = "Odometry", module = "pomona._core")]
pub struct PyOdometry(Odometry);

#[pymethods]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
impl PyOdometry {
    #[new]
    #[pyo3(signature = (camera, *, config))]
    fn new(camera: Calibration, config: &str) -> PyResult<Self> {
        let config = parsed(config)?.odometry;
        Ok(Self(Odometry::new(Lens::new(&camera.to_camera()?, &config), config)))
    }

    /// Disparity of what is a metre away, and the largest that is searched for.
    #[getter]
    fn disparities_px(&self) -> (f64, f64) {
        (self.0.lens().reach_px_m(), self.0.lens().farthest_px(self.0.config()))
    }

    fn take<'py>(&mut self, py: Python<'py>, eyes: Py<PyAny>) -> PyResult<Told<'py>> {
        let motion = detached(py, || self.0.take(&mut PyEyes(&eyes)))?.map_err(|failure| failure.0)?;
        told(py, motion)
    }

    fn skip<'py>(&mut self, py: Python<'py>, reason: String) -> PyResult<Told<'py>> {
        told(py, self.0.skip(reason))
    }

    fn trajectory<'py>(&self, py: Python<'py>) -> PyResult<Way<'py>> {
        let all = detached(py, || self.0.trajectory())?;
        let numbers = |all: Vec<usize>| PyArray1::from_iter(py, all.into_iter().map(|one| one as i64));
        let (first, second) = all.pairs.into_iter().unzip();
        Ok((
            numbers(all.frames),
            numbers(all.parts),
            pose_arrays(py, &all.poses)?,
            numbers(first),
            numbers(second),
            pose_arrays(py, &all.first_from_second)?,
            blocks(py, all.information.into_iter())?,
            all.median_disparity_px,
        ))
    }
}

fn told(py: Python<'_>, motion: Motion) -> PyResult<Told<'_>> {
    let pose = motion.pose.map(|pose| pose_array(py, &pose)).transpose()?;
    Ok((pose, motion.part, motion.broken, motion.lost, motion.inliers, motion.keyframe))
}

fn greys<'a>(pictures: &'a [PyReadonlyArray2<'_, u8>]) -> PyResult<Vec<Grey<'a>>> {
    pictures.iter().map(|one| Ok(Grey { pixels: one.as_slice()?, width: one.shape()[1] })).collect()
}

fn pixels<'py>(py: Python<'py>, all: &[Vector2<f64>]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    array(py, all.iter().flat_map(|one| [one.x, one.y]).collect(), [all.len(), 2])
}

fn columns<const D: usize>(what: &str, rows: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<[f64; D]>> {
    if rows.shape()[1] != D {
        return Err(wrong(format!("{what}: found {} columns, expected {D}", rows.shape()[1])));
    }
    Ok(rows.as_array().outer_iter().map(|row| std::array::from_fn(|column| row[column])).collect())
}

/// `before_from_part` (4, 4) by the fruits that two parts of a drive saw, or None where they do not tell it.
#[pyfunction]
#[pyo3(signature = (before, part, *, last, step, first))]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn rejoin<'py>(
    py: Python<'py>,
    before: (PyReadonlyArray2<'py, f64>, PyReadonlyArray3<'py, f64>),
    part: (PyReadonlyArray2<'py, f64>, PyReadonlyArray3<'py, f64>),
    last: PyReadonlyArray2<'py, f64>,
    step: [f64; 3],
    first: PyReadonlyArray2<'py, f64>,
) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
    let (before, part) = (places(&before)?, places(&part)?);
    let pose = |name, matrix| pose(name, matrix, Pose::from_exact_matrix);
    let passage = Passage { last: pose("last", &last)?, step: Vector3::from(step), first: pose("first", &first)? };
    let found = detached(py, || rejoined(&before, &part, &passage))?;
    found.map(|found| pose_array(py, &found)).transpose()
}

fn places(all: &(PyReadonlyArray2<'_, f64>, PyReadonlyArray3<'_, f64>)) -> PyResult<Places> {
    let places = Places { points: points(&all.0)?, covariances: matrices(&all.1)? };
    if places.points.len() != places.covariances.len() {
        return Err(wrong("places: found another number of covariances"));
    }
    Ok(places)
}
