//! Threads that several things share: each with its own would keep memory for its own.
//!
//! A process that was forked has none of its parent's threads, and would wait for them for ever: it starts its own.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::process;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// At most so many threads, for all that are given them together.
#[pyclass(name = "Threads", module = "pomona._core", frozen)]
pub struct PyThreads(Arc<Threads>);

#[pymethods]
impl PyThreads {
    #[new]
    fn new(count: usize) -> PyResult<Self> {
        Threads::new(count).map(|threads| Self(Arc::new(threads)))
    }

    #[getter]
    fn count(&self) -> usize {
        self.0.count
    }
}

impl PyThreads {
    pub fn shared(&self) -> Arc<Threads> {
        Arc::clone(&self.0)
    }
}

/// Threads of their own, at most as many as the machine has cores: more would only wait for each other.
pub struct Threads {
    /// As many as the machine has cores where it is 0.
    count: usize,
    /// By the process that started them.
    started: Mutex<(u32, Arc<ThreadPool>)>,
}

impl Threads {
    pub fn new(count: usize) -> PyResult<Self> {
        if count == 0 {
            return Err(PyValueError::new_err("threads: found 0, expected at least 1"));
        }
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        Self::started(count.min(cores))
    }

    fn started(count: usize) -> PyResult<Self> {
        Ok(Self { count, started: Mutex::new((process::id(), started(count)?)) })
    }

    /// Those that were asked for, if any were.
    pub fn asked(count: Option<usize>) -> PyResult<Option<Self>> {
        count.map(Self::new).transpose()
    }

    fn of_this_process(&self) -> PyResult<Arc<ThreadPool>> {
        let mut threads = self.started.lock().unwrap_or_else(PoisonError::into_inner);
        if threads.0 != process::id() {
            let own = (process::id(), started(self.count)?);
            // To end the parent's would be to wait for them, too.
            std::mem::forget(std::mem::replace(&mut *threads, own));
        }
        Ok(Arc::clone(&threads.1))
    }
}

fn started(count: usize) -> PyResult<Arc<ThreadPool>> {
    let threads = ThreadPoolBuilder::new().num_threads(count).build();
    threads.map(Arc::new).map_err(|error| PyValueError::new_err(format!("threads: {error}")))
}

/// The process that all threads of its own belong to where none are asked for.
static FIRST: OnceLock<u32> = OnceLock::new();

/// Those of a process that was forked from it.
static FORKED: Mutex<Option<Threads>> = Mutex::new(None);

/// Remembers which process this is.
pub fn begin() {
    FIRST.get_or_init(process::id);
}

/// Does `work` on the threads of the whole process while Python goes on.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    if FIRST.get() == Some(&process::id()) {
        return Ok(py.detach(work));
    }
    let mut forked = FORKED.lock().unwrap_or_else(PoisonError::into_inner);
    let threads = forked.take().map_or_else(|| Threads::started(0), Ok)?;
    let own = threads.of_this_process();
    *forked = Some(threads);
    // Work may call Python, which may come back here.
    drop(forked);
    let own = own?;
    Ok(py.detach(|| own.install(work)))
}

/// The same on these threads, where there are any.
pub fn detached_on<T: Send>(py: Python<'_>, threads: Option<&Threads>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let Some(threads) = threads else { return detached(py, work) };
    let threads = threads.of_this_process()?;
    Ok(py.detach(|| threads.install(work)))
}
