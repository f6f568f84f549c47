//! The facade: an index of a map, its answers, the settings.

use crate::cloud::Arrays;
use crate::config::parsed;
use crate::threads::{Threads, detached_on};
use memmap2::{Mmap, MmapOptions};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pomona::nalgebra::{Matrix4, Vector3};
use pomona::verified::compact::Bytes;
use pomona::{Config, MapIndex, Match, Method, ReadyCloud, Scale, Similarity, Verdict};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::collections::HashMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Settings and their defaults as JSON.
#[pyfunction]
pub fn default_config() -> PyResult<String> {
    serde_json::to_string(&Config::default()).map_err(wrong)
}

/// What every setting and every table means, by their names with dots between tables.
#[pyfunction]
pub fn setting_meanings() -> HashMap<String, &'static str> {
    Config::meanings().collect()
}

fn wrong(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A verdict by its name.
pub fn status(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Found => "Found",
        Verdict::TooFew => "TooFew",
        Verdict::Ambiguous => "Ambiguous",
        Verdict::NoMatch => "NoMatch",
    }
}

/// The answer to one query.
#[pyclass(name = "Match", module = "pomona._core", frozen)]
pub struct PyMatch(Match);

fn rows(matrix: &Matrix4<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

#[pymethods]
impl PyMatch {
    #[getter]
    fn status(&self) -> &'static str {
        status(self.0.verdict)
    }

    #[getter]
    fn map_from_query<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let matrix = self.0.registration.map(|found| rows(&found.map_from_query.to_matrix()));
        matrix.map(|rows| PyArray2::from_vec2(py, &rows).map_err(wrong)).transpose()
    }

    #[getter]
    fn scale(&self) -> Option<f64> {
        self.0.registration.map(|found| found.map_from_query.scale)
    }

    #[getter]
    fn log_odds(&self) -> Option<f64> {
        self.0.registration.map(|found| found.log_odds)
    }

    #[getter]
    fn alternatives(&self) -> Vec<(Vec<Vec<f64>>, f64)> {
        self.0.alternatives.iter().map(|found| (rows(&found.map_from_query.to_matrix()), found.log_odds)).collect()
    }

    #[getter]
    fn further(&self) -> Vec<Vec<Vec<f64>>> {
        self.0.further.iter().map(|found| rows(&found.map_from_query.to_matrix())).collect()
    }

    #[getter]
    fn pairs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let flat: Vec<i64> = self.0.pairs.iter().flat_map(|pair| [pair.query as i64, pair.map as i64]).collect();
        PyArray1::from_vec(py, flat).reshape([self.0.pairs.len(), 2])
    }

    #[getter]
    fn probabilities<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.0.pairs.iter().map(|pair| pair.probability))
    }

    #[getter]
    fn distances_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.0.pairs.iter().map(|pair| pair.distance_m))
    }

    #[getter]
    fn support<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.0.pairs.iter().map(|pair| pair.support))
    }

    #[getter]
    fn part_of_pairs<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.0.pairs.iter().map(|pair| pair.part as i64))
    }

    #[getter]
    fn noise_m(&self) -> f64 {
        self.0.noise_m
    }

    #[getter]
    fn stages(&self) -> Vec<(&'static str, f64)> {
        self.0.stages.clone()
    }
}

/// A map made ready for many queries.
#[pyclass(name = "MapIndex", module = "pomona._core", frozen)]
pub struct PyMapIndex {
    index: MapIndex,
    threads: Option<Threads>,
}

#[pymethods]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
impl PyMapIndex {
    #[new]
    #[pyo3(signature = (map, *, method, scale, config, threads=None))]
    fn new(
        py: Python<'_>,
        map: Arrays<'_>,
        method: &str,
        scale: &str,
        config: &str,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let method: Method = parse("method", method)?;
        let scale: Scale = parse("scale", scale)?;
        let config = parsed(config)?;
        let cloud = map.to_cloud()?;
        Self::made(py, threads, || MapIndex::new(&cloud, method, scale, config))
    }

    /// An index as of a large map, whatever its size.
    #[staticmethod]
    #[pyo3(signature = (map, *, config, threads=None))]
    fn compact(py: Python<'_>, map: Arrays<'_>, config: &str, threads: Option<usize>) -> PyResult<Self> {
        let config = parsed(config)?;
        let cloud = map.to_cloud()?;
        Self::made(py, threads, || MapIndex::compact(&cloud, config))
    }

    /// The index of `map` in a file, which is mapped into memory.
    #[staticmethod]
    #[pyo3(signature = (path, map, *, config, threads=None))]
    fn opened(py: Python<'_>, path: PathBuf, map: Arrays<'_>, config: &str, threads: Option<usize>) -> PyResult<Self> {
        let config = parsed(config)?;
        let bytes: Bytes = Arc::new(mapped(&path)?);
        let cloud = map.to_cloud()?;
        Self::made(py, threads, || MapIndex::opened(&bytes, &cloud, config))
    }

    /// Writes a compact index into a file.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let pieces = self.index.pieces().map_err(wrong)?;
        py.detach(|| {
            let mut file = File::create(path)?;
            for piece in pieces {
                file.write_all(&piece)?;
            }
            file.sync_all()
        })
        .map_err(PyErr::from)
    }

    #[getter]
    fn is_compact(&self) -> bool {
        self.index.is_compact()
    }

    #[pyo3(signature = (query, *, noise_m=None, up=None, per_frame=false))]
    fn search(
        &self,
        py: Python<'_>,
        query: Arrays<'_>,
        noise_m: Option<f64>,
        up: Option<([f64; 3], [f64; 3])>,
        per_frame: bool,
    ) -> PyResult<PyMatch> {
        let cloud = query.to_cloud()?;
        let up = up.map(|(query, map)| [Vector3::from(query), Vector3::from(map)]);
        let search = || {
            if per_frame { self.index.search_by_frame(&cloud, noise_m) } else { self.index.search(&cloud, noise_m, up) }
        };
        detached_on(py, self.threads.as_ref(), search)?.map(PyMatch).map_err(wrong)
    }

    #[pyo3(signature = (query, *, map_from_query, noise_m=None))]
    fn pairs_under(
        &self,
        py: Python<'_>,
        query: Arrays<'_>,
        map_from_query: [[f64; 4]; 4],
        noise_m: Option<f64>,
    ) -> PyResult<PyMatch> {
        let cloud = query.to_cloud()?;
        let matrix = Matrix4::from_fn(|row, column| map_from_query[row][column]);
        let pose = Similarity::from_matrix(&matrix).map_err(wrong)?;
        let pairs = || self.index.pairs_under(&cloud, &pose, noise_m);
        detached_on(py, self.threads.as_ref(), pairs)?.map(PyMatch).map_err(wrong)
    }
}

/// A cloud made ready for several matches where it is expected.
#[pyclass(name = "ReadyCloud", module = "pomona._core", frozen)]
pub struct PyReadyCloud(ReadyCloud);

#[pymethods]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
impl PyReadyCloud {
    #[new]
    #[pyo3(signature = (cloud, *, threads=None))]
    fn new(py: Python<'_>, cloud: Arrays<'_>, threads: Option<usize>) -> PyResult<Self> {
        let threads = Threads::asked(threads)?;
        let cloud = cloud.to_cloud()?;
        detached_on(py, threads.as_ref(), || ReadyCloud::new(&cloud))?.map(Self).map_err(wrong)
    }
}

/// Pairs of two clouds whose pose is known to a few decimetres.
#[pyfunction]
#[pyo3(signature = (query, map, *, map_from_query, config, noise_m=None, threads=None))]
#[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
pub fn match_expected(
    py: Python<'_>,
    query: PyRef<'_, PyReadyCloud>,
    map: PyRef<'_, PyReadyCloud>,
    map_from_query: [[f64; 4]; 4],
    config: &str,
    noise_m: Option<f64>,
    threads: Option<usize>,
) -> PyResult<PyMatch> {
    let config = parsed(config)?;
    let threads = Threads::asked(threads)?;
    let (query, map) = (&query.0, &map.0);
    let matrix = Matrix4::from_fn(|row, column| map_from_query[row][column]);
    let pose = Similarity::from_matrix(&matrix).map_err(wrong)?;
    let search = || pomona::match_expected(query, map, &pose, noise_m, &config);
    detached_on(py, threads.as_ref(), search)?.map(PyMatch).map_err(wrong)
}

impl PyMapIndex {
    fn made(
        py: Python<'_>,
        threads: Option<usize>,
        make: impl FnOnce() -> pomona::Result<MapIndex> + Send,
    ) -> PyResult<Self> {
        let threads = Threads::asked(threads)?;
        let index = detached_on(py, threads.as_ref(), make)?.map_err(wrong)?;
        Ok(Self { index, threads })
    }
}

/// A file as bytes that are read as they are needed.
#[expect(
    unsafe_code,
    reason = "nobody can promise that no other program writes into the file meanwhile; Pomona replaces it whole"
)]
pub fn mapped(path: &Path) -> PyResult<Mmap> {
    let file = File::open(path)?;
    // SAFETY: a file that Pomona writes appears whole under its name and is never written into again.
    // All of it is summed when it is opened: one request costs less than a fault a page.
    Ok(unsafe { MmapOptions::new().populate().map(&file) }?)
}

/// A name of an enumeration, spelled as in the configuration.
fn parse<T: serde::de::DeserializeOwned>(field: &str, name: &str) -> PyResult<T> {
    serde_json::from_value(serde_json::Value::String(name.to_owned()))
        .map_err(|error| wrong(format!("{field}: {error}")))
}
