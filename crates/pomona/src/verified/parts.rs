//! A row that is torn apart: where the camera lost its way for a moment, what lies before has one pose and what lies behind another.
//!
//! Each pose is found on its own, has enough evidence, and pairs other fruits. So they are no rivals but parts of one answer: the
//! pairs are those of all parts, the pose is that of the part with most evidence.

use super::axes::along;
use super::case::{Finding, Search};
use super::decision::{CLEAR, MIN_FRUITS};
use super::overlap::Overlap;
use super::settlement::{Settled, settle_together};
use nalgebra::Vector3;
use std::collections::HashMap;

/// Share of its pairs that the answer may exclude of a part. Of 145 parts of torn rows one has more, .27, and three in four .04 at the
/// most; wrong poses on wires have .31 to .43, a second tree that looks the same .6 and more.
const EXCLUDED: f64 = 0.25;

/// Turn between two parts of a row, radians, at the most: 45 degrees.
const TORN_RAD: f64 = std::f64::consts::FRAC_PI_4;

/// Findings that together are one answer.
struct Joined {
    parts: Vec<usize>,
    /// Findings that contradict them.
    others: Vec<usize>,
    /// The parts as they stand together; none where there is one.
    settled: Vec<Settled>,
    /// Pairs that are expected.
    pairs: f64,
}

impl Search<'_> {
    /// Joins the best finding with those that do not contradict it, and these with each other, unless the planting gives as much to wrong
    /// poses; the others stay behind it.
    ///
    /// The best is the one with most evidence as it stands in the end, or as it grew: a row that is torn may bend to one pose beyond the
    /// gap, and a tree grows to more than another that the whole row is found from. What expects more pairs is the answer.
    pub(super) fn join(&self, accepted: &mut Vec<Finding>) {
        if accepted.len() < 2 {
            return;
        }
        let mut orders: [Vec<usize>; 2] = std::array::from_fn(|_| (0..accepted.len()).collect());
        orders[1].sort_by(|&a, &b| accepted[b].overlap.log_odds.total_cmp(&accepted[a].overlap.log_odds));
        let different = if orders[0] == orders[1] { 1 } else { 2 };
        let joined = orders[..different].iter().map(|order| self.joined(accepted, order));
        let Some(joined) = joined.reduce(|one, other| if other.pairs > one.pairs { other } else { one }) else {
            return;
        };
        let Joined { parts, others, mut settled, .. } = joined;
        let first =
            (0..settled.len()).max_by(|&a, &b| settled[a].evidence.total_cmp(&settled[b].evidence)).unwrap_or(0);
        let mut findings: Vec<Option<Finding>> = accepted.drain(..).map(Some).collect();
        // The answer of all parts says what each of them says.
        accepted.extend([parts[first]].iter().chain(&others).filter_map(|&at| findings[at].take()));
        if let (Some(best), false) = (accepted.first_mut(), settled.is_empty()) {
            (best.settled, best.further) = (Some(settled.remove(first)), settled);
        }
    }

    /// The first in this `order` with those that do not contradict it and add pairs.
    fn joined(&self, findings: &[Finding], order: &[usize]) -> Joined {
        let mut joined = Joined { parts: Vec::new(), others: Vec::new(), settled: Vec::new(), pairs: 0.0 };
        for &at in order {
            let finding = &findings[at];
            if joined.parts.is_empty() {
                joined.parts.push(at);
                joined.pairs = expected(finding.settled.iter());
            } else if contradicted(finding, joined.parts.iter().map(|&part| &findings[part])) >= EXCLUDED
                || !joined.parts.iter().all(|&part| self.may_be_torn_off(finding, &findings[part]))
                || self.stands_out_of_the_planting(finding, 1.0) == Some(false)
            {
                joined.others.push(at);
            } else {
                let settled = self.settled_together(joined.parts.iter().chain([&at]).map(|&part| &findings[part]));
                let pairs = expected(settled.iter());
                // What adds less says of other fruits what the parts say.
                if pairs > joined.pairs + MIN_FRUITS as f64 {
                    joined.parts.push(at);
                    (joined.settled, joined.pairs) = (settled, pairs);
                }
            }
        }
        joined
    }

    /// Whether a finding may be a part that was torn off another, unless it has far more evidence than a stem has: a row that is torn keeps its
    /// direction and its order.
    ///
    /// Stems that stand apart and are nearly copies of each other, as of bananas, are found one by one, each turned as it likes, in any
    /// order.
    pub(super) fn may_be_torn_off(&self, finding: &Finding, other: &Finding) -> bool {
        let [own, others] = [finding, other].map(Finding::as_it_stands);
        let turn = others.pose.rotation.rotation_to(&own.pose.rotation).angle();
        finding.rated().nats > CLEAR * self.least() || (turn < TORN_RAD && !self.passes(own, others))
    }

    /// Whether one passes as many fruits of another along the row as it has itself, on its way from where that one puts it.
    fn passes(&self, one: &Overlap, other: &Overlap) -> bool {
        let Some(along) = along(self.query) else { return false };
        let along = other.pose.rotation * along;
        let mut way = [&other.pose, &one.pose].map(|pose| along.dot(&pose.image(&one.middle)));
        way.sort_by(f64::total_cmp);
        let is_passed = |place: &Vector3<f64>| (way[0]..way[1]).contains(&along.dot(place));
        let passed = other.predictions.iter().flatten().filter(|at| is_passed(&at.place)).count();
        passed >= one.predictions.iter().flatten().count()
    }

    /// Parts settled together: a fruit has one partner at most, and which part it belongs to is told by how many around it find
    /// partners there.
    fn settled_together<'b>(&self, parts: impl Iterator<Item = &'b Finding<'b>>) -> Vec<Settled> {
        let growths: Vec<_> =
            parts.filter_map(|part| Some((&part.growth, part.settled.as_ref()?.direction.as_expected()))).collect();
        settle_together(&growths, self.noise_m)
    }
}

/// Pairs that are expected of parts that stand together.
fn expected<'b>(parts: impl Iterator<Item = &'b Settled>) -> f64 {
    parts.flat_map(|settled| &settled.beliefs.probabilities).sum()
}

/// Share of the pairs of a finding that those of others exclude: they have one of the two fruits with another.
fn contradicted<'b>(finding: &Finding, others: impl Iterator<Item = &'b Finding<'b>>) -> f64 {
    let (mut of_query, mut of_map, mut of_both) = (HashMap::new(), HashMap::new(), HashMap::new());
    for (edge, probability) in others.flat_map(Finding::links) {
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
