//! Fruits followed through the frames of one visit.

use crate::camera::Calibration;
use crate::cloud::{matrices, points, rows};
use crate::config::parsed;
use crate::lifting::boxes;
use crate::pose::{pose, poses};
use crate::threads::detached;
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pomona::Pose;
use pomona::stereo::Picture;
use pomona::tracking::{Body, Boxes, Colours, LiftedBoxes, TrackViews, Tracker, Tracks, belief, merge_duplicates};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

fn wrong(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Boxes that have a depth, as Python passes them.
#[derive(FromPyObject)]
pub struct LiftedArrays<'py> {
    #[pyo3(item)]
    rows: PyReadonlyArray1<'py, i64>,
    #[pyo3(item)]
    centres_in_camera: PyReadonlyArray2<'py, f64>,
    #[pyo3(item)]
    covariances: PyReadonlyArray3<'py, f64>,
    #[pyo3(item)]
    diameters_m: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    diameter_sigmas_m: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    support: PyReadonlyArray1<'py, f64>,
}

/// A tracker and what it knows.
#[pyclass(name = "Tracker", module = "pomona._core")]
pub struct PyTracker {
    tracker: Tracker,
    min_views: usize,
}

#[pymethods]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
impl PyTracker {
    #[new]
    #[pyo3(signature = (camera, *, config))]
    fn new(camera: Calibration, config: &str) -> PyResult<Self> {
        let config = parsed(config)?.tracking;
        let tracker = Tracker::new(camera.to_camera()?, config).map_err(wrong)?;
        Ok(Self { tracker, min_views: config.min_views })
    }

    fn update<'py>(
        &mut self,
        py: Python<'py>,
        frame: i64,
        session_from_camera: PyReadonlyArray2<'py, f64>,
        boxes_px: PyReadonlyArray2<'py, f64>,
        scores: PyReadonlyArray1<'py, f64>,
        lifted: LiftedArrays<'py>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let pose = pose("session_from_camera", &session_from_camera, Pose::from_matrix)?;
        let edges_px = boxes(&boxes_px)?;
        let scores = scores.as_array().to_vec();
        let rows = rows("rows", &lifted.rows)?;
        let centres: Vec<_> = points(&lifted.centres_in_camera)?.iter().map(|point| point.coords).collect();
        let covariances = matrices(&lifted.covariances)?;
        let diameters_m = lifted.diameters_m.as_array().to_vec();
        let diameter_sigmas_m = lifted.diameter_sigmas_m.as_array().to_vec();
        let support = lifted.support.as_array().to_vec();
        let boxes = Boxes { edges_px: &edges_px, scores: &scores };
        let lifted = LiftedBoxes {
            rows: &rows,
            centres_in_camera: &centres,
            covariances: &covariances,
            diameters_m: &diameters_m,
            diameter_sigmas_m: &diameter_sigmas_m,
            support: &support,
        };
        let numbers = detached(py, || self.tracker.update(frame, &pose, &boxes, &lifted))?.map_err(wrong)?;
        Ok(PyArray1::from_iter(py, numbers.into_iter().map(|number| number.map_or(-1, |number| number as i64))))
    }

    /// Looks in the picture of the last frame, (H, W, 3), for fruits that have no box.
    fn glimpse(&mut self, py: Python<'_>, picture: PyReadonlyArray3<'_, u8>) -> PyResult<()> {
        let width = picture.shape()[1];
        let values = picture.as_slice()?;
        detached(py, || self.tracker.glimpse(Picture::new(values, width)))?;
        Ok(())
    }

    #[getter]
    fn min_views(&self) -> usize {
        self.min_views
    }

    #[pyo3(signature = (min_views=None))]
    fn finish(&self, py: Python<'_>, min_views: Option<usize>) -> PyResult<PyTracks> {
        detached(py, || self.tracker.finish(min_views.unwrap_or(self.min_views))).map(PyTracks)
    }
}

/// The fruits of a visit.
#[pyclass(name = "Tracks", module = "pomona._core", frozen)]
pub struct PyTracks(Tracks);

#[pymethods]
impl PyTracks {
    #[getter]
    fn numbers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.0.numbers.iter().map(|&number| number as i64))
    }

    #[getter]
    fn centres<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let flat = PyArray1::from_iter(py, self.0.centres.iter().flat_map(|centre| centre.iter().copied()));
        flat.reshape([self.0.centres.len(), 3])
    }

    #[getter]
    fn covariances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        // Symmetric: the order of rows and columns makes no difference.
        let flat = PyArray1::from_iter(py, self.0.covariances.iter().flat_map(|matrix| matrix.iter().copied()));
        flat.reshape([self.0.covariances.len(), 3, 3])
    }

    #[getter]
    fn radii_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.0.radii_m)
    }

    #[getter]
    fn radius_sigmas_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.0.radius_sigmas_m)
    }

    #[getter]
    fn n_views<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.0.views.iter().map(|&views| views as i64))
    }

    #[getter]
    fn n_glimpses<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.0.glimpses.iter().map(|&glimpses| glimpses as i64))
    }

    #[getter]
    fn missed_boxes(&self) -> f64 {
        self.0.missed_boxes
    }

    #[getter]
    fn evidence<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.0.evidence)
    }

    #[getter]
    fn frames<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.0.sightings.iter().map(|sighting| sighting.frame))
    }

    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.0.sightings.iter().map(|sighting| sighting.row as i64))
    }

    #[getter]
    fn fruits<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.0.sightings.iter().map(|sighting| sighting.fruit as i64))
    }

    #[getter]
    fn shared<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_iter(py, self.0.sightings.iter().map(|sighting| sighting.shared))
    }
}

/// What is known of tracks, as Python passes it.
#[derive(FromPyObject)]
pub struct TrackArrays<'py> {
    #[pyo3(item)]
    centres: PyReadonlyArray2<'py, f64>,
    #[pyo3(item)]
    depths_m: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    views: PyReadonlyArray1<'py, i64>,
    #[pyo3(item)]
    glimpses: PyReadonlyArray1<'py, i64>,
    #[pyo3(item)]
    shown_m2: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    fruitness: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    diameters_m: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    diameter_sigmas_m: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    missed_boxes: f64,
}

type Believed<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<bool>>, f64);

/// Probability of each track to be a fruit, whether it is to be reported, and frames for which one stays in view.
#[pyfunction]
#[pyo3(signature = (tracks, *, box_fruitness, elsewhere, camera, poses, config))]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn believed<'py>(
    py: Python<'py>,
    tracks: TrackArrays<'py>,
    box_fruitness: PyReadonlyArray1<'py, f64>,
    elsewhere: PyReadonlyArray1<'py, f64>,
    camera: Calibration,
    poses: PyReadonlyArray3<'py, f64>,
    config: &str,
) -> PyResult<Believed<'py>> {
    let config = parsed(config)?.tracking;
    let centres: Vec<_> = points(&tracks.centres)?.iter().map(|point| point.coords).collect();
    let n = centres.len();
    let numbers = |values: &PyReadonlyArray1<'py, f64>| values.as_array().to_vec();
    let (depths_m, shown_m2) = (numbers(&tracks.depths_m), numbers(&tracks.shown_m2));
    let fruitness = numbers(&tracks.fruitness);
    let (views, glimpses) = (rows("views", &tracks.views)?, rows("glimpses", &tracks.glimpses)?);
    let (diameters_m, sigmas_m) = (numbers(&tracks.diameters_m), numbers(&tracks.diameter_sigmas_m));
    let numbers_of = [depths_m.len(), shown_m2.len(), fruitness.len(), diameters_m.len(), sigmas_m.len()];
    if numbers_of != [n; 5] || [views.len(), glimpses.len()] != [n; 2] {
        return Err(wrong("tracks: expected one row for each track in every array"));
    }
    let camera = camera.to_camera()?;
    let poses = self::poses("session_from_camera", &poses, Pose::from_matrix)?;
    let (boxes, elsewhere) = (numbers(&box_fruitness), numbers(&elsewhere));
    let tracks = TrackViews {
        centres: &centres,
        depths_m: &depths_m,
        views: &views,
        glimpses: &glimpses,
        shown_m2: &shown_m2,
        fruitness: &fruitness,
        diameters_m: &diameters_m,
        diameter_sigmas_m: &sigmas_m,
        missed_boxes: tracks.missed_boxes,
    };
    let colours = Colours { boxes: &boxes, elsewhere: &elsewhere };
    let found = detached(py, || belief(&tracks, &colours, (&camera, &poses), &config))?;
    let probability = PyArray1::from_vec(py, found.probability);
    Ok((probability, PyArray1::from_vec(py, found.is_believed), found.frames_in_view))
}

/// For every fruit the smallest row of those that are the same fruit.
#[pyfunction]
#[pyo3(signature = (*, centres, covariances, radii_m, frames, fruits, place_sigma_m, config))]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
#[expect(clippy::too_many_arguments, reason = "a struct of arrays")]
pub fn one_fruit_each<'py>(
    py: Python<'py>,
    centres: PyReadonlyArray2<'py, f64>,
    covariances: PyReadonlyArray3<'py, f64>,
    radii_m: PyReadonlyArray1<'py, f64>,
    frames: PyReadonlyArray1<'py, i64>,
    fruits: PyReadonlyArray1<'py, i64>,
    place_sigma_m: f64,
    config: &str,
) -> PyResult<Bound<'py, PyArray1<i64>>> {
    let config = parsed(config)?.tracking;
    let centres = points(&centres)?;
    let covariances = matrices(&covariances)?;
    let radii_m = radii_m.as_array().to_vec();
    if covariances.len() != centres.len() || radii_m.len() != centres.len() {
        return Err(wrong("expected a centre, a covariance and a radius for each fruit"));
    }
    let bodies: Vec<_> = centres
        .iter()
        .zip(covariances)
        .zip(radii_m)
        .map(|((centre, covariance), radius_m)| Body { centre: centre.coords, covariance, radius_m })
        .collect();
    let mut frames_of: Vec<Vec<i64>> = vec![Vec::new(); bodies.len()];
    for (&frame, fruit) in frames.as_array().iter().zip(rows("fruits", &fruits)?) {
        frames_of.get_mut(fruit).ok_or_else(|| wrong("fruits: a sighting names a row beyond the last"))?.push(frame);
    }
    for frames in &mut frames_of {
        frames.sort_unstable();
    }
    let labels = detached(py, || merge_duplicates(&bodies, &frames_of, place_sigma_m, &config))?;
    Ok(PyArray1::from_iter(py, labels.into_iter().map(|label| label as i64)))
}
