//! A seed of the query laid on seeds of the map: the least-squares pose, and a first look at the fruits around.

use super::contender::Contender;
use super::hypothesis::{GATE, Model};
use super::landscape::Landscape;
use super::seeds::{Quad, STARS, frame};
use super::vertical::Stands;
use crate::geometry::{Scale, Similarity};
use nalgebra::{Matrix3, Rotation3, Vector3};
use std::ops::Add;

/// What a proposal asks of a map.
pub(crate) trait Terrain {
    /// Where a fruit is.
    fn place(&self, row: u32) -> Vector3<f64>;
    /// The nearest fruit within `gate`, with its squared distance.
    fn nearest(&self, place: &Vector3<f64>, gate: f64) -> Option<(u32, f64)>;
    /// Fruits per cubic metre that chance puts at a fruit.
    fn density(&self, row: u32) -> f64;
    /// Probability that the map would have shown a fruit at `place`.
    fn support(&self, place: &Vector3<f64>) -> f64;
}

impl Terrain for Landscape {
    #[inline]
    fn place(&self, row: u32) -> Vector3<f64> {
        self.points[row as usize]
    }

    #[inline]
    fn nearest(&self, place: &Vector3<f64>, gate: f64) -> Option<(u32, f64)> {
        self.nearest(place, gate)
    }

    #[inline]
    fn density(&self, row: u32) -> f64 {
        self.density[row as usize]
    }

    #[inline]
    fn support(&self, place: &Vector3<f64>) -> f64 {
        self.support.at(place)
    }
}

/// What proposing cost.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Effort {
    pub(crate) codes: u64,
    pub(crate) candidates: u64,
    pub(crate) fitted: u64,
    /// How those stood that fit in space.
    pub(crate) stands: Stands,
}

impl Add for Effort {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            codes: self.codes + other.codes,
            candidates: self.candidates + other.candidates,
            fitted: self.fitted + other.fitted,
            stands: self.stands + other.stands,
        }
    }
}

/// A seed of the query with all that its candidates have in common.
pub(crate) struct Proposer<'a, M> {
    query: &'a Landscape,
    map: &'a M,
    model: &'a Model,
    quad: Quad,
    /// The fruit of the seed nearest to the centroid: its neighbours are those of the seed.
    middle: u32,
    pub(crate) centroid: Vector3<f64>,
    /// Axes of the seed as rows: from the query to the frame of the seed.
    to_frame: Matrix3<f64>,
    /// The fruits about their centroid, in the frame of the seed.
    fruits: [Vector3<f64>; STARS],
    /// Sum of the squared distances from the centroid.
    square: f64,
    /// From the torque on the fruits to the turn that relieves it.
    inverse_inertia: Matrix3<f64>,
}

/// The fruits of a seed: their centroid, and where they are about it in the frame of the seed, whose axes are the rows.
fn in_frame(fruits: [Vector3<f64>; STARS], to_frame: &Matrix3<f64>) -> (Vector3<f64>, [Vector3<f64>; STARS]) {
    let centroid = fruits.iter().sum::<Vector3<f64>>() / STARS as f64;
    (centroid, fruits.map(|p| to_frame * (p - centroid)))
}

impl<'a, M: Terrain> Proposer<'a, M> {
    /// `None` where the seed is degenerate.
    pub(crate) fn new(query: &'a Landscape, map: &'a M, model: &'a Model, quad: Quad) -> Option<Self> {
        let fruits = quad.map(|row| query.points[row as usize]);
        let to_frame = Matrix3::from_columns(&frame(&fruits)?).transpose();
        let (centroid, fruits) = in_frame(fruits, &to_frame);
        let moments = fruits.iter().fold(Matrix3::zeros(), |sum, p| sum + p * p.transpose());
        let off_centre = |&i: &usize| fruits[i].norm_squared();
        let middle = (0..STARS).min_by(|a, b| off_centre(a).total_cmp(&off_centre(b))).map(|i| quad[i])?;
        let square = moments.trace();
        let inverse_inertia = (Matrix3::identity() * square - moments).try_inverse()?;
        Some(Self { query, map, model, quad, middle, centroid, to_frame, fruits, square, inverse_inertia })
    }

    /// The pose on a seed of the map, where its squared residuals sum up to `most` at the most, it stands as a vertical asks and
    /// the fruits around speak for it.
    pub(super) fn contender(&self, target: &Quad, most: f64, effort: &mut Effort) -> Option<Contender> {
        let (pose, residual) = self.fit(target.map(|row| self.map.place(row)))?;
        if residual > most {
            return None;
        }
        effort.stands = effort.stands + self.stand(&pose);
        let pose = self.upright(pose)?;
        effort.fitted += 1;
        let log_odds = self.first_look(&pose);
        let key = (self.quad, *target);
        (log_odds > 0.0).then_some(Contender { pose, log_odds, place: self.centroid, key })
    }

    /// Least-squares pose on the fruits of a seed of the map and the sum of the squared residuals. `None` where that
    /// is degenerate.
    ///
    /// The frames of both seeds are laid on each other; one Gauss-Newton step from there, in their common axes, does
    /// the rest (see [`crate::moments`]): the inertia is the same for all candidates.
    #[inline]
    pub(crate) fn fit(&self, fruits: [Vector3<f64>; STARS]) -> Option<(Similarity, f64)> {
        let axes = Matrix3::from_columns(&frame(&fruits)?);
        let (centroid, fruits) = in_frame(fruits, &axes.transpose());
        let both = || self.fruits.iter().zip(&fruits);
        let torque = both().fold(Vector3::zeros(), |sum, (here, there)| sum + here.cross(there));
        let turn = Rotation3::new(self.inverse_inertia * torque).into_inner();
        let turned = self.fruits.map(|p| turn * p);
        let scale = match self.model.scale {
            Scale::Metric => 1.0,
            Scale::Free => turned.iter().zip(&fruits).map(|(here, there)| here.dot(there)).sum::<f64>() / self.square,
        };
        if scale.is_nan() || scale <= 0.0 {
            return None;
        }
        let residual = turned.iter().zip(&fruits).map(|(here, there)| (there - here * scale).norm_squared()).sum();
        let rotation = Rotation3::from_matrix_unchecked(axes * turn * self.to_frame);
        let translation = centroid - rotation * self.centroid * scale;
        Some((Similarity { rotation, translation, scale }, residual))
    }

    /// The pose as a known vertical corrects it; `None` where the two contradict each other.
    #[inline]
    pub(crate) fn upright(&self, pose: Similarity) -> Option<Similarity> {
        let Some(vertical) = self.model.vertical else { return Some(pose) };
        vertical.straightened(&pose, &self.centroid, self.turn_variance(&pose))
    }

    /// How the pose stands, where a vertical is known.
    #[inline]
    pub(crate) fn stand(&self, pose: &Similarity) -> Stands {
        self.model.vertical.map_or(Stands::default(), |vertical| vertical.stand(pose, self.turn_variance(pose)))
    }

    /// Variance of the turn about each axis.
    #[inline]
    fn turn_variance(&self, pose: &Similarity) -> f64 {
        // The noise is in metres of the map, the inertia in those of the query.
        let sigma = self.model.sigma / pose.scale;
        sigma * sigma * self.inverse_inertia.trace() / 3.0
    }

    /// Evidence of the fruits next to the seed, the seed's own fit included, with the pose as the seed gives it.
    #[inline]
    pub(crate) fn first_look(&self, pose: &Similarity) -> f64 {
        // Likelihood ratios are multiplied: one logarithm in the end costs less than one a fruit.
        let mut around = 1.0;
        for &row in self.query.neighbours(self.middle as usize).iter().filter(|&row| !self.quad.contains(row)) {
            around *= self.ratio(row, pose);
            // A sequential test: a true pose falls this low only when its first four fruits or so are all hidden.
            if around < HOPELESS {
                return f64::NEG_INFINITY;
            }
        }
        self.quad.iter().fold(around, |product, &row| product * self.ratio(row, pose)).ln()
    }

    /// Variance of where the pose of the seed puts a fruit, in variances of one pair.
    ///
    /// The pose of four noisy fruits is uncertain: with the inertia J about their centroid, a fruit at r from there has
    /// `1/4 + tr([r] J^-1 [r]^T) / 3` per axis (cf. 1 + r^2/Q^2 of Lang et al.).
    #[inline]
    fn looseness(&self, p: &Vector3<f64>) -> f64 {
        let r = self.to_frame * (p - self.centroid);
        let turn = self.inverse_inertia;
        1.0 / STARS as f64 + (turn.trace() * r.norm_squared() - r.dot(&(turn * r))) / 3.0
    }

    /// Variance per axis of the distance to the partner of a fruit at `p`, square metres of the map.
    #[inline]
    pub(super) fn variance(&self, p: &Vector3<f64>) -> f64 {
        self.model.sigma * self.model.sigma * (1.0 + self.looseness(p))
    }

    /// What a fruit says for the pose, as a likelihood ratio.
    #[inline]
    fn ratio(&self, row: u32, pose: &Similarity) -> f64 {
        let p = self.query.points[row as usize];
        let variance = self.variance(&p);
        let place = pose.image(&p);
        match self.map.nearest(&place, GATE * variance.sqrt()) {
            Some((partner, d2)) => self.model.met(d2, variance, self.map.density(partner)),
            None => self.model.missed(self.map.support(&place)),
        }
    }
}

/// Likelihood ratio of the fruits beside the seed at which a first look ends: 2.5 nats against the pose.
pub(super) const HOPELESS: f64 = 0.082_085;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FruitCloud;
    use crate::verified::fixture::visits;
    use crate::verified::seeds::longest;
    use nalgebra::Point3;

    fn model(scale: Scale) -> Model {
        Model { sigma: 0.02, detection: 0.6, scale, vertical: None, row: None }
    }

    /// The row of the map that shows the fruit in `row` of the query, where both show the same cloud.
    fn shown(query: &Landscape, map: &Landscape, row: u32) -> u32 {
        let fruit = query.rows[row as usize];
        map.rows.iter().position(|&other| other == fruit).expect("both show all fruits") as u32
    }

    #[test]
    fn the_fit_of_a_moved_seed_is_exact() {
        let (cloud, _) = visits(0.02);
        let query = Landscape::new(&cloud);
        let turn = Rotation3::new(Vector3::new(0.7, -1.9, 0.4));
        for (model, scale) in [(model(Scale::Metric), 1.0), (model(Scale::Free), 1.3)] {
            let moved = |p: &Point3<f64>| Point3::from(turn * p.coords * scale + Vector3::new(3.0, -1.0, 2.0));
            let map = Landscape::new(&FruitCloud::from_positions(cloud.positions.iter().map(moved).collect()));
            for (quad, _) in longest(&query, 50, f32::INFINITY) {
                let proposer = Proposer::new(&query, &map, &model, quad).expect("no seed is degenerate");
                let (pose, residual) =
                    proposer.fit(quad.map(|row| map.points[shown(&query, &map, row) as usize])).expect("nor its image");
                assert!(residual < 1e-18, "{residual}");
                assert!((pose.rotation.matrix() - turn.matrix()).norm() < 1e-9 && (pose.scale - scale).abs() < 1e-9);
                for (row, p) in (0..).zip(&query.points) {
                    let place = map.points[shown(&query, &map, row) as usize];
                    assert!((pose.image(p) - place).norm() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn a_first_look_prefers_the_true_pose_to_a_turned_one() {
        let (query, map) = visits(0.02);
        let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
        let model = model(Scale::Metric);
        let truth = Similarity { translation: query.centre - map.centre, ..Similarity::identity() };
        let mut looks = Vec::new();
        for (quad, _) in longest(&query, 200, f32::INFINITY) {
            let proposer = Proposer::new(&query, &map, &model, quad).expect("no seed is degenerate");
            for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
                let turned = truth.turned(&proposer.centroid, &Rotation3::new(axis * 0.5));
                looks.push([truth, turned].map(|pose| proposer.first_look(&pose)));
            }
        }
        // Where the fruits next to a seed are hidden, neither pose is looked at to its end.
        let preferred = looks.iter().filter(|[truth, turned]| truth > turned).count();
        assert!(10 * preferred >= 9 * looks.len(), "{preferred} of {}", looks.len());
    }
}
