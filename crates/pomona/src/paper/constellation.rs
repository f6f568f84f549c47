//! Constellations: each fruit with `K - 1` of its `n` nearest neighbours (the paper, section III-C).

use crate::neighbours::index::Index;
use nalgebra::Point3;
use rayon::prelude::*;

/// Largest number of neighbours; C(32, 6) = 906,192 constellations of one fruit are beyond any use.
pub const MAX_NEIGHBOURS: usize = 32;

/// All sets of `K` fruits that hold a fruit and `K - 1` of its `n` nearest neighbours, each set once.
///
/// Rows ascend inside a set. Sets are ordered by the fruit they are first found at, then lexicographically, on any
/// number of threads. A cloud of at most `n` fruits gives all its sets of `K`.
pub fn constellations<const K: usize>(positions: &[Point3<f64>], n: usize) -> Vec<[u32; K]> {
    let hoods = neighbourhoods(positions, n);
    let size = hoods.first().map_or(0, Vec::len);
    if size < K {
        return Vec::new();
    }
    let choices: Vec<_> = (0..size).map(|centre| choices_with::<K>(size, centre)).collect();
    hoods
        .par_iter()
        .enumerate()
        .flat_map_iter(|(fruit, hood)| {
            let centre = hood.partition_point(|&row| (row as usize) < fruit);
            let earlier = earlier_hoods(&hoods, fruit);
            choices[centre]
                .iter()
                .filter(move |choice| !earlier.iter().any(|hood| hood.holds(choice.mask)))
                .map(move |choice| choice.places.map(|place| hood[place as usize]))
        })
        .collect()
}

/// Each fruit's neighbourhood: the rows of its `n` nearest neighbours and its own, ascending.
fn neighbourhoods(positions: &[Point3<f64>], n: usize) -> Vec<Vec<u32>> {
    let index = Index::new(positions.iter().map(|p| [p.x, p.y, p.z]).collect());
    let n = n.min(MAX_NEIGHBOURS);
    (0..positions.len())
        .into_par_iter()
        .map(|fruit| {
            let found = index.nearest_few(&index.points()[fruit], n + 1);
            let mut hood: Vec<_> = found.iter().map(|neighbour| neighbour.row as u32).collect();
            // Among n + 1 or more fruits in one place the fruit itself may be missing.
            if !hood.contains(&(fruit as u32)) {
                hood.pop();
                hood.push(fruit as u32);
            }
            hood.sort_unstable();
            hood
        })
        .collect()
}

/// A choice of `K` places in a neighbourhood.
struct Choice<const K: usize> {
    places: [u8; K],
    mask: u64,
}

/// All choices of `K` of `size` places that hold `centre`, in lexicographic order.
fn choices_with<const K: usize>(size: usize, centre: usize) -> Vec<Choice<K>> {
    let mut choices = Vec::new();
    let mut places: [u8; K] = std::array::from_fn(|i| i as u8);
    loop {
        if places.contains(&(centre as u8)) {
            choices.push(Choice { places, mask: places.iter().fold(0, |mask, &place| mask | 1 << place) });
        }
        let Some(i) = (0..K).rev().find(|&i| (places[i] as usize) < size - K + i) else { return choices };
        places[i] += 1;
        for j in i + 1..K {
            places[j] = places[j - 1] + 1;
        }
    }
}

/// What the neighbourhood of an earlier fruit shares with that of the fruit in hand, as places of the latter.
struct EarlierHood {
    own: u64,
    shared: u64,
}

impl EarlierHood {
    /// Whether the earlier fruit belongs to the set and already gave it.
    fn holds(&self, set: u64) -> bool {
        set & self.own != 0 && set & !self.shared == 0
    }
}

/// A set is given by the first fruit of it that has all the others as neighbours; this finds the others of `fruit`'s
/// neighbours that may have given a set before.
fn earlier_hoods(hoods: &[Vec<u32>], fruit: usize) -> Vec<EarlierHood> {
    let hood = &hoods[fruit];
    let place_of = |row: &u32| hood.binary_search(row).ok();
    let earlier = hood.iter().enumerate().take_while(|(_, row)| (**row as usize) < fruit);
    earlier
        .map(|(place, &row)| EarlierHood {
            own: 1 << place,
            shared: hoods[row as usize].iter().filter_map(place_of).fold(0, |mask, place| mask | 1 << place),
        })
        .filter(|earlier| earlier.shared.count_ones() > 1)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// Straight from the definition.
    fn by_definition<const K: usize>(positions: &[Point3<f64>], n: usize) -> BTreeSet<Vec<u32>> {
        let mut sets = BTreeSet::new();
        for (fruit, centre) in positions.iter().enumerate() {
            let mut others: Vec<_> = (0..positions.len()).filter(|&other| other != fruit).collect();
            others.sort_by(|&a, &b| (positions[a] - centre).norm().total_cmp(&(positions[b] - centre).norm()));
            others.truncate(n);
            for mask in 0u32..1 << others.len() {
                if mask.count_ones() as usize == K - 1 {
                    let members = (0..others.len()).filter(|i| mask & (1 << i) != 0).map(|i| others[i] as u32);
                    let mut set: Vec<_> = members.chain([fruit as u32]).collect();
                    set.sort_unstable();
                    sets.insert(set);
                }
            }
        }
        sets
    }

    fn check<const K: usize>(positions: &[Point3<f64>], n: usize) {
        let found = constellations::<K>(positions, n);
        let unique: BTreeSet<_> = found.iter().map(|set| set.to_vec()).collect();
        assert_eq!(unique.len(), found.len(), "a set is given twice");
        assert_eq!(unique, by_definition::<K>(positions, n));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn as_defined(
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64).prop_map(Point3::from), 0..24),
            extra in 0..4usize,
        ) {
            check::<4>(&points, 3 + extra);
            check::<5>(&points, 4 + extra);
            check::<6>(&points, 5 + extra);
            check::<7>(&points, 6 + extra);
        }
    }

    #[test]
    fn a_fruit_alone_in_reach_gives_210() {
        let points: Vec<_> = (0..11).map(|i| Point3::new(f64::from(i), f64::from(i * i), 1.0)).collect();
        // All 11 fruits are neighbours of one another: C(11, 5) sets, each once.
        assert_eq!(constellations::<5>(&points, 10).len(), 462);
        assert_eq!(choices_with::<5>(11, 3).len(), 210);
    }

    #[test]
    fn coordinates_may_be_as_large_as_numbers_are() {
        let points: Vec<_> = (0..12).map(|i| Point3::new(1e300 * f64::from(i), 1e-300, f64::from(i * i))).collect();
        assert_eq!(constellations::<5>(&points[..11], 10).len(), 462);
    }

    #[test]
    fn fruits_in_one_place_are_sets_too() {
        let points = vec![Point3::new(1.0, 2.0, 3.0); 14];
        assert!(constellations::<5>(&points, 10).iter().all(|set| set.is_sorted_by(|a, b| a < b)));
    }
}
