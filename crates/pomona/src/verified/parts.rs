//! A row that is torn apart: where the camera lost its way for a moment, what lies before has one pose and what lies behind another.
//!
//! Each pose is found on its own, has enough evidence, and says nothing of the fruits of the other. So they are no rivals but parts
//! of one answer: the pairs are those of all parts, the pose is that of the part with most evidence.

use super::case::{Finding, Search};
use super::doubts::{RIVAL, is_most};
use super::growth::{CONVINCING, Growth};
use super::overlap::Overlap;
use super::settlement::settle;

impl<'a> Search<'a> {
    /// Gives the cells of which another finding says far more than the best to that one, where the two do not contradict each other
    /// else, and settles all of that once more, where that says more than the best alone.
    pub(super) fn join(&self, accepted: &mut [Finding<'a>]) {
        let Some((best, others)) = accepted.split_first_mut() else { return };
        let mut joined = best.growth.clone();
        for other in others.iter() {
            let (left, there) = (joined.left_by(&other.growth), other.growth.overlap());
            if !is_most(self.contradicted(&left, &there)) {
                joined.give_to(&other.growth);
            }
        }
        if joined.patches.torn_off.is_empty() {
            return;
        }
        joined.go_on();
        let all = settle(&joined, self.noise_m);
        if all.evidence > best.evidence() {
            (best.growth, best.settled) = (joined, Some(all));
        }
    }
}

impl Growth<'_> {
    /// Whether another growth says so much more of a cell that this one is no rival there.
    fn gives_way(&self, cell: usize, other: &Self) -> bool {
        let there = other.says(cell);
        there > CONVINCING && RIVAL * there > self.says(cell)
    }

    /// Cells that this leaves to another.
    fn given_to(&self, other: &Self) -> Vec<usize> {
        (0..self.patches.cells.len()).filter(|&cell| self.gives_way(cell, other)).collect()
    }

    /// What this explains but where it gives way.
    fn left_by(&self, other: &Self) -> Overlap {
        let mut left = self.overlap();
        for cell in self.given_to(other) {
            self.patches.cells[cell].rows.iter().for_each(|&row| left.predictions[row as usize] = None);
        }
        left
    }

    /// Makes the cells that this leaves to another a part of its own, as that one puts them.
    fn give_to(&mut self, other: &Self) {
        let given = self.given_to(other);
        if given.is_empty() {
            return;
        }
        self.patches.torn_off.push(other.patches.pose);
        let part = self.patches.torn_off.len();
        for i in given {
            let cell = &mut self.patches.cells[i];
            (cell.reached, cell.pose, cell.part) = (true, other.patches.cells[i].pose, part);
        }
        self.meet(1.0);
    }
}
