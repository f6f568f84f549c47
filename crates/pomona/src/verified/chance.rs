//! What chance puts at each place of a cloud: the density of strangers, near a fruit and at a distance from one.

use super::layers::denser;
use super::moved::along_the_row;
use crate::neighbours::others::{Neighbours, each_row};
use crate::neighbours::tree::{Tree, single};
use nalgebra::{Matrix3, Vector3};
use std::ops::Range;

/// Kernel estimate at each fruit from its neighbours, half at the width of a cluster, half at that of a branch.
///
/// Fruits hang in clusters: a wrong pose that lays one fruit on a cluster meets its other members for free. The
/// narrow kernel prices that in. And they hang in walls and on wires: a wrong pose that lays a wall on itself, moved along,
/// meets strangers within its thickness. A kernel that is wider than the wall would spread them to where none are, so it
/// is as flat as the cloud around; and where that is not as thin as what they hang on, the cloud moved along itself shows it.
pub(super) fn local_density(points: &[Vector3<f64>], neighbours: &Neighbours, spacing: f64, floor: f64) -> Vec<f64> {
    let sheets = sheets(points, neighbours, spacing);
    let density = each_row(points.len(), |row| {
        let kernels = KERNELS.map(|width| Kernel::new(width * spacing, &sheets[row].flatness));
        let from = |&other: &u32| {
            let apart = points[other as usize] - points[row];
            kernels.iter().map(|kernel| kernel.at(&apart)).sum::<f64>()
        };
        neighbours.of(row).iter().map(from).sum::<f64>() / KERNELS.len() as f64 + floor
    });
    let times = denser(points, neighbours, spacing, &sheets, &density);
    density.iter().map(|density| density * times).collect()
}

/// Widths of the kernels in spacings: of a cluster, and of a branch.
const KERNELS: [f64; 2] = [0.4, 0.8];

/// Thickness of a wall in spacings that noise gives to one that has none.
const LEAST_THICKNESS: f64 = 0.1;

/// Different fruits among the neighbours of a fruit's neighbours, in clouds that have as many.
pub(crate) const SEEN: f64 = 60.0;

/// A Gaussian.
struct Kernel {
    scale: f64,
    precision: Matrix3<f64>,
}

impl Kernel {
    fn new(width: f64, flatness: &Matrix3<f64>) -> Self {
        let precision = Matrix3::identity() / (width * width) + flatness;
        let scale = precision.determinant().sqrt() / (2.0 * std::f64::consts::PI).powf(1.5);
        Self { scale, precision }
    }

    fn at(&self, apart: &Vector3<f64>) -> f64 {
        self.scale * (-0.5 * apart.dot(&(self.precision * apart))).exp()
    }
}

/// Covariances of the kernels at a fruit with so many around it, as they lie from it.
pub(crate) fn kernels_among(around: &[Vector3<f64>], spacing: f64) -> [Matrix3<f64>; 2] {
    let count = around.len().max(1) as f64;
    let mean = around.iter().sum::<Vector3<f64>>() / count;
    let scatter = around.iter().map(|one| (one - mean) * (one - mean).transpose()).sum::<Matrix3<f64>>() / count;
    let sheet = Sheet::seen(&scatter, count.min(SEEN), spacing);
    KERNELS.map(|width| {
        let Kernel { precision, .. } = Kernel::new(width * spacing, &sheet.flatness);
        precision.try_inverse().unwrap_or_else(|| Matrix3::identity() * (width * spacing).powi(2))
    })
}

/// What a cloud looks like around a fruit.
pub(super) struct Sheet {
    /// Inverse covariance of the fruits around, less that of their longest extent: zero where they hang alike in all directions.
    flatness: Matrix3<f64>,
    /// The way in which they extend least.
    pub(super) normal: Vector3<f64>,
}

impl Sheet {
    /// Of the covariance of so many fruits.
    ///
    /// A dozen fruits are flat by chance, so one that hangs alike in all directions, a spacing away, is added to those seen: the
    /// weakest inverse-Wishart prior that has a mean. And noise gives some thickness to a wall that has none.
    fn seen(covariance: &Matrix3<f64>, seen: f64, spacing: f64) -> Self {
        let round = Matrix3::identity() * spacing.powi(2);
        Self::of((covariance * seen + round) / (seen + 1.0) + round * LEAST_THICKNESS.powi(2))
    }

    fn of(covariance: Matrix3<f64>) -> Self {
        let found = covariance.symmetric_eigen();
        let longest = found.eigenvalues.max();
        let flat = found.eigenvalues.map(|extent| 1.0 / extent - 1.0 / longest);
        Self {
            flatness: found.eigenvectors * Matrix3::from_diagonal(&flat) * found.eigenvectors.transpose(),
            normal: found.eigenvectors.column(found.eigenvalues.imin()).into_owned(),
        }
    }
}

/// The sheet around each fruit, from its neighbours and theirs.
fn sheets(points: &[Vector3<f64>], neighbours: &Neighbours, spacing: f64) -> Vec<Sheet> {
    let around = |row: usize| {
        let near = neighbours.of(row);
        let count = near.len().max(1) as f64;
        let mean = near.iter().map(|&other| points[other as usize]).sum::<Vector3<f64>>() / count;
        let spread = |other: &u32| {
            let off = points[*other as usize] - mean;
            off * off.transpose()
        };
        near.iter().map(spread).sum::<Matrix3<f64>>() / count
    };
    let of_each = each_row(points.len(), around);
    // Two dozen fruits show a shape where there is none; those of their neighbours together do not.
    let seen = SEEN.min(points.len() as f64);
    let shape = |row: usize| {
        let near = neighbours.of(row);
        let covariance =
            near.iter().map(|&other| of_each[other as usize]).sum::<Matrix3<f64>>() / near.len().max(1) as f64;
        Sheet::seen(&covariance, seen, spacing)
    };
    each_row(points.len(), shape)
}

/// Expected density of companions at each fruit over the mean, from the number of its neighbours within the spacing.
///
/// Counts scatter more than a Poisson process of one density lets them: branches are crowded or bare. With a gamma
/// distribution of shape k over the places, n neighbours where m are the mean make it (k + n) / (k + m), and
/// var n = m + m^2 / k says what k is.
pub(super) fn crowding(points: &[Vector3<f64>], neighbours: &Neighbours, spacing: f64) -> Vec<f64> {
    let within = |(row, p): (usize, &Vector3<f64>)| {
        let near = |other: &&u32| (points[**other as usize] - p).norm_squared() < spacing * spacing;
        neighbours.of(row).iter().take_while(near).count() as f64
    };
    let counts: Vec<f64> = points.iter().enumerate().map(within).collect();
    let total = counts.len().max(1) as f64;
    let mean = counts.iter().sum::<f64>() / total;
    let variance = counts.iter().map(|n| (n - mean).powi(2)).sum::<f64>() / total;
    // Of counts that scatter no more than Poisson's, or are all none, every place is alike.
    let inverse_shape = ((variance - mean) / (mean * mean)).max(0.0);
    counts.iter().map(|n| (1.0 + inverse_shape * n) / (1.0 + inverse_shape * mean)).collect()
}

/// Width of a bin of distances between fruits, in spacings: 1.1 cm in an orchard.
pub(super) const BIN: f64 = 1.0 / 24.0;

/// The fruits around a fruit by their distance, from the cloud's own pairs.
///
/// Fruits of a cluster keep their distance and crowd beyond it: there is no companion at 3 cm and many at 8 cm. What
/// one visit shows around its own fruits is what chance shows around the fruits of another visit with the same noise.
#[derive(Debug, Clone)]
pub(super) struct Companions {
    bin: f64,
    /// Mean number of fruits within a bin, two bins and so on of a fruit.
    within: Vec<f64>,
}

impl Companions {
    /// Up to 1.5 spacings.
    pub(super) const BINS: usize = 36;

    /// Half the width of what a density is the mean of, in bins: a shell of 3 cm in an orchard.
    const HALF: f64 = 1.5;

    pub(super) fn new(points: &[Vector3<f64>], neighbours: &Neighbours, spacing: f64) -> Self {
        let apart =
            |row: usize| neighbours.of(row).iter().map(move |&other| (points[other as usize] - points[row]).norm());
        Self::counted(spacing, (0..points.len()).flat_map(apart), points.len())
    }

    /// The nearest alone.
    pub(super) fn nearest(points: &[Vector3<f64>], neighbours: &Neighbours, spacing: f64) -> Self {
        let apart = |(row, p): (usize, &Vector3<f64>)| {
            neighbours.of(row).first().map(|&near| (points[near as usize] - p).norm())
        };
        Self::counted(spacing, points.iter().enumerate().filter_map(apart), points.len())
    }

    /// By their distances, from so many places.
    fn counted(spacing: f64, distances: impl Iterator<Item = f64>, places: usize) -> Self {
        let bin = BIN * spacing;
        let mut within = vec![0.0; Self::BINS + 1];
        for distance in distances {
            if let Some(count) = within[1..].get_mut((distance / bin) as usize) {
                *count += 1.0 / places as f64;
            }
        }
        (0..Self::BINS).for_each(|at| within[at + 1] += within[at]);
        Self { bin, within }
    }

    /// The denser of both at each distance, whose bins are alike.
    pub(super) fn or_denser(&self, other: &Self) -> Self {
        let more = self
            .within
            .windows(2)
            .zip(other.within.windows(2))
            .map(|(own, others)| (own[1] - own[0]).max(others[1] - others[0]));
        let within = std::iter::once(0.0).chain(more.scan(0.0, |sum, more| {
            *sum += more;
            Some(*sum)
        }));
        Self { bin: self.bin, within: within.collect() }
    }

    /// As many, but spread in distance as another cloud's are by this `share`, whose lengths are `scale` times as long here.
    ///
    /// Where the other knows of none so far away, its own spread stands.
    pub(super) fn spread_as(&self, other: &Self, scale: f64, share: f64) -> Self {
        let (reach, [own, others]) = self.beside(other, scale);
        if own == 0.0 || others == 0.0 {
            return self.clone();
        }
        let both = |(at, here): (usize, &f64)| {
            let distance = at as f64 * self.bin;
            if distance > reach { *here } else { here + share * (other.up_to(distance / scale) * own / others - here) }
        };
        Self { bin: self.bin, within: self.within.iter().enumerate().map(both).collect() }
    }

    /// As many, but such as keep no distance: nowhere denser than nearer by.
    ///
    /// Those of another tree know nothing of the fruit that hung in its place. Of the densities that fall with the distance this is the
    /// likeliest (Grenander 1956): a shell that is denser than those within is spread over them.
    pub(super) fn keeping_no_distance(&self) -> Self {
        let volume = |bins: &Range<usize>| shell(bins.start as f64, bins.end as f64);
        let fruits = |bins: &Range<usize>| self.within[bins.end] - self.within[bins.start];
        let mut blocks: Vec<Range<usize>> = Vec::new();
        for at in 0..Self::BINS {
            let mut block = at..at + 1;
            while let Some(inner) =
                blocks.pop_if(|inner| fruits(inner) * volume(&block) <= fruits(&block) * volume(inner))
            {
                block.start = inner.start;
            }
            blocks.push(block);
        }
        let evened = |block: Range<usize>| {
            let density = fruits(&block) / volume(&block);
            let start = block.start;
            block.map(move |at| self.within[start] + density * shell(start as f64, (at + 1) as f64))
        };
        Self { bin: self.bin, within: std::iter::once(0.0).chain(blocks.into_iter().flat_map(evened)).collect() }
    }

    /// Fruits around a fruit of the cloud that shows fewer, over those of the other; 1 where either shows none.
    pub(super) fn as_many_as(&self, other: &Self, scale: f64) -> f64 {
        let (_, [own, others]) = self.beside(other, scale);
        if own > 0.0 && others > 0.0 { (own / others).min(others / own) } else { 1.0 }
    }

    /// How far both know of others, and how many either knows of up to there.
    fn beside(&self, other: &Self, scale: f64) -> (f64, [f64; 2]) {
        let reach = Self::BINS as f64 * self.bin.min(other.bin * scale);
        (reach, [self.up_to(reach), other.up_to(reach / scale)])
    }

    /// Mean number of fruits between two distances from a fruit.
    pub(super) fn between(&self, inner: f64, outer: f64) -> f64 {
        self.up_to(outer) - self.up_to(inner)
    }

    /// Fruits per volume at a distance from a fruit.
    pub(super) fn density(&self, distance: f64) -> f64 {
        let half = Self::HALF * self.bin;
        let middle = distance.min(Self::BINS as f64 * self.bin - half);
        let (inner, outer) = ((middle - half).max(0.0), middle + half);
        self.between(inner, outer) / shell(inner, outer)
    }

    fn up_to(&self, distance: f64) -> f64 {
        let place = (distance / self.bin).min(Self::BINS as f64 - 0.001);
        let (at, rest) = (place as usize, place.fract());
        self.within[at] * (1.0 - rest) + self.within[at + 1] * rest
    }
}

/// What a cloud has around the places of its fruits when it is moved along its row: what another tree would have there.
#[derive(Debug, Clone)]
pub(super) struct MovedCompanions {
    pub(super) all: Companions,
    pub(super) nearest: Companions,
}

impl MovedCompanions {
    /// How far it is moved, in spacings: a row's direction, by its fruits, is off by a degree or so.
    const FARTHEST: f64 = 4.0;

    /// Places that tell enough.
    const PLACES: usize = 1000;

    pub(super) fn new(points: &[Vector3<f64>], tree: &Tree, spacing: f64) -> Self {
        let ways = along_the_row(points, spacing, Self::FARTHEST);
        let axis = ways.first().map_or(Vector3::zeros(), Vector3::normalize);
        let ahead = points.iter().map(|p| p.dot(&axis));
        let (first, last) = ahead.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let moved = points.iter().flat_map(|p| ways.iter().map(move |way| p + way));
        // An odd step takes as many ways ahead as back.
        let asked = moved.step_by((points.len() * ways.len() / Self::PLACES) | 1);
        let places: Vec<_> = asked.filter(|place| (first..=last).contains(&place.dot(&axis))).collect();
        let reach = Companions::BINS as f64 * BIN * spacing;
        let around = each_row(places.len(), |row| {
            let mut distances = Vec::new();
            tree.within(&single(&places[row]), reach as f32, |_, d2| distances.push(f64::from(d2).sqrt()));
            distances
        });
        let all = Companions::counted(spacing, around.iter().flatten().copied(), places.len());
        let nearest = around.iter().filter_map(|distances| distances.iter().copied().min_by(f64::total_cmp));
        let nearest = Companions::counted(spacing, nearest, places.len());
        // Nowhere farther off more densely than nearer by: places know nothing of these fruits.
        let [all, nearest] = [all, nearest].map(|found| found.keeping_no_distance());
        Self { all, nearest }
    }
}

/// Volume between two distances from a place.
pub(super) fn shell(inner: f64, outer: f64) -> f64 {
    4.0 / 3.0 * std::f64::consts::PI * (outer.powi(3) - inner.powi(3))
}

/// Gaussian of the distance of every neighbour, as wide as the spacing: a branch's reach.
pub(super) fn kinship(points: &[Vector3<f64>], neighbours: &Neighbours, spacing: f64) -> Vec<f64> {
    let precision = -0.5 / (spacing * spacing);
    let of = |row: usize| {
        neighbours
            .of(row)
            .iter()
            .map(move |&other| (precision * (points[other as usize] - points[row]).norm_squared()).exp())
    };
    (0..points.len()).flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FruitCloud;
    use crate::statistics::upper_median;
    use crate::verified::fixture::Dice;
    use crate::verified::landscape::Landscape;

    /// Median density of fruits spread evenly in a box, over the true one.
    fn seen(count: usize, size: [f64; 3]) -> f64 {
        let mut dice = Dice(3);
        let fruits = (0..count).map(|_| size.map(|length| length * dice.uniform()).into()).collect();
        let mut density = Landscape::new(&FruitCloud::from_positions(fruits)).density;
        upper_median(&mut density) * size.iter().product::<f64>() / count as f64
    }

    #[test]
    fn walls_and_cordons_are_nearly_as_dense_as_they_are() {
        let found = [[2.0, 2.0, 2.0], [5.0, 0.14, 3.0], [60.0, 0.12, 0.12]].map(|size| seen(900, size));
        // 14 and 12 cm are less than the spacings, 18 and 15 cm: round kernels find 0.45 and 0.16.
        for (found, least) in found.into_iter().zip([0.7, 0.6, 0.42]) {
            assert!((least..1.25).contains(&found), "{found}, expected {least} at least");
        }
    }

    #[test]
    fn companions_are_counted_where_they_hang_and_in_full() {
        // Twos, 9 cm apart, half a metre from the next: the sixth neighbour is the spacing, half a metre, a bin 2 cm.
        let fruit = |i: i32| [0.5 * f64::from(i / 2), 0.5 * f64::from(i % 2), 0.0];
        let fruits = (0..40).flat_map(|i| [0.0, 0.09].map(|off| [fruit(i)[0], fruit(i)[1], off].into())).collect();
        let row = Landscape::new(&FruitCloud::from_positions(fruits));
        assert!((0.5..0.52).contains(&row.spacing), "{}", row.spacing);
        assert!((row.companions.between(0.06, 0.11) - 1.0).abs() < 1e-9);
        assert!(row.companions.between(0.0, 0.06) == 0.0 && row.companions.between(0.11, 0.45) == 0.0);
        assert!((row.companions.density(0.09) * shell(0.06, 0.12) - 1.0).abs() < 0.1);
        assert!(row.companions.density(0.3) == 0.0);
    }

    #[test]
    fn companions_are_as_many_as_here_and_spread_as_there() {
        let mut dice = Dice(5);
        let fruits = |count: usize, dice: &mut Dice| {
            (0..count).map(|_| [dice.uniform(), dice.uniform(), dice.uniform()].into()).collect()
        };
        let [dense, sparse] =
            [400, 50].map(|count| Landscape::new(&FruitCloud::from_positions(fruits(count, &mut dice))).companions);
        for (own, other) in [(&dense, &sparse), (&sparse, &dense)] {
            let both = own.spread_as(other, 1.0, 1.0);
            // The denser one knows of none beyond 1.5 of its spacings: there the sparse one's own stand.
            let all = Companions::BINS as f64 * own.bin;
            assert!((both.up_to(all) / own.up_to(all) - 1.0).abs() < 1e-3);
            let reach = Companions::BINS as f64 * own.bin.min(other.bin);
            let share = |cloud: &Companions| cloud.up_to(0.6 * reach) / cloud.up_to(reach);
            assert!((share(&both) - share(other)).abs() < 0.05, "{} {}", share(&both), share(other));
        }
        // Another unit changes nothing.
        let own = dense.spread_as(&dense, 1.0, 0.5);
        assert!((own.up_to(0.1) - dense.up_to(0.1)).abs() < 1e-12);
    }

    #[test]
    fn companions_that_keep_no_distance_fill_the_gap_around_a_fruit_and_are_as_many() {
        // Fruits of a lattice, 10 cm apart: none nearer, six at that distance.
        let fruit = |i: i32| [i % 6, i / 6 % 6, i / 36].map(|at| 0.1 * f64::from(at)).into();
        let own = Landscape::new(&FruitCloud::from_positions((0..216).map(fruit).collect())).companions;
        let another = own.keeping_no_distance();
        let all = Companions::BINS as f64 * own.bin;
        assert!((another.up_to(all) / own.up_to(all) - 1.0).abs() < 1e-9);
        let densities: Vec<f64> = [0.02, 0.04, 0.06, 0.08, 0.1].map(|distance| another.density(distance)).into();
        assert!(own.density(0.05) == 0.0 && densities.is_sorted_by(|near, far| near > far), "{densities:?}");
        // In a bin beyond 10 cm all neighbours are counted, 5 of a fruit in the mean.
        let ball = shell(0.0, (0.1 / own.bin).ceil() * own.bin);
        assert!((own.up_to(0.12) - 5.0).abs() < 1e-9 && (densities[1] * ball / 5.0 - 1.0).abs() < 0.1, "{densities:?}");
    }

    #[test]
    fn a_dozen_fruits_are_less_sure_to_be_flat_than_hundreds() {
        let [many, few] = [900, 12].map(|count| seen(count, [2.0, 2.0, 0.1]) / seen(count, [2.0, 2.0, 2.0]));
        // Without a round fruit beside the twelve it is 0.4.
        assert!(many > 0.8 && few < 0.32, "{many} {few}");
    }
}
