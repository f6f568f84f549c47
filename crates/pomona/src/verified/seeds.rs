//! Constellations of four fruits as seeds: metric codes, their near-tie labelings and their index.
//!
//! The verified method needs a seed only to propose a pose; whether the pose holds is decided by the fruits around
//! it. Four fruits survive occlusion far more often than five (0.55^4 against 0.55^5 at 45 %), and verification is
//! cheap enough to sort out the additional false candidates.

use super::landscape::Landscape;
use crate::geometry::Scale;
use crate::neighbours::code_grid::{Code, CodeGrid};
use crate::random::shuffled;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Fruits in a seed.
pub(crate) const STARS: usize = 4;

/// Nearest neighbours among which the three companions of a fruit are chosen: 120 seeds per fruit.
pub(crate) const COMPANIONS: usize = 10;

/// Seeds flatter than this (distance of C from the line AB over |AB|) fix the turn about AB too badly. Not more: along a cordon most are flat,
/// and the fruits around hang as near the line, so that they are hardly moved by a turn that is off.
const MIN_FLATNESS: f64 = 0.05;

/// Seeds shorter than this, in standard deviations of the noise, fix no pose.
pub(crate) const SHORTEST: f64 = 6.0;

/// Share of the seeds of a map that are longer than any that is asked for among the longest of a query.
const FEW: f64 = 0.05;

/// Standard deviations of one axis within which noise moves what a seed shows: the numbers of its code, the longer of two
/// lengths, and how its pose leans.
///
/// The residuals of a seed's fit, 12 - 6 degrees of freedom, may sum up to twice its square: 95 % of chi^2.
pub(crate) const WITHIN: f64 = 2.5;

/// Four rows labelled A, B, C, D.
pub(crate) type Quad = [u32; STARS];

/// A labelled set with its code.
pub(crate) type Seed = (Quad, Code);

/// Labels a set: A and B farthest apart, A nearer the centroid, C farther from the line AB than D.
pub(crate) fn canonical(points: &[Vector3<f64>], set: [u32; STARS]) -> Option<Seed> {
    let length2 = |&[a, b, ..]: &Quad| (points[a as usize] - points[b as usize]).norm_squared();
    // Of lengths that are the same the first.
    let longest = with_ends(set).reduce(|best, next| if length2(&next) > length2(&best) { next } else { best })?;
    let labelled = oriented(points, longest);
    code(points, labelled).map(|code| (labelled, code))
}

/// The six ways to take two of four fruits for the ends, which come first.
fn with_ends([a, b, c, d]: Quad) -> impl Iterator<Item = Quad> {
    [[a, b, c, d], [a, c, b, d], [a, d, b, c], [b, c, a, d], [b, d, a, c], [c, d, a, b]].into_iter()
}

/// Swaps A with B and C with D until A is nearer the centroid and C farther from the line.
fn oriented(points: &[Vector3<f64>], [a, b, c, d]: Quad) -> Quad {
    let p = |row: u32| points[row as usize];
    let axis = p(b) - p(a);
    // The centroid is nearer A when the mean coordinate along AB is below a half: A counts 0, B counts 1.
    let along = (p(c) - p(a)).dot(&axis) + (p(d) - p(a)).dot(&axis);
    let (a, b) = if along <= axis.norm_squared() { (a, b) } else { (b, a) };
    let across = |row: u32| (p(row) - p(a)).cross(&axis).norm_squared();
    if across(c) >= across(d) { [a, b, c, d] } else { [a, b, d, c] }
}

/// Unit axes of a seed: along AB, towards C, and their cross product. `None` for near-collinear seeds.
#[inline]
pub(crate) fn frame(fruits: &[Vector3<f64>; STARS]) -> Option<[Vector3<f64>; 3]> {
    let [origin, ..] = *fruits;
    let ab = fruits[1] - origin;
    let ac = fruits[2] - origin;
    let length = ab.norm();
    let e1 = ab / length;
    let across = ac - e1 * ac.dot(&e1);
    let distance = across.norm();
    if distance.is_nan() || distance <= MIN_FLATNESS * length {
        return None;
    }
    let e2 = across / distance;
    Some([e1, e2, e1.cross(&e2)])
}

/// Length of AB, then C (along, across) and D (along, across, above) in the frame of the seed, metres.
///
/// The closed form of the STaR-i code without the division by |AB| and the fixed turn by (1,1,1).
fn code(points: &[Vector3<f64>], quad: Quad) -> Option<Code> {
    let fruits = quad.map(|row| points[row as usize]);
    let [e1, e2, e3] = frame(&fruits)?;
    let [ab, ac, ad] = [1, 2, 3].map(|i| fruits[i] - fruits[0]);
    Some([ab.dot(&e1), ac.dot(&e1), ac.dot(&e2), ad.dot(&e1), ad.dot(&e2), ad.dot(&e3)].map(|x| x as f32))
}

/// Every labeling that noise of `margin` metres could have made canonical, the given one among them.
pub(crate) fn near_ties(points: &[Vector3<f64>], quad: Quad, margin: f64, emit: &mut impl FnMut(Quad, Code)) {
    let length = |[a, b, ..]: Quad| (points[b as usize] - points[a as usize]).norm();
    let longest = length(quad);
    for ends in with_ends(quad).filter(|&ends| length(ends) >= longest - margin) {
        orientations(points, oriented(points, ends), margin, emit);
    }
}

/// The labeling itself, and with A and B or C and D swapped where the margin does not decide.
fn orientations(points: &[Vector3<f64>], quad: Quad, margin: f64, emit: &mut impl FnMut(Quad, Code)) {
    let p = |row: u32| points[row as usize];
    let [a, b, c, d] = quad;
    let axis = (p(b) - p(a)).normalize();
    let along = (p(c) - p(a)).dot(&axis) + (p(d) - p(a)).dot(&axis);
    let swap_ends = (along - (p(b) - p(a)).norm()).abs() < margin;
    let across = |row: u32| (p(row) - p(a)).cross(&axis).norm();
    let swap_sides = across(c) - across(d) < margin;
    let swapped =
        [(true, quad), (swap_ends, [b, a, c, d]), (swap_sides, [a, b, d, c]), (swap_ends && swap_sides, [b, a, d, c])];
    for (_, labelled) in swapped.into_iter().filter(|(possible, _)| *possible) {
        if let Some(code) = code(points, labelled) {
            emit(labelled, code);
        }
    }
}

/// Divides by |AB|, so that the code no longer knows the scale.
pub(crate) fn without_scale(code: &Code) -> Code {
    let inverse = 1.0 / code[0];
    let [_, c1, c2, d1, d2, d3] = code.map(|number| number * inverse);
    [0.0, c1, c2, d1, d2, d3]
}

/// Every seed of a cloud among so many `companions` of each fruit, each set once, in a fixed order; `shortest` is the least |AB| in
/// metres.
pub(crate) fn enumerate(landscape: &Landscape, companions: usize, shortest: f64) -> Vec<Seed> {
    (0..landscape.len())
        .into_par_iter()
        .flat_map_iter(|row| sets_of(&|row| landscape.neighbours(row), companions, row as u32))
        .filter_map(|set| canonical(&landscape.points, set))
        .filter(|(_, code)| f64::from(code[0]) >= shortest)
        .collect()
}

/// The `count` seeds with the longest |AB|, of those that are no longer than `most` metres, in a fixed order.
///
/// Long seeds fix their pose best and have the fewest lookalikes.
pub(crate) fn longest(landscape: &Landscape, count: usize, most: f32) -> Vec<Seed> {
    let mut seeds = enumerate(landscape, COMPANIONS, 0.0);
    seeds.retain(|(_, code)| code[0] <= most);
    if count < seeds.len() {
        seeds.select_nth_unstable_by(count, |a, b| b.1[0].total_cmp(&a.1[0]).then(a.0.cmp(&b.0)));
        seeds.truncate(count);
    }
    seeds.par_sort_unstable_by_key(|seed| (shuffled(u64::from(seed.0[0])), seed.0));
    seeds
}

/// The sets of a fruit and three companions that no fruit before it forms too, each in ascending order.
///
/// `neighbours` gives the nearest others of a fruit, nearest first; `most` of them are its companions.
pub(super) fn sets_of<'a>(neighbours: &impl Fn(usize) -> &'a [u32], most: usize, row: u32) -> Vec<[u32; STARS]> {
    let companions = |row: u32| {
        let near = neighbours(row as usize);
        &near[..near.len().min(most)]
    };
    let near = companions(row);
    // For a companion before this fruit, which others it has for companions: bit i for `near[i]`.
    let knows: Vec<u32> = near
        .iter()
        .map(|&other| {
            let theirs = companions(other);
            if other > row || !theirs.contains(&row) {
                return 0;
            }
            near.iter().enumerate().map(|(i, row)| u32::from(theirs.contains(row)) << i).sum()
        })
        .collect();
    let mut sets = Vec::with_capacity(120);
    for b in 0..near.len() {
        for c in b + 1..near.len() {
            for d in c + 1..near.len() {
                let both = |i: usize, j: usize| 1 << i | 1 << j;
                let formed = |of: usize, others: u32| knows[of] & others == others;
                if formed(b, both(c, d)) || formed(c, both(b, d)) || formed(d, both(b, c)) {
                    continue;
                }
                let mut set = [row, near[b], near[c], near[d]];
                set.sort_unstable();
                sets.push(set);
            }
        }
    }
    sets
}

/// The length that [`FEW`] of these exceed.
fn exceeded_by_few(mut lengths: Vec<f32>) -> f32 {
    let at = (lengths.len() as f64 * (1.0 - FEW)) as usize;
    if at < lengths.len() { *lengths.select_nth_unstable_by(at, f32::total_cmp).1 } else { f32::INFINITY }
}

/// The seeds of the map, searchable by code.
#[derive(Debug, Clone)]
pub(crate) struct SeedIndex {
    /// In the order of the grid.
    pub(crate) quads: Vec<Quad>,
    pub(crate) codes: CodeGrid,
    /// Length that few of the seeds exceed, metres of the query; none where the scale is free.
    pub(super) longest: f32,
}

impl SeedIndex {
    pub(crate) fn new(landscape: &Landscape, scale: Scale, shortest: f64) -> Self {
        let seeds = enumerate(landscape, COMPANIONS, shortest);
        let longest = match scale {
            Scale::Metric => exceeded_by_few(seeds.iter().map(|(_, code)| code[0]).collect()),
            Scale::Free => f32::INFINITY,
        };
        let code = |(_, code): &(Quad, Code)| match scale {
            Scale::Metric => *code,
            Scale::Free => without_scale(code),
        };
        let (codes, order) = CodeGrid::new(seeds.len(), |row| code(&seeds[row]));
        let quads = order.par_iter().map(|&row| seeds[row as usize].0).collect();
        Self { quads, codes, longest }
    }

    /// Of no seeds.
    pub(super) fn empty() -> Self {
        Self { quads: Vec::new(), codes: CodeGrid::new(0, |_| Code::default()).0, longest: f32::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FruitCloud;
    use crate::verified::fixture::visits;
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    fn four() -> impl Strategy<Value = Vec<Vector3<f64>>> {
        prop::collection::vec(prop::array::uniform3(-0.5..0.5f64).prop_map(Vector3::from), 4)
    }

    proptest! {
        #[test]
        fn the_code_ignores_pose_and_order(points in four(), turn in prop::array::uniform3(-3.0..3.0f64)) {
            let rotation = Rotation3::new(Vector3::from(turn));
            let moved: Vec<_> = points.iter().map(|p| rotation * p + Vector3::new(3.0, -1.0, 2.0)).collect();
            let (here, there) = (canonical(&points, [0, 1, 2, 3]), canonical(&moved, [2, 0, 3, 1]));
            prop_assert_eq!(here.is_some(), there.is_some());
            if let (Some((quad, code)), Some((moved_quad, moved_code))) = (here, there) {
                prop_assert_eq!(quad, moved_quad);
                prop_assert!(code.iter().zip(&moved_code).all(|(a, b)| (a - b).abs() < 1e-5));
            }
        }

        #[test]
        fn near_ties_hold_the_canonical_labeling(points in four(), margin in 0.0..0.1f64) {
            if let Some((quad, _)) = canonical(&points, [0, 1, 2, 3]) {
                let mut labelings = Vec::new();
                near_ties(&points, quad, margin, &mut |labelled, _| labelings.push(labelled));
                prop_assert!(labelings.contains(&quad));
            }
        }
    }

    #[test]
    fn every_set_of_a_fruit_and_three_companions_is_listed_once() {
        let place = |i: u64| [1, 2, 3].map(|axis| (shuffled(4 * i + axis) >> 40) as f64 * 1e-7);
        let cloud = FruitCloud::from_positions((0..60).map(|i| place(i).into()).collect());
        let landscape = Landscape::new(&cloud);
        let mut expected = Vec::new();
        for row in 0..60 {
            let near = &landscape.neighbours(row)[..COMPANIONS];
            for b in 0..COMPANIONS {
                for c in b + 1..COMPANIONS {
                    for d in c + 1..COMPANIONS {
                        let mut set = [row as u32, near[b], near[c], near[d]];
                        set.sort_unstable();
                        expected.push(set);
                    }
                }
            }
        }
        expected.sort_unstable();
        expected.dedup();
        let mut found: Vec<_> =
            (0..60).flat_map(|row| sets_of(&|row| landscape.neighbours(row), COMPANIONS, row)).collect();
        found.sort_unstable();
        assert_eq!(found, expected);
    }

    #[test]
    fn a_mirror_image_has_another_code() {
        let points = [[0.0, 0.0, 0.0], [0.8, 0.0, 0.0], [0.3, 0.4, 0.0], [0.2, 0.1, 0.3]].map(Vector3::from);
        let mirrored = points.map(|p| Vector3::new(p.x, p.y, -p.z));
        let [here, there] = [points, mirrored].map(|p| canonical(&p, [0, 1, 2, 3]).expect("not collinear").1);
        assert!((here[5] + there[5]).abs() < 1e-6 && here[5].abs() > 0.1);
    }

    #[test]
    fn no_seed_left_out_is_longer_than_one_taken() {
        let landscape = Landscape::new(&visits(0.02).0);
        let lengths = |seeds: Vec<Seed>| {
            let mut lengths: Vec<f32> = seeds.iter().map(|seed| seed.1[0]).collect();
            lengths.sort_unstable_by(|a, b| b.total_cmp(a));
            lengths
        };
        let all = lengths(enumerate(&landscape, COMPANIONS, 0.0));
        for count in [0, 1, 1000, all.len()] {
            assert_eq!(lengths(longest(&landscape, count, f32::INFINITY)), all[..count]);
            let rest: Vec<f32> = all.iter().copied().filter(|length| *length <= all[40]).take(count).collect();
            assert_eq!(lengths(longest(&landscape, count, all[40])), rest);
        }
        assert_eq!(longest(&landscape, all.len() + 1, f32::INFINITY).len(), all.len());
    }

    #[test]
    fn the_longest_seeds_do_not_depend_on_the_order_of_the_input() {
        let (cloud, _) = visits(0.02);
        let mut permuted = cloud.clone();
        permuted.positions.sort_unstable_by_key(|p| shuffled(p.x.to_bits()));
        let [here, there] = [cloud, permuted].map(|cloud| {
            let landscape = Landscape::new(&cloud);
            let fruit = |row: u32| cloud.positions[landscape.rows[row as usize] as usize];
            longest(&landscape, 1000, f32::INFINITY).iter().map(|seed| seed.0.map(fruit)).collect::<Vec<_>>()
        });
        assert_eq!(here, there);
    }
}
