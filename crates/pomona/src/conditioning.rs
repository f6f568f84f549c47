//! A cloud as the methods see it: every fruit once, no strays, about its own middle, in one unit where the scale is free.
//!
//! A match must not depend on where the origin of a cloud lies, on how its axes are turned, in which unit a reconstruction
//! came, on a row that is there twice or on one that lies a thousand kilometres away. So both clouds are conditioned before any method sees
//! them, and the answer is put back into the caller's rows, frames and units:
//!
//! 1. Fruits at exactly one place are one fruit; the first row stands for all.
//! 2. The spacing is the median, over a sample of the fruits, of the distance to the sixth-nearest.
//! 3. What lies beyond [`REACH`] spacings of the bulk of the sample, or has fewer than six others within [`ISOLATED`]
//!    spacings, is a stray: no constellation holds it, and it shall set no extent, no grid and no middle.
//! 4. Where more than [`CROWD`] share a cell of one spacing, which no plant bears, that many are kept: what is near each
//!    other is compared with each other, and a heap of thousands would take hours.
//! 5. What is left is moved to its mean; where the scale is free it is also scaled to one spacing.
//! 6. It is turned into its principal axes, the longest first, each the way in which it reaches farther: so cells and the order
//!    of fruits are the cloud's own, and a row lies in one layer of cells.

use crate::answer::{Match, Pair, Registration};
use crate::cloud::{FruitCloud, Views};
use crate::error::{Error, Result};
use crate::geometry::{Scale, Similarity};
use crate::neighbours::cells::{CellKey, CellMap};
use crate::statistics::upper_median;
use nalgebra::{Matrix3, Point3, Rotation3, Vector3};

/// Fruits whose spacing is measured: enough for a median that up to fifteen strays among them do not touch.
const SAMPLE: usize = 32;

/// Which neighbour measures the spacing: as the verified method does.
const NEIGHBOUR: usize = 6;

/// Spacings from the bulk of the cloud within which an orchard lies: 27 km.
const REACH: f64 = 1e5;

/// Spacings within which a fruit that is no stray has others: 13 m, more than the gap that a missing tree leaves.
const ISOLATED: f64 = 50.0;

/// Fruits of one cell of a spacing's edge at the most. Fruits hang there by six, stars of a cluster by fifty.
const CROWD: usize = 100;

/// Spacing after conditioning where the scale is free, metres: that of an orchard, for which the lengths of the settings
/// are chosen.
const SPACING_M: f64 = 0.27;

/// Spacings of a cloud in metres, and ratios of two, beyond which no arithmetic and no match makes sense.
const LARGEST: f64 = 1e6;

/// A conditioned cloud with the way back.
#[derive(Debug, Clone)]
pub(crate) struct Conditioned {
    /// Fruits in the order of their coordinates.
    pub(crate) cloud: FruitCloud,
    /// The caller's row of each fruit.
    rows: Vec<usize>,
    /// Fruits of the caller's cloud.
    given: usize,
    /// The origin in the caller's frame.
    middle: Vector3<f64>,
    /// The axes in the caller's frame.
    axes: Rotation3<f64>,
    /// The unit of length in the caller's.
    unit: f64,
    /// Median distance to the sixth-nearest fruit, in the unit.
    spacing: f64,
}

impl Conditioned {
    /// Conditions a cloud that is valid; where its fruits have no spacing that numbers hold, none is left.
    pub(crate) fn new(cloud: &FruitCloud, scale: Scale) -> Self {
        let (distinct, first_of) = distinct(&cloud.positions);
        let sample = Sample::new(&cloud.positions, &distinct);
        let measurable = match scale {
            Scale::Metric => 1.0 / LARGEST..LARGEST,
            Scale::Free => f64::MIN_POSITIVE.sqrt()..f64::MAX.sqrt(),
        };
        let is_measurable = measurable.contains(&sample.spacing);
        let rows = if is_measurable { sample.kept(&cloud.positions, &distinct) } else { Vec::new() };
        // Measured again: what was left out shall not touch the unit either.
        let spacing = Sample::new(&cloud.positions, &rows).spacing;
        let unit = match scale {
            Scale::Metric => 1.0,
            Scale::Free => spacing / SPACING_M,
        };
        let middle = middle(&cloud.positions, &rows);
        Self {
            cloud: moved(cloud, &rows, &first_of, &middle, unit),
            given: cloud.len(),
            rows,
            middle,
            axes: Rotation3::identity(),
            unit,
            spacing: spacing / unit,
        }
    }

    /// What is known of the conditioned fruits, in the caller's rows; `other` where one has no part.
    pub(crate) fn given_rows<T: Copy>(&self, of_fruits: &[T], other: T) -> Vec<T> {
        let mut all = vec![other; self.given];
        self.rows.iter().zip(of_fruits).for_each(|(&row, &one)| all[row] = one);
        all
    }

    /// Turned into its principal axes.
    #[must_use]
    pub(crate) fn turned(mut self) -> Self {
        self.axes = principal_axes(&self.cloud.positions);
        for p in &mut self.cloud.positions {
            *p = self.axes.inverse_transform_point(p);
        }
        let axes = self.axes.matrix();
        for covariance in self.cloud.covariances.iter_mut().flatten() {
            *covariance = axes.tr_mul(&(*covariance * axes));
        }
        self
    }

    /// The same of a cloud that was conditioned before: its `rows`, about `middle`; the scale is metric.
    pub(crate) fn again(cloud: &FruitCloud, rows: Vec<usize>, middle: Vector3<f64>, spacing: f64) -> Self {
        let first_of: Vec<usize> = (0..cloud.len()).collect();
        let (axes, unit) = (Rotation3::identity(), 1.0);
        Self {
            cloud: moved(cloud, &rows, &first_of, &middle, unit),
            given: cloud.len(),
            rows,
            middle,
            axes,
            unit,
            spacing,
        }
    }

    /// Puts its fruits into another order.
    pub(crate) fn reorder(&mut self, order: &[usize]) {
        self.cloud = self.cloud.select(order);
        self.rows = order.iter().map(|&at| self.rows[at]).collect();
    }

    pub(crate) fn rows(&self) -> &[usize] {
        &self.rows
    }

    pub(crate) fn middle(&self) -> Vector3<f64> {
        self.middle
    }

    pub(crate) fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Copies, strays and what crowds: they take no part.
    pub(crate) fn left_out(&self) -> usize {
        self.given - self.rows.len()
    }

    /// Whether fruits of the two could lie as far apart as each other; clouds without fruits could.
    pub(crate) fn is_comparable(&self, other: &Self) -> bool {
        self.rows.is_empty()
            || other.rows.is_empty()
            || (1.0 / LARGEST.sqrt()..LARGEST.sqrt()).contains(&(self.spacing / other.spacing))
    }

    /// The noise of two visits to this map in the unit.
    ///
    /// # Errors
    /// It exceeds the spacing: then any fruit could be any of its neighbours.
    pub(crate) fn noise(&self, noise_m: Option<f64>) -> Result<Option<f64>> {
        let most_m = self.spacing * self.unit;
        match noise_m {
            Some(found) if !self.rows.is_empty() && found > most_m => {
                let reason =
                    format!("found {found} m, expected at most {most_m:.3} m, the spacing of the map's fruits");
                Err(Error::Request { name: "noise_m", reason })
            }
            _ => Ok(noise_m.map(|noise_m| noise_m / self.unit)),
        }
    }

    /// A pose between the callers' frames, between the conditioned ones; `self` is the map.
    pub(crate) fn conditioned_pose(&self, query: &Self, pose: &Similarity) -> Similarity {
        self.outward().inverse().compose(pose).compose(&query.outward())
    }

    /// A pose between the conditioned clouds, between the callers' frames; `self` is the map.
    pub(crate) fn restored_pose(&self, query: &Self, pose: &Similarity) -> Similarity {
        self.outward().compose(pose).compose(&query.outward().inverse())
    }

    /// An answer between conditioned clouds in the callers' rows, frames and units; `self` is the map.
    pub(crate) fn restored(&self, query: &Self, found: Match) -> Match {
        let pose = |found: Registration| Registration {
            map_from_query: self.restored_pose(query, &found.map_from_query),
            ..found
        };
        let pair = |pair: Pair| Pair {
            query: query.rows[pair.query],
            map: self.rows[pair.map],
            distance_m: pair.distance_m * self.unit,
            ..pair
        };
        let mut pairs: Vec<Pair> = found.pairs.into_iter().map(pair).collect();
        pairs.sort_unstable_by_key(|pair| pair.query);
        Match {
            registration: found.registration.map(pose),
            further: found.further.into_iter().map(pose).collect(),
            alternatives: found.alternatives.into_iter().map(pose).collect(),
            pairs,
            noise_m: found.noise_m * self.unit,
            ..found
        }
    }

    /// Takes conditioned places into the caller's frame.
    pub(crate) fn outward(&self) -> Similarity {
        Similarity { rotation: self.axes, translation: self.middle, scale: self.unit }
    }

    /// A direction of the caller's frame between conditioned places.
    pub(crate) fn direction(&self, of_caller: &Vector3<f64>) -> Vector3<f64> {
        self.axes.inverse_transform_vector(of_caller)
    }
}

/// The first row at every place, in the order of coordinates; and for every row, the first at its place.
fn distinct(positions: &[Point3<f64>]) -> (Vec<usize>, Vec<usize>) {
    // Zero has two signs, and they are one place.
    let key = |row: usize| positions[row].coords.map(|x| x + 0.0);
    let mut order: Vec<usize> = (0..positions.len()).collect();
    order.sort_unstable_by(|&a, &b| {
        let (at, other) = (key(a), key(b));
        let along = |axis: usize| at[axis].total_cmp(&other[axis]);
        along(0).then(along(1)).then(along(2)).then(a.cmp(&b))
    });
    let mut first_of = vec![0; positions.len()];
    for place in order.chunk_by(|&a, &b| key(a) == key(b)) {
        for &row in place {
            first_of[row] = place[0];
        }
    }
    order.retain(|&row| first_of[row] == row);
    (order, first_of)
}

/// The spacing of a cloud, and where its bulk is.
struct Sample {
    /// Others that a fruit should have near it: six, or half of a cloud that is smaller than twelve.
    others: usize,
    /// Infinite or zero where fruits are too far apart for numbers, or too few.
    spacing: f64,
    bulk: Point3<f64>,
}

impl Sample {
    fn new(positions: &[Point3<f64>], rows: &[usize]) -> Self {
        let others = NEIGHBOUR.min(rows.len() / 2);
        let stride = rows.len().div_ceil(SAMPLE).max(1);
        let sampled: Vec<Point3<f64>> = rows.iter().step_by(stride).map(|&row| positions[row]).collect();
        let mut distances = vec![0.0; rows.len()];
        let mut nearest: Vec<f64> = sampled
            .iter()
            .map(|p| {
                distances.iter_mut().zip(rows).for_each(|(distance, &row)| *distance = (positions[row] - p).norm());
                *distances.select_nth_unstable_by(others, f64::total_cmp).1
            })
            .collect();
        let spacing = upper_median(&mut nearest);
        let around = |p: &Point3<f64>| sampled.iter().filter(|other| (*other - p).norm() <= REACH * spacing).count();
        // Of equals the first.
        let bulk = sampled.iter().rev().max_by_key(|p| around(p)).copied().unwrap_or_default();
        Self { others, spacing, bulk }
    }

    /// The fruits that take part, in the order of `rows`.
    fn kept(&self, positions: &[Point3<f64>], rows: &[usize]) -> Vec<usize> {
        let within = |row: &usize| (positions[*row] - self.bulk).norm() <= REACH * self.spacing;
        let near: Vec<usize> = rows.iter().copied().filter(within).collect();
        self.uncrowded(positions, &self.in_company(positions, &near))
    }

    /// Those that have enough others within [`ISOLATED`] spacings.
    fn in_company(&self, positions: &[Point3<f64>], rows: &[usize]) -> Vec<usize> {
        let far = ISOLATED * self.spacing;
        // Fruits of one cell are within `far` of each other.
        let cells = Cells::new(positions, rows, &self.bulk, far / 3f64.sqrt());
        let has_others = |row: usize| {
            let is_near = |other: &&usize| (positions[**other] - positions[row]).norm() <= far;
            let own = cells.of(row);
            cells.rows[&own].len() > self.others
                || cells.around(own).filter(is_near).take(self.others + 1).count() > self.others
        };
        rows.iter().copied().filter(|&row| has_others(row)).collect()
    }

    /// At most [`CROWD`] of those that share a cell of one spacing, evenly in the order of `rows`.
    fn uncrowded(&self, positions: &[Point3<f64>], rows: &[usize]) -> Vec<usize> {
        let cells = Cells::new(positions, rows, &self.bulk, self.spacing);
        let is_taken = |row: usize| {
            let mates = &cells.rows[&cells.of(row)];
            let stride = mates.len().div_ceil(CROWD);
            stride == 1 || mates.iter().step_by(stride).any(|&mate| mate == row)
        };
        rows.iter().copied().filter(|&row| is_taken(row)).collect()
    }
}

/// Fruits by the cell of a grid that they lie in.
struct Cells<'a> {
    positions: &'a [Point3<f64>],
    origin: &'a Point3<f64>,
    edge: f64,
    rows: CellMap<Vec<usize>>,
}

impl<'a> Cells<'a> {
    fn new(positions: &'a [Point3<f64>], rows: &[usize], origin: &'a Point3<f64>, edge: f64) -> Self {
        let mut cells = Self { positions, origin, edge, rows: CellMap::default() };
        for &row in rows {
            let cell = cells.of(row);
            cells.rows.entry(cell).or_default().push(row);
        }
        cells
    }

    fn of(&self, row: usize) -> CellKey {
        let p = (self.positions[row] - self.origin) / self.edge;
        [p.x, p.y, p.z].map(|x| x.floor() as i64)
    }

    /// Fruits up to two cells away.
    fn around(&self, [x, y, z]: CellKey) -> impl Iterator<Item = &usize> {
        let steps = || -2..=2i64;
        let cells =
            steps().flat_map(move |dx| steps().flat_map(move |dy| steps().map(move |dz| [x + dx, y + dy, z + dz])));
        cells.filter_map(|cell| self.rows.get(&cell)).flatten()
    }
}

fn middle(positions: &[Point3<f64>], rows: &[usize]) -> Vector3<f64> {
    let Some(&first) = rows.first() else { return Vector3::zeros() };
    // About one of them: the sum of a thousand coordinates of 5,000 km would lose their last digits.
    let origin = positions[first];
    let sum: Vector3<f64> = rows.iter().map(|&row| positions[row] - origin).sum();
    origin.coords + sum / rows.len() as f64
}

/// The principal axes of places about their mean as a proper rotation, the longest first. The first two point where the third
/// moment is above zero, which no turn of the frame changes.
fn principal_axes(positions: &[Point3<f64>]) -> Rotation3<f64> {
    let scatter: Matrix3<f64> = positions.iter().map(|p| p.coords * p.coords.transpose()).sum();
    let eigen = scatter.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let [along, up] = [order[0], order[1]].map(|i| {
        let axis = eigen.eigenvectors.column(i).into_owned();
        let third: f64 = positions.iter().map(|p| axis.dot(&p.coords).powi(3)).sum();
        if third < 0.0 { -axis } else { axis }
    });
    let axes = Matrix3::from_columns(&[along, up, along.cross(&up)]);
    if axes.iter().all(|x| x.is_finite()) { Rotation3::from_matrix_unchecked(axes) } else { Rotation3::identity() }
}

fn moved(cloud: &FruitCloud, rows: &[usize], first_of: &[usize], middle: &Vector3<f64>, unit: f64) -> FruitCloud {
    let mut moved = cloud.select(rows);
    for p in &mut moved.positions {
        *p = Point3::from((p.coords - middle) / unit);
    }
    for covariance in moved.covariances.iter_mut().flatten() {
        *covariance /= unit * unit;
    }
    moved.views = cloud.views.as_ref().map(|views| views_of(views, rows, first_of));
    moved
}

/// Sightings of the rows that are left, a copy's as those of the row that stands for it.
fn views_of(views: &Views, rows: &[usize], first_of: &[usize]) -> Views {
    let mut place = vec![None; first_of.len()];
    rows.iter().enumerate().for_each(|(at, &row)| place[row] = Some(at));
    let seen = views.frames.iter().zip(&views.fruits);
    let (frames, fruits) = seen.filter_map(|(&frame, &row)| Some((frame, place[first_of[row]]?))).unzip();
    Views { frames, fruits }
}
