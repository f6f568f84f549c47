//! Votes for the offset between two rows: every fruit of the query laid on every fruit of the map.
//!
//! A generalised Hough transform. For each turn that the principal axes of two rows leave, the offsets of all fruits are
//! counted in cells. Crowns on crowns raise whole regions of them; fruits on fruits raise one.

use super::landscape::Landscape;
use super::placement::Placement;
use super::seeds::shuffled;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rayon::prelude::*;

/// Fewer fruits have no principal axes to go by.
const MIN_FRUITS: usize = 100;

/// A row is so many times as long as it is high, and as high as it is deep, at the least: else the axes do not say which is
/// which.
const LEAST_RATIO: f64 = 1.2;

/// Pairs of fruits that are counted for each turn; of larger clouds some fruits are taken.
const MOST_PAIRS: usize = 60_000;

/// Clouds with more pairs than this are left alone: with so few of their fruits too little in common would be asked.
const TOO_MANY_PAIRS: usize = 16 * MOST_PAIRS;

/// Steps either way, and their width in radians, of the turns about the axis across the row and about the one along it:
/// the parts of the crowns that each visit sees tilt its axes by 15 degrees across and 4 along.
const ACROSS: (i32, f64) = (6, 0.044);
const ALONG: (i32, f64) = (1, 0.07);

/// Signs of the axes that principal axes leave open, those of turns.
pub(super) const HALF_TURNS: [[f64; 3]; 4] = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];

/// Edges of a cell along the row, up and in depth, in spacings: the noise, and what half a step of the turns moves.
const CELL: [f64; 3] = [0.45, 0.45, 0.6];

/// How far rows are laid off each other's middles, in the sum of their standard deviations along each axis: along the row as far
/// as half of them overlap, up by what their crowns' parts differ, in depth by a crown.
const REACHES: [f64; 3] = [1.5, 0.8, 2.0];

/// A cell has 2 to the power of this many parts.
const PARTS_BITS: u32 = 10;

/// Cells of a block; its mean and that of the blocks around say what crowns on crowns give.
const BLOCK: [usize; 3] = [4, 4, 2];

/// Standard deviations by which a cell exceeds its surroundings at the least.
const OUTSTANDING: f64 = 4.0;

/// Votes that a cell has at the least: a pair of clusters gives two.
const LEAST_VOTES: u16 = 3;

/// Votes of a cell count four times, and those of the six next to it once.
const WEIGHTS: f64 = 10.0;

/// Votes beside those expected, so that a cell does not stand out by one where none are.
const LEAST_EXPECTED: f64 = 0.3;

/// A pose whose cell stands out, by so many standard deviations.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peak {
    pub(super) height: f64,
    pub(super) pose: Placement,
}

/// Two rows, each in the frame of its axes: along, up, in depth.
pub(super) struct Rows {
    axes: [Matrix3<f64>; 2],
    query: Vec<Vector3<f64>>,
    /// In parts of a cell, number by number: whole numbers, of which a processor adds many at once.
    map: [Vec<i32>; 3],
    edges: Vector3<f64>,
    /// Cells to either side of no offset, and all of them.
    half: [f32; 3],
    size: [usize; 3],
    blocks: [usize; 3],
}

/// Votes of all cells, and what is asked of them.
struct Counts {
    /// In the last one what lies outside of all. A cell never has more votes than there are pairs.
    cells: Vec<u16>,
    /// Sums of blocks, each a mean with those around.
    blocks: Vec<f32>,
    /// For each line of blocks in depth, cell by cell: what the weighted votes in and next to a cell must exceed.
    asked: Vec<u16>,
    /// Votes of the lines of one such line of blocks together.
    line: Vec<u16>,
    /// Cells that one fruit votes for.
    voted: Vec<u32>,
}

impl Rows {
    /// `None` where the clouds are no rows, or too large.
    pub(super) fn new(query: &Landscape, map: &Landscape) -> Option<Self> {
        let pairs = query.len() * map.len();
        if query.len().min(map.len()) < MIN_FRUITS || pairs > TOO_MANY_PAIRS {
            return None;
        }
        let axes = [axes_of(query)?, axes_of(map)?];
        let share = (MOST_PAIRS as f64 / pairs as f64).sqrt().min(1.0);
        let [query, map_points] = [(query, &axes[0]), (map, &axes[1])].map(|(cloud, axes)| some_of(cloud, axes, share));
        let edges = Vector3::from(CELL) * map.spacing;
        let reach = |i: usize| REACHES[i] * (extent(&query, i) + extent(&map_points, i)) / edges[i];
        let half = [0, 1, 2].map(|i| reach(i).ceil() as f32 + 1.0);
        let size = half.map(|half| 2 * half as usize + 1);
        let blocks = [0, 1, 2].map(|i| size[i].div_ceil(BLOCK[i]));
        let map = [0, 1, 2].map(|i| map_points.iter().map(|p| parts(p[i] / edges[i])).collect());
        Some(Self { axes, query, map, edges, half, size, blocks })
    }

    /// Poses that stand out, turn by turn, of those that are admitted.
    pub(super) fn peaks(&self, admits: &(impl Fn(&Placement) -> bool + Sync)) -> Vec<Peak> {
        let turns: Vec<Matrix3<f64>> =
            turns().filter(|turn| admits(&self.placement(turn, &Vector3::zeros()))).collect();
        turns
            .par_iter()
            .map_init(|| self.no_counts(), |counts, turn| self.peaks_of(turn, counts))
            .flatten_iter()
            .collect()
    }

    fn placement(&self, turn: &Matrix3<f64>, offset: &Vector3<f64>) -> Placement {
        let [query, map] = &self.axes;
        Placement { rotation: map * turn * query.transpose(), translation: map * offset, scale: 1.0 }
    }

    fn no_counts(&self) -> Counts {
        let ([_, _, deep], [along, up, _]) = (self.size, self.blocks);
        Counts {
            cells: vec![0; self.size.iter().product::<usize>() + 1],
            blocks: vec![0.0; self.blocks.iter().product()],
            asked: vec![0; along * up * deep],
            line: vec![0; deep],
            voted: vec![0; self.map[0].len()],
        }
    }

    fn peaks_of(&self, turn: &Matrix3<f64>, counts: &mut Counts) -> Vec<Peak> {
        self.count(turn, counts);
        self.sum_up(counts);
        self.ask(counts);
        let [long, high, deep] = self.size;
        let mut peaks = Vec::new();
        for (x, y) in (1..long - 1).flat_map(|x| (1..high - 1).map(move |y| (x, y))) {
            let first = (x * high + y) * deep;
            let asked = &counts.asked[(x / BLOCK[0] * self.blocks[1] + y / BLOCK[1]) * deep..][..deep];
            if !self.stands_out(&counts.cells, first, asked) {
                continue;
            }
            for z in 1..deep - 1 {
                let sum = self.weighted(&counts.cells, first + z);
                if sum > asked[z] && counts.cells[first + z] >= LEAST_VOTES {
                    let (height, offset) = self.height(counts, first + z, [x, y, z]);
                    peaks.push(Peak { height, pose: self.placement(turn, &offset) });
                }
            }
        }
        peaks
    }

    /// Counts the offsets of all fruits of the map from all of the query.
    fn count(&self, turn: &Matrix3<f64>, Counts { cells, voted, .. }: &mut Counts) {
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
            voted.iter().for_each(|&place| cells[place as usize] += 1);
        }
    }

    /// Sums of the blocks, each a mean with those around.
    fn sum_up(&self, Counts { cells, blocks: sums, line, .. }: &mut Counts) {
        let ([long, high, deep], [along, up, back]) = (self.size, self.blocks);
        for (i, sums) in sums.chunks_exact_mut(back).enumerate() {
            let [x, y] = [i / up * BLOCK[0], i % up * BLOCK[1]];
            line.fill(0);
            for x in x..long.min(x + BLOCK[0]) {
                let lines = cells[(x * high + y) * deep..].chunks_exact(deep);
                for cells in lines.take(BLOCK[1].min(high - y)) {
                    line.iter_mut().zip(cells).for_each(|(sum, votes)| *sum += votes);
                }
            }
            for (sum, votes) in sums.iter_mut().zip(line.chunks(BLOCK[2])) {
                *sum = f32::from(votes.iter().sum::<u16>());
            }
        }
        for (stride, count) in [(up * back, along), (back, up), (1, back)] {
            smooth(sums, stride, count);
        }
    }

    /// What cells must exceed to stand out of their blocks.
    fn ask(&self, Counts { blocks, asked, .. }: &mut Counts) {
        for (asked, blocks) in asked.chunks_exact_mut(self.size[2]).zip(blocks.chunks_exact(self.blocks[2])) {
            for (asked, &sum) in asked.chunks_mut(BLOCK[2]).zip(blocks) {
                let expected = expected(sum);
                asked.fill((WEIGHTS * (expected + OUTSTANDING * (expected + LEAST_EXPECTED).sqrt())) as u16);
            }
        }
    }

    /// Whether any cell of the line in depth that begins at `first` may have more votes than are asked of it: of many cells
    /// at once, for hardly any has.
    fn stands_out(&self, cells: &[u16], first: usize, asked: &[u16]) -> bool {
        let [_, high, deep] = self.size;
        let most = deep - 2;
        let line = |first: usize| &cells[first..][..most];
        let (here, middle) = (line(first + 1), first + 1);
        let around = [middle - 1, middle + 1, middle - deep, middle + deep, middle - high * deep, middle + high * deep];
        let [a, b, c, d, e, f] = around.map(line);
        let asked = &asked[1..][..most];
        let mut over = 0;
        for z in 0..most {
            let next = [a[z], b[z], c[z], d[z], e[z], f[z]].into_iter().fold(0, u16::saturating_add);
            let twice = here[z].saturating_add(here[z]);
            over |= next.saturating_add(twice).saturating_add(twice).saturating_sub(asked[z]);
        }
        over > 0
    }

    /// Votes of a cell, four times, and of the six next to it.
    fn weighted(&self, cells: &[u16], place: usize) -> u16 {
        let [_, high, deep] = self.size;
        let next = |stride: usize| cells[place - stride].saturating_add(cells[place + stride]);
        let sum = [1, deep, high * deep].map(next).into_iter().fold(0, u16::saturating_add);
        (0..4).fold(sum, |sum, _| sum.saturating_add(cells[place]))
    }

    /// Standard deviations by which a cell with its neighbours exceeds its surroundings, and the offset that it stands for.
    fn height(&self, Counts { cells, blocks, .. }: &Counts, place: usize, at: [usize; 3]) -> (f64, Vector3<f64>) {
        let ([_, high, deep], [_, up, back]) = (self.size, self.blocks);
        let sum = f64::from(self.weighted(cells, place));
        let votes = |place: usize| f64::from(cells[place]);
        let aside = Vector3::from([high * deep, deep, 1]).map(|stride| votes(place + stride) - votes(place - stride));
        let [x, y, z] = [0, 1, 2].map(|i| at[i] / BLOCK[i]);
        let expected = expected(blocks[(x * up + y) * back + z]);
        let height = (sum / WEIGHTS - expected) / (expected + LEAST_EXPECTED).sqrt();
        let cell = Vector3::from_fn(|i, _| at[i] as f64 - f64::from(self.half[i]));
        (height, (cell + aside / sum).component_mul(&self.edges))
    }
}

/// Votes of a cell that the sum of its block, a mean with those around, lets expect.
fn expected(sum: f32) -> f64 {
    f64::from(sum) / BLOCK.iter().product::<usize>() as f64
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
    let steps = |(count, step): (i32, f64)| (-count..=count).map(move |i| f64::from(i) * step);
    let of = move |signs: [f64; 3]| {
        steps(ACROSS).flat_map(move |across| {
            steps(ALONG).map(move |along| {
                let turn = Rotation3::new(Vector3::x() * along) * Rotation3::new(Vector3::z() * across);
                turn.into_inner() * Matrix3::from_diagonal(&Vector3::from(signs))
            })
        })
    };
    HALF_TURNS.into_iter().flat_map(of)
}

/// Mean of each of `count` values a `stride` apart with its neighbours, the own one twice.
fn smooth(values: &mut [f32], stride: usize, count: usize) {
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

/// Principal axes, the longest first, as a proper rotation; `None` where they are no row's.
pub(super) fn axes_of(cloud: &Landscape) -> Option<Matrix3<f64>> {
    let scatter = cloud.points.iter().fold(Matrix3::zeros(), |sum, p| sum + p * p.transpose()) / cloud.len() as f64;
    let eigen = scatter.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let extents = order.map(|i| eigen.eigenvalues[i].max(0.0).sqrt());
    let [along, up] = [order[0], order[1]].map(|i| eigen.eigenvectors.column(i).into_owned());
    let axes = Matrix3::from_columns(&[along, up, along.cross(&up)]);
    let told = extents[0] > LEAST_RATIO * extents[1] && extents[1] > LEAST_RATIO * extents[2];
    (told && axes.iter().all(|x| x.is_finite())).then_some(axes)
}

/// Standard deviation along an axis.
fn extent(points: &[Vector3<f64>], axis: usize) -> f64 {
    (points.iter().map(|p| p[axis] * p[axis]).sum::<f64>() / points.len().max(1) as f64).sqrt()
}

/// A share of the fruits in the frame of the axes, in a fixed shuffled order.
fn some_of(cloud: &Landscape, axes: &Matrix3<f64>, share: f64) -> Vec<Vector3<f64>> {
    let mut rows: Vec<u32> = (0..cloud.len() as u32).collect();
    rows.sort_unstable_by_key(|&row| shuffled(u64::from(row)));
    rows.truncate((share * cloud.len() as f64).round() as usize);
    rows.iter().map(|&row| axes.tr_mul(&cloud.points[row as usize])).collect()
}
