//! Seeds laid on all fruits that lie to each other as theirs do, where no index knows them.
//!
//! The index holds sets of fruits that are next to each other. After a harvest few hang next to each other that did before: four
//! neighbours have others between them in the map, which has no seed of the four. So seeds of such a query are laid on all fruits of
//! the map, which shows all four of some.

use super::case::{Findings, SEED_SIGMA, Search};
use super::contender::{Contender, by_evidence, distinct};
use super::hypothesis::Model;
use super::landscape::Landscape;
use super::proposal::{Effort, Proposer};
use super::seeds::{COMPANIONS, Quad, STARS, WITHIN, enumerate};
use crate::geometry::Scale;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Spacing of a visit over that of another from which on it is sparser: half of the fruits.
const SPARSER: f64 = 1.25;

/// Whether one of two clouds in metres is sparser than the other.
pub(super) fn is_sparser(one: &Landscape, other: &Landscape, scale: Scale) -> bool {
    scale == Scale::Metric && one.spacing > SPARSER * other.spacing
}

/// Seeds times fruits of the map that are tried, and seeds at the most: one takes a microsecond or two a fruit.
const TRIED: usize = 200_000;
const MOST: usize = 128;

/// Seeds that are laid at once, and fours that lie like one of them, on the average, from which on neither they nor longer ones tell
/// anything: where noise is as wide as fruits hang apart any four lie like any other. After a harvest they are 200 to 3,300.
const AT_ONCE: usize = 8;
const ANY: u64 = 4_000;

/// Poses that are refined: of thousands that a sparse visit lets pass at first the right one is seldom among the best.
const MOST_REFINED: usize = 1_500;

/// Length of a seed in standard deviations of the noise, at the least.
const LEAST: f64 = 10.0;

/// And in spacings of the map, at the most: a few fruits strewn over a long row would be laid on all of it for minutes.
const LONGEST: f64 = 6.0;

impl<'a> Search<'a> {
    /// Lays seeds of a sparse query on all fruits of the map, where its index has none of them.
    pub(super) fn lay_sparse_seeds(&self, findings: &mut Findings<'a>) {
        let (mut candidates, effort) = self.congruent();
        findings.log.effort = findings.log.effort + effort;
        candidates.sort_unstable_by(by_evidence);
        let best = distinct(self.query, self.map.spacing, &candidates, MOST_REFINED);
        let hypotheses = self.refined(&best);
        findings.log.refined += hypotheses.len();
        self.grow_distinct(&hypotheses, findings);
        self.sift(findings);
        if !findings.accepted.is_empty() {
            self.doubt(findings, &candidates);
        }
    }

    /// Poses that lay seeds of a query that is sparser than the map on all its fruits, and what they cost; none where it is not, or
    /// the scale is free.
    fn congruent(&self) -> (Vec<Contender>, Effort) {
        let Self { query, map, .. } = *self;
        if !is_sparser(query, map, self.model.scale) {
            return (Vec::new(), Effort::default());
        }
        // The map says what noise is usual: where few fruits are left, how far they hang apart says nothing of it.
        let sigma = self.model.sigma.min(SEED_SIGMA * map.spacing);
        let (model, most) = (Model { sigma, ..self.model }, 2.0 * (WITHIN * sigma).powi(2));
        // The shortest: how many fours lie alike by chance grows with the fourth power of their length.
        let mut seeds = enumerate(query, COMPANIONS, LEAST * sigma);
        seeds.retain(|(_, code)| f64::from(code[0]) < LONGEST * map.spacing);
        seeds.sort_unstable_by(|a, b| a.1[0].total_cmp(&b.1[0]).then(a.0.cmp(&b.0)));
        seeds.truncate((TRIED / map.len()).clamp(1, MOST));
        let (mut contenders, mut effort) = (Vec::new(), Effort::default());
        for some in seeds.chunks(AT_ONCE) {
            let proposed = some.iter().filter_map(|&(quad, _)| {
                let proposer = Proposer::new(query, map, &model, quad)?;
                Some((proposer, quad.map(|row| query.points[row as usize])))
            });
            let laid: Vec<(Proposer<_>, [Vector3<f64>; STARS])> = proposed.collect();
            let reach = laid.iter().map(|(_, fruits)| (fruits[0] - fruits[1]).norm()).fold(0.0, f64::max);
            let at = |first: u32| {
                let (mut found, mut effort) = (Vec::new(), Effort::default());
                let around = Around::new(map, first, reach + WITHIN * sigma);
                for (proposer, fruits) in &laid {
                    around.each_alike(fruits, WITHIN * sigma, &mut |target| {
                        effort.candidates += 1;
                        found.extend(proposer.contender(&target, most, &mut effort));
                    });
                }
                (found, effort)
            };
            let of_each: Vec<(Vec<Contender>, Effort)> = (0..map.len() as u32).into_par_iter().map(at).collect();
            effort.codes += some.len() as u64;
            let before = effort.candidates;
            effort = of_each.iter().fold(effort, |sum, &(_, spent)| sum + spent);
            if effort.candidates - before > ANY * some.len() as u64 {
                break;
            }
            contenders.extend(of_each.into_iter().flat_map(|(found, _)| found));
        }
        (contenders, effort)
    }
}

/// The fruits around one of a cloud, nearest first: those at a distance are next to each other.
struct Around<'a> {
    cloud: &'a Landscape,
    first: u32,
    rows: Vec<u32>,
    distances: Vec<f64>,
}

impl<'a> Around<'a> {
    fn new(cloud: &'a Landscape, first: u32, reach: f64) -> Self {
        let place = cloud.points[first as usize];
        let apart = |row: u32| ((cloud.points[row as usize] - place).norm(), row);
        let mut near: Vec<(f64, u32)> = cloud.within(&place, reach).into_iter().map(apart).collect();
        near.sort_unstable_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
        let (distances, rows) = near.into_iter().unzip();
        Self { cloud, first, rows, distances }
    }

    /// Calls `take` with every four fruits, this the first, whose distances differ from those of `fruits` by less than `within`.
    fn each_alike(&self, fruits: &[Vector3<f64>; STARS], within: f64, take: &mut impl FnMut(Quad)) {
        let shell = |star: usize| {
            let apart = (fruits[0] - fruits[star]).norm();
            let [low, high] =
                [apart - within, apart + within].map(|end| self.distances.partition_point(|&distance| distance < end));
            &self.rows[low..high]
        };
        each_alike_among(fruits, self.cloud, [&[self.first], shell(1), shell(2), shell(3)], within, take);
    }
}

/// Calls `take` with every four fruits, one of each list, whose distances differ from those of `fruits` by less than `within`.
pub(super) fn each_alike_among(
    fruits: &[Vector3<f64>; STARS],
    cloud: &Landscape,
    lists: [&[u32]; STARS],
    within: f64,
    take: &mut impl FnMut(Quad),
) {
    let apart = |one: usize, other: usize| (fruits[one] - fruits[other]).norm();
    let place = |row: u32| cloud.points[row as usize];
    let alike = |one: usize, other: usize, rows: [u32; 2]| {
        let [here, there] = rows.map(place);
        rows[0] != rows[1] && ((here - there).norm() - apart(one, other)).abs() < within
    };
    for &a in lists[0] {
        let of = |star: usize| lists[star].iter().copied().filter(move |&row| alike(0, star, [a, row]));
        let (of_c, of_d): (Vec<u32>, Vec<u32>) = (of(2).collect(), of(3).collect());
        for b in of(1) {
            for &c in of_c.iter().filter(|&&c| alike(1, 2, [b, c])) {
                for &d in of_d.iter().filter(|&&d| alike(1, 3, [b, d]) && alike(2, 3, [c, d])) {
                    take([a, b, c, d]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verified::fixture::visits;

    #[test]
    fn all_fours_that_lie_alike_are_found_and_no_others() {
        let map = Landscape::new(&visits(0.02).1);
        let rows = [3, 17, 40, 58];
        let mut fruits = rows.map(|row: u32| map.points[row as usize]);
        // A and B are those farthest apart.
        let mut order = [0, 1, 2, 3];
        let apart = |[a, b, ..]: [usize; STARS]| (fruits[a] - fruits[b]).norm();
        let ends = [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 0, 2], [2, 3, 0, 1]];
        order = ends.into_iter().fold(order, |best, next| if apart(next) > apart(best) { next } else { best });
        fruits = order.map(|at| fruits[at]);
        let (mut found, mut wrong) = (Vec::new(), 0);
        let mut take = |four: Quad| {
            found.push(four);
            let places = four.map(|row| map.points[row as usize]);
            let off = |i: usize, j: usize| ((places[i] - places[j]).norm() - (fruits[i] - fruits[j]).norm()).abs();
            wrong += usize::from((0..STARS).any(|i| (0..i).any(|j| off(i, j) >= 0.01)));
        };
        let reach = (fruits[0] - fruits[1]).norm() + 0.01;
        (0..map.len() as u32).for_each(|first| Around::new(&map, first, reach).each_alike(&fruits, 0.01, &mut take));
        assert!(found.contains(&order.map(|at| rows[at])));
        assert_eq!(wrong, 0);
    }
}
