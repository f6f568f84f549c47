//! Fruits left over find their partner by nearest neighbour after the alignment (the paper, section III-C).

use crate::geometry::Similarity;
use crate::neighbours::index::Index;
use nalgebra::Point3;

/// Pairs of left-over fruits that are each other's nearest within `reach_m`, by query row.
///
/// `taken_query` and `taken_map` tell which rows have a partner already.
pub fn complete(
    query: &[Point3<f64>],
    map: &[Point3<f64>],
    map_from_query: &Similarity,
    taken_query: &[bool],
    taken_map: &[bool],
    reach_m: f64,
) -> Vec<(usize, usize)> {
    let free = |taken: &[bool]| (0..taken.len()).filter(|&row| !taken[row]).collect::<Vec<_>>();
    let (free_query, free_map) = (free(taken_query), free(taken_map));
    let place = |p: Point3<f64>| [p.x, p.y, p.z];
    let in_map = Index::new(free_query.iter().map(|&row| place(map_from_query.apply(&query[row]))).collect());
    let targets = Index::new(free_map.iter().map(|&row| place(map[row])).collect());
    let mutual = |i: usize| {
        let partner = targets.nearest(&in_map.points()[i])?;
        let back = in_map.nearest(&targets.points()[partner.row])?;
        (partner.distance <= reach_m && back.row == i).then_some((free_query[i], free_map[partner.row]))
    };
    (0..free_query.len()).filter_map(mutual).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_free_and_mutual_and_near() {
        let at = |xs: &[f64]| xs.iter().map(|&x| Point3::new(x, 0.0, 0.0)).collect::<Vec<_>>();
        let (query, map) = (at(&[0.0, 1.0, 1.03, 5.0, 7.0]), at(&[0.01, 1.02, 5.2, 7.0]));
        let taken = [false, false, false, false, true];
        let found = complete(&query, &map, &Similarity::identity(), &taken, &[false; 4], 0.1);
        // 1.0 has 1.02 as nearest, which is nearer to 1.03; 5.0 is too far; 7.0 is taken.
        assert_eq!(found, [(0, 0), (2, 1)]);
    }
}
