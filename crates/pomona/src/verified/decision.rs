//! The story of one query: seeds, hypotheses, growth, acceptance, pairs.

use super::acceptance::{KEPT, SURE, VerifiedConfig};
use super::case::{Finding, Findings, Search, VerifiedMap, best_first};
use super::congruent::is_sparser;
use super::contender::{Contender, by_evidence};
use super::growth::{grow, hold};
use super::hypothesis::{Hypothesis, Model};
use super::landscape::Landscape;
use super::proposal::Effort;
use super::search::{FIRST_FRUITS, of_some_fruits};
use super::seeds::Seed;
use super::vertical::Vertical;
use crate::answer::{Match, Verdict};
use crate::cloud::FruitCloud;
use crate::geometry::{Scale, Similarity};
use crate::matching::Request;
use nalgebra::Vector3;

/// Fruits below which there is no answer: a seed of four and one that speaks for it.
pub(super) const MIN_FRUITS: usize = 5;

/// Fruits of a map at the most whose seeds are all kept: some 7 kB a fruit; and of a query.
pub(crate) const MAX_FRUITS: usize = 300_000;

/// A hypothesis with less than this share of the evidence around the seed of an accepted pose grows to no rival, and with less of what
/// is needed to no further part.
pub(super) const RIVAL_SEED: f64 = 0.3;

/// Fruits of the map for one of the query, at the most, where the map is looked for in the query, too: nine in ten were picked.
const EXCHANGED: usize = 10;

/// Candidates of a round that are refined before all others.
const FIRST_REFINED: usize = 8;

/// Hypotheses of a round that are grown.
const GROWN: usize = 6;

/// Rows found with less than this many times the evidence needed are laid along rows too, for of few fruits in common seeds show a
/// part; and parts of a torn row with less have to lie as a torn row does, for a stem that lies on another has up to 1.8 times as much.
pub(super) const CLEAR: f64 = 2.0;

/// Poses that a search by seeds has to have grown before one can stand out: fewer do not say what chance reaches.
const SHOWN: usize = 4;

/// Finds the query in the map.
pub(crate) fn search(map: &VerifiedMap, query: &FruitCloud, request: &Request, config: &VerifiedConfig) -> Match {
    let query = Landscape::new(query);
    let search = Search::new(map, &query, request, config);
    if query.len().min(search.map.len()) < MIN_FRUITS {
        return Match::too_few();
    }
    let answer = search.answer_of(search.run());
    let (scale, most) = (search.model.scale, EXCHANGED * query.len());
    let unlike = is_sparser(search.map, &query, scale) || is_sparser(&query, search.map, scale);
    if answer.verdict == Verdict::NoMatch && unlike && search.map.len() <= most {
        exchanged(map, query, request, config)
    } else {
        answer
    }
}

/// Finds the map in the query: of two visits one of which was picked, seeds of the one are not found where those of the other are.
fn exchanged(map: &VerifiedMap, query: Landscape, request: &Request, config: &VerifiedConfig) -> Match {
    let prepared = VerifiedMap::of(query, Scale::Metric);
    let request = Request { up: request.up.map(|[query, map]| [map, query]), ..*request };
    let search = Search::new(&prepared, &map.landscape, &request, config);
    search.answer_of(search.run()).exchanged()
}

/// Pairs of two clouds whose pose is known: the final stage alone.
pub(crate) fn pairs_under(
    map: &VerifiedMap,
    query: &FruitCloud,
    map_from_query: &Similarity,
    request: &Request,
    config: &VerifiedConfig,
) -> Match {
    let query = Landscape::new(query);
    let search = Search::new(map, &query, request, config);
    if query.len() == 0 || search.map.len() < MIN_FRUITS {
        return Match::too_few();
    }
    let pose = map_from_query.about(&query.centre, &search.map.centre);
    let sigma = request.noise_m.unwrap_or(search.model.sigma);
    let seed = Hypothesis { pose, log_odds: f64::NAN, place: Vector3::zeros(), sigma };
    let mut finding = Finding::new(hold(&query, search.map, &seed, &Model { sigma, ..search.model }), seed);
    search.settle(&mut finding);
    let found =
        search.answer(Findings { accepted: vec![finding], ..Findings::none(Effort::default(), 0.0) }, Vec::new());
    if found.pairs.is_empty() { Match::without_answer(Verdict::NoMatch, found.stages) } else { found }
}

impl Match {
    pub(super) fn too_few() -> Self {
        Self::without_answer(Verdict::TooFew, vec![("fruits_needed", MIN_FRUITS as f64)])
    }
}

impl<'a> Search<'a> {
    /// Rounds of seeds until a pose is accepted, and the offsets where they find none.
    fn run(&self) -> Findings<'a> {
        let mut findings = Findings::none(Effort::default(), self.threshold(Vertical::share_of_turns()));
        for seeds in self.rounds() {
            let rest = self.try_seeds(&seeds, &mut findings);
            self.sift(&mut findings);
            if !findings.accepted.is_empty() {
                self.doubt(&mut findings, &rest);
            }
            if !findings.accepted.is_empty() {
                break;
            }
        }
        if findings.accepted.is_empty() {
            self.lay_sparse_seeds(&mut findings);
        }
        self.look_at_the_rest(&mut findings);
        let clear = CLEAR * findings.log.threshold;
        if findings.accepted.iter().all(|found| found.overlap.log_odds < clear) {
            self.lay_along(&mut findings);
        }
        if findings.accepted.is_empty() && self.may_stand_out(&findings.others) {
            findings.others.extend(self.upside_down_poses());
            if findings.others.len() >= SHOWN {
                self.accept_outlier(&mut findings, f64::NEG_INFINITY);
            }
        }
        best_first(&mut findings.accepted);
        findings
    }

    /// Poses that are upside down, where the vertical is known: chance finds as many as upright ones, and they are wrong for sure.
    fn upside_down_poses(&self) -> Vec<Finding<'a>> {
        let Some(inverted) = self.upside_down() else { return Vec::new() };
        let mut findings = Findings::none(Effort::default(), 0.0);
        for seeds in inverted.rounds() {
            inverted.try_seeds(&seeds, &mut findings);
        }
        findings.accepted.retain(|finding| inverted.is_pose(finding));
        findings.accepted
    }

    /// Grows the best of what seeds propose; returns the candidates that were not refined.
    ///
    /// Where one of the first few is sure, the others are no more than its rivals.
    pub(super) fn try_seeds(&self, seeds: &[Seed], findings: &mut Findings<'a>) -> Vec<Contender> {
        let [best, mut rest] = self.ask(seeds, &mut findings.log);
        let (first, others) = best.split_at(FIRST_REFINED.min(best.len()));
        let mut hypotheses = self.refined(first);
        if let Some(sure) = self.sure(&hypotheses, findings) {
            findings.log.refined += hypotheses.len();
            findings.log.grown += 1;
            findings.accepted.push(sure);
            rest.splice(0..0, best);
            rest.sort_unstable_by(by_evidence);
        } else {
            hypotheses.extend(self.refined(others));
            hypotheses.sort_by(|a, b| b.log_odds.total_cmp(&a.log_odds));
            findings.log.refined += hypotheses.len();
            self.grow_distinct(&hypotheses, findings);
        }
        rest
    }

    /// The best of some hypotheses as it grew, where nothing is found yet and it is sure.
    fn sure(&self, hypotheses: &[Hypothesis], Findings { accepted, log, .. }: &Findings) -> Option<Finding<'a>> {
        let best = hypotheses.first().filter(|best| accepted.is_empty() && best.log_odds > log.threshold)?;
        let grown = Finding::new(grow(self.query, self.map, best, &self.model), *best);
        (grown.overlap.log_odds > SURE * log.threshold && self.is_pose(&grown)).then_some(grown)
    }

    /// Weighs poses that are proposed, most evidence first, in place of rounds of seeds.
    pub(super) fn weigh(&self, contenders: &[Contender], effort: Effort) -> Findings<'a> {
        let mut findings = Findings::none(effort, self.threshold(effort.stands.share_left()));
        let hypotheses = self.refined(contenders);
        findings.log.refined = hypotheses.len();
        for some in hypotheses.chunks(GROWN) {
            self.grow_distinct(some, &mut findings);
        }
        self.sift(&mut findings);
        if findings.accepted.is_empty() {
            self.accept_outlier(&mut findings, self.least());
        } else {
            self.doubt(&mut findings, &[]);
        }
        best_first(&mut findings.accepted);
        findings
    }

    /// Accepts the best of the other poses where it stands out of them and has the `least` evidence.
    fn accept_outlier(&self, Findings { accepted, others, log, .. }: &mut Findings<'a>, least: f64) {
        accepted.extend(self.single_out(others, least, KEPT.outlier, log));
    }

    /// Looks for rivals of what was found, and for better optima near it.
    pub(super) fn doubt(&self, findings: &mut Findings<'a>, rest: &[Contender]) {
        self.look_for_rivals(rest, findings);
        // A pose found with few seeds has shown little of where else the query might lie.
        if findings.log.seeds < FIRST_FRUITS / 2 {
            let (fruits, missing) = (self.query.len(), FIRST_FRUITS - findings.log.seeds);
            let (stride, turns) = ((fruits / missing).max(1) as u64, missing.div_ceil(fruits) as u64);
            let more = of_some_fruits(self.query, stride, 2..2 + turns);
            self.try_seeds(&more, findings);
        }
        self.sift(findings);
        let least = SURE * findings.log.threshold;
        let unsure = |finding: &&mut Finding| finding.overlap.log_odds < least;
        findings.accepted.iter_mut().filter(unsure).for_each(|finding| self.polish(finding));
        self.sift(findings);
    }

    /// Tells findings with enough evidence, grown and settled, from the others.
    pub(super) fn sift(&self, findings: &mut Findings<'a>) {
        for mut finding in std::mem::take(&mut findings.accepted) {
            if !self.is_pose(&finding) {
                continue;
            }
            findings.log.best = findings.log.best.max(finding.overlap.log_odds);
            let holds = self.holds(&mut finding, KEPT.threshold, &mut findings.log);
            let is_sure = finding.overlap.log_odds > SURE * findings.log.threshold;
            if holds && (is_sure || self.stands_out_of_the_planting(&finding, 1.0) != Some(false)) {
                findings.accepted.push(finding);
            } else {
                findings.others.push(finding);
            }
        }
    }

    /// Whether a finding is a whole pose: it stands as a known vertical asks, and its turns are fixed.
    pub(super) fn is_pose(&self, finding: &Finding) -> bool {
        self.model.admits(&finding.overlap.pose) && finding.turns_are_fixed()
    }

    /// Grows the best hypotheses that no accepted finding explains yet, and adds them to these.
    pub(super) fn grow_distinct(&self, hypotheses: &[Hypothesis], findings: &mut Findings<'a>) {
        let before = findings.accepted.len();
        for seed in hypotheses {
            if findings.accepted.len() == before + GROWN {
                break;
            }
            if self.is_worth_growing(seed, findings) {
                findings.accepted.push(Finding::new(grow(self.query, self.map, seed, &self.model), *seed));
            }
        }
        findings.log.grown += findings.accepted.len() - before;
    }

    /// Whether no finding explains a hypothesis, and it is strong enough to be a rival.
    fn is_worth_growing(&self, seed: &Hypothesis, Findings { accepted, log, .. }: &Findings) -> bool {
        let enough = accepted.iter().filter(|finding| finding.overlap.log_odds > log.threshold);
        let best = enough.map(|finding| finding.seed.log_odds).fold(0.0, f64::max);
        seed.log_odds >= RIVAL_SEED * best
            && !accepted.iter().any(|finding| self.explains(finding, &seed.place, &seed.pose))
    }
}
