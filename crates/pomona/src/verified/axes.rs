//! Principal axes of a row: what its extent says of a pose.

use super::landscape::Landscape;
use crate::principal::Principal;
use nalgebra::{Matrix3, Vector3};

/// Fewer fruits have no extent to go by.
pub(super) const MIN_FRUITS: usize = 100;

/// A row is so many times as long as it is high, and as high as it is deep, at the least: else the axes do not say which is
/// which.
const LEAST_RATIO: f64 = 1.2;

/// Signs of the axes that an extent leaves open, those of turns.
pub(super) const HALF_TURNS: [[f64; 3]; 4] = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];

/// Axes of a row as a proper rotation, along it, up and in depth; `None` where the cloud is no row.
pub(super) fn row_axes(cloud: &Landscape) -> Option<Matrix3<f64>> {
    let Principal { axes, extents } = Principal::of(cloud.points.iter())?;
    extents.windows(2).all(|two| two[0] > LEAST_RATIO * two[1]).then_some(axes)
}

/// The way along a cloud that is longer than wide.
pub(super) fn along(cloud: &Landscape) -> Option<Vector3<f64>> {
    let Principal { axes, extents } = Principal::of(cloud.points.iter())?;
    (extents[0] > LEAST_RATIO * extents[1]).then(|| axes.column(0).into_owned())
}
