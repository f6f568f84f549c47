//! Exact search among points of a fixed dimension: codes of constellations (5, 8, 11 or 14 numbers) and fruits (3).
//!
//! A balanced k-d tree, sixteen children to a node and up to sixteen points to a leaf (`LANES`). Nodes keep the tight
//! boxes of their children and leaves their points coordinate by coordinate, so that one pass of vector instructions
//! measures all sixteen. Boxes and leaves are stored in single precision, about the middle of the points and over their
//! reach; every candidate that survives is measured again in double precision. The bound that prunes is widened by the largest possible rounding
//! error, so the answer is exact. Of equal distances the smaller row wins, which makes the answer independent of the order
//! of the search.

use rayon::prelude::*;

/// Children of a node and points of a leaf at most: four vectors of four lanes, the width every x86-64 and aarch64 has.
const LANES: usize = 16;
/// Binary splits from a node to its children.
const SPLITS: u32 = LANES.ilog2();
/// Below this many points a subtree is built on one thread; splitting smaller work costs more than it saves.
const PARALLEL_BUILD: usize = 4096;
/// Queries answered in one piece of work.
const QUERIES_PER_TASK: usize = 512;

/// Points nearer to each other than this are one place; its inverse is finite.
const LEAST_REACH: f64 = 1e-300;
/// Coordinates of a query, in reaches, whose squares still add up.
const FARTHEST: f32 = 1e18;

/// A row of the index and its Euclidean distance from the query.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbour {
    /// Row among the indexed points.
    pub row: usize,
    /// Euclidean distance.
    pub distance: f64,
}

/// Exact nearest-neighbour and radius search over points of `D` numbers.
#[derive(Debug, Clone)]
pub struct Index<const D: usize> {
    points: Vec<[f64; D]>,
    /// Row of each place of the leaves; `u32::MAX` pads.
    rows: Vec<[u32; LANES]>,
    leaves: Vec<[[f32; LANES]; D]>,
    /// Inner nodes, the root first, level by level. Child `c` of the `i`-th node of a level is the `16 i + c`-th of the
    /// next; below the last level are the leaves.
    nodes: Vec<Children<D>>,
    /// Where each level starts in `nodes`.
    levels: Vec<usize>,
    middle: [f64; D],
    /// One over the largest distance of a coordinate from the middle: stored coordinates are -1 to 1, whatever the unit.
    per_reach: f64,
}

/// Boxes of the children of a node; absent children have boxes at infinity.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct Children<const D: usize> {
    low: [[f32; LANES]; D],
    high: [[f32; LANES]; D],
}

impl<const D: usize> Children<D> {
    const NONE: Self = Self { low: [[f32::INFINITY; LANES]; D], high: [[f32::INFINITY; LANES]; D] };

    /// Squared distances of a point from the boxes.
    #[inline]
    fn distances_squared(&self, point: &[f32; D]) -> [f32; LANES] {
        let mut sums = [0.0; LANES];
        for ((lows, highs), x) in self.low.iter().zip(&self.high).zip(point) {
            for ((sum, low), high) in sums.iter_mut().zip(lows).zip(highs) {
                let outside = larger(larger(low - x, x - high), 0.0);
                *sum += outside * outside;
            }
        }
        sums
    }

    fn set(&mut self, child: usize, (low, high): ([f32; D], [f32; D])) {
        for d in 0..D {
            (self.low[d][child], self.high[d][child]) = (low[d], high[d]);
        }
    }
}

/// A node to look into, as one number that orders by squared distance: its bits (those of a float that is not negative
/// order as it does), four bits of level, then the place in the level.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Waiting(u64);

impl Waiting {
    #[inline]
    fn new(distance: f32, level: usize, place: u32) -> Self {
        Self(u64::from(distance.to_bits()) << 32 | (level as u64) << 28 | u64::from(place))
    }

    #[inline]
    fn distance(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline]
    fn level(self) -> usize {
        (self.0 >> 28 & 0xf) as usize
    }

    #[inline]
    fn place(self) -> u32 {
        self.0 as u32 & 0x0fff_ffff
    }
}

/// What a search keeps of the points it meets.
trait Keep {
    /// Squared distance beyond which nothing is kept any more.
    fn limit_squared(&self) -> f64;
    fn offer(&mut self, row: u32, distance_squared: f64);
}

struct KeepNearest {
    row: u32,
    distance_squared: f64,
}

impl Keep for KeepNearest {
    fn limit_squared(&self) -> f64 {
        self.distance_squared
    }

    fn offer(&mut self, row: u32, distance_squared: f64) {
        if (distance_squared, row) < (self.distance_squared, self.row) {
            (self.row, self.distance_squared) = (row, distance_squared);
        }
    }
}

struct KeepWithin {
    limit_squared: f64,
    found: Vec<(u32, f64)>,
}

impl Keep for KeepWithin {
    fn limit_squared(&self) -> f64 {
        self.limit_squared
    }

    fn offer(&mut self, row: u32, distance_squared: f64) {
        if distance_squared <= self.limit_squared {
            self.found.push((row, distance_squared));
        }
    }
}

/// The `count` nearest, nearest first.
struct KeepNearestFew {
    count: usize,
    found: Vec<(f64, u32)>,
}

impl Keep for KeepNearestFew {
    fn limit_squared(&self) -> f64 {
        if self.found.len() < self.count { f64::INFINITY } else { self.found[self.count - 1].0 }
    }

    fn offer(&mut self, row: u32, distance_squared: f64) {
        let place = self.found.partition_point(|&kept| kept < (distance_squared, row));
        if place < self.count {
            self.found.truncate(self.count - 1);
            self.found.insert(place, (distance_squared, row));
        }
    }
}

/// A query in the precision of the tree.
struct Probe<'a, const D: usize> {
    exact: &'a [f64; D],
    rounded: [f32; D],
    /// Of the index: from its distances to those of the tree.
    per_reach: f64,
    /// Largest error of a distance between this query and a point or box, see [`Index::probe`].
    slack: f64,
}

impl<const D: usize> Probe<'_, D> {
    /// A single-precision bound that no rounding error lets a kept point exceed.
    fn widen(&self, limit_squared: f64) -> f32 {
        let relative = 1.0 + D as f64 * f64::from(f32::EPSILON);
        let widened = (limit_squared.sqrt() * self.per_reach + self.slack) * relative;
        (widened * widened * relative) as f32
    }
}

impl<const D: usize> Index<D> {
    /// Indexes `points`; rows of answers are rows of `points`.
    ///
    /// # Panics
    /// If a coordinate is not finite or there are 2^31 points or more.
    pub fn new(points: Vec<[f64; D]>) -> Self {
        assert!(points.iter().flatten().all(|x| x.is_finite()), "an indexed coordinate is not finite");
        assert!(points.len() < 1 << 31, "2^31 points or more");
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        let (low, high) = extent(&points, &order);
        let middle: [f64; D] = std::array::from_fn(|d| 0.5 * low[d] + 0.5 * high[d]);
        let reach = (0..D).map(|d| 0.5 * high[d] - 0.5 * low[d]).fold(0.0, f64::max);
        let per_reach = if reach > LEAST_REACH { 1.0 / reach } else { 1.0 };
        let splits = points.len().div_ceil(LANES).next_power_of_two().ilog2();
        split(&points, &mut order, splits);
        let (rows, leaves, nodes, levels) = Default::default();
        let mut index = Self { points, rows, leaves, nodes, levels, middle, per_reach };
        index.fill_leaves(&order, splits);
        index.fill_nodes(splits);
        index
    }

    /// Number of indexed points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether nothing is indexed.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The indexed points, in the order they were given.
    pub fn points(&self) -> &[[f64; D]] {
        &self.points
    }

    fn fill_leaves(&mut self, order: &[u32], splits: u32) {
        let mut ends = Vec::with_capacity(1 << splits);
        leaf_ends(order.len(), splits, 0, &mut ends);
        let mut start = 0;
        for end in ends {
            let mut leaf = [[f32::INFINITY; LANES]; D];
            let mut rows = [u32::MAX; LANES];
            for (place, &row) in order[start..end].iter().enumerate() {
                rows[place] = row;
                let rounded = self.round(&self.points[row as usize]);
                for d in 0..D {
                    leaf[d][place] = rounded[d];
                }
            }
            self.rows.push(rows);
            self.leaves.push(leaf);
            start = end;
        }
    }

    /// All levels but the root have sixteen children to a node; the root takes the splits that are left over.
    fn fill_nodes(&mut self, splits: u32) {
        let depth = splits.div_ceil(SPLITS);
        let mut size = 0;
        for level in 0..depth {
            self.levels.push(size);
            size += 1usize << splits.saturating_sub(SPLITS * (depth - level));
        }
        self.nodes = vec![Children::NONE; size];
        let Some(&last) = self.levels.last() else { return };
        for (i, leaf) in self.leaves.iter().enumerate() {
            self.nodes[last + i / LANES].set(i % LANES, bounds(leaf, leaf));
        }
        for level in (1..depth as usize).rev() {
            let (above, here) = (self.levels[level - 1], self.levels[level]);
            for i in 0..self.levels.get(level + 1).unwrap_or(&size) - here {
                let node = &self.nodes[here + i];
                let around = bounds(&node.low, &node.high);
                self.nodes[above + i / LANES].set(i % LANES, around);
            }
        }
    }

    fn round(&self, point: &[f64; D]) -> [f32; D] {
        // A query beyond the range only seems nearer than it is, which prunes less.
        std::array::from_fn(|d| (((point[d] - self.middle[d]) * self.per_reach) as f32).clamp(-FARTHEST, FARTHEST))
    }

    /// Rounding moves a coordinate of query or point by half an ulp of at most 1 or the query's own, and their difference
    /// by as much again: four ulps per coordinate cover it.
    fn probe<'a>(&self, query: &'a [f64; D]) -> Probe<'a, D> {
        let rounded = self.round(query);
        let largest = rounded.iter().fold(1.0, |largest, x| f64::max(largest, f64::from(x.abs())));
        let slack = 4.0 * largest * f64::from(f32::EPSILON) * (D as f64).sqrt();
        Probe { exact: query, rounded, per_reach: self.per_reach, slack }
    }

    /// The nearest point; `None` where nothing is indexed.
    pub fn nearest(&self, query: &[f64; D]) -> Option<Neighbour> {
        self.nearest_from(query, None)
    }

    /// The nearest point, where `guess` is a row that is probably near.
    fn nearest_from(&self, query: &[f64; D], guess: Option<usize>) -> Option<Neighbour> {
        let mut keep = KeepNearest { row: u32::MAX, distance_squared: f64::INFINITY };
        if let Some(row) = guess {
            keep.offer(row as u32, distance_squared(query, &self.points[row]));
        }
        self.search(query, &mut keep);
        (keep.row != u32::MAX).then(|| Neighbour { row: keep.row as usize, distance: keep.distance_squared.sqrt() })
    }

    /// The nearest point of every query; `None` where nothing is indexed.
    ///
    /// Queries are answered in the order of the tree, so that neighbouring queries share what they touch and the answer
    /// of one bounds the next.
    pub fn nearest_all(&self, queries: &[[f64; D]]) -> Vec<Option<Neighbour>> {
        let mut order: Vec<(u32, u32)> =
            queries.par_iter().enumerate().map(|(i, query)| (self.home(query), i as u32)).collect();
        order.par_sort_unstable();
        let answers: Vec<_> = order
            .par_chunks(QUERIES_PER_TASK)
            .flat_map_iter(|chunk| {
                let mut guess = None;
                chunk.iter().map(move |&(_, i)| {
                    let found = self.nearest_from(&queries[i as usize], guess);
                    guess = found.map(|neighbour| neighbour.row);
                    (i, found)
                })
            })
            .collect();
        let mut sorted = vec![None; queries.len()];
        for (i, found) in answers {
            sorted[i as usize] = found;
        }
        sorted
    }

    /// All points within `radius`, by ascending row.
    pub fn within(&self, query: &[f64; D], radius: f64) -> Vec<Neighbour> {
        let mut keep = KeepWithin { limit_squared: radius * radius, found: Vec::new() };
        self.search(query, &mut keep);
        keep.found.sort_unstable_by_key(|&(row, _)| row);
        keep.found.iter().map(|&(row, d)| Neighbour { row: row as usize, distance: d.sqrt() }).collect()
    }

    /// The `count` nearest points, nearest first; fewer where fewer are indexed.
    pub fn nearest_few(&self, query: &[f64; D], count: usize) -> Vec<Neighbour> {
        if count == 0 {
            return Vec::new();
        }
        let mut keep = KeepNearestFew { count, found: Vec::with_capacity(count + 1) };
        self.search(query, &mut keep);
        keep.found.iter().map(|&(d, row)| Neighbour { row: row as usize, distance: d.sqrt() }).collect()
    }

    /// The leaf that a query falls into.
    fn home(&self, query: &[f64; D]) -> u32 {
        let query = self.round(query);
        self.levels.iter().fold(0, |place, start| {
            let distances = self.nodes[start + place as usize].distances_squared(&query);
            let nearest = (0..LANES).min_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap_or(0);
            place * LANES as u32 + nearest as u32
        })
    }

    /// Depth first, the nearest child first.
    #[inline]
    fn search(&self, query: &[f64; D], keep: &mut impl Keep) {
        let probe = self.probe(query);
        let mut limit = probe.widen(keep.limit_squared());
        // At most fifteen siblings wait at each of the seven levels that 2^31 points fill.
        let mut waiting = [Waiting::default(); 8 * LANES];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (level, place) = (waiting[count].level(), waiting[count].place());
            if waiting[count].distance() > limit {
                continue;
            }
            let Some(start) = self.levels.get(level) else {
                limit = self.scan(place as usize, &probe, limit, keep);
                continue;
            };
            let distances = self.nodes[start + place as usize].distances_squared(&probe.rounded);
            let first = count;
            for child in lanes(below(&distances, limit)) {
                waiting[count] = Waiting::new(distances[child], level + 1, place * LANES as u32 + child as u32);
                count += 1;
            }
            farthest_first(&mut waiting[first..count]);
        }
    }

    /// Measures a leaf; returns the limit after it.
    #[inline]
    fn scan(&self, leaf: usize, probe: &Probe<D>, mut limit: f32, keep: &mut impl Keep) -> f32 {
        let mut sums = [0.0f32; LANES];
        for (coordinates, query) in self.leaves[leaf].iter().zip(&probe.rounded) {
            for (sum, x) in sums.iter_mut().zip(coordinates) {
                let difference = x - query;
                *sum += difference * difference;
            }
        }
        for place in lanes(below(&sums, limit)) {
            if sums[place] <= limit {
                let row = self.rows[leaf][place];
                keep.offer(row, distance_squared(probe.exact, &self.points[row as usize]));
                limit = probe.widen(keep.limit_squared());
            }
        }
        limit
    }
}

/// Bit `i` tells whether lane `i` is within the limit; lanes at infinity are padding and never are.
#[inline]
fn below(distances: &[f32; LANES], limit: f32) -> u32 {
    let limit = if limit < f32::INFINITY { limit } else { f32::MAX };
    let within = distances.map(|distance| u32::from(distance <= limit));
    (0..LANES).fold(0, |bits, lane| bits | within[lane] << lane)
}

/// The lanes whose bit is set, ascending.
#[inline]
fn lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        (bits != 0).then(|| {
            bits &= bits - 1;
            lane
        })
    })
}

/// One instruction, where `f32::max` takes four to treat NaN.
#[inline]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Sorts the few that survive the bound by exchanges without branches.
#[inline]
fn farthest_first(nodes: &mut [Waiting]) {
    for i in 1..nodes.len() {
        for j in (1..=i).rev() {
            let (a, b) = (nodes[j - 1], nodes[j]);
            (nodes[j - 1], nodes[j]) = (a.max(b), a.min(b));
        }
    }
}

/// Least and greatest of each coordinate, without the padding at infinity.
fn bounds<const D: usize>(lows: &[[f32; LANES]; D], highs: &[[f32; LANES]; D]) -> ([f32; D], [f32; D]) {
    let side = |all: &[[f32; LANES]; D], start: f32, pick: fn(f32, f32) -> f32| {
        all.each_ref().map(|xs| xs.iter().copied().filter(|x| x.is_finite()).fold(start, pick))
    };
    (side(lows, f32::INFINITY, f32::min), side(highs, f32::NEG_INFINITY, f32::max))
}

fn distance_squared<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    (0..D).map(|d| (a[d] - b[d]) * (a[d] - b[d])).sum()
}

/// Smallest and largest coordinates of the rows `order`; zeros where there are none.
fn extent<const D: usize>(points: &[[f64; D]], order: &[u32]) -> ([f64; D], [f64; D]) {
    let first = order.first().map_or([0.0; D], |&row| points[row as usize]);
    let (mut low, mut high) = (first, first);
    for &row in order {
        let point = &points[row as usize];
        for d in 0..D {
            low[d] = low[d].min(point[d]);
            high[d] = high[d].max(point[d]);
        }
    }
    (low, high)
}

/// Orders rows such that every subtree is contiguous; halves along the widest side, ties by row.
fn split<const D: usize>(points: &[[f64; D]], order: &mut [u32], levels: u32) {
    if levels == 0 {
        return;
    }
    let (low, high) = extent(points, order);
    let widest = (0..D).max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b]))).unwrap_or(0);
    let half = order.len() / 2;
    if half > 0 {
        order.select_nth_unstable_by(half, |&a, &b| {
            points[a as usize][widest].total_cmp(&points[b as usize][widest]).then(a.cmp(&b))
        });
    }
    let (left, right) = order.split_at_mut(half);
    if left.len() > PARALLEL_BUILD {
        rayon::join(|| split(points, left, levels - 1), || split(points, right, levels - 1));
    } else {
        split(points, left, levels - 1);
        split(points, right, levels - 1);
    }
}

/// Where the leaves end after [`split`] of `n` rows.
fn leaf_ends(n: usize, levels: u32, start: usize, ends: &mut Vec<usize>) {
    if levels == 0 {
        ends.push(start + n);
    } else {
        leaf_ends(n / 2, levels - 1, start, ends);
        leaf_ends(n - n / 2, levels - 1, start + n / 2, ends);
    }
}
