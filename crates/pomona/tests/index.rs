//! The index against looking at every point.

use pomona::neighbours::index::{Index, Neighbour};
use proptest::prelude::*;

fn distance_squared<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    (0..D).map(|d| (a[d] - b[d]) * (a[d] - b[d])).sum()
}

/// Every row with its squared distance, nearest first, ties by row: two squares may have one root.
fn ranked<const D: usize>(points: &[[f64; D]], query: &[f64; D]) -> Vec<(f64, usize)> {
    let mut all: Vec<_> = points.iter().enumerate().map(|(row, p)| (distance_squared(query, p), row)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all
}

fn rooted(ranked: &[(f64, usize)]) -> Vec<(f64, usize)> {
    ranked.iter().map(|&(squared, row)| (squared.sqrt(), row)).collect()
}

fn answers(found: &[Neighbour]) -> Vec<(f64, usize)> {
    found.iter().map(|neighbour| (neighbour.distance, neighbour.row)).collect()
}

fn check<const D: usize>(points: &[[f64; D]], queries: &[[f64; D]], radius: f64) {
    let index = Index::new(points.to_vec());
    let together = index.nearest_all(queries);
    for (query, nearest) in queries.iter().zip(together) {
        let ranked = ranked(points, query);
        let few = rooted(&ranked[..ranked.len().min(7)]);
        assert_eq!(nearest.map(|n| (n.distance, n.row)), few.first().copied());
        assert_eq!(index.nearest(query), nearest);
        assert_eq!(answers(&index.nearest_few(query, 7)), few);
        let mut inside: Vec<_> = ranked.iter().copied().filter(|n| n.0 <= radius * radius).collect();
        inside.sort_by_key(|n| n.1);
        assert_eq!(answers(&index.within(query, radius)), rooted(&inside));
    }
}

fn points<const D: usize>(most: usize) -> impl Strategy<Value = Vec<[f64; D]>> {
    // Some coordinates on a grid, which makes ties.
    let coordinate = prop_oneof![-1.0..1.0f64, (-3..3i32).prop_map(|i| f64::from(i) / 4.0)];
    prop::collection::vec(prop::array::uniform(coordinate), 0..most)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn as_looking_at_all_in_3d(all in points::<3>(300), queries in points::<3>(20), radius in 0.0..1.0f64) {
        check(&all, &queries, radius);
    }

    #[test]
    fn as_looking_at_all_in_8d(all in points::<8>(300), queries in points::<8>(20), radius in 0.0..2.0f64) {
        check(&all, &queries, radius);
    }

    #[test]
    fn far_from_the_origin(all in points::<3>(200), queries in points::<3>(20)) {
        // Easting and northing: metres in the hundreds of thousands, which single precision rounds to centimetres.
        let moved = |p: &[f64; 3]| [p[0] * 0.01 + 512_345.0, p[1] * 0.01 + 4_181_234.0, p[2]];
        let all: Vec<_> = all.iter().map(moved).collect();
        let queries: Vec<_> = queries.iter().map(moved).collect();
        check(&all, &queries, 0.01);
    }

    #[test]
    fn of_any_magnitude(all in points::<3>(100), queries in points::<3>(10), power in -150.0..307.0f64, far in 0.0..307.0f64) {
        let scaled = |p: &[f64; 3]| p.map(|x| x * 10f64.powf(power));
        let mut all: Vec<_> = all.iter().map(scaled).collect();
        let queries: Vec<_> = queries.iter().map(scaled).collect();
        check(&all, &queries, 10f64.powf(power));
        all.push([10f64.powf(far), -10f64.powf(far), 0.0]);
        check(&all, &queries, 10f64.powf(power));
    }
}

#[test]
fn nothing_indexed_nothing_found() {
    let index = Index::<5>::new(Vec::new());
    assert_eq!(index.nearest(&[0.0; 5]), None);
    assert!(index.within(&[0.0; 5], f64::MAX).is_empty());
}
