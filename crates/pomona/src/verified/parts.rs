//! A row that is torn apart: where the camera lost its way for a moment, what lies before has one pose and what lies behind another.
//!
//! Each pose is found on its own, has enough evidence, and pairs other fruits. So they are no rivals but parts of one answer: the
//! pairs are those of all parts, the pose is that of the part with most evidence.

use super::case::{Finding, Search};
use super::settlement::{Settled, settle_together};
use crate::beliefs::Beliefs;
use std::collections::HashMap;

/// Share of its pairs that the answer may exclude of a part. Of 145 parts of torn rows one has more, .27, and three in four .04 at the
/// most; wrong poses on wires have .31 to .43, a second tree that looks the same .6 and more.
const EXCLUDED: f64 = 0.25;

impl Search<'_> {
    /// Joins the best finding with those that do not contradict it, and these with each other; the others stay behind it.
    ///
    /// They are settled together: a fruit has one partner at most, and which part it belongs to is told by how many around it find
    /// partners there. That is kept where more pairs are expected than of the best alone.
    pub(super) fn join(&self, accepted: &mut Vec<Finding>) {
        let mut parts: Vec<Finding> = Vec::new();
        let mut others = Vec::new();
        for finding in accepted.drain(..) {
            let is_part = parts.is_empty() || contradicted(&finding, &parts) < EXCLUDED;
            (if is_part { &mut parts } else { &mut others }).push(finding);
        }
        let together = self.settled_together(&parts);
        let mut parts = parts.into_iter();
        if let Some(mut best) = parts.next() {
            match together {
                Some((settled, further)) => (best.settled, best.further) = (Some(settled), further),
                None => others.splice(..0, parts).for_each(drop),
            }
            accepted.push(best);
        }
        accepted.append(&mut others);
    }

    /// The first part and the further ones, where all of them together expect more pairs than the first alone.
    fn settled_together(&self, parts: &[Finding]) -> Option<(Settled, Vec<Settled>)> {
        let settled: Vec<&Settled> = parts.iter().filter_map(|part| part.settled.as_ref()).collect();
        if settled.len() < 2 {
            return None;
        }
        let growths: Vec<_> =
            parts.iter().zip(&settled).map(|(part, settled)| (&part.growth, settled.direction.as_expected())).collect();
        let mut together = settle_together(&growths, self.noise_m);
        let expected = |beliefs: &Beliefs| beliefs.probabilities.iter().sum::<f64>();
        let all: f64 = together.iter().map(|part| expected(&part.beliefs)).sum();
        let further = together.split_off(1);
        together.pop().filter(|_| all > expected(&settled[0].beliefs)).map(|first| (first, further))
    }
}

/// Share of the pairs of a finding that those of others exclude: they have one of the two fruits with another.
fn contradicted(finding: &Finding, others: &[Finding]) -> f64 {
    let (mut of_query, mut of_map, mut of_both) = (HashMap::new(), HashMap::new(), HashMap::new());
    for (edge, probability) in others.iter().flat_map(Finding::links) {
        *of_query.entry(edge.query).or_insert(0.0) += probability;
        *of_map.entry(edge.map).or_insert(0.0) += probability;
        *of_both.entry((edge.query, edge.map)).or_insert(0.0) += probability;
    }
    let told = |told: Option<&f64>| told.copied().unwrap_or(0.0);
    let (mut excluded, mut all) = (0.0, 0.0);
    for (edge, probability) in finding.links() {
        let either = told(of_query.get(&edge.query)).max(told(of_map.get(&edge.map)));
        let same = told(of_both.get(&(edge.query, edge.map)));
        excluded += probability * (either - same).clamp(0.0, 1.0);
        all += probability;
    }
    if all > 0.0 { excluded / all } else { 1.0 }
}
