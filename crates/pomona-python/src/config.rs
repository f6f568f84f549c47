//! Settings as Python passes them.

use pomona::Config;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The tables of a JSON text, checked; what is wrong is told without the place in a text that nobody wrote.
pub fn parsed(text: &str) -> PyResult<Config> {
    let config: Config = serde_json::from_str(text).map_err(|error| {
        let told = error.to_string();
        let reason = told.rsplit_once(" at line ").map_or(told.as_str(), |(reason, _)| reason);
        PyValueError::new_err(format!("configuration: {reason}"))
    })?;
    config.validate().map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(config)
}
