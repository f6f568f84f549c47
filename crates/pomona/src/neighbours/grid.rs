//! Columns of cells over a cloud that stays: which points are near a place.

use super::cells::{cell_of, hash};
use nalgebra::Vector3;

/// Columns of cells along z, hashed; any extent, memory in proportion to the points.
#[derive(Debug, Clone)]
pub(crate) struct Grid {
    inverse_cell: f64,
    mask: u64,
    /// Start of each bucket in `points`, one more than there are buckets.
    starts: Vec<u32>,
    /// Cell along z and row of each point, in the order of both within a bucket.
    points: Vec<(i64, u32)>,
}

impl Grid {
    pub(crate) fn new(points: &[Vector3<f64>], cell: f64) -> Self {
        let buckets = (4 * points.len().max(4)).next_power_of_two();
        let mask = buckets as u64 - 1;
        let inverse_cell = 1.0 / cell;
        let mut placed: Vec<(usize, i64, u32)> = Vec::with_capacity(points.len());
        placed.extend((0..).zip(points).map(|(row, p)| {
            let [x, y, z] = cell_of(p, inverse_cell);
            (hash([x, y, 0], mask), z, row)
        }));
        placed.sort_unstable();
        let mut starts = vec![0u32; buckets + 1];
        for &(bucket, ..) in &placed {
            starts[bucket + 1] += 1;
        }
        for i in 0..buckets {
            starts[i + 1] += starts[i];
        }
        Self { inverse_cell, mask, starts, points: placed.into_iter().map(|(_, z, row)| (z, row)).collect() }
    }

    #[inline]
    pub(crate) fn near(&self, place: &Vector3<f64>, gate: f64, mut visit: impl FnMut(u32)) {
        let reach = Vector3::repeat(gate);
        let low = cell_of(&(place - reach), self.inverse_cell);
        let high = cell_of(&(place + reach), self.inverse_cell);
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                let bucket = hash([x, y, 0], self.mask);
                let column = &self.points[self.starts[bucket] as usize..self.starts[bucket + 1] as usize];
                let first = column.partition_point(|&(z, _)| z < low[2]);
                column[first..].iter().take_while(|&&(z, _)| z <= high[2]).for_each(|&(_, row)| visit(row));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_point_within_the_gate_is_visited(
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64).prop_map(Vector3::from), 0..100),
            place in prop::array::uniform3(-1.5..1.5f64).prop_map(Vector3::from),
            cell in 0.05..1.0f64,
            gate in 0.0..1.5f64,
        ) {
            let mut visited = vec![false; points.len()];
            Grid::new(&points, cell).near(&place, gate, |row| visited[row as usize] = true);
            for (p, visited) in points.iter().zip(visited) {
                prop_assert!((p - place).norm() > gate || visited);
            }
        }
    }
}
