//! What the first answer leaves over.
//!
//! A search ends with the first round of seeds that finds an answer, and a further part of a row that is torn apart, or a rival, may
//! need a later one. It may lie beyond what the answer reaches, or amid it: a branch that was tied elsewhere, a tree that leans.

use super::case::{Finding, Findings, Search};
use super::decision::{MIN_FRUITS, RIVAL_SEED};
use super::hypothesis::GATE;
use super::proposal::Effort;
use super::seeds::Seed;

/// Seeds of a round that are asked, at the most: all of some four hundred fruits. What is left over of a longer row has several parts' worth
/// of seeds, and to ask all of them costs as much as a search for a row that is not there.
const SEEDS_ASKED: usize = 12_000;

/// Nearest neighbours of a fruit that have no partner either where a further part may lie.
const AROUND: usize = 4;

/// Mean probability of the pairs of a further part, at the least: 0.9 and more where it is one, 0.5 to 0.65 where fruits on shells or
/// wires lie on others.
const BELIEVED: f64 = 0.75;

impl<'a> Search<'a> {
    /// Looks for further parts of a row that is torn apart, or rivals, where fruits of the query lie that are without partners together.
    pub(super) fn look_at_the_rest(&self, findings: &mut Findings<'a>) {
        while !findings.accepted.is_empty() {
            let Some(alone) = self.alone(findings) else { return };
            let mut more = Findings::none(Effort::default(), findings.log.threshold);
            for mut seeds in self.rounds() {
                seeds.retain(|(quad, _)| quad.iter().all(|&row| alone[row as usize]));
                let some: Vec<Seed> = seeds.iter().copied().step_by(seeds.len().div_ceil(SEEDS_ASKED).max(1)).collect();
                let [best, _] = self.ask(&some, &mut more.log);
                let mut hypotheses = self.refined(&best);
                hypotheses.retain(|seed| seed.log_odds > RIVAL_SEED * findings.log.threshold);
                self.grow_distinct(&hypotheses, &mut more);
                self.sift(&mut more);
                if !more.accepted.is_empty() {
                    break;
                }
            }
            more.accepted.retain(|one| {
                self.believed(one) > BELIEVED
                    && !findings.accepted.iter().any(|found| self.shows(&found.overlap, &one.overlap))
            });
            if more.accepted.is_empty() {
                return;
            }
            findings.accepted.append(&mut more.accepted);
        }
    }

    /// Fruits of the query that are likelier without a partner than with one; `None` where no more of them are together than would be
    /// where each hides for itself.
    fn alone(&self, findings: &Findings) -> Option<Vec<bool>> {
        let mut paired = vec![0.0; self.query.len()];
        for (edge, probability) in findings.accepted.iter().flat_map(Finding::links) {
            paired[edge.query as usize] += probability;
        }
        let alone: Vec<bool> = paired.iter().map(|paired| *paired < 0.5).collect();
        let amid = |row: &usize| {
            let around = self.query.neighbours(*row).iter().take(AROUND);
            alone[*row] && around.copied().all(|other| alone[other as usize])
        };
        let together = (0..self.query.len()).filter(amid).count();
        let share = alone.iter().filter(|alone| **alone).count() as f64 / alone.len() as f64;
        let by_chance = alone.len() as f64 * share.powi(1 + AROUND as i32);
        let most = by_chance + GATE * by_chance.sqrt();
        (together >= MIN_FRUITS && together as f64 > most).then_some(alone)
    }
}
