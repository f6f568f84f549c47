//! Points that move, come and go: a map of cells.

use super::cells::CellKey;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Rows by the cell of their place, in the order of the cells.
#[derive(Debug, Clone)]
pub(crate) struct MovingRows {
    cell_m: f64,
    cells: BTreeMap<CellKey, Vec<usize>>,
}

impl MovingRows {
    /// Nothing yet; cells have the edge `cell_m`.
    pub(crate) fn new(cell_m: f64) -> Self {
        Self { cell_m, cells: BTreeMap::new() }
    }

    fn cell_of(&self, place: &Vector3<f64>) -> CellKey {
        std::array::from_fn(|axis| (place[axis] / self.cell_m).floor() as i64)
    }

    pub(crate) fn insert(&mut self, row: usize, place: &Vector3<f64>) {
        self.cells.entry(self.cell_of(place)).or_default().push(row);
    }

    pub(crate) fn remove(&mut self, row: usize, place: &Vector3<f64>) {
        let cell = self.cell_of(place);
        if let Some(members) = self.cells.get_mut(&cell) {
            members.retain(|&member| member != row);
            if members.is_empty() {
                self.cells.remove(&cell);
            }
        }
    }

    pub(crate) fn moved(&mut self, row: usize, from: &Vector3<f64>, to: &Vector3<f64>) {
        if self.cell_of(from) != self.cell_of(to) {
            self.remove(row, from);
            self.insert(row, to);
        }
    }

    /// Rows in cells that touch the box around `corners` or lie beside one that does, in ascending order.
    pub(crate) fn around(&self, corners: &[Vector3<f64>]) -> Vec<usize> {
        let low = self.bound(corners, f64::min).map(|number| number.saturating_sub(1));
        let high = self.bound(corners, f64::max).map(|number| number.saturating_add(1));
        let inside = |cell: &CellKey| (1..3).all(|axis| (low[axis]..=high[axis]).contains(&cell[axis]));
        // Cells are ordered by x first.
        let (from, to) = ([low[0], i64::MIN, i64::MIN], [high[0], i64::MAX, i64::MAX]);
        let near = self.cells.range(from..=to).filter(|(cell, _)| inside(cell));
        let mut found: Vec<_> = near.flat_map(|(_, rows)| rows).copied().collect();
        found.sort_unstable();
        found
    }

    fn bound(&self, corners: &[Vector3<f64>], of: fn(f64, f64) -> f64) -> CellKey {
        self.cell_of(&corners.iter().copied().reduce(|a, b| a.zip_map(&b, of)).unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_where_they_moved_to_and_nowhere_once_they_are_gone() {
        let at = |x: f64| Vector3::new(x, -0.3, 0.2);
        let mut rows = MovingRows::new(0.5);
        for (row, x) in [0.1, 0.4, 5.0].into_iter().enumerate() {
            rows.insert(row, &at(x));
        }
        assert_eq!(rows.around(&[at(0.0), at(0.2)]), [0, 1]);
        rows.moved(1, &at(0.4), &at(5.2));
        assert_eq!(rows.around(&[at(0.0)]), [0]);
        assert_eq!(rows.around(&[at(5.0)]), [1, 2]);
        rows.remove(2, &at(5.0));
        assert_eq!(rows.around(&[at(-9.0), at(9.0)]), [0, 1]);
    }
}
