//! Poses with the evidence around them, refined from what seeds propose.

use super::claims::Claims;
use super::footing::Footing;
use super::landscape::Landscape;
use super::shares::of_either;
use super::sight::Sight;
use super::vertical::Vertical;
use crate::geometry::{Scale, Similarity};
use crate::moments::{FIXING, Moments};
use crate::neighbours::tree::single;
use crate::statistics::{Evidence, gaussian};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Probability that a fruit is seen again, while poses are compared; the pairs estimate their own.
pub(super) const DETECTION: f64 = 0.55;

/// Least and largest share of fruits seen again that is believed once pairs tell.
pub(super) const SHARES: (f64, f64) = (0.05, 0.97);

/// What is assumed of one pair of visits while poses are compared.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Model {
    /// Relative noise per axis in metres of the map.
    pub(crate) sigma: f64,
    /// Probability that a fruit of the query, inside the map's support, has its partner there.
    pub(crate) detection: f64,
    pub(crate) scale: Scale,
    pub(crate) vertical: Option<Vertical>,
    /// Axes of the map's row, where the visits may have looked at it from either side.
    pub(crate) row: Option<Matrix3<f64>>,
}

impl Model {
    /// Likelihood ratio of a fruit at squared distance `d2` from a map fruit being that fruit, against chance at
    /// `density`.
    ///
    /// 1 - p + p N(d; 0, `variance`) / density: missing costs 1 - p, agreement gains what the Gaussian exceeds the
    /// fruits that chance puts there (Lang et al. 2010, eq. for the foreground-background odds).
    #[inline]
    pub(crate) fn met(&self, d2: f64, variance: f64, density: f64) -> f64 {
        1.0 - self.detection + self.detection * gaussian(d2, variance) / density
    }

    /// Probability that a partner of this likelihood ratio is the fruit and no chance neighbour.
    #[inline]
    pub(crate) fn no_stranger(&self, met: f64) -> f64 {
        1.0 - (1.0 - self.detection) / met
    }

    /// The same of fruits of which the other visit can have seen a `share`.
    #[inline]
    pub(crate) fn of_share(&self, share: f64) -> Self {
        Self { detection: share * self.detection, ..*self }
    }

    /// What each visit can have seen of the other's fruits; `None` where both looked alike.
    pub(super) fn sight(&self, query: &Landscape, map: &Landscape, pose: &Similarity) -> Option<Sight> {
        self.row.map(|axes| Sight::new(query, map, &axes, pose))
    }

    /// One least-squares step from `start`, of pairs whose noise is `sigma` and of a vertical that is known.
    pub(crate) fn step(&self, pairs: &Moments, start: &Similarity, sigma: f64) -> Option<Similarity> {
        let pose = pairs.step(start, self.scale, 0.0)?;
        let Some(vertical) = self.vertical else { return Some(pose) };
        Some(vertical.upheld(&pose, &pairs.centroid(), &(pairs.inertia_under(&pose) / (sigma * sigma))))
    }

    /// Whether a pose stands as a known vertical asks.
    pub(crate) fn admits(&self, pose: &Similarity) -> bool {
        self.vertical.is_none_or(|vertical| vertical.admits(pose))
    }

    /// Noise per axis of pairs whose squared residuals sum up to `squares` under a pose that was fitted to them.
    pub(crate) fn noise(&self, squares: f64, weight: f64) -> f64 {
        let mean = squares / (3.0 * weight - 6.0).max(weight);
        // The noise that is expected is worth one degree of freedom: it keeps few pairs from shrinking the noise to their own fit.
        ((self.sigma * self.sigma + 3.0 * weight * mean) / (1.0 + 3.0 * weight)).sqrt()
    }

    /// Likelihood ratio of a fruit without a partner at a place of `support`; of a fruit of either visit.
    #[inline]
    pub(crate) fn missed(&self, support: f64) -> f64 {
        1.0 - self.detection * support
    }
}

/// How many standard deviations a partner may lie away: `P(chi^2_3 > 9)` = 3 %.
pub(crate) const GATE: f64 = 3.0;

/// A pose with the evidence around one place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hypothesis {
    pub(crate) pose: Similarity,
    /// Evidence against chance within the place's reach, nats.
    pub(crate) log_odds: f64,
    /// Where the evidence lies, in the centred query.
    pub(crate) place: Vector3<f64>,
    /// Relative noise per axis that the residuals show, metres of the map.
    pub(crate) sigma: f64,
}

/// Improves poses, each on the fruits within `reach` of a place; most evidence first. Poses that no pairs fix are left out.
pub(super) fn refined(
    [query, map]: [&Landscape; 2],
    model: &Model,
    reach: f64,
    starts: &[(Similarity, Vector3<f64>)],
) -> Vec<Hypothesis> {
    let refiner = || Refiner::new(query, map, model);
    let from = |refiner: &mut Refiner, (start, place): &(Similarity, Vector3<f64>)| refiner.refine(start, place, reach);
    let mut found: Vec<Hypothesis> = starts.par_iter().with_max_len(1).map_init(refiner, from).flatten_iter().collect();
    found.sort_by(|a, b| b.log_odds.total_cmp(&a.log_odds));
    found
}

/// Improves poses on the fruits around a place, its buffers reused from pose to pose.
#[derive(Debug)]
struct Refiner<'a> {
    query: &'a Landscape,
    map: &'a Landscape,
    /// What is assumed of the clouds, and of the region that is looked at.
    clouds: Model,
    model: Model,
    /// Share of the region's fruits of the map that are seen again; that of the query's is the model's.
    of_map: f64,
    /// Fruits of the query around the place: rows and points.
    rows: Vec<u32>,
    region: Vec<Vector3<f64>>,
    /// Under the pose that the refinement starts from.
    sight: Option<Sight>,
    /// Of each the variance of the prediction, and the nearest fruit of the map with its squared distance.
    nearest: Vec<(f64, Option<(u32, f64)>)>,
    claims: Claims,
}

/// Steps of a refinement, the last of which only weighs: with four, two of 30 rows are lost that have few fruits in common.
const STEPS: usize = 6;

/// Turns of every loop that ends when nothing new is learnt: pairs and patches, pairs and the share that is seen again. The
/// noise stands after the first, patches after the second; then what a branch shows near its stem leads on to its tip, a
/// few fruits a turn.
pub(super) const TURNS: usize = 4;

impl<'a> Refiner<'a> {
    fn new(query: &'a Landscape, map: &'a Landscape, model: &Model) -> Self {
        let claims = Claims::on(map.len());
        Self {
            query,
            map,
            clouds: *model,
            model: *model,
            of_map: model.detection,
            rows: Vec::new(),
            region: Vec::new(),
            sight: None,
            nearest: Vec::new(),
            claims,
        }
    }

    /// Improves a pose on the fruits within `reach` of `place` and weighs their evidence.
    fn refine(&mut self, start: &Similarity, place: &Vector3<f64>, reach: f64) -> Option<Hypothesis> {
        let query = self.query;
        self.rows = query.within(place, reach);
        self.region = self.rows.iter().map(|&row| query.points[row as usize]).collect();
        self.sight = self.model.sight(query, self.map, start);
        self.compare(start, place, reach);
        let model = self.model;
        let (mut pose, mut sigma) = (*start, model.sigma);
        let mut footing = Footing::of_seed(place, reach);
        let mut answer = None;
        for step in 1..=STEPS {
            self.pair_up(&pose, |p| sigma * sigma * (1.0 + footing.looseness(p)));
            let (moments, residual, mut log_odds) = self.weigh(&pose);
            if moments.weight < FIXING {
                return answer;
            }
            if step == STEPS {
                log_odds += self.other_side(&pose, place, reach);
            }
            answer = Some(Hypothesis { pose, log_odds, place: *place, sigma });
            if step == STEPS {
                break;
            }
            pose = model.step(&moments, &pose, sigma)?;
            footing = Footing::new(&moments, 0.0, reach, *place);
            if step > 2 {
                sigma = model.noise(residual, moments.weight);
            }
        }
        answer
    }

    /// Nearest partners of the region's fruits; of several that claim one fruit the nearest keeps it.
    fn pair_up(&mut self, pose: &Similarity, variance_at: impl Fn(&Vector3<f64>) -> f64) {
        self.claims.forget();
        self.nearest.clear();
        for (at, p) in self.region.iter().enumerate() {
            let variance = variance_at(p);
            let nearest = self.map.nearest(&pose.image(p), GATE * variance.sqrt());
            if let Some((partner, d2)) = nearest {
                self.claims.claim(partner, at, -d2);
            }
            self.nearest.push((variance, nearest));
        }
    }

    /// Sums over the pairs, their weighted squared distances, and the evidence of the region's fruits.
    fn weigh(&self, pose: &Similarity) -> (Moments, f64, f64) {
        let (mut moments, mut residual, mut evidence) = (Moments::default(), 0.0, Evidence::default());
        for (at, (p, &(variance, nearest))) in self.region.iter().zip(&self.nearest).enumerate() {
            let model = self.model.of_share(self.share(at));
            let Some((partner, d2)) = nearest.filter(|nearest| self.claims.owner(nearest.0) == Some(at)) else {
                evidence.multiply(model.missed(self.map.support.at(&pose.image(p))));
                continue;
            };
            let met = model.met(d2, variance, self.map.density[partner as usize]);
            evidence.multiply(met);
            let weight = model.no_stranger(met);
            moments.add(p, &self.map.points[partner as usize], weight);
            residual += weight * d2;
        }
        (moments, residual, evidence.log_odds())
    }

    /// Share of the fruits in the depth of one of the region that the map can show.
    fn share(&self, at: usize) -> f64 {
        self.sight.as_ref().map_or(1.0, |sight| sight.shares[0][self.rows[at] as usize])
    }

    /// Shares that are seen again of what either visit shows of the region: of the one that shows more, less.
    fn compare(&mut self, pose: &Similarity, place: &Vector3<f64>, reach: f64) {
        let mut there = 0.0;
        self.each_looked_at(pose, place, reach, |_, seen| there += seen);
        [self.model.detection, self.of_map] = of_either(self.clouds.detection, [self.shown(pose), there]);
    }

    /// The other half of the evidence: fruits of the map that the query should have seen, and how many pairs were due.
    ///
    /// With visits that see again the share p of the query's fruits and q of the map's, the likelihood ratio of "same trees" to
    /// "unrelated" is the product of N(d) p / density over the pairs, of 1 - p and 1 - q over the fruits of either that lack a
    /// partner, and exp(p n) for the n fruits of the query inside the overlap: the pairs that unrelated trees would have shown double.
    fn other_side(&self, pose: &Similarity, place: &Vector3<f64>, reach: f64) -> f64 {
        let back = Model { detection: self.of_map, ..self.model };
        let mut missing = Evidence::default();
        self.each_looked_at(pose, place, reach, |row, seen| {
            if self.claims.owner(row).is_none() {
                missing.multiply(back.missed(seen));
            }
        });
        self.model.detection * self.shown(pose) + missing.log_odds()
    }

    /// Fruits of the region that the map can have seen.
    fn shown(&self, pose: &Similarity) -> f64 {
        let seen = |(at, p): (usize, &Vector3<f64>)| self.share(at) * self.map.support.at(&pose.image(p));
        self.region.iter().enumerate().map(seen).sum()
    }

    /// Calls `visit` with the fruits of the map in the region, and how surely the query would have shown each.
    fn each_looked_at(&self, pose: &Similarity, place: &Vector3<f64>, reach: f64, mut visit: impl FnMut(u32, f64)) {
        self.map.tree.within(&single(&pose.image(place)), (reach * pose.scale) as f32, |row, _| {
            let share = self.sight.as_ref().map_or(1.0, |sight| sight.shares[1][row as usize]);
            visit(row, share * self.query.support.at(&pose.preimage(&self.map.points[row as usize])));
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verified::fixture::visits;

    #[test]
    fn a_visit_that_shows_a_third_says_as_much_as_the_query_and_as_the_map() {
        let (mut few, all) = visits(0.02);
        few.positions = few.positions.into_iter().step_by(3).collect();
        let [few, all] = [few, all].map(|cloud| Landscape::new(&cloud));
        let model = Model { sigma: 0.02, detection: DETECTION, scale: Scale::Metric, vertical: None, row: None };
        let said = |query: &Landscape, map: &Landscape| {
            let pose = Similarity { translation: query.centre - map.centre, ..Similarity::identity() };
            // The same metre and a half of the orchard.
            let start = (pose, all.centre - query.centre);
            refined([query, map], &model, 1.5, &[start]).first().expect("pairs fix the true pose").log_odds
        };
        let [there, back] = [said(&few, &all), said(&all, &few)];
        // Each takes the density of strangers from its own map. With one share for both visits they say 39 and 231 nats.
        assert!(there > 100.0 && (there / back).ln().abs() < 0.25, "{there} {back}");
    }
}
