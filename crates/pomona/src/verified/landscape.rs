//! One cloud prepared for verification: its grid, its typical spacing, and what chance predicts at each place.

use super::space::Tree;
use crate::cloud::FruitCloud;
use nalgebra::{Matrix3, Vector3};

/// Neighbours kept per fruit: enough for the seeds (the nearest ten) and for the first look at a hypothesis.
pub(crate) const NEIGHBOURS: usize = 24;

/// Points of one cloud, centred on their mean, with the neighbourhood questions that verification asks.
#[derive(Debug, Clone)]
pub(crate) struct Landscape {
    /// Mean of the cloud, which is the origin of everything below.
    pub(crate) centre: Vector3<f64>,
    /// Row in the cloud of each point: points are in the order of their coordinates, so that the order of the input
    /// changes nothing.
    pub(crate) rows: Vec<u32>,
    /// Positions about the mean, metres.
    pub(crate) points: Vec<Vector3<f64>>,
    /// Covariance of each point, square metres, where the cloud has them.
    pub(crate) covariances: Option<Vec<Matrix3<f64>>>,
    /// The nearest [`NEIGHBOURS`] other fruits of each fruit, nearest first; shorter lists in small clouds.
    pub(crate) neighbours: Vec<Vec<u32>>,
    /// Typical distance to the sixth-nearest fruit: the unit of length of the cloud, metres.
    pub(crate) spacing: f64,
    /// Fruits per cubic metre that chance puts at each fruit, the fruit itself left out.
    pub(crate) density: Vec<f64>,
    /// Floor of the density: a tenth of what the typical spacing gives.
    pub(crate) floor: f64,
    pub(crate) tree: Tree<3>,
    companions: Companions,
    grid: Grid,
    support: Support,
}

impl Landscape {
    pub(crate) fn new(cloud: &FruitCloud) -> Self {
        let count = cloud.len().max(1) as f64;
        let mut rows: Vec<u32> = (0..cloud.len() as u32).collect();
        rows.sort_by(|&a, &b| {
            let [a, b] = [a, b].map(|row| cloud.positions[row as usize]);
            a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
        });
        let centre = rows.iter().fold(Vector3::zeros(), |sum, &row| sum + cloud.positions[row as usize].coords) / count;
        let points: Vec<_> = rows.iter().map(|&row| cloud.positions[row as usize].coords - centre).collect();
        let single: Vec<_> = points.iter().map(single).collect();
        let tree = Tree::new(&single);
        let mut found = Vec::new();
        let mut sixth = Vec::with_capacity(points.len());
        let neighbours: Vec<Vec<u32>> = single
            .iter()
            .enumerate()
            .map(|(row, point)| {
                tree.nearest(point, NEIGHBOURS + 1, &mut found);
                found.retain(|entry| entry.0 as usize != row);
                found.truncate(NEIGHBOURS);
                sixth.push(f64::from(found.get(5).or(found.last()).map_or(0.0, |entry| entry.1)).sqrt());
                found.iter().map(|entry| entry.0).collect()
            })
            .collect();
        let spacing = median(&mut sixth).max(f64::MIN_POSITIVE);
        // Six neighbours within the spacing: their density, were fruits spread evenly.
        let typical = 6.0 / (4.0 / 3.0 * std::f64::consts::PI * spacing.powi(3));
        let floor = 0.1 * typical;
        let density = local_density(&points, &neighbours, spacing, floor);
        let companions = Companions::new(&points, &neighbours, spacing);
        let grid = Grid::new(&points, 0.6 * spacing);
        let support = Support::new(&points, spacing);
        let covariances = cloud.covariances.as_ref().map(|all| rows.iter().map(|&row| all[row as usize]).collect());
        Self { centre, rows, points, covariances, neighbours, spacing, density, floor, tree, companions, grid, support }
    }

    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }

    /// The nearest point within `gate` that `free` admits, with its squared distance.
    #[inline]
    pub(crate) fn nearest(&self, place: &Vector3<f64>, gate: f64, free: impl Fn(u32) -> bool) -> Option<(u32, f64)> {
        let mut best: Option<(u32, f64)> = None;
        let mut limit = gate * gate;
        self.near(place, gate, |row| {
            let d2 = (self.points[row as usize] - place).norm_squared();
            if d2 <= limit && free(row) {
                limit = d2;
                best = Some((row, d2));
            }
        });
        best
    }

    /// Calls `visit` for at least every point within `gate` of `place`; the caller measures.
    #[inline]
    pub(crate) fn near(&self, place: &Vector3<f64>, gate: f64, visit: impl FnMut(u32)) {
        self.grid.near(place, gate, visit);
    }

    /// Other fruits per cubic metre at `distance` from a fruit.
    #[inline]
    pub(crate) fn companions(&self, distance: f64) -> f64 {
        self.companions.at(distance)
    }

    /// Probability in 0..1 that the recording would have shown a fruit at `place`: 1 inside the crowns, 0 beyond.
    #[inline]
    pub(crate) fn support(&self, place: &Vector3<f64>) -> f64 {
        self.support.at(place)
    }
}

#[inline]
pub(crate) fn single(p: &Vector3<f64>) -> [f32; 3] {
    [p.x as f32, p.y as f32, p.z as f32]
}

pub(crate) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Kernel estimate at each fruit from its neighbours, half at the width of a cluster, half at that of a branch.
///
/// Fruits hang in clusters: a wrong pose that lays one fruit on a cluster meets its other members for free. The
/// narrow kernel prices that in.
fn local_density(points: &[Vector3<f64>], neighbours: &[Vec<u32>], spacing: f64, floor: f64) -> Vec<f64> {
    let kernel = |width: f64| {
        let scale = 0.5 / ((2.0 * std::f64::consts::PI).powf(1.5) * width.powi(3));
        (scale, -0.5 / (width * width))
    };
    let (narrow, wide) = (kernel(0.4 * spacing), kernel(0.8 * spacing));
    points
        .iter()
        .zip(neighbours)
        .map(|(p, near)| {
            let sum: f64 = near
                .iter()
                .map(|&other| {
                    let d2 = (points[other as usize] - p).norm_squared();
                    narrow.0 * (narrow.1 * d2).exp() + wide.0 * (wide.1 * d2).exp()
                })
                .sum();
            sum + floor
        })
        .collect()
}

/// The radial density of fruits around a fruit, from the cloud's own pairs.
///
/// Fruits of a cluster keep their distance and crowd beyond it: there is no companion at 3 cm and many at 8 cm. What
/// one visit shows around its own fruits is what chance shows around the fruits of another visit with the same noise.
#[derive(Debug, Clone)]
struct Companions {
    inverse_bin: f64,
    densities: Vec<f64>,
}

impl Companions {
    /// Bins of an eighth of the spacing: 3 cm in an orchard.
    const BINS: usize = 12;
    const BIN: f64 = 0.125;

    fn new(points: &[Vector3<f64>], neighbours: &[Vec<u32>], spacing: f64) -> Self {
        let inverse_bin = 1.0 / (Self::BIN * spacing);
        let mut densities = vec![0.0; Self::BINS];
        for (p, near) in points.iter().zip(neighbours) {
            for &other in near {
                let bin = ((points[other as usize] - p).norm() * inverse_bin) as usize;
                if bin < Self::BINS {
                    densities[bin] += 1.0;
                }
            }
        }
        let shell = 4.0 / 3.0 * std::f64::consts::PI / inverse_bin.powi(3) * points.len().max(1) as f64;
        for (bin, density) in densities.iter_mut().enumerate() {
            let (inner, outer) = (bin as f64, bin as f64 + 1.0);
            *density /= shell * (outer.powi(3) - inner.powi(3));
        }
        Self { inverse_bin, densities }
    }

    /// Linear between the middles of the bins.
    fn at(&self, distance: f64) -> f64 {
        let place = (distance * self.inverse_bin - 0.5).clamp(0.0, Self::BINS as f64 - 1.001);
        let (bin, rest) = (place as usize, place.fract());
        self.densities[bin] * (1.0 - rest) + self.densities[bin + 1] * rest
    }
}

/// A hashed grid: cells hold the rows of their points; any extent, memory in proportion to the points.
#[derive(Debug, Clone)]
struct Grid {
    inverse_cell: f64,
    mask: u64,
    /// Start of each bucket in `rows`, one more than there are buckets.
    starts: Vec<u32>,
    rows: Vec<u32>,
}

impl Grid {
    fn new(points: &[Vector3<f64>], cell: f64) -> Self {
        let buckets = (4 * points.len().max(4)).next_power_of_two();
        let mask = buckets as u64 - 1;
        let inverse_cell = 1.0 / cell;
        let bucket = |p: &Vector3<f64>| hash(cell_of(p, inverse_cell), mask);
        let mut starts = vec![0u32; buckets + 1];
        for p in points {
            starts[bucket(p) + 1] += 1;
        }
        for i in 0..buckets {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut rows = vec![0u32; points.len()];
        for (row, p) in points.iter().enumerate() {
            let slot = &mut next[bucket(p)];
            rows[*slot as usize] = row as u32;
            *slot += 1;
        }
        Self { inverse_cell, mask, starts, rows }
    }

    #[inline]
    fn near(&self, place: &Vector3<f64>, gate: f64, mut visit: impl FnMut(u32)) {
        let reach = Vector3::repeat(gate);
        let low = cell_of(&(place - reach), self.inverse_cell);
        let high = cell_of(&(place + reach), self.inverse_cell);
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let bucket = hash([x, y, z], self.mask);
                    for &row in &self.rows[self.starts[bucket] as usize..self.starts[bucket + 1] as usize] {
                        visit(row);
                    }
                }
            }
        }
    }
}

#[inline]
fn cell_of(p: &Vector3<f64>, inverse_cell: f64) -> [i64; 3] {
    [p.x, p.y, p.z].map(|x| (x * inverse_cell).floor() as i64)
}

#[inline]
fn hash(cell: [i64; 3], mask: u64) -> usize {
    let mixed = (cell[0] as u64)
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add((cell[1] as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F))
        .wrapping_add((cell[2] as u64).wrapping_mul(0x1656_67B1_9E37_79F9));
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 32 & mask) as usize
}

/// Where the cloud has fruits at all, at the resolution of its spacing.
#[derive(Debug, Clone)]
struct Support {
    inverse_cell: f64,
    cells: std::collections::HashMap<[i64; 3], f32, Mixing>,
}

type Mixing = std::hash::BuildHasherDefault<CellHasher>;

/// Hashes a cell by the mixing of the grid: cells are no attack surface, and the answer must not change from run to run.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct CellHasher(u64);

impl std::hash::Hasher for CellHasher {
    fn finish(&self) -> u64 {
        (self.0 ^ (self.0 >> 32)).wrapping_mul(0xBF58_476D_1CE4_E5B9)
    }
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u64(u64::from(byte));
        }
    }
    fn write_i64(&mut self, value: i64) {
        self.write_u64(value as u64);
    }
    fn write_u64(&mut self, value: u64) {
        self.0 = (self.0.rotate_left(21) ^ value).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }
    fn write_usize(&mut self, value: usize) {
        self.write_u64(value as u64);
    }
}

impl Support {
    /// A cell is supported in the measure of the fruits in it and around it: 1 - exp(-count / 2).
    fn new(points: &[Vector3<f64>], spacing: f64) -> Self {
        let inverse_cell = 1.0 / spacing;
        let mut cells: std::collections::HashMap<[i64; 3], f32, Mixing> = std::collections::HashMap::default();
        for p in points {
            let [x, y, z] = cell_of(p, inverse_cell);
            for dx in -1..=1i64 {
                for dy in -1..=1i64 {
                    for dz in -1..=1i64 {
                        let steps = (dx.abs() + dy.abs() + dz.abs()) as i32;
                        *cells.entry([x + dx, y + dy, z + dz]).or_default() += 0.5f32.powi(steps);
                    }
                }
            }
        }
        for value in cells.values_mut() {
            *value = 1.0 - (-*value / 2.0).exp();
        }
        Self { inverse_cell, cells }
    }

    #[inline]
    fn at(&self, place: &Vector3<f64>) -> f64 {
        self.cells.get(&cell_of(place, self.inverse_cell)).map_or(0.0, |&value| f64::from(value))
    }
}
