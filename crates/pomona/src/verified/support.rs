//! Whether the recording looked at a place at all.

use crate::neighbours::cells::{CellMap, around, cell_of};
use nalgebra::Vector3;

/// Where the cloud has fruits at all, at the resolution of its spacing.
#[derive(Debug, Clone)]
pub(super) struct Support {
    inverse_cell: f64,
    cells: CellMap<f32>,
}

impl Support {
    /// A cell is supported in the measure of the fruits in it and around it: 1 - exp(-count / 2).
    pub(super) fn new(points: &[Vector3<f64>], spacing: f64) -> Self {
        let inverse_cell = 1.0 / spacing;
        let mut cells: CellMap<f32> = CellMap::default();
        for p in points {
            let own = cell_of(p, inverse_cell);
            for cell in around(own, 1) {
                let steps: i32 = own.iter().zip(cell).map(|(own, there)| (there - own).abs() as i32).sum();
                *cells.entry(cell).or_default() += 0.5f32.powi(steps);
            }
        }
        for count in cells.values_mut() {
            *count = 1.0 - (-*count / 2.0).exp();
        }
        Self { inverse_cell, cells }
    }

    /// Probability in 0..1 that the recording would have shown a fruit at `place`: 1 inside the crowns, 0 beyond.
    #[inline]
    pub(super) fn at(&self, place: &Vector3<f64>) -> f64 {
        self.cells.get(&cell_of(place, self.inverse_cell)).map_or(0.0, |&support| f64::from(support))
    }
}
