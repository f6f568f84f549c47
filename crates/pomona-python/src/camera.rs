//! A camera from what Python passes.

use pomona::Camera;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The fields of a calibration that the core needs.
#[derive(FromPyObject)]
pub struct Calibration {
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
    #[pyo3(attribute)]
    baseline_m: Option<f64>,
}

impl Calibration {
    /// The same as the core has it.
    pub fn to_camera(&self) -> PyResult<Camera> {
        let &Self { width, height, fx, fy, cx, cy, baseline_m } = self;
        if ![fx, fy, cx, cy].iter().all(|x| x.is_finite()) || fx <= 0.0 || fy <= 0.0 {
            return Err(PyValueError::new_err(format!(
                "camera: found fx {fx}, fy {fy}, cx {cx}, cy {cy}, expected finite pixels and focal lengths above 0"
            )));
        }
        if baseline_m.is_some_and(|baseline_m| !(baseline_m.is_finite() && baseline_m > 0.0)) {
            let found = baseline_m.unwrap_or_default();
            return Err(PyValueError::new_err(format!(
                "camera: found baseline_m {found}, expected a finite number above 0"
            )));
        }
        Ok(Camera { width, height, fx, fy, cx, cy, baseline_m })
    }

    /// The same where two pictures are compared.
    pub fn to_stereo_camera(&self) -> PyResult<Camera> {
        let camera = self.to_camera()?;
        if camera.baseline_m.is_none() {
            return Err(PyValueError::new_err("camera: found no baseline_m, expected one of a stereo pair"));
        }
        Ok(camera)
    }
}
