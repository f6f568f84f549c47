//! Growth across gaps: from tree to tree, from bunch to bunch, past a stretch that was replanted.
//!
//! Growth goes from cell to neighbouring cell ([`super::growth`]) and ends where none has fruits. Beyond the gap the pose is known as
//! well as the fruits before it say, and rows bend. So the fruits next beyond it are laid on the map as those before it say, and
//! moved by as much as a row may have bent: the offsets to all fruits of the map around vote, the best are refined as seeds are. What
//! then has more evidence than chance reaches in so many tries is reached, and growth goes on from there: a tree that was replaced is
//! like others, and of many places beside it one suits it.

use super::acceptance::reached;
use super::cut::Cell;
use super::doubts::BENT;
use super::growth::{CONVINCING, Growth};
use super::hypothesis::{Hypothesis, Model, refined};
use super::patches::Patchwork;
use super::search::REACH;
use super::translations::{WIDTH, most_common};
use crate::geometry::{Scale, Similarity};
use crate::moments::Moments;
use crate::neighbours::tree::{Tree, single};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Offsets that are refined beside none.
const BEST: usize = 4;

/// The way beyond a gap, as a share of how far what is reached extends; the nearest is tried however far it is.
const LEAP: f64 = 0.5;

/// What was tried in vain is tried again from as much nearer.
const NEARER: f64 = 0.8;

/// A cell that is not reached, and how far it lies from those that are, metres of the query.
struct Beyond {
    cell: usize,
    gap: f64,
}

impl Growth<'_> {
    /// Looks at what growth did not reach, beyond gaps without fruits; whether it found any of it.
    ///
    /// That adds pairs, but nothing to the evidence as it grew, which would be the better of several tries.
    pub(crate) fn reach_all(&mut self) -> bool {
        let before = self.reached();
        let mut tried = vec![f64::INFINITY; self.patches.cells.len()];
        loop {
            let beyond = self.beyond(&tried);
            if beyond.is_empty() {
                break;
            }
            for one in &beyond {
                let around = self.patches.cells[one.cell].around.iter();
                around.for_each(|&(other, _)| tried[other as usize] = tried[other as usize].min(one.gap));
            }
            let found: Vec<Hypothesis> = beyond.par_iter().filter_map(|one| self.bridge(one)).collect();
            if !found.is_empty() {
                for one in &found {
                    self.land(one);
                }
                self.go_on_from_there();
            }
        }
        self.look_at_the_rest();
        let outside: Vec<usize> = (0..self.patches.cells.len()).filter(|&i| !self.convincing(i)).collect();
        for i in outside {
            self.patches.cells[i].reached = false;
        }
        self.meet(1.0);
        self.go_on();
        self.reached() != before
    }

    /// Lays on the map what is still not reached, as what is says: a cell with a fruit or two fixes no pose of its own.
    fn look_at_the_rest(&mut self) {
        let patches = &self.patches;
        let pose = |one: &Beyond| patches.pose_from(&patches.cells[one.cell].centre, one.gap + patches.cut.edge);
        let rest = self.not_reached();
        let poses: Vec<_> = rest.par_iter().map(pose).collect();
        for (one, pose) in rest.iter().zip(poses) {
            let cell = &mut self.patches.cells[one.cell];
            (cell.reached, cell.pose) = (true, pose.unwrap_or(self.patches.pose));
        }
        self.meet(1.0);
    }

    fn reached(&self) -> Vec<bool> {
        self.patches.cells.iter().map(|cell| cell.reached).collect()
    }

    /// Grows from what was reached beyond gaps, and fits the patches anew.
    fn go_on_from_there(&mut self) {
        self.meet(1.0);
        while self.spread() {
            self.meet(1.0);
        }
        self.refit(false);
        self.meet(1.0);
    }

    /// Cells that are not reached, the nearest to what is first.
    fn not_reached(&self) -> Vec<Beyond> {
        let cells = &self.patches.cells;
        let reached: Vec<Vector3<f64>> = cells.iter().filter(|cell| cell.reached).map(|cell| cell.centre).collect();
        let tree = Tree::new(&reached.iter().map(single).collect::<Vec<_>>());
        let mut nearest = Vec::new();
        let mut gap = |cell: &Cell| {
            tree.nearest(&single(&cell.centre), 1, &mut nearest);
            nearest.first().map_or(f64::INFINITY, |&(row, _)| (reached[row as usize] - cell.centre).norm())
        };
        let open = (0..cells.len()).filter(|&i| !cells[i].reached);
        let mut open: Vec<Beyond> = open.map(|cell| Beyond { cell, gap: gap(&cells[cell]) }).collect();
        open.sort_by(|a, b| a.gap.total_cmp(&b.gap).then(a.cell.cmp(&b.cell)));
        open
    }

    /// Of those one of several next to each other, as far as a leap goes, and not those that were tried from hardly farther.
    fn beyond(&self, tried: &[f64]) -> Vec<Beyond> {
        let cells = &self.patches.cells;
        let mut reached = cells.iter().filter(|cell| cell.reached).map(|cell| cell.centre);
        let Some(first) = reached.next() else { return Vec::new() };
        let extent = reached.map(|centre| (centre - first).norm()).fold(0.0, f64::max);
        let mut open = self.not_reached();
        open.retain(|one| one.gap < NEARER * tried[one.cell]);
        let farthest = open.first().map_or(0.0, |nearest| (nearest.gap / NEARER).max(LEAP * extent));
        let mut taken = vec![false; cells.len()];
        open.retain(|one| {
            let new = one.gap <= farthest && !taken[one.cell];
            if new {
                cells[one.cell].around.iter().for_each(|&(other, _)| taken[other as usize] = true);
            }
            new
        });
        open
    }

    /// Where the fruits around a cell beyond a gap lie, if that says enough.
    fn bridge(&self, Beyond { cell, gap }: &Beyond) -> Option<Hypothesis> {
        let Patchwork { query, map, model, cells, sigma, cut, .. } = &self.patches;
        let place = cells[*cell].centre;
        let start = self.patches.pose_from(&place, gap + cut.edge)?;
        let reach = REACH * query.spacing;
        let bent = BENT * gap * start.scale;
        let width = WIDTH * sigma;
        let mut starts = vec![(start, place)];
        let mut least = CONVINCING;
        if bent > 0.5 * width {
            let fruits = query.within(&place, reach).into_iter().map(|row| start.image(&query.points[row as usize]));
            let offsets = most_common(fruits, map, bent, width).take(BEST);
            starts.extend(offsets.map(|by| (Similarity { translation: start.translation + by, ..start }, place)));
            least = reached(1.0, (2.0 * bent / width).powi(3), 1.0);
        }
        let model = Model { sigma: *sigma, ..*model };
        let found = *refined([query, map], &model, reach, &starts).first()?;
        let moved = (found.pose.image(&place) - start.image(&place)).norm();
        let enough = found.log_odds > least && moved < bent + width;
        (enough && model.admits(&found.pose)).then_some(found)
    }

    /// Reaches the cells around a place that was found.
    fn land(&mut self, found: &Hypothesis) {
        let reach = REACH * self.patches.query.spacing;
        let near = |cell: &&mut Cell| !cell.reached && (cell.centre - found.place).norm() < reach;
        for cell in self.patches.cells.iter_mut().filter(near) {
            (cell.reached, cell.pose) = (true, found.pose);
        }
    }
}

impl Patchwork<'_> {
    /// The pose at a place as the pairs around it say, those farther than `reach` ever less.
    fn pose_from(&self, place: &Vector3<f64>, reach: f64) -> Option<Similarity> {
        let weight = |cell: &Cell| (-0.5 * ((cell.centre - place).norm() / reach).powi(2)).exp();
        let reached = self.cells.iter().filter(|cell| cell.reached);
        let near = Moments::total(reached.map(|cell| (&cell.moments, weight(cell))));
        (near.weight > 0.0).then(|| near.step(&self.pose, Scale::Metric, self.cut.edge * self.cut.edge))?
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FruitCloud;
    use crate::verified::fixture::Dice;
    use crate::verified::growth::grow;
    use crate::verified::hypothesis::DETECTION;
    use crate::verified::landscape::Landscape;

    /// Fruits on trees, each with the number of its tree.
    type Row = Vec<(Vector3<f64>, u32)>;

    /// A tree of forty fruits.
    fn tree(dice: &mut Dice, number: u32) -> Row {
        let mut fruit = || {
            let stem = Vector3::new(3.0 * f64::from(number), 0.0, 1.2 * dice.uniform());
            stem + 0.2 * dice.normal().component_mul(&Vector3::new(1.0, 1.0, 0.0))
        };
        (0..40).map(|_| (fruit(), number)).collect()
    }

    /// Five trees, 3 m apart.
    fn trees(dice: &mut Dice) -> Row {
        (0..5).flat_map(|number| tree(dice, number)).collect()
    }

    /// A tree, and fruits 2 m from it, each alone.
    fn tree_among_single_fruits(dice: &mut Dice) -> Row {
        let mut row = tree(dice, 0);
        row.extend((1..20).map(|i| {
            let (y, x) = (0.33 * f64::from(i)).sin_cos();
            (Vector3::new(2.0 * x, 2.0 * y, 0.6 + 0.1 * dice.normal().z), i)
        }));
        row
    }

    /// Share of the fruits that are expected within 5 cm of where they are, once the first tree is found, before and after it went on;
    /// two visits with 1 cm of noise, the row of one bent by `bend` times the distance.
    fn share_found(row: impl Fn(&mut Dice) -> Row, bend: f64) -> [f64; 2] {
        let mut dice = Dice(3);
        let row = row(&mut dice);
        let mut visit = |bend: f64| {
            let bent = |p: &Vector3<f64>| p + Vector3::new(0.0, bend * p.x * p.x, 0.0);
            FruitCloud::from_positions(row.iter().map(|(p, _)| (bent(p) + 0.01 * dice.normal()).into()).collect())
        };
        let clouds = [visit(bend), visit(0.0)];
        let [query, map] = clouds.each_ref().map(Landscape::new);
        let model = Model { sigma: 0.02, detection: DETECTION, scale: Scale::Metric, vertical: None, row: None };
        let on_first = |at: &&u32| row[**at as usize].1 == 0;
        let of_first: Vec<_> = query.points.iter().zip(&query.rows).filter(|(_, at)| on_first(at)).collect();
        let place = of_first.iter().map(|(p, _)| **p).sum::<Vector3<f64>>() / of_first.len() as f64;
        let pose = Similarity { translation: query.centre - map.centre, ..Similarity::identity() };
        let seed = Hypothesis { pose, log_odds: 50.0, place, sigma: 0.02 };
        let mut growth = grow(&query, &map, &seed, &model);
        let share = |growth: &Growth| {
            let right = |(row, at): (usize, &Option<crate::verified::patches::Landing>)| {
                let there = clouds[1].positions[query.rows[row] as usize].coords - map.centre;
                at.is_some_and(|at| (at.place - there).norm() < 0.05)
            };
            let predictions = growth.patches.predictions.iter().enumerate();
            predictions.filter(|one| right(*one)).count() as f64 / query.len() as f64
        };
        let grown = share(&growth);
        assert!(growth.reach_all());
        [grown, share(&growth)]
    }

    #[test]
    fn trees_that_stand_apart_are_reached_from_one() {
        let [grown, beyond] = share_found(trees, 0.0);
        assert!(grown < 0.25 && beyond > 0.95, "{grown}, then {beyond}");
    }

    #[test]
    fn they_are_where_the_row_bends() {
        // 58 cm at the last tree, 14 cm more between two trees than between the two before.
        let [grown, beyond] = share_found(trees, 0.004);
        assert!(grown < 0.25 && beyond > 0.95, "{grown}, then {beyond}");
    }

    #[test]
    fn fruits_too_few_for_a_pose_of_their_own_are_looked_at_as_the_others_say() {
        let [grown, beyond] = share_found(tree_among_single_fruits, 0.0);
        assert!(grown < 0.7 && beyond > 0.8, "{grown}, then {beyond}");
    }
}
