//! Where the camera is in a map.

use crate::bundle::{array, wrong};
use crate::cloud::Arrays;
use crate::config::parsed;
use crate::matching::{mapped, status};
use crate::pose::{pose, pose_array};
use crate::threads::{PyThreads, Threads, detached_on};
use numpy::{PyArray1, PyArray2, PyReadonlyArray2};
use pomona::nalgebra::{Matrix6, Vector3};
use pomona::verified::compact::Bytes;
use pomona::{Config, FruitCloud, Localization, Localizer, Pose, ToldMotion};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// Where the camera is, or why nobody can say.
#[pyclass(name = "Localization", module = "pomona._core", frozen)]
pub struct PyLocalization(Localization);

#[pymethods]
impl PyLocalization {
    #[getter]
    fn status(&self) -> &'static str {
        status(self.0.verdict)
    }

    #[getter]
    fn map_from_camera<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.0.pose.as_ref().map(|pose| pose_array(py, pose)).transpose()
    }

    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array(py, self.0.covariance.as_slice().to_vec(), [6, 6])
    }

    #[getter]
    fn pairs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let flat = self.0.pairs.iter().flat_map(|pair| [pair.seen as i64, pair.map as i64]).collect();
        array(py, flat, [self.0.pairs.len(), 2])
    }

    #[getter]
    fn probabilities<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.0.pairs.iter().map(|pair| pair.probability))
    }

    #[getter]
    fn log_odds(&self) -> f64 {
        self.0.log_odds
    }

    #[getter]
    fn tracked(&self) -> bool {
        self.0.tracked
    }
}

type Up = Option<([f64; 3], [f64; 3])>;

fn vertical(up: Up) -> Option<[Vector3<f64>; 2]> {
    up.map(|(seen, map)| [Vector3::from(seen), Vector3::from(map)])
}

/// A map in which a camera finds itself.
#[pyclass(name = "Localizer", module = "pomona._core")]
pub struct PyLocalizer {
    localizer: Localizer,
    threads: Option<Arc<Threads>>,
}

#[pymethods]
#[expect(
    clippy::needless_pass_by_value,
    clippy::large_types_passed_by_value,
    reason = "arguments arrive by value from Python"
)]
impl PyLocalizer {
    #[new]
    #[pyo3(signature = (map, *, config, threads=None))]
    fn new(py: Python<'_>, map: Arrays<'_>, config: &str, threads: Option<&PyThreads>) -> PyResult<Self> {
        Self::made(py, &map, config, threads, Localizer::new)
    }

    /// A map whose index is in a file, which is mapped into memory.
    #[staticmethod]
    #[pyo3(signature = (path, map, *, config, threads=None))]
    fn opened(
        py: Python<'_>,
        path: PathBuf,
        map: Arrays<'_>,
        config: &str,
        threads: Option<&PyThreads>,
    ) -> PyResult<Self> {
        let bytes: Bytes = Arc::new(mapped(&path)?);
        Self::made(py, &map, config, threads, |cloud, config| Localizer::opened(&bytes, cloud, config))
    }

    #[pyo3(signature = (seen, *, up=None))]
    fn locate(&self, py: Python<'_>, seen: Arrays<'_>, up: Up) -> PyResult<PyLocalization> {
        let (cloud, up) = (seen.to_cloud()?, vertical(up));
        detached_on(py, self.threads.as_deref(), || self.localizer.locate(&cloud, up))?
            .map(PyLocalization)
            .map_err(wrong)
    }

    #[pyo3(signature = (seen, *, previous_from_camera=None, motion_covariance=None, up=None))]
    fn update(
        &mut self,
        py: Python<'_>,
        seen: Arrays<'_>,
        previous_from_camera: Option<PyReadonlyArray2<'_, f64>>,
        motion_covariance: Option<[[f64; 6]; 6]>,
        up: Up,
    ) -> PyResult<PyLocalization> {
        let moved = previous_from_camera.map(|moved| pose("moved", &moved, Pose::from_matrix)).transpose()?;
        let covariance = motion_covariance.map(|rows| Matrix6::from_fn(|row, column| rows[row][column]));
        let moved = moved.map(|previous_from_camera| ToldMotion { previous_from_camera, covariance });
        let (cloud, up) = (seen.to_cloud()?, vertical(up));
        let Self { localizer, threads } = self;
        detached_on(py, threads.as_deref(), || localizer.update(&cloud, moved.as_ref(), up))?
            .map(PyLocalization)
            .map_err(wrong)
    }

    fn reset(&mut self) {
        self.localizer.reset();
    }
}

impl PyLocalizer {
    fn made(
        py: Python<'_>,
        map: &Arrays<'_>,
        config: &str,
        threads: Option<&PyThreads>,
        make: impl FnOnce(&FruitCloud, Config) -> pomona::Result<Localizer> + Send,
    ) -> PyResult<Self> {
        let config = parsed(config)?;
        let threads = threads.map(PyThreads::shared);
        let cloud = map.to_cloud()?;
        let localizer = detached_on(py, threads.as_deref(), || make(&cloud, config))?.map_err(wrong)?;
        Ok(Self { localizer, threads })
    }
}
