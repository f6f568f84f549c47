//! Sparse linear assignment with the option to leave rows and columns alone.
//!
//! Successive shortest augmenting paths with potentials (Jonker and Volgenant, 1987) on the stored edges only. Every row
//! also owns an edge of gain 0 to "unmatched", so that a partner is never forced: an edge is used only where it raises
//! the total. A cost of leaving two fruits unmatched is added to the gain of the edge that would join them.
//!
//! A search never leaves the connected component it starts in, so the work is that of solving each component alone.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A partner for every row, or `None`, such that the summed gain is largest.
///
/// `edges` are `(row, column, gain)`; of repeated edges the best counts; edges with a gain of zero or less, or without a
/// finite gain, are never used. The order of `edges` does not matter. Optimal up to rounding of the sums of gains.
///
/// # Panics
/// If an edge names a row or column beyond the last.
pub fn assign(n_rows: usize, n_cols: usize, edges: &[(usize, usize, f64)]) -> Vec<Option<usize>> {
    let mut solver = Solver::new(n_rows, n_cols, edges);
    for row in 0..n_rows {
        solver.insert(row);
    }
    solver.col_of_row
}

/// Distance of a column in the search; ordered by distance, then column.
#[derive(PartialEq)]
struct Reach(f64, usize);

impl Eq for Reach {}

impl Ord for Reach {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

impl PartialOrd for Reach {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Where a shortest augmenting path ends.
#[derive(Clone, Copy)]
enum End {
    /// A row gives up its column, or never gets one.
    Unmatched(usize),
    /// A column without a row.
    Free(usize),
}

/// Costs are negated gains. Invariant: `cost - u[row] - v[col] >= 0` on every edge of an inserted row, with equality on
/// matched edges; `v` of free columns and of "unmatched" is 0.
struct Solver {
    /// Edges of row `r`: `starts[r]..starts[r + 1]` of `edges`.
    starts: Vec<usize>,
    edges: Vec<(usize, f64)>,
    u: Vec<f64>,
    v: Vec<f64>,
    col_of_row: Vec<Option<usize>>,
    row_of_col: Vec<Option<usize>>,
    /// Distance of a column in the running search, infinite where not reached.
    reach: Vec<f64>,
    /// The row through which a column was reached.
    parent: Vec<usize>,
    reached: Vec<usize>,
}

impl Solver {
    fn new(n_rows: usize, n_cols: usize, edges: &[(usize, usize, f64)]) -> Self {
        let mut useful: Vec<_> = edges.iter().copied().filter(|e| e.2 > 0.0 && e.2.is_finite()).collect();
        useful.sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(b.2.total_cmp(&a.2)));
        useful.dedup_by_key(|edge| (edge.0, edge.1));
        let starts = (0..=n_rows).map(|row| useful.partition_point(|edge| edge.0 < row)).collect();
        assert!(useful.iter().all(|edge| edge.0 < n_rows && edge.1 < n_cols), "an edge lies outside the matrix");
        Self {
            starts,
            edges: useful.into_iter().map(|(_, col, gain)| (col, -gain)).collect(),
            u: vec![0.0; n_rows],
            v: vec![0.0; n_cols],
            col_of_row: vec![None; n_rows],
            row_of_col: vec![None; n_cols],
            reach: vec![f64::INFINITY; n_cols],
            parent: vec![usize::MAX; n_cols],
            reached: Vec::new(),
        }
    }

    fn edges_of(&self, row: usize) -> &[(usize, f64)] {
        &self.edges[self.starts[row]..self.starts[row + 1]]
    }

    /// Adds a row and restores optimality over all rows so far.
    fn insert(&mut self, row: usize) {
        self.u[row] = self.edges_of(row).iter().map(|&(col, cost)| cost - self.v[col]).fold(0.0, f64::min);
        let (end, length, settled) = self.shortest_path(row);
        self.raise_potentials(row, length, &settled);
        self.flip(row, end);
        for col in self.reached.drain(..) {
            self.reach[col] = f64::INFINITY;
        }
    }

    /// Dijkstra over alternating paths; returns the end, its distance and the columns settled before it.
    fn shortest_path(&mut self, start: usize) -> (End, f64, Vec<usize>) {
        let mut heap = BinaryHeap::new();
        let mut settled = Vec::new();
        let (mut row, mut distance) = (start, 0.0);
        let mut end = End::Unmatched(start);
        let mut shortest = f64::INFINITY;
        loop {
            let unmatched = distance - self.u[row];
            if unmatched < shortest {
                (end, shortest) = (End::Unmatched(row), unmatched);
            }
            for edge in self.starts[row]..self.starts[row + 1] {
                let (col, cost) = self.edges[edge];
                let through = distance + (cost - self.u[row] - self.v[col]).max(0.0);
                if through < self.reach[col] && through < shortest {
                    if self.reach[col].is_infinite() {
                        self.reached.push(col);
                    }
                    self.reach[col] = through;
                    self.parent[col] = row;
                    heap.push(Reverse(Reach(through, col)));
                }
            }
            let next = loop {
                match heap.pop() {
                    Some(Reverse(Reach(d, col))) if d > self.reach[col] => {}
                    Some(Reverse(Reach(d, col))) if d < shortest => break Some((d, col)),
                    _ => break None,
                }
            };
            let Some((d, col)) = next else { return (end, shortest, settled) };
            let Some(owner) = self.row_of_col[col] else { return (End::Free(col), d, settled) };
            settled.push(col);
            (row, distance) = (owner, d);
        }
    }

    fn raise_potentials(&mut self, start: usize, length: f64, settled: &[usize]) {
        self.u[start] += length;
        for &col in settled {
            let slack = length - self.reach[col];
            self.v[col] -= slack;
            if let Some(owner) = self.row_of_col[col] {
                self.u[owner] += slack;
            }
        }
    }

    /// Swaps matched and unmatched edges along the path from `start` to `end`.
    fn flip(&mut self, start: usize, end: End) {
        let mut col = match end {
            End::Free(col) => col,
            End::Unmatched(row) => match self.col_of_row[row].take() {
                Some(col) => col,
                None => return,
            },
        };
        loop {
            let row = self.parent[col];
            self.row_of_col[col] = Some(row);
            let previous = self.col_of_row[row].replace(col);
            match previous {
                Some(freed) if row != start => col = freed,
                _ => return,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Largest total by trying everything.
    fn best_total(row: usize, n_rows: usize, used: u32, edges: &[(usize, usize, f64)]) -> f64 {
        if row == n_rows {
            return 0.0;
        }
        let taken = edges
            .iter()
            .filter(|e| e.0 == row && used & (1 << e.1) == 0 && e.2 > 0.0)
            .map(|e| e.2 + best_total(row + 1, n_rows, used | (1 << e.1), edges));
        taken.fold(best_total(row + 1, n_rows, used, edges), f64::max)
    }

    /// Total of an assignment; fails where a column is used twice or an edge does not exist.
    fn total(found: &[Option<usize>], edges: &[(usize, usize, f64)]) -> f64 {
        let mut used = std::collections::BTreeSet::new();
        let gain = |(row, col): (usize, usize)| {
            assert!(used.insert(col), "column {col} is used twice");
            let gains = edges.iter().filter(|e| (e.0, e.1) == (row, col)).map(|e| e.2);
            gains.reduce(f64::max).expect("the edge exists")
        };
        found.iter().enumerate().filter_map(|(row, col)| Some((row, (*col)?))).map(gain).sum()
    }

    proptest! {
        #[test]
        fn as_good_as_trying_everything(
            edges in prop::collection::vec((0..6usize, 0..7usize, -1.0..5.0f64), 0..26),
            whole in any::<bool>(),
        ) {
            // Whole numbers make ties.
            let round = |gain: f64| if whole { gain.round() } else { gain };
            let edges: Vec<_> = edges.into_iter().map(|(r, c, gain)| (r, c, round(gain))).collect();
            let found = assign(6, 7, &edges);
            prop_assert!((total(&found, &edges) - best_total(0, 6, 0, &edges)).abs() < 1e-9);
            let mut turned = edges.clone();
            turned.reverse();
            prop_assert_eq!(assign(6, 7, &turned), found);
        }
    }

    #[test]
    fn a_partner_is_not_forced() {
        assert_eq!(assign(2, 2, &[(0, 0, 3.0), (1, 0, 2.0), (1, 1, 0.0)]), vec![Some(0), None]);
    }

    #[test]
    fn a_row_gives_way_where_the_total_gains() {
        let edges = [(0, 0, 5.0), (0, 1, 4.0), (1, 0, 4.5)];
        assert_eq!(assign(2, 2, &edges), vec![Some(1), Some(0)]);
    }

    #[test]
    fn nothing_to_assign() {
        assert_eq!(assign(0, 3, &[]), Vec::<Option<usize>>::new());
        assert_eq!(assign(2, 0, &[]), vec![None, None]);
    }
}
