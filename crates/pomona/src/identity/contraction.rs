//! Correlation clustering of signed log-odds: who is one fruit, two sights of one visit never.
//!
//! Greedy contraction (Keuper and others, 2015): the two clusters with the most evidence for being one are joined until
//! no two are better joined. Evidence of two clusters is the sum over all pairs of their sights, of which most are links
//! or were left apart by a match of their visits. The most evidence goes first whatever the order of the visits' coming.

use crate::error::{Error, Result};
use std::collections::BinaryHeap;

/// Bits of a mask's word.
const WORD: usize = u64::BITS as usize;

/// What speaks for and against: sights of visits, and links between them.
#[derive(Debug, Clone)]
pub struct Evidence<'a> {
    /// Visit of each sight.
    pub visits: &'a [usize],
    /// How many visits there are.
    pub n_visits: usize,
    /// Pairs of sights that a match joined, each once.
    pub links: &'a [[usize; 2]],
    /// That the two of each link are one fruit, nats.
    pub log_odds: &'a [f64],
    /// Visits that were found in one another: then a pair that is not there speaks against.
    pub matched: &'a [[usize; 2]],
    /// How much it speaks against, of each two of them, nats.
    pub against: &'a [f64],
}

impl Evidence<'_> {
    fn validate(&self) -> Result<()> {
        if self.log_odds.len() != self.links.len() {
            let (found, expected) = (self.log_odds.len(), self.links.len());
            return Err(Error::Length { what: "log_odds", found, expected });
        }
        if self.against.len() != self.matched.len() {
            let (found, expected) = (self.against.len(), self.matched.len());
            return Err(Error::Length { what: "against", found, expected });
        }
        for (what, nats) in [("log_odds", self.log_odds), ("against", self.against)] {
            if let Some(row) = nats.iter().position(|nats| !nats.is_finite()) {
                return Err(Error::NotFinite { what, row });
            }
        }
        below("visits", self.visits.iter(), self.n_visits)?;
        below("links", self.links.iter().flatten(), self.visits.len())?;
        below("matched", self.matched.iter().flatten(), self.n_visits)
    }
}

fn below<'a>(what: &'static str, mut rows: impl Iterator<Item = &'a usize>, below: usize) -> Result<()> {
    rows.find(|&&row| row >= below).map_or(Ok(()), |&found| Err(Error::Row { what, found, below }))
}

/// The cluster of every sight, numbered from 0 in the order of their first sights.
///
/// # Errors
/// A number that names no sight or no visit, or evidence that is not finite.
pub fn contracted(evidence: &Evidence) -> Result<Vec<usize>> {
    evidence.validate()?;
    let mut clusters = Clusters::new(evidence);
    // Of the two that a link joins one offers it.
    let first = (0..evidence.visits.len()).flat_map(|sight| clusters.offered(sight, move |other| other > sight));
    let mut heap: BinaryHeap<Candidate> = first.collect::<Vec<_>>().into();
    while let Some(best) = heap.pop() {
        if clusters.is_as_it_was(&best) {
            clusters.join(best.one, best.other);
            heap.extend(clusters.offered(best.one, |_| true));
        }
    }
    Ok(clusters.numbered())
}

/// Two clusters that are better joined.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    nats: f64,
    one: usize,
    other: usize,
    /// How often each had grown.
    grown: [u32; 2],
}

impl Ord for Candidate {
    /// The most evidence is the greatest; of equal evidence the earlier sights.
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let sights = |candidate: &Self| (candidate.one, candidate.other, candidate.grown);
        self.nats.total_cmp(&other.nats).then_with(|| sights(other).cmp(&sights(self)))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Candidate {}

/// Clusters of sights while they grow; a cluster is called by the first of its sights.
struct Clusters {
    /// Visits of each cluster, as masks of `words` words.
    visits: Vec<u64>,
    /// Nats against sights of any two visits that are no pair; 0 where they were not matched.
    against: Vec<f64>,
    n_visits: usize,
    words: usize,
    /// The cluster that each was joined to; itself while it stands.
    joined_to: Vec<usize>,
    grown: Vec<u32>,
    /// Links of each cluster to others: beyond what is said against every pair of sights.
    linked: Vec<Vec<(usize, f64)>>,
}

impl Clusters {
    fn new(evidence: &Evidence) -> Self {
        let (n_sights, words) = (evidence.visits.len(), evidence.n_visits.div_ceil(WORD).max(1));
        let mut clusters = Self {
            visits: vec![0; n_sights * words],
            against: vec![0.0; evidence.n_visits * evidence.n_visits],
            n_visits: evidence.n_visits,
            words,
            joined_to: (0..n_sights).collect(),
            grown: vec![0; n_sights],
            linked: vec![Vec::new(); n_sights],
        };
        for (sight, &visit) in evidence.visits.iter().enumerate() {
            clusters.visits[sight * words + visit / WORD] |= 1 << (visit % WORD);
        }
        for (&[one, other], &nats) in evidence.matched.iter().zip(evidence.against) {
            clusters.against[one * evidence.n_visits + other] = nats;
            clusters.against[other * evidence.n_visits + one] = nats;
        }
        for (&[one, other], nats) in evidence.links.iter().zip(evidence.log_odds) {
            let beyond = nats + clusters.against(evidence.visits[one], evidence.visits[other]);
            clusters.linked[one].push((other, beyond));
            clusters.linked[other].push((one, beyond));
        }
        clusters
    }

    /// Those of the chosen ones that a cluster is better joined with.
    fn offered(&self, cluster: usize, is_chosen: impl Fn(usize) -> bool) -> impl Iterator<Item = Candidate> {
        let chosen = self.linked[cluster].iter().filter(move |&&(linked, _)| is_chosen(linked));
        chosen.filter_map(move |&(linked, nats)| {
            let (one, other) = (cluster.min(linked), cluster.max(linked));
            let nats = self.evidence(one, other, nats);
            (nats > 0.0).then(|| Candidate { nats, one, other, grown: [self.grown[one], self.grown[other]] })
        })
    }

    /// Log-odds that two clusters are one fruit; minus infinity where one visit saw both.
    fn evidence(&self, one: usize, other: usize, linked: f64) -> f64 {
        let [visits, others] = [one, other].map(|cluster| self.mask(&self.visits, cluster));
        if visits.iter().zip(others).any(|(a, b)| a & b != 0) {
            return f64::NEG_INFINITY;
        }
        let of = |visit| bits(others).map(|other| self.against(visit, other)).sum::<f64>();
        linked - bits(visits).map(of).sum::<f64>()
    }

    fn against(&self, visit: usize, other: usize) -> f64 {
        self.against[visit * self.n_visits + other]
    }

    fn mask<'a>(&self, masks: &'a [u64], row: usize) -> &'a [u64] {
        &masks[row * self.words..(row + 1) * self.words]
    }

    /// Whether both clusters are still there, and no larger.
    fn is_as_it_was(&self, candidate: &Candidate) -> bool {
        let Candidate { one, other, grown, .. } = *candidate;
        [one, other].map(|cluster| self.joined_to[cluster] == cluster) == [true; 2]
            && [self.grown[one], self.grown[other]] == grown
    }

    /// Makes one cluster of two.
    fn join(&mut self, kept: usize, gone: usize) {
        for word in 0..self.words {
            self.visits[kept * self.words + word] |= self.visits[gone * self.words + word];
        }
        self.joined_to[gone] = kept;
        self.grown[kept] += 1;
        self.linked[kept].retain(|&(other, _)| other != gone);
        for (other, nats) in std::mem::take(&mut self.linked[gone]) {
            self.linked[other].retain(|&(linked, _)| linked != gone);
            if other != kept {
                self.link(kept, other, nats);
                self.link(other, kept, nats);
            }
        }
    }

    fn link(&mut self, cluster: usize, other: usize, nats: f64) {
        match self.linked[cluster].iter_mut().find(|(linked, _)| *linked == other) {
            Some((_, sum)) => *sum += nats,
            None => self.linked[cluster].push((other, nats)),
        }
    }

    /// A cluster is called by its first sight, so one pass over the sights numbers them all.
    fn numbered(&self) -> Vec<usize> {
        let mut numbers = vec![0; self.joined_to.len()];
        let mut count = 0;
        for sight in 0..numbers.len() {
            let to = self.joined_to[sight];
            numbers[sight] = if to == sight { count } else { numbers[to] };
            count += usize::from(to == sight);
        }
        numbers
    }
}

/// The bits that are set in a mask.
fn bits(mask: &[u64]) -> impl Iterator<Item = usize> {
    mask.iter().enumerate().flat_map(|(at, &word)| {
        // Each step takes the lowest bit away.
        let beyond = |word: &u64| Some(word & (word - 1)).filter(|&left| left != 0);
        let left = std::iter::successors(Some(word).filter(|&word| word != 0), beyond);
        left.map(move |word| at * WORD + word.trailing_zeros() as usize)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const UNPAIRED: f64 = 7.0;
    const EVERY_TWO: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

    fn labels(visits: &[usize], links: &[[usize; 2]], log_odds: &[f64], matched: &[[usize; 2]]) -> Vec<usize> {
        let n_visits = visits.iter().max().map_or(0, |most| most + 1);
        let against = vec![UNPAIRED; matched.len()];
        contracted(&Evidence { visits, n_visits, links, log_odds, matched, against: &against }).expect("valid")
    }

    #[test]
    fn links_join_through_all_visits_and_two_of_one_visit_never_join() {
        assert_eq!(labels(&[0, 1, 2], &[[0, 1], [1, 2]], &[8.0, 8.0], &[[0, 1], [1, 2]]), [0, 0, 0]);
        assert_eq!(labels(&[0, 0, 1], &[[0, 2], [1, 2]], &[3.0, 2.0], &[[0, 1]]), [0, 1, 0]);
    }

    #[test]
    fn what_matched_visits_leave_unpaired_speaks_against() {
        assert_eq!(labels(&[0, 1, 2], &[[0, 1], [1, 2]], &[8.0, 6.0], &EVERY_TWO), [0, 0, 1]);
        assert_eq!(labels(&[0, 1, 2], &[[0, 1], [1, 2]], &[8.0, 7.5], &EVERY_TWO), [0, 0, 0]);
    }

    #[test]
    fn a_match_that_leaves_out_much_speaks_less_against() {
        let labels = |against: &[f64]| {
            let (links, log_odds) = ([[0, 1], [1, 2]], [8.0, 6.0]);
            let evidence = Evidence {
                visits: &[0, 1, 2],
                n_visits: 3,
                links: &links,
                log_odds: &log_odds,
                matched: &EVERY_TWO,
                against,
            };
            contracted(&evidence)
        };
        assert_eq!(labels(&[7.0, 7.0, 7.0]).expect("valid"), [0, 0, 1]);
        assert_eq!(labels(&[7.0, 2.0, 7.0]).expect("valid"), [0, 0, 0]);
        assert!(labels(&[7.0, 7.0]).is_err() && labels(&[7.0, f64::NAN, 7.0]).is_err());
    }

    #[test]
    fn every_bit_of_a_mask_is_told_once() {
        let mask = [1 << 63 | 0b1001, 0, u64::MAX];
        let told: Vec<usize> = bits(&mask).collect();
        assert_eq!(told, [0, 3, 63].into_iter().chain(128..192).collect::<Vec<_>>());
    }

    #[test]
    fn numbers_that_name_nothing_are_refused() {
        let wrong = |links: &[[usize; 2]], log_odds: &[f64]| {
            contracted(&Evidence { visits: &[0, 1], n_visits: 2, links, log_odds, matched: &[], against: &[] }).is_err()
        };
        assert!(wrong(&[[0, 2]], &[1.0]) && wrong(&[[0, 1]], &[]) && wrong(&[[0, 1]], &[f64::NAN]));
    }

    /// Sights of five visits in three places; links of any sign between sights of two visits.
    fn seasons() -> impl Strategy<Value = (Vec<usize>, Vec<[usize; 2]>, Vec<f64>)> {
        let visits: Vec<usize> = (0..15).map(|sight| sight % 5).collect();
        let pairs: Vec<[usize; 2]> = (0..15)
            .flat_map(|one| (one + 1..15).map(move |other| [one, other]))
            .filter(|[one, other]| one % 5 != other % 5)
            .collect();
        prop::collection::btree_map(0..pairs.len(), -4.0..8.0f64, 0..40).prop_map(move |chosen| {
            (visits.clone(), chosen.keys().map(|&at| pairs[at]).collect(), chosen.into_values().collect())
        })
    }

    fn every_two_of(n_visits: usize) -> Vec<[usize; 2]> {
        (0..n_visits).flat_map(|one| (one + 1..n_visits).map(move |other| [one, other])).collect()
    }

    proptest! {
        #[test]
        fn no_two_clusters_are_better_joined((visits, links, log_odds) in seasons()) {
            let labels = labels(&visits, &links, &log_odds, &every_two_of(5));
            for (one, other) in (0..15).flat_map(|one| (0..one).map(move |other| (other, one))) {
                let of = |label| (0..15).filter(|&sight| labels[sight] == label).collect::<Vec<_>>();
                let [here, there] = [one, other].map(of);
                let apart = here.iter().any(|a| there.iter().any(|b| a % 5 == b % 5));
                if here.is_empty() || there.is_empty() || apart {
                    continue;
                }
                let between = |[a, b]: &[usize; 2]| here.contains(a) && there.contains(b) || here.contains(b) && there.contains(a);
                let linked: Vec<f64> = links.iter().zip(&log_odds).filter(|(link, _)| between(link)).map(|(_, nats)| nats + UNPAIRED).collect();
                let evidence = linked.iter().sum::<f64>() - UNPAIRED * (here.len() * there.len()) as f64;
                prop_assert!(evidence <= 1e-9);
            }
        }

        #[test]
        fn fruits_that_no_link_joins_do_not_know_of_each_other((visits, links, log_odds) in seasons()) {
            let alone = labels(&visits, &links, &log_odds, &every_two_of(5));
            let beside: Vec<usize> = visits.iter().chain(&visits).copied().collect();
            let moved = links.iter().map(|link| link.map(|sight| sight + 15));
            let twice: Vec<[usize; 2]> = moved.chain(links.iter().copied()).collect();
            let odds: Vec<f64> = log_odds.iter().chain(&log_odds).copied().collect();
            let together = labels(&beside, &twice, &odds, &every_two_of(5));
            prop_assert_eq!(&together[..15], &alone[..]);
            let count = alone.iter().max().map_or(0, |most| most + 1);
            prop_assert!(together[15..].iter().zip(&alone).all(|(there, here)| *there == here + count));
        }
    }
}
