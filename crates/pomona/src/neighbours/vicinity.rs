//! The nearest fruit to a place, by one look at a list.
//!
//! Poses are weighed by asking, again and again, which fruit of the map is nearest to a place. A place's cell has a
//! list of all fruits that can be within reach of any place in it, so that no neighbouring cell is asked.

use super::cells::{cell_of, hash};
use nalgebra::Vector3;

/// Lists of the fruits within `reach` of every cell; cells that share a bucket share a list.
#[derive(Debug, Clone)]
pub(crate) struct Vicinity {
    inverse_cell: f64,
    mask: u64,
    /// Distance that the lists answer for, metres.
    pub(crate) reach: f64,
    /// Start of each bucket's list in `rows`, one more than there are buckets.
    starts: Vec<u32>,
    rows: Vec<u32>,
}

/// Buckets for a fruit, half of the cells within its reach: fruits crowd and share most of their cells.
const BUCKETS: usize = 8;

impl Vicinity {
    /// Cells are as large as the reach: smaller ones would have shorter lists, but more of them than a cache holds.
    pub(crate) fn new(points: &[Vector3<f64>], reach: f64) -> Self {
        let buckets = (BUCKETS * points.len().max(1)).next_power_of_two();
        let (mask, inverse_cell) = (buckets as u64 - 1, 1.0 / reach);
        let mut starts = vec![0u32; buckets + 1];
        for p in points {
            buckets_around(p, inverse_cell, mask, |bucket| starts[bucket] += 1);
        }
        let mut end = 0;
        for start in &mut starts {
            end += *start;
            *start = end;
        }
        let mut rows = vec![0u32; end as usize];
        // From the last to the first, so that every list is ascending.
        for (row, p) in points.iter().enumerate().rev() {
            buckets_around(p, inverse_cell, mask, |bucket| {
                starts[bucket] -= 1;
                rows[starts[bucket] as usize] = row as u32;
            });
        }
        Self { inverse_cell, mask, reach, starts, rows }
    }

    /// Rows among which are all fruits within the reach of `place`.
    #[inline]
    pub(crate) fn of(&self, place: &Vector3<f64>) -> &[u32] {
        let bucket = hash(cell_of(place, self.inverse_cell), self.mask);
        &self.rows[self.starts[bucket] as usize..self.starts[bucket + 1] as usize]
    }
}

/// The buckets of all cells within one edge of a point: its own and those of the 26 around it that are near enough.
#[inline]
fn buckets_around(p: &Vector3<f64>, inverse_cell: f64, mask: u64, mut visit: impl FnMut(usize)) {
    let cell = cell_of(p, inverse_cell);
    // Squared distances to the cells before, here and after along each axis, in edges, a rounding error short.
    let gaps: [[f64; 3]; 3] = std::array::from_fn(|axis| {
        let inside = p[axis] * inverse_cell - cell[axis] as f64;
        [inside * inside, 0.0, (1.0 - inside) * (1.0 - inside)]
    });
    for (dx, gap_x) in (-1..).zip(gaps[0]) {
        for (dy, gap_y) in (-1..).zip(gaps[1]) {
            for (dz, gap_z) in (-1..).zip(gaps[2]) {
                if gap_x + gap_y + gap_z <= ALMOST_ONE {
                    visit(hash([cell[0] + dx, cell[1] + dy, cell[2] + dz], mask));
                }
            }
        }
    }
}

/// An edge squared, and more than rounding takes from it.
const ALMOST_ONE: f64 = 1.0 + 1e-6;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn lists_hold_all_within_reach(
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64).prop_map(Vector3::from), 1..100),
            place in prop::array::uniform3(-1.5..1.5f64).prop_map(Vector3::from),
            reach in 0.05..1.0f64,
        ) {
            let vicinity = Vicinity::new(&points, reach);
            let listed = vicinity.of(&place);
            for (row, p) in points.iter().enumerate() {
                prop_assert!((p - place).norm() > reach || listed.contains(&(row as u32)));
            }
        }
    }
}
