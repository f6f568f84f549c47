//! Threads that several things share: each with its own would keep memory for its own.

use crate::matching::pool_of;
use pyo3::prelude::*;
use std::sync::Arc;

/// At most so many threads, for all that are given them together.
#[pyclass(name = "Threads", module = "pomona._core", frozen)]
pub struct PyThreads(Arc<rayon::ThreadPool>);

#[pymethods]
impl PyThreads {
    #[new]
    fn new(count: usize) -> PyResult<Self> {
        pool_of(count).map(|pool| Self(Arc::new(pool)))
    }

    #[getter]
    fn count(&self) -> usize {
        self.0.current_num_threads()
    }
}

impl PyThreads {
    pub fn pool(&self) -> Arc<rayon::ThreadPool> {
        Arc::clone(&self.0)
    }
}
