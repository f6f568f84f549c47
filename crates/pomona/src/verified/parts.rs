//! A row that is torn apart: where the camera lost its way for a moment, what lies before has one pose and what lies behind another.
//!
//! Each pose is found on its own, has enough evidence, and says nothing of the fruits of the other. So they are no rivals but parts
//! of one answer: the pairs are those of all parts, the pose is that of the part with most evidence.

use super::case::{Finding, Search};
use super::doubts::is_most;
use super::growth::Growth;
use super::settlement::settle;

impl<'a> Search<'a> {
    /// Lays what the best finding did not reach as the others put it that do not contradict it, and settles all of that once more, where
    /// that says more than the best alone.
    pub(super) fn join(&self, accepted: &mut [Finding<'a>]) {
        let Some((best, others)) = accepted.split_first_mut() else { return };
        let Some(settled) = &best.settled else { return };
        let mut joined = best.growth.clone();
        let mut more = false;
        for other in others.iter() {
            let Some(there) = &other.settled else { continue };
            if !is_most(self.contradicted(&settled.overlap, &there.overlap)) {
                more |= joined.adopt(&other.growth);
            }
        }
        if !more {
            return;
        }
        joined.go_on_as_parts();
        let mut all = settle(&joined, self.noise_m);
        if all.evidence > settled.evidence {
            // A pose between those of two parts is right for neither.
            all.overlap.pose = settled.overlap.pose;
            (best.growth, best.settled) = (joined, Some(all));
        }
    }
}

impl Growth<'_> {
    /// Reaches the cells that another growth reached and this one did not, as that one puts them; whether there are any.
    fn adopt(&mut self, other: &Self) -> bool {
        let mut any = false;
        for (cell, there) in self.patches.cells.iter_mut().zip(&other.patches.cells) {
            if !cell.reached && there.reached {
                (cell.reached, cell.pose) = (true, there.pose);
                any = true;
            }
        }
        any
    }

    fn go_on_as_parts(&mut self) {
        self.meet(1.0);
        self.go_on();
    }
}
