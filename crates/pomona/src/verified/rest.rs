//! What the first answer leaves over.
//!
//! A search ends with the first round of seeds that finds an answer, and a further part of a row that is torn apart, or a rival, may
//! need a later one.

use super::case::{Findings, Search};
use super::proposal::Effort;

/// Fruits of the query that no finding explains, where others are looked for: fewer are hardly found anywhere.
const LEAST_REST: usize = 12;

/// Mean probability of the pairs of a further part, at the least: 0.9 and more where it is one, 0.5 to 0.65 where fruits on shells or
/// wires lie on others.
const BELIEVED: f64 = 0.75;

impl<'a> Search<'a> {
    /// Looks for further parts of a row that is torn apart, or rivals, where fruits of the query lie that no finding explains.
    pub(super) fn look_at_the_rest(&self, findings: &mut Findings<'a>) {
        loop {
            let rest: Vec<bool> =
                (0..self.query.len()).map(|row| !findings.accepted.iter().any(|found| found.has(row))).collect();
            if findings.accepted.is_empty() || rest.iter().filter(|rest| **rest).count() < LEAST_REST {
                return;
            }
            let mut more = Findings::none(Effort::default(), findings.log.threshold);
            for (mut seeds, keep) in self.rounds() {
                seeds.retain(|(quad, _)| quad.iter().all(|&row| rest[row as usize]));
                self.try_seeds(&seeds, keep, &mut more);
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
}
