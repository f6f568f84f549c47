//! Ways to move places onto the fruits of a cloud.

use super::landscape::Landscape;
use crate::neighbours::cells::{CellMap, cell_of};
use nalgebra::Vector3;

/// Edge of a cell of translations in standard deviations of the noise: what a refinement reaches.
pub(super) const WIDTH: f64 = 4.0;

/// The translations within `reach` by which places come on fruits of a cloud, those by which most do first; those within a cell of the
/// edge `width` are one, their mean.
pub(super) fn most_common(
    places: impl Iterator<Item = Vector3<f64>>,
    cloud: &Landscape,
    reach: f64,
    width: f64,
) -> impl Iterator<Item = Vector3<f64>> {
    let mut cells: CellMap<(f64, Vector3<f64>)> = CellMap::default();
    for place in places {
        for row in cloud.within(&place, reach) {
            let by = cloud.points[row as usize] - place;
            let cell = cells.entry(cell_of(&by, 1.0 / width)).or_default();
            *cell = (cell.0 + 1.0, cell.1 + by);
        }
    }
    let mut votes: Vec<_> = cells.into_iter().collect();
    votes.sort_unstable_by(|(a, (one, _)), (b, (other, _))| other.total_cmp(one).then(a.cmp(b)));
    votes.into_iter().map(|(_, (count, sum))| sum / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FruitCloud;
    use crate::verified::fixture::Dice;

    #[test]
    fn fruits_on_a_lattice_come_on_each_other_by_its_steps() {
        let mut dice = Dice(7);
        let step = |i: usize| Vector3::new(0.5 * (i % 10) as f64, 0.0, 0.6 * (i / 10) as f64);
        let place = |i: usize| (step(i) + 0.01 * dice.normal()).into();
        let cloud = Landscape::new(&FruitCloud::from_positions((0..40).map(place).collect()));
        let found: Vec<Vector3<f64>> = most_common(cloud.points.iter().copied(), &cloud, 1.0, 0.08).take(9).collect();
        assert_eq!(found.len(), 9);
        for by in found {
            let off = [by.x / 0.5, by.y, by.z / 0.6].map(|steps| (steps - steps.round()).abs());
            assert!(off.iter().all(|off| *off < 0.1), "{by}");
        }
    }
}
