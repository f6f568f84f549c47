//! Cells over a cloud: which fruits are near a place, and whether the recording looked there at all.

use nalgebra::Vector3;

/// Columns of cells along z, hashed; any extent, memory in proportion to the points.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    inverse_cell: f64,
    mask: u64,
    /// Start of each bucket in `points`, one more than there are buckets.
    starts: Vec<u32>,
    /// Cell along z and row of each point, in the order of both within a bucket.
    points: Vec<(i64, u32)>,
}

impl Grid {
    pub(super) fn new(points: &[Vector3<f64>], cell: f64) -> Self {
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
    pub(super) fn near(&self, place: &Vector3<f64>, gate: f64, mut visit: impl FnMut(u32)) {
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

#[inline]
pub(super) fn cell_of(p: &Vector3<f64>, inverse_cell: f64) -> [i64; 3] {
    [p.x, p.y, p.z].map(|x| floor(x * inverse_cell))
}

/// By truncation: not every processor has an instruction that rounds down, and a call costs more than the rest of a
/// look.
#[inline]
fn floor(x: f64) -> i64 {
    let truncated = x as i64;
    truncated.saturating_sub(i64::from(truncated as f64 > x))
}

#[inline]
pub(super) fn hash(cell: [i64; 3], mask: u64) -> usize {
    let mixed = (cell[0] as u64)
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add((cell[1] as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F))
        .wrapping_add((cell[2] as u64).wrapping_mul(0x1656_67B1_9E37_79F9));
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 32 & mask) as usize
}

/// Where the cloud has fruits at all, at the resolution of its spacing.
#[derive(Debug, Clone)]
pub(super) struct Support {
    inverse_cell: f64,
    mask: u64,
    /// A cell and its support at the place of its hash or the next free one behind; at least half are free.
    slots: Vec<([i32; 3], f32)>,
}

/// No cell's support is zero.
const FREE: ([i32; 3], f32) = ([0; 3], 0.0);

/// A cell in short: no recording is 2^31 spacings long.
#[inline]
fn key(cell: [i64; 3]) -> [i32; 3] {
    cell.map(|x| x as i32)
}

type Mixing = std::hash::BuildHasherDefault<CellHasher>;

/// Hashes a cell by the mixing of the grid: cells are no attack surface, and the answer must not change from run to
/// run.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct CellHasher(u64);

impl std::hash::Hasher for CellHasher {
    fn finish(&self) -> u64 {
        (self.0 ^ (self.0 >> 32)).wrapping_mul(0xBF58_476D_1CE4_E5B9)
    }
    fn write(&mut self, bytes: &[u8]) {
        for word in bytes.chunks(8) {
            let mut whole = [0; 8];
            whole[..word.len()].copy_from_slice(word);
            self.write_u64(u64::from_le_bytes(whole));
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
    pub(super) fn new(points: &[Vector3<f64>], spacing: f64) -> Self {
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
        let mask = (2 * cells.len()).next_power_of_two() as u64 - 1;
        let mut slots = vec![FREE; mask as usize + 1];
        for (cell, count) in cells {
            let mut slot = hash(cell, mask);
            while slots[slot] != FREE {
                slot = (slot + 1) & mask as usize;
            }
            slots[slot] = (key(cell), 1.0 - (-count / 2.0).exp());
        }
        Self { inverse_cell, mask, slots }
    }

    #[inline]
    pub(super) fn at(&self, place: &Vector3<f64>) -> f64 {
        let cell = cell_of(place, self.inverse_cell);
        let mut slot = hash(cell, self.mask);
        loop {
            let (found, support) = self.slots[slot];
            if found == key(cell) || support == 0.0 {
                return f64::from(support);
            }
            slot = (slot + 1) & self.mask as usize;
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
