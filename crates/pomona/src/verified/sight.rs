//! Which fruits of two rows the other visit can have shown.
//!
//! A visit sees one side of a row, and fades in depth. Of two from opposite sides each shows fruits that the other could not
//! have shown, and they say nothing against a pose. How far each sees is told by the pose itself: of the fruits that one
//! visit shows in a depth of the row, the other has seen as many again as it shows there, at the most.

use super::landscape::Landscape;
use crate::geometry::Similarity;
use nalgebra::{Matrix3, Vector3};

/// Standard deviation of the depths over which fruits are counted, in spacings: 7 cm in an orchard.
const WIDTH: f64 = 0.25;

/// Depths that are told apart within one [`WIDTH`].
const STEPS: usize = 4;

/// Standard deviations over which a fruit counts.
const REACH: usize = 3;

/// Depths that are told apart at the most: 15 m of an orchard. A stray fruit far away would ask for more than there is memory.
const MOST: usize = 1024;

/// Share of the fruits in the depth of each that the other visit can have seen.
#[derive(Debug, Clone)]
pub(super) struct Sight {
    /// Of the query, and of the map, row by row.
    pub(super) shares: [Vec<f64>; 2],
}

impl Sight {
    /// Under a pose, along the `axes` of the map's row.
    pub(super) fn new(query: &Landscape, map: &Landscape, axes: &Matrix3<f64>, pose: &Similarity) -> Self {
        let [along, depth] = [0, 2].map(|axis| axes.column(axis).into_owned());
        let both: [Vec<Vector3<f64>>; 2] = [query.points.iter().map(|p| pose.image(p)).collect(), map.points.clone()];
        // Trees that only one visit shows say nothing about how far the other sees.
        let [one, other] = both.each_ref().map(|places| range(places, &along));
        let common = [one[0].max(other[0]), one[1].min(other[1])];
        let step = WIDTH * map.spacing / STEPS as f64;
        let places = both.each_ref().map(|places| places.iter().map(|p| p.dot(&depth) / step).collect::<Vec<f64>>());
        let least = places.iter().flatten().fold(f64::INFINITY, |least, place| least.min(*place));
        let bin = |place: &f64| ((place - least) as usize).min(MOST - 1);
        let bins = places.iter().flatten().map(bin).max().map_or(0, |last| last + 1);
        let [here, there] = [0, 1].map(|visit: usize| {
            let mut counts = vec![0.0; bins];
            for (place, p) in places[visit].iter().zip(&both[visit]) {
                if (common[0]..=common[1]).contains(&p.dot(&along)) {
                    counts[bin(place)] += 1.0;
                }
            }
            smooth(&counts)
        });
        // A visit that shows so many would show two standard deviations more by chance; the squares of weights under a bell come
        // to 1 / sqrt(2) of their sum.
        let shown = |count: f64| count + 2.0 * (count * std::f64::consts::FRAC_1_SQRT_2).sqrt();
        let share = |places: &[f64], own: &[f64], other: &[f64]| {
            places.iter().map(bin).map(|at| (shown(other[at]) / own[at].max(f64::MIN_POSITIVE)).min(1.0)).collect()
        };
        Self { shares: [share(&places[0], &here, &there), share(&places[1], &there, &here)] }
    }
}

/// From where to where fruits hang along an axis.
fn range(places: &[Vector3<f64>], axis: &Vector3<f64>) -> [f64; 2] {
    places.iter().map(|p| p.dot(axis)).fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], at| [a.min(at), b.max(at)])
}

/// Counts over [`WIDTH`] around each depth.
fn smooth(counts: &[f64]) -> Vec<f64> {
    let weights: [f64; STEPS * REACH + 1] =
        std::array::from_fn(|away| (-0.5 * (away as f64 / STEPS as f64).powi(2)).exp());
    let around = |at: usize| {
        let (first, last) = (at.saturating_sub(STEPS * REACH), (at + STEPS * REACH).min(counts.len() - 1));
        (first..=last).map(|other| weights[at.abs_diff(other)] * counts[other]).sum()
    };
    (0..counts.len()).map(around).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FruitCloud;
    use crate::verified::fixture::Dice;
    use nalgebra::Point3;

    /// Two visits to a row of 8 x 2 x 0.6 m that show a fruit with the probability that `seen` gives a visit and a place.
    fn visits(seen: impl Fn(usize, &Vector3<f64>) -> f64) -> [Landscape; 2] {
        let mut dice = Dice(11);
        let mut both = [Vec::new(), Vec::new()];
        for _ in 0..800 {
            let p = Vector3::new(8.0 * dice.uniform(), 2.0 * dice.uniform(), 0.6 * dice.uniform() - 0.3);
            for (visit, shown) in both.iter_mut().enumerate() {
                if dice.uniform() < seen(visit, &p) {
                    shown.push(Point3::from(p));
                }
            }
        }
        both.map(|points| Landscape::new(&FruitCloud::from_positions(points)))
    }

    /// Shares under the true pose, with the places of the fruits of the query and of the map.
    fn shares([query, map]: &[Landscape; 2]) -> [Vec<(Vector3<f64>, f64)>; 2] {
        let pose = Similarity { translation: query.centre - map.centre, ..Similarity::identity() };
        let sight = Sight::new(query, map, &Matrix3::identity(), &pose);
        let places = [query, map].map(|cloud| cloud.points.iter().map(|p| p + cloud.centre).collect::<Vec<_>>());
        let [one, other] = places;
        let [first, second] = sight.shares;
        [one.into_iter().zip(first).collect(), other.into_iter().zip(second).collect()]
    }

    #[test]
    fn visits_from_one_side_may_have_seen_all_of_each_other() {
        let all = shares(&visits(|_, p| 0.4 + p.z)).concat();
        let full = all.iter().filter(|(_, share)| *share > 0.95).count();
        assert!(full as f64 > 0.95 * all.len() as f64, "{full} of {}", all.len());
        // A tree that only one of them came to changes nothing.
        let part = shares(&visits(|visit, p| if visit == 0 && p.x > 5.0 { 0.0 } else { 0.6 }));
        let full = part[1].iter().filter(|(_, share)| *share > 0.95).count();
        assert!(full as f64 > 0.95 * part[1].len() as f64, "{full} of {}", part[1].len());
    }

    #[test]
    fn visits_from_opposite_sides_have_seen_each_other_s_fruits_in_the_middle() {
        let sides = [-1.0, 1.0];
        let both = shares(&visits(|visit, p| 1.0 / (1.0 + (-sides[visit] * p.z / 0.05).exp())));
        for (visit, fruits) in both.iter().enumerate() {
            for (place, share) in fruits {
                let depth = sides[visit] * place.z;
                assert!((0.0..=1.0).contains(share));
                assert!(depth < 0.2 || *share < 0.2, "{share} at {depth}");
                assert!(depth > 0.0 || *share > 0.8, "{share} at {depth}");
            }
        }
    }
}
