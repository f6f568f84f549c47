//! Votes for the offset between two rows: every fruit of the query laid on every fruit of the map.
//!
//! A generalised Hough transform. For each turn that the principal axes of two rows leave, the offsets of all fruits are
//! counted in cells. Crowns on crowns raise whole regions of them; fruits on fruits raise one.

use super::axes::{HALF_TURNS, MIN_FRUITS, row_axes};
use super::hypothesis::Model;
use super::landscape::Landscape;
use crate::geometry::{Scale, Similarity};
use crate::random::shuffled;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rayon::prelude::*;

/// Pairs of fruits that are counted for each turn, of larger clouds those of some fruits; and pairs of clouds that
/// are left alone: with so few of their fruits too little in common would be asked.
const MOST_PAIRS: [usize; 2] = [60_000, 960_000];

/// Visits to one row show fruits that hang at most so many times as far apart in one as in the other: one fruit in 27. Cells
/// count by the cube of it, so that a query in millimetres would ask for more of them than there is memory.
const ALIKE: f64 = 3.0;

/// Radians between turns that are tried, 3 degrees, and steps either way about the axis across the row and about the one along
/// it: the parts of the crowns that each visit sees tilt its axes by 15 degrees across and 4 along.
const STEP_RAD: f64 = 0.05;
const STEPS: [i32; 2] = [5, 1];

/// Edges of a cell along the row, up and in depth, in spacings: the noise, and what half a step of the turns moves.
const CELL: [f64; 3] = [0.45, 0.45, 0.6];

/// How far rows are laid off each other's middles, in the sum of their standard deviations along each axis: along the row as far
/// as half of them overlap, up by what their crowns' parts differ, in depth by a crown.
const REACHES: [f64; 3] = [1.5, 0.8, 2.0];

/// A cell has 2 to the power of this many parts.
const PARTS_BITS: u32 = 10;

/// Lines of cells, in depth, of a block along the row and up: its mean and that of the blocks around say what crowns on crowns
/// give there.
const BLOCK: [usize; 2] = [4, 4];

/// Standard deviations by which a cell exceeds what crowns on crowns give at the least. More cells do than are looked at, for of a
/// row that is not there these have to show what chance reaches.
const OUTSTANDING: f64 = 4.0;

/// Votes of a cell count four times, and those of the six next to it once.
const WEIGHTS: f64 = 10.0;

/// Votes beside those expected, so that a cell does not stand out by one where none are.
const LEAST_EXPECTED: f64 = 0.3;

/// Two rows, each in the frame of its axes: along, up, in depth.
pub(super) struct Rows {
    axes: [Matrix3<f64>; 2],
    /// Of the query to the map.
    scale: f64,
    /// Of the size that it has in the map.
    query: Vec<Vector3<f64>>,
    /// In parts of a cell, number by number: whole numbers, of which a processor adds many at once.
    map: [Vec<i32>; 3],
    edges: Vector3<f64>,
    /// Cells to either side of no offset, and all of them.
    half: [f32; 3],
    size: [usize; 3],
    blocks: [usize; 2],
}

/// Votes of all cells.
struct Counts {
    /// In the last one what lies outside of all. A cell never has more votes than there are pairs.
    cells: Vec<u16>,
    /// Cells that one fruit votes for.
    voted: Vec<u32>,
}

impl Rows {
    /// `None` where the clouds are no rows, not alike, or too large.
    pub(super) fn new(query: &Landscape, map: &Landscape, scale: Scale) -> Option<Self> {
        let (pairs, [counted, too_many]) = (query.len() * map.len(), MOST_PAIRS);
        let scale = match scale {
            Scale::Metric => 1.0,
            // Visits to the same trees are as long as these.
            Scale::Free => radius(&map.points) / radius(&query.points),
        };
        let spacing = scale * query.spacing;
        let alike = spacing.max(map.spacing) <= ALIKE * spacing.min(map.spacing);
        if !alike || query.len().min(map.len()) < MIN_FRUITS || pairs > too_many {
            return None;
        }
        let axes = [row_axes(query)?, row_axes(map)?];
        let share = (counted as f64 / pairs as f64).sqrt().min(1.0);
        let [query, map_points] =
            [(query, axes[0] * scale), (map, axes[1])].map(|(cloud, axes)| some_of(cloud, &axes, share));
        let edges = Vector3::from(CELL) * map.spacing;
        let reach = |i: usize| REACHES[i] * (extent(&query, i) + extent(&map_points, i)) / edges[i];
        let half = [0, 1, 2].map(|i| reach(i).ceil() as f32 + 1.0);
        let size = half.map(|half| 2 * half as usize + 1);
        let blocks = [0, 1].map(|i| size[i].div_ceil(BLOCK[i]));
        let map = [0, 1, 2].map(|i| map_points.iter().map(|p| parts(p[i] / edges[i])).collect());
        Some(Self { axes, scale, query, map, edges, half, size, blocks })
    }

    /// Poses whose cells stand out, with the standard deviations by which, turn by turn, of those that are admitted.
    pub(super) fn peaks(&self, model: &Model) -> Vec<(f64, Similarity)> {
        let turns: Vec<Matrix3<f64>> =
            turns().filter(|turn| model.admits(&self.placement(turn, &Vector3::zeros()))).collect();
        turns
            .par_iter()
            .map_init(|| self.no_counts(), |counts, turn| self.peaks_of(turn, counts))
            .flatten_iter()
            .collect()
    }

    fn placement(&self, turn: &Matrix3<f64>, offset: &Vector3<f64>) -> Similarity {
        let [query, map] = &self.axes;
        let rotation = Rotation3::from_matrix_unchecked(map * turn * query.transpose());
        Similarity { rotation, translation: map * offset, scale: self.scale }
    }

    fn no_counts(&self) -> Counts {
        let all = self.size.iter().product::<usize>() + 1;
        Counts { cells: vec![0; all], voted: vec![0; self.map[0].len()] }
    }

    fn peaks_of(&self, turn: &Matrix3<f64>, counts: &mut Counts) -> Vec<(f64, Similarity)> {
        self.count(turn, counts);
        let expected = self.expected(&counts.cells);
        // Of whole numbers; more than they hold is beyond every cell.
        let asked = |votes: &f64| (WEIGHTS * (votes + OUTSTANDING * (votes + LEAST_EXPECTED).sqrt())) as u16;
        let asked: Vec<u16> = expected.iter().map(asked).collect();
        let [long, high, deep] = self.size;
        let (mut sums, mut peaks) = (vec![0u16; deep], Vec::new());
        for (x, y) in (1..long - 1).flat_map(|x| (1..high - 1).map(move |y| (x, y))) {
            let line = |x: usize, y: usize| &counts.cells[(x * high + y) * deep..][..deep];
            let [here, before, after, below, above] =
                [line(x, y), line(x - 1, y), line(x + 1, y), line(x, y - 1), line(x, y + 1)];
            // A processor adds many cells at once. Where one has a fourth of all votes the clouds are no rows.
            for z in 1..deep - 1 {
                sums[z] = [before[z], after[z], below[z], above[z], here[z - 1], here[z + 1]]
                    .into_iter()
                    .fold(here[z].wrapping_mul(4), u16::wrapping_add);
            }
            let (asked, expected) = (&asked[self.block(x, y)..], &expected[self.block(x, y)..]);
            for z in (1..deep - 1).filter(|z| sums[*z] > asked[*z]) {
                let (sum, expected) = (f64::from(sums[z]), expected[z]);
                let height = (sum / WEIGHTS - expected) / (expected + LEAST_EXPECTED).sqrt();
                let beside = [[before[z], after[z]], [below[z], above[z]], [here[z - 1], here[z + 1]]];
                let aside = Vector3::from(beside.map(|[less, more]| f64::from(more) - f64::from(less)));
                let cell = Vector3::new(x as f64, y as f64, z as f64) - Vector3::from(self.half.map(f64::from));
                let offset = (cell + aside / sum).component_mul(&self.edges);
                peaks.push((height, self.placement(turn, &offset)));
            }
        }
        peaks
    }

    /// Where in what is expected the block of a line in depth begins.
    fn block(&self, x: usize, y: usize) -> usize {
        (x / BLOCK[0] * self.blocks[1] + y / BLOCK[1]) * self.size[2]
    }

    /// Counts the offsets of all fruits of the map from all of the query.
    fn count(&self, turn: &Matrix3<f64>, Counts { cells, voted }: &mut Counts) {
        cells.fill(0);
        let outside = cells.len() as u32 - 1;
        let [long, high, deep] = self.size.map(|cells| cells as u32);
        let [along, up, depth] = &self.map;
        for p in &self.query {
            let p = turn * p;
            let [x, y, z] = [0, 1, 2].map(|i| parts(f64::from(self.half[i]) + 0.5 - p[i] / self.edges[i]));
            for (((place, a), u), d) in voted.iter_mut().zip(along).zip(up).zip(depth) {
                // What lies below the first cell is beyond the last one as a number without a sign.
                let (along, up, depth) = (cell(a.wrapping_add(x)), cell(u.wrapping_add(y)), cell(d.wrapping_add(z)));
                let inside = along < long && up < high && depth < deep;
                // A cell of its own for those outside: where a fourth are, a processor that guesses is wrong too often.
                *place = if inside { (along * high + up) * deep + depth } else { outside };
            }
            for &place in voted.iter() {
                cells[place as usize] += 1;
            }
        }
    }

    /// Votes that crowns on crowns give the cells of a line in each block: the mean of the lines in it and in the blocks around,
    /// spread in depth as all votes are.
    ///
    /// A canopy is a few cells deep. What its votes fall by from one cell to the next is more than what its fruits add to one, so
    /// that the mean of cells in several depths is no measure of either.
    fn expected(&self, cells: &[u16]) -> Vec<f64> {
        let ([_, high, deep], [along, up]) = (self.size, self.blocks);
        // Whole numbers, of which a processor adds many at once.
        let (mut sums, mut depths) = (vec![0u32; along * up], vec![0u32; deep]);
        for (at, line) in cells.chunks_exact(deep).enumerate() {
            depths.iter_mut().zip(line).for_each(|(depth, &votes)| *depth += u32::from(votes));
            sums[self.block(at / high, at % high) / deep] += line.iter().map(|&votes| u32::from(votes)).sum::<u32>();
        }
        let [mut lines, depths] = [sums, depths].map(|sums| sums.into_iter().map(f64::from).collect::<Vec<f64>>());
        for (stride, count) in [(up, along), (1, up)] {
            smooth(&mut lines, stride, count);
        }
        // Of a mean by these weights, of which a line has eight, two cells have one each.
        let beside = |z: usize| depths.get(z).copied().unwrap_or(0.0);
        let weighed = |z: usize| (8.0 * depths[z] + beside(z.wrapping_sub(1)) + beside(z + 1)) / WEIGHTS;
        let all = depths.iter().sum::<f64>().max(1.0) * BLOCK.iter().product::<usize>() as f64;
        let shares: Vec<f64> = (0..deep).map(|z| weighed(z) / all).collect();
        lines.iter().flat_map(|votes| shares.iter().map(move |share| votes * share)).collect()
    }
}

/// A length in cells as whole parts of one.
fn parts(cells: f64) -> i32 {
    (cells * f64::from(1 << PARTS_BITS)).floor() as i32
}

fn cell(parts: i32) -> u32 {
    (parts >> PARTS_BITS) as u32
}

/// Turns of a row laid along a row, in the frames of their axes.
fn turns() -> impl Iterator<Item = Matrix3<f64>> {
    let [most_across, most_along] = STEPS;
    let steps = |count: i32| (-count..=count).map(|i| f64::from(i) * STEP_RAD);
    let of = move |signs: [f64; 3]| {
        steps(most_across).flat_map(move |across| {
            steps(most_along).map(move |along| {
                let turn = Rotation3::new(Vector3::x() * along) * Rotation3::new(Vector3::z() * across);
                turn.into_inner() * Matrix3::from_diagonal(&Vector3::from(signs))
            })
        })
    };
    HALF_TURNS.into_iter().flat_map(of)
}

/// Mean of each of `count` values a `stride` apart with its neighbours, the own one twice.
fn smooth(values: &mut [f64], stride: usize, count: usize) {
    for values in values.chunks_exact_mut(stride * count) {
        for first in 0..stride {
            let mut before = 0.0;
            for place in (first..values.len()).step_by(stride) {
                let (own, after) = (values[place], values.get(place + stride).copied().unwrap_or(0.0));
                values[place] = 0.25 * (before + 2.0 * own + after);
                before = own;
            }
        }
    }
}

/// Standard deviation along an axis.
fn extent(points: &[Vector3<f64>], axis: usize) -> f64 {
    (points.iter().map(|p| p[axis] * p[axis]).sum::<f64>() / points.len().max(1) as f64).sqrt()
}

/// Root mean square distance from the mean.
fn radius(points: &[Vector3<f64>]) -> f64 {
    (points.iter().map(Vector3::norm_squared).sum::<f64>() / points.len().max(1) as f64).sqrt()
}

/// A share of the fruits in the frame of the axes, in a fixed shuffled order.
fn some_of(cloud: &Landscape, axes: &Matrix3<f64>, share: f64) -> Vec<Vector3<f64>> {
    let mut rows: Vec<u32> = (0..cloud.len() as u32).collect();
    rows.sort_unstable_by_key(|&row| shuffled(u64::from(row)));
    rows.truncate((share * cloud.len() as f64).round() as usize);
    rows.iter().map(|&row| axes.tr_mul(&cloud.points[row as usize])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rows, the map's votes spread as `size` says.
    fn rows(size: [usize; 3]) -> Rows {
        Rows {
            axes: [Matrix3::identity(); 2],
            scale: 1.0,
            query: Vec::new(),
            map: [Vec::new(), Vec::new(), Vec::new()],
            edges: Vector3::repeat(0.1),
            half: size.map(|cells| (cells / 2) as f32),
            size,
            blocks: [0, 1].map(|i| size[i].div_ceil(BLOCK[i])),
        }
    }

    #[test]
    fn what_a_thin_canopy_gives_each_depth_is_expected_there_and_fruits_in_common_are_not() {
        let size @ [long, high, deep] = [32, 24, 7];
        let rows = rows(size);
        // A bell two cells wide.
        let bell = [0u16, 2, 10, 20, 10, 2, 0];
        let mut cells: Vec<u16> = bell.iter().copied().cycle().take(long * high * deep).collect();
        let at = |x: usize, y: usize, z: usize| (x * high + y) * deep + z;
        cells[at(17, 13, 5)] += 9;
        let expected = rows.expected(&cells);
        let seen = |x, y, z| expected[rows.block(x, y) + z];
        for (z, votes) in bell.iter().enumerate().skip(2).take(3) {
            let beside = f64::from(bell[z - 1] + bell[z + 1]);
            let weighed = 0.8 * f64::from(*votes) + 0.1 * beside;
            assert!((seen(10, 10, z) - weighed).abs() < 0.02 * weighed, "{z}");
        }
        assert!((seen(17, 13, 5) - 2.6).abs() < 0.2);
    }
}
