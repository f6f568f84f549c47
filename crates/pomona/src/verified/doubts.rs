//! What may rule a pose out, or move it: rivals, lines, mirrors, local optima.

use super::acceptance::{SURE, outlying};
use super::case::{Finding, Findings, Log, Search};
use super::contender::{Contender, SAME};
use super::growth::grow;
use super::hypothesis::{Hypothesis, Model, refined};
use super::landscape::Landscape;
use super::overlap::Overlap;
use super::patches::Landing;
use super::proposal::Effort;
use super::search::REACH;
use crate::cloud::FruitCloud;
use crate::geometry::Similarity;
use crate::neighbours::tree::{Tree, single};
use nalgebra::{Point3, Vector3};

/// Candidates that are refined in search of a rival once a pose is accepted.
const RIVAL_CANDIDATES: usize = 24;

/// No other pose may have this share of the best evidence.
pub(super) const RIVAL: f64 = 0.5;

/// Share of its distance by which a row may have bent: a pose that is off by less, far away, is no other pose.
pub(super) const BENT: f64 = 0.05;

/// How much more a mirror image must explain to rule a pose out; on a plane both explain the same.
const MIRRORED: f64 = 1.3;

/// Places that an answer has most evidence at when it is moved and that a rival is looked for at; and the share of what a rival needs that
/// it has to have there, for on copies of one tree it keeps half, and more, of what is found once it is fitted.
const MOVED: (usize, f64) = (3, 0.4);

/// Turn about each axis that a polish tries either way, radians: 7 degrees.
const POLISH_TURN_RAD: f64 = 0.13;

/// An overlap and its evidence, nats.
#[derive(Clone, Copy)]
pub(super) struct Rated<'a> {
    pub(super) overlap: &'a Overlap,
    pub(super) nats: f64,
}

impl<'a> Search<'a> {
    /// Grows what the candidates that no finding explains propose: a second tree that looks the same has seeds too, but
    /// the true one may have more of the best.
    pub(super) fn look_for_rivals(&self, rest: &[Contender], findings: &mut Findings<'a>) {
        let new = |one: &&Contender| !findings.accepted.iter().any(|found| self.explains(found, &one.place, &one.pose));
        let others: Vec<Contender> = rest.iter().filter(new).take(RIVAL_CANDIDATES).copied().collect();
        self.grow_distinct(&self.refined(&others), findings);
    }

    /// Whether a finding, as it stands by now, puts the fruits around the seed where the seed puts them.
    pub(super) fn explains(&self, finding: &Finding, place: &Vector3<f64>, pose: &Similarity) -> bool {
        let (spacings, _) = SAME;
        let reach = spacings * self.query.spacing;
        let mut near = Vec::new();
        self.query.tree.nearest(&single(place), 8, &mut near);
        let overlap = finding.as_it_stands();
        let same = near
            .iter()
            .filter(|(row, _)| {
                let p = self.query.points[*row as usize];
                let found = match overlap.predictions[*row as usize] {
                    Some(prediction) => prediction.place,
                    None => finding.seed.pose.image(&p),
                };
                (found - pose.image(&p)).norm() < reach * pose.scale
            })
            .count();
        2 * same > near.len()
    }

    /// Whether the mirror image of the query is found with more evidence than the query.
    ///
    /// Where a crown is flat, or half of one is like the other, a mirrored row matches in part; all of it matches as what it is. It
    /// is looked for as the query was, with the first seeds. What is sure is not doubted.
    pub(super) fn fits_better_mirrored(&self, finding: &Finding, log: &Log) -> bool {
        let Overlap { log_odds, .. } = finding.overlap;
        if log_odds >= SURE * log.threshold {
            return false;
        }
        let query = self.mirrored_query();
        let search = self.for_query(&query);
        let mut findings = Findings::none(Effort::default(), log.threshold);
        if let Some(seeds) = search.rounds().next() {
            search.try_seeds(&seeds, &mut findings);
        }
        findings.accepted.iter().any(|image| image.overlap.log_odds > MIRRORED * log_odds)
    }

    /// Reflected at a plane that a known vertical lies in.
    fn mirrored_query(&self) -> Landscape {
        let up = self.model.vertical.map_or(Vector3::z(), |vertical| vertical.of_query());
        let across = up.cross(&Vector3::ith(up.iamin(), 1.0)).normalize();
        let image = |p: &Vector3<f64>| Point3::from(p - across * (2.0 * across.dot(p)));
        let positions = self.query.points.iter().map(image).collect();
        Landscape::with_spacing(&FruitCloud::from_positions(positions), Some(self.query.spacing))
    }

    /// Tries to leave the local optimum of a finding: turned starts, refined, the best grown; more evidence wins.
    ///
    /// A seed half a metre wide is turned by a few degrees by its noise. In a crown where fruits hang 8 cm apart the
    /// fruits a metre away then meet their neighbours, and the refinement can settle there.
    pub(super) fn polish(&self, finding: &mut Finding<'a>) {
        let Overlap { pose, middle, sigma, .. } = finding.overlap;
        let model = Model { sigma, ..self.model };
        let turned = std::iter::once(pose).chain(pose.turned_either_way(&middle, POLISH_TURN_RAD));
        let starts: Vec<_> = turned.map(|start| (start, middle)).collect();
        let reach = REACH * self.query.spacing;
        let Some(&seed) = refined([self.query, self.map], &model, reach, &starts).first() else { return };
        let better = Finding::new(grow(self.query, self.map, &seed, &finding.growth.patches.model), seed);
        if better.overlap.log_odds > finding.overlap.log_odds && self.model.admits(&better.overlap.pose) {
            *finding = better;
        }
    }

    /// Whether another optimum has nearly as much evidence, nats, elsewhere, of which it puts this share of its fruits.
    ///
    /// What it puts where the best has it speaks for the best, so its evidence counts by the share that it puts elsewhere: of the
    /// best's fruits, and of its own, for a pose that is found on one tree says little of where another stands.
    fn rivals(&self, best: Rated, other: Rated, share: f64, pattern: f64) -> bool {
        let elsewhere = self.elsewhere(best.overlap, other.overlap).min(share);
        is_most(elsewhere) && elsewhere * other.nats > pattern.max(RIVAL * best.nats)
    }

    /// Whether an optimum that was not accepted shows that wrong poses reach nearly as much on this planting, wherever it lies.
    pub(super) fn outdoes(&self, best: Rated, other: Rated, pattern: f64) -> bool {
        self.rivals(best, other, self.unexplained(best.overlap, &other.overlap.predictions), pattern)
    }

    /// Whether an optimum that puts other fruits elsewhere has so much evidence that by chance the best may have more.
    pub(super) fn equals(&self, best: Rated, other: Rated) -> bool {
        !self.lays(best.overlap, &other.overlap.predictions)
            && best.nats < outlying(self.config.false_alarm_rate, other.nats)
    }

    /// Whether both cannot be true: a row that is torn apart has a pose before and one behind, and neither doubts the other.
    pub(super) fn excludes(&self, best: Rated, other: Rated, pattern: f64) -> bool {
        self.rivals(best, other, self.contradicted(best.overlap, other.overlap), pattern)
    }

    /// Share of the fruits of another optimum's overlap that the best puts elsewhere, or where it puts others.
    pub(super) fn contradicted(&self, best: &Overlap, other: &Overlap) -> f64 {
        let landings: Vec<_> = best.predictions.iter().flatten().map(|at| single(&at.place)).collect();
        let (taken, reach) = (Tree::new(&landings), 0.5 * self.map.spacing);
        let mut nearest = Vec::new();
        let both = best.predictions.iter().zip(&other.predictions);
        share(both.filter_map(|(best, other)| {
            let there = other.as_ref()?.place;
            if let Some(at) = best {
                return Some((at.place - there).norm() > reach);
            }
            taken.nearest(&single(&there), 1, &mut nearest);
            Some(nearest.first().is_some_and(|&(_, d2)| f64::from(d2) < reach * reach))
        }))
    }

    /// Whether another optimum puts most fruits of the overlap elsewhere.
    pub(super) fn apart(&self, best: &Overlap, other: &Overlap) -> bool {
        is_most(self.elsewhere(best, other))
    }

    /// Share of the fruits of the overlap that another optimum puts elsewhere.
    pub(super) fn elsewhere(&self, best: &Overlap, other: &Overlap) -> f64 {
        let apart = |(p, at): (&Vector3<f64>, &Option<Landing>)| {
            let bent = BENT * best.pose.scale * (p - other.middle).norm();
            at.map(|at| (other.pose.image(p) - at.place).norm() > 0.5 * self.map.spacing + bent)
        };
        share(self.query.points.iter().zip(&best.predictions).filter_map(apart))
    }

    /// Whether one puts most of the fruits of another optimum's overlap where that puts them.
    pub(super) fn shows(&self, one: &Overlap, other: &Overlap) -> bool {
        self.lays(one, &other.predictions)
    }

    /// Whether it puts most of the fruits where these are.
    pub(super) fn lays(&self, one: &Overlap, places: &[Option<Landing>]) -> bool {
        !is_most(self.unexplained(one, places))
    }

    /// Share of the fruits at these places that the best does not put there.
    fn unexplained(&self, best: &Overlap, places: &[Option<Landing>]) -> f64 {
        let apart = |(best, other): (&Option<Landing>, &Option<Landing>)| {
            let there = other.as_ref()?.place;
            Some(best.is_none_or(|at| (at.place - there).norm() > 0.5 * self.map.spacing))
        };
        share(best.predictions.iter().zip(places).filter_map(apart))
    }

    /// A second tree that looks the same and that no seed proposed: where what is not sure has most evidence once it is moved, a pose
    /// is grown and settled as every other is, and is a rival where it then has what an answer needs, too.
    pub(super) fn unseen_rival(&self, best: Rated, found: &Finding<'a>, log: &Log) -> Option<Overlap> {
        if found.overlap.log_odds >= SURE * log.threshold {
            return None;
        }
        let enough = self.threshold(log.effort.stands.share_left());
        let Overlap { pose, middle, sigma, .. } = *found.as_it_stands();
        let fitted = |by: &Vector3<f64>| {
            let pose = Similarity { translation: pose.translation + by, ..pose };
            let seed = Hypothesis { pose, log_odds: f64::NAN, place: middle, sigma };
            let mut rival = Finding::new(grow(self.query, self.map, &seed, &found.growth.patches.model), seed);
            self.settle(&mut rival);
            rival
        };
        let (places, share) = MOVED;
        let least = share * enough.max(RIVAL * best.nats);
        let most = found.most_moved(places).into_iter().filter(|moved| moved.evidence > least);
        let mut rivals = most.map(|moved| fitted(&moved.by));
        let is_rival = |rival: &Finding| {
            let rated = Rated { overlap: &rival.overlap, nats: rival.evidence() };
            self.is_pose(rival) && self.excludes(best, rated, enough)
        };
        rivals.find(is_rival).map(|rival| rival.overlap)
    }
}

fn share(of: impl Iterator<Item = bool>) -> f64 {
    let (those, all) = of.fold((0, 0), |(those, all), one| (those + u32::from(one), all + 1));
    f64::from(those) / f64::from(all.max(1))
}

pub(super) fn is_most(share: f64) -> bool {
    share > 0.5
}
