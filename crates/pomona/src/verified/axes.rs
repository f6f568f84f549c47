//! Principal axes of a cloud: what its outline says of a pose.

use super::landscape::Landscape;
use nalgebra::{Matrix3, Vector3};

/// Fewer fruits have no outline to go by.
pub(super) const MIN_FRUITS: usize = 100;

/// Signs of the axes that an outline leaves open, those of turns.
pub(super) const HALF_TURNS: [[f64; 3]; 4] = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];

/// Axes as a proper rotation, the longest first, with the standard deviations along them; `None` where all fruits hang in one
/// place.
pub(super) fn axes_of(cloud: &Landscape) -> Option<(Matrix3<f64>, Vector3<f64>)> {
    let scatter = cloud.points.iter().fold(Matrix3::zeros(), |sum, p| sum + p * p.transpose()) / cloud.len() as f64;
    let eigen = scatter.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let extents = Vector3::from(order.map(|i| eigen.eigenvalues[i].max(0.0).sqrt()));
    let [first, second] = [order[0], order[1]].map(|i| eigen.eigenvectors.column(i).into_owned());
    let axes = Matrix3::from_columns(&[first, second, first.cross(&second)]);
    (extents[0] > 0.0 && axes.iter().all(|x| x.is_finite())).then_some((axes, extents))
}
