//! A camera from what Python passes.

use pomona::camera::Camera;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The fields of a calibration that the core needs.
#[derive(FromPyObject)]
pub struct Fields {
    #[pyo3(attribute)]
    width: usize,
    #[pyo3(attribute)]
    height: usize,
    #[pyo3(attribute)]
    fx: f64,
    #[pyo3(attribute)]
    fy: f64,
    #[pyo3(attribute)]
    cx: f64,
    #[pyo3(attribute)]
    cy: f64,
}

impl Fields {
    /// The same as the core has it.
    pub fn to_camera(&self) -> PyResult<Camera> {
        let &Self { width, height, fx, fy, cx, cy } = self;
        if ![fx, fy, cx, cy].iter().all(|x| x.is_finite()) || fx <= 0.0 || fy <= 0.0 {
            return Err(PyValueError::new_err(format!(
                "camera: found fx {fx}, fy {fy}, cx {cx}, cy {cy}, expected finite pixels and focal lengths above 0"
            )));
        }
        Ok(Camera { width, height, fx, fy, cx, cy })
    }
}
