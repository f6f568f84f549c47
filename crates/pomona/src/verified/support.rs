//! Whether the recording looked at a place at all.

use crate::neighbours::cells::{CellKey, CellMap, cell_of, hash};
use nalgebra::Vector3;

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
fn key(cell: CellKey) -> [i32; 3] {
    cell.map(|x| x as i32)
}

impl Support {
    /// A cell is supported in the measure of the fruits in it and around it: 1 - exp(-count / 2).
    pub(super) fn new(points: &[Vector3<f64>], spacing: f64) -> Self {
        let inverse_cell = 1.0 / spacing;
        let mut cells: CellMap<f32> = CellMap::default();
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
