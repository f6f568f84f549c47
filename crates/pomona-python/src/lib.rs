//! Python bindings of the pomona core: thin, no logic. One file per core module.

mod appearance;
mod bundle;
mod camera;
mod cloud;
mod config;
mod descriptor;
mod identity;
mod lifting;
mod localization;
mod matching;
mod odometry;
mod pose;
mod render;
mod stereo;
mod threads;
mod tracking;

use pomona::stereo::alignment::CORRECTED;
use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    threads::begin();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<matching::PyMatch>()?;
    module.add_class::<matching::PyMapIndex>()?;
    module.add_class::<matching::PyReadyCloud>()?;
    module.add_class::<localization::PyLocalization>()?;
    module.add_class::<localization::PyLocalizer>()?;
    module.add_class::<threads::PyThreads>()?;
    module.add_class::<odometry::PyLooking>()?;
    module.add_class::<odometry::PyOdometry>()?;
    module.add_class::<render::PyRowScene>()?;
    module.add_class::<tracking::PyTracker>()?;
    module.add_class::<tracking::PyTracks>()?;
    module.add_function(wrap_pyfunction!(tracking::one_fruit_each, module)?)?;
    module.add_function(wrap_pyfunction!(tracking::believed, module)?)?;
    module.add_function(wrap_pyfunction!(appearance::look_of, module)?)?;
    module.add_function(wrap_pyfunction!(descriptor::describe, module)?)?;
    module.add_function(wrap_pyfunction!(identity::contracted, module)?)?;
    module.add_function(wrap_pyfunction!(identity::whereabouts, module)?)?;
    module.add_function(wrap_pyfunction!(lifting::fuse_fruits, module)?)?;
    module.add_function(wrap_pyfunction!(lifting::lift, module)?)?;
    module.add_function(wrap_pyfunction!(bundle::adjust, module)?)?;
    module.add_function(wrap_pyfunction!(odometry::rejoin, module)?)?;
    module.add_function(wrap_pyfunction!(stereo::read_pair, module)?)?;
    module.add_function(wrap_pyfunction!(stereo::exposure_gains, module)?)?;
    module.add_function(wrap_pyfunction!(stereo::exposure_tables, module)?)?;
    module.add_function(wrap_pyfunction!(stereo::row_alignment, module)?)?;
    module.add_function(wrap_pyfunction!(stereo::row_reach_px, module)?)?;
    module.add("MOST_MISALIGNED", (CORRECTED[0], CORRECTED[1]))?;
    module.add_function(wrap_pyfunction!(matching::default_config, module)?)?;
    module.add_function(wrap_pyfunction!(matching::setting_meanings, module)?)?;
    module.add_function(wrap_pyfunction!(matching::match_expected, module)?)?;
    Ok(())
}
