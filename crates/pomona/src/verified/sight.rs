//! Which fruits of two rows hang where both visits see.
//!
//! A visit sees one side of a row, and fades in depth. Of two from opposite sides each shows fruits that the other could not
//! have shown, and they say nothing against a pose. How far each sees is told by the pose itself: in a depth of the row
//! where one visit shows many fruits and the other hardly any, the other does not see.

use super::axes::row_axes;
use super::landscape::Landscape;
use crate::geometry::Similarity;
use crate::statistics::gaussian;
use nalgebra::Vector3;
use std::collections::HashMap;

/// A visit that shows less than this share of the other's fruits in a depth does not see there.
const LEAST: f64 = 0.1;

/// Standard deviation of the depths over which fruits are counted, in spacings: 7 cm in an orchard.
const WIDTH: f64 = 0.25;

/// Fruits of the query, and of the map, that hang where the other visit does not see; none where the map is no row.
pub(super) fn unseen(query: &Landscape, map: &Landscape, pose: &Similarity) -> [Vec<bool>; 2] {
    let Some(axes) = row_axes(map) else { return [vec![false; query.len()], vec![false; map.len()]] };
    let depth = |place: &Vector3<f64>| place.dot(&axes.column(2));
    let here: Vec<Vector3<f64>> = query.points.iter().map(|p| pose.image(p)).collect();
    // Trees that only one visit shows say nothing about how far the other sees.
    let both = [
        here.iter().filter(|place| map.support.at(place) > 0.0).map(depth).collect::<Vec<f64>>(),
        map.points.iter().filter(|p| query.support.at(&pose.preimage(p)) > 0.0).map(depth).collect(),
    ];
    let variance = (WIDTH * map.spacing).powi(2);
    let shown =
        |depths: &[f64], at: f64| depths.iter().map(|depth| gaussian((depth - at).powi(2), variance)).sum::<f64>();
    // Fruits within a quarter of that width share what is shown there.
    let (step, mut sums) = (WIDTH * map.spacing / 4.0, HashMap::new());
    let mut sums_at = |place: &Vector3<f64>| {
        let steps = (depth(place) / step).round();
        let at = || [0, 1].map(|side: usize| shown(&both[side], steps * step));
        *sums.entry(steps as i64).or_insert_with(at)
    };
    let mut hidden = |place: &Vector3<f64>, own: usize| {
        let sums = sums_at(place);
        sums[1 - own] < LEAST * sums[own]
    };
    [here.iter().map(|place| hidden(place, 0)).collect(), map.points.iter().map(|place| hidden(place, 1)).collect()]
}
