//! One cloud prepared for verification: its grid, its typical spacing, and what chance predicts at each place.

use super::bearing::Bearings;
use super::chance::{Companions, MovedCompanions, crowding, kinship, local_density};
use super::cut::{Cut, EDGE};
use super::support::Support;
use crate::cloud::FruitCloud;
use crate::neighbours::grid::Grid;
use crate::neighbours::others::Neighbours;
use crate::neighbours::tree::{Tree, single};
use crate::neighbours::vicinity::Vicinity;
use crate::statistics::upper_median;
use nalgebra::{Matrix3, Vector3};
use std::sync::OnceLock;

/// Edge of a grid's cell in spacings.
const CELL: f64 = 0.6;

/// Reaches of the lists of nearby fruits in spacings: the gates next to a seed, and those at the rim of a region.
const REACHES: [f64; 2] = [0.4, 0.8];

/// Points of one cloud, centred on their mean, with the neighbourhood questions that verification asks.
#[derive(Debug, Clone)]
pub(crate) struct Landscape {
    /// Mean of the cloud, which is the origin of everything below.
    pub(crate) centre: Vector3<f64>,
    /// Row in the cloud of each point: points are in the order of their coordinates, so that the order of the input
    /// changes nothing.
    pub(crate) rows: Vec<u32>,
    /// Positions about the mean, metres.
    pub(crate) points: Vec<Vector3<f64>>,
    /// Covariance of each point, square metres, where the cloud has them.
    pub(crate) covariances: Option<Vec<Matrix3<f64>>>,
    /// Logarithm of each diameter, NaN where it is unknown, where the cloud has any.
    pub(super) log_diameters: Option<Vec<f64>>,
    neighbours: Neighbours,
    /// Typical distance to the sixth-nearest fruit: the unit of length of the cloud, metres.
    pub(crate) spacing: f64,
    /// Fruits per cubic metre that chance puts at each fruit, the fruit itself left out.
    pub(crate) density: Vec<f64>,
    /// Per fruit and neighbour, how far they move together.
    kinship: Vec<f64>,
    /// How much more crowded each fruit hangs than a typical one.
    pub(crate) crowding: Vec<f64>,
    /// Floor of the density: a tenth of what the typical spacing gives.
    pub(crate) floor: f64,
    pub(crate) tree: Tree,
    /// Cells that growth goes by, once it is asked for.
    cut: OnceLock<Cut>,
    pub(super) companions: Companions,
    /// The nearest of them, which way they lie, and what it has when it is moved, once they are asked for.
    nearest_companions: OnceLock<Companions>,
    bearings: OnceLock<Bearings>,
    moved: OnceLock<MovedCompanions>,
    grid: Grid,
    /// By their reach.
    vicinities: [Vicinity; 2],
    pub(super) support: Support,
}

impl Landscape {
    pub(crate) fn new(cloud: &FruitCloud) -> Self {
        Self::with_spacing(cloud, None)
    }

    /// A part that is cut out of a cloud has that one's spacing: at its rim fruits have fewer neighbours than they had.
    pub(super) fn with_spacing(cloud: &FruitCloud, spacing: Option<f64>) -> Self {
        let count = cloud.len().max(1) as f64;
        let mut rows: Vec<u32> = (0..cloud.len() as u32).collect();
        rows.sort_by(|&a, &b| {
            let [a, b] = [a, b].map(|row| cloud.positions[row as usize]);
            a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
        });
        let centre = rows.iter().fold(Vector3::zeros(), |sum, &row| sum + cloud.positions[row as usize].coords) / count;
        let points: Vec<_> = rows.iter().map(|&row| cloud.positions[row as usize].coords - centre).collect();
        let single: Vec<_> = points.iter().map(single).collect();
        let tree = Tree::new(&single);
        let neighbours = Neighbours::new(&single, &tree);
        let spacing = spacing.unwrap_or_else(|| spacing_of(&points, &neighbours));
        let floor = floor_of(spacing);
        let ((kinship, density, crowding, companions), (grid, vicinities, support)) = rayon::join(
            || {
                (
                    kinship(&points, &neighbours, spacing),
                    local_density(&points, &neighbours, spacing, floor),
                    crowding(&points, &neighbours, spacing),
                    Companions::new(&points, &neighbours, spacing),
                )
            },
            || {
                let vicinities = REACHES.map(|reach| Vicinity::new(&points, reach * spacing));
                (Grid::new(&points, CELL * spacing), vicinities, Support::new(&points, spacing))
            },
        );
        let covariances = cloud.covariances.as_ref().map(|all| rows.iter().map(|&row| all[row as usize]).collect());
        let log_diameter = |all: &Vec<f64>| rows.iter().map(|&row| all[row as usize].ln()).collect();
        let log_diameters = cloud.diameters_m.as_ref().map(log_diameter);
        Self {
            centre,
            rows,
            points,
            covariances,
            log_diameters,
            neighbours,
            spacing,
            density,
            kinship,
            crowding,
            floor,
            tree,
            cut: OnceLock::new(),
            companions,
            nearest_companions: OnceLock::new(),
            bearings: OnceLock::new(),
            moved: OnceLock::new(),
            grid,
            vicinities,
            support,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }

    /// The nearest other fruits, as many as [`crate::neighbours::others`] keeps, nearest first; all others in smaller
    /// clouds.
    #[inline]
    pub(crate) fn neighbours(&self, row: usize) -> &[u32] {
        self.neighbours.of(row)
    }

    /// The neighbours of a fruit with the weight of what they tell about its displacement.
    #[inline]
    pub(crate) fn kin(&self, row: usize) -> impl Iterator<Item = (u32, f64)> {
        let first = row * self.neighbours.each;
        self.neighbours(row).iter().copied().zip(self.kinship[first..].iter().copied())
    }

    /// The nearest fruits around each.
    pub(super) fn nearest_companions(&self) -> &Companions {
        self.nearest_companions.get_or_init(|| Companions::nearest(&self.points, &self.neighbours, self.spacing))
    }

    /// Which way fruits around a fruit lie.
    pub(super) fn bearings(&self) -> &Bearings {
        self.bearings.get_or_init(|| Bearings::new(&self.points, &self.neighbours, self.spacing))
    }

    /// What it has around its fruits when it is moved along its row.
    pub(super) fn moved(&self) -> &MovedCompanions {
        self.moved.get_or_init(|| MovedCompanions::new(&self.points, &self.tree, self.spacing))
    }

    /// The cells that growth goes by.
    pub(super) fn cut(&self) -> &Cut {
        self.cut.get_or_init(|| Cut::new(&self.points, EDGE * self.spacing))
    }

    /// The nearest point within `gate`, with its squared distance.
    #[inline]
    pub(crate) fn nearest(&self, place: &Vector3<f64>, gate: f64) -> Option<(u32, f64)> {
        let nearer = |(best, limit): (Option<u32>, f64), row: u32| {
            let d2 = (self.points[row as usize] - place).norm_squared();
            if d2 <= limit { (Some(row), d2) } else { (best, limit) }
        };
        let mut found = (None, gate * gate);
        // What is beyond the reach of a list may be listed nevertheless, and be beaten by what is not.
        for list in &self.vicinities {
            found = list.of(place).iter().copied().fold(found, nearer);
            if found.1 <= list.reach * list.reach {
                return found.0.map(|row| (row, found.1));
            }
        }
        self.near(place, gate, |row| found = nearer(found, row));
        found.0.map(|row| (row, found.1))
    }

    /// All points within `reach` of `place`, in order.
    pub(crate) fn within(&self, place: &Vector3<f64>, reach: f64) -> Vec<u32> {
        let mut rows = Vec::new();
        self.tree.within(&single(place), reach as f32, |row, _| rows.push(row));
        rows.sort_unstable();
        rows
    }

    /// Calls `visit` for at least every point within `gate` of `place`; the caller measures.
    #[inline]
    pub(crate) fn near(&self, place: &Vector3<f64>, gate: f64, visit: impl FnMut(u32)) {
        match self.vicinities.iter().find(|list| gate <= list.reach) {
            Some(list) => list.of(place).iter().copied().for_each(visit),
            None => self.grid.near(place, gate, visit),
        }
    }
}

/// Typical distance to the sixth-nearest fruit.
pub(super) fn spacing_of(points: &[Vector3<f64>], neighbours: &Neighbours) -> f64 {
    let mut sixth: Vec<f64> = (0..points.len())
        .filter_map(|row| {
            let near = neighbours.of(row);
            near.get(5).or(near.last()).map(|&other| (points[other as usize] - points[row]).norm())
        })
        .collect();
    // Fruits on one spot have no spacing; cells must not become finer than the coordinates.
    let extent = points.iter().fold(0.0f64, |far, p| far.max(p.amax()));
    upper_median(&mut sixth).max(1e-6 * extent).max(f64::MIN_POSITIVE)
}

/// Fruits per cubic metre that chance puts anywhere, at the least.
pub(super) fn floor_of(spacing: f64) -> f64 {
    // Six neighbours within the spacing: their density, were fruits spread evenly.
    let typical = 6.0 / (4.0 / 3.0 * std::f64::consts::PI * spacing.powi(3));
    0.1 * typical
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_nearest_equals_brute_force_at_gates_of_both_lists_and_beyond(
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 2..120),
            place in prop::array::uniform3(-1.2..1.2f64).prop_map(Vector3::from),
            gates in (0.0..REACHES[0], REACHES[0]..REACHES[1], REACHES[1]..3.0),
        ) {
            let cloud = FruitCloud::from_positions(points.into_iter().map(Into::into).collect());
            let landscape = Landscape::new(&cloud);
            let apart = |row: u32| (landscape.points[row as usize] - place).norm_squared();
            for gate in [gates.0, gates.1, gates.2].map(|gate| gate * landscape.spacing) {
                let within = (0..landscape.len() as u32).map(apart).filter(|&d2| d2 <= gate * gate);
                let found = landscape.nearest(&place, gate);
                prop_assert_eq!(found.map(|(_, d2)| d2), within.min_by(f64::total_cmp));
                prop_assert_eq!(found.map(|(row, _)| apart(row)), found.map(|(_, d2)| d2));
            }
        }
    }
}
