//! The cells that a query is cut into for growth: some ten fruits each, with a pose of their own.

use super::landscape::{CellHasher, Landscape};
use super::pose::{Moments, Pose};
use nalgebra::Vector3;
use std::collections::HashMap;
use std::hash::BuildHasherDefault;

/// Fruits that share one pose.
#[derive(Debug, Clone)]
pub(super) struct Cell {
    /// Place in the grid of cells.
    pub(super) key: [i64; 3],
    pub(super) centre: Vector3<f64>,
    pub(super) rows: Vec<u32>,
    /// Cells up to two steps away, itself included, with their weights.
    pub(super) around: Vec<(u32, f64)>,
    /// Sums over the pairs in the cell.
    pub(super) moments: Moments,
    pub(super) pose: Pose,
    /// Whether growth has come here.
    pub(super) reached: bool,
    pub(super) log_odds: f64,
}

/// Weighted sum of sums.
pub(super) fn total<'a>(parts: impl Iterator<Item = (&'a Moments, f64)>) -> Moments {
    let mut sum = Moments::default();
    for (part, weight) in parts {
        sum.accumulate(part, weight);
    }
    sum
}

/// Pairs in and around a cell, the nearer the more.
pub(super) fn surroundings(cells: &[Cell], cell: &Cell) -> Moments {
    total(cell.around.iter().map(|a| (&cells[a.0 as usize].moments, a.1)))
}

/// Number of the cell at each place of the grid.
pub(super) type CellIndex = HashMap<[i64; 3], usize, BuildHasherDefault<CellHasher>>;

pub(super) fn key_of(p: &Vector3<f64>, edge: f64) -> [i64; 3] {
    [p.x, p.y, p.z].map(|x| (x / edge).floor() as i64)
}

/// Cuts the query into cells of `edge` metres that have fruits; all start with `pose`.
pub(super) fn cells_of(query: &Landscape, edge: f64, pose: &Pose) -> (Vec<Cell>, CellIndex) {
    let mut index = CellIndex::default();
    let mut cells: Vec<Cell> = Vec::new();
    for (row, p) in query.points.iter().enumerate() {
        let key = key_of(p, edge);
        let at = *index.entry(key).or_insert_with(|| {
            cells.push(Cell {
                key,
                centre: Vector3::zeros(),
                rows: Vec::new(),
                around: Vec::new(),
                moments: Moments::default(),
                pose: *pose,
                reached: false,
                log_odds: 0.0,
            });
            cells.len() - 1
        });
        cells[at].rows.push(row as u32);
        cells[at].centre += p;
    }
    for cell in &mut cells {
        cell.centre /= cell.rows.len() as f64;
    }
    for i in 0..cells.len() {
        let key = cells[i].key;
        let mut around = Vec::new();
        for dx in -2..=2i64 {
            for dy in -2..=2i64 {
                for dz in -2..=2i64 {
                    if let Some(&other) = index.get(&[key[0] + dx, key[1] + dy, key[2] + dz]) {
                        let d2 = (cells[other].centre - cells[i].centre).norm_squared() / (edge * edge);
                        around.push((other as u32, (-0.5 * d2).exp()));
                    }
                }
            }
        }
        cells[i].around = around;
    }
    (cells, index)
}
