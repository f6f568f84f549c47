//! The cells that a query is cut into for growth: some ten fruits each, with a pose of their own.

use crate::geometry::Similarity;
use crate::moments::Moments;
use crate::neighbours::cells::{self, CellKey, CellMap, around};
use nalgebra::Vector3;
use std::sync::Arc;

/// Edge of a cell in spacings of the query: some ten fruits.
pub(super) const EDGE: f64 = 2.5;

/// Fruits that share one pose.
#[derive(Debug, Clone)]
pub(crate) struct Cell {
    pub(super) centre: Vector3<f64>,
    pub(super) rows: Arc<[u32]>,
    /// Cells up to two steps away, itself included, with their weights.
    pub(super) around: Arc<[(u32, f64)]>,
    /// Sums over the pairs in the cell.
    pub(super) moments: Moments,
    pub(super) pose: Similarity,
    /// What neighbours' residuals share in the cell: sums of their products and of the pairs.
    pub(super) shared: [f64; 2],
    /// Whether growth has come here.
    pub(super) reached: bool,
    /// Whether it stays as it is for now, its fruits with their partners: growth goes on elsewhere.
    pub(super) at_rest: bool,
}

/// The cells of a cloud, as every growth starts with them.
#[derive(Debug, Clone)]
pub(crate) struct Cut {
    pub(super) edge: f64,
    /// Distance from the origin within which all cells lie, metres.
    pub(super) reach: f64,
    pub(super) cells: Vec<Cell>,
    /// Cell of each fruit.
    pub(super) cell_of: Vec<u32>,
    /// Number of the cell at each place of the grid.
    pub(super) index: CellMap<usize>,
}

impl Cell {
    /// Whether its pose and pairs are made anew.
    pub(super) fn is_open(&self) -> bool {
        self.reached && !self.at_rest
    }

    /// Whether they stay as they are.
    pub(super) fn is_at_rest(&self) -> bool {
        self.reached && self.at_rest
    }
}

impl Cut {
    /// Cuts the cloud into cells of `edge` metres that have fruits.
    pub(super) fn new(points: &[Vector3<f64>], edge: f64) -> Self {
        let mut index = CellMap::default();
        let mut keys = Vec::new();
        let mut rows: Vec<Vec<u32>> = Vec::new();
        let mut cell_of = Vec::with_capacity(points.len());
        for (row, p) in points.iter().enumerate() {
            let key = cells::cell_of(p, 1.0 / edge);
            let at = *index.entry(key).or_insert_with(|| {
                keys.push(key);
                rows.push(Vec::new());
                rows.len() - 1
            });
            rows[at].push(row as u32);
            cell_of.push(at as u32);
        }
        let middle = |rows: &Vec<u32>| {
            rows.iter().fold(Vector3::zeros(), |sum, &row| sum + points[row as usize]) / rows.len() as f64
        };
        let centres: Vec<Vector3<f64>> = rows.iter().map(middle).collect();
        let neighbours = |key: CellKey| around(key, 2).filter_map(|near| index.get(&near).copied());
        let closeness = |one: usize, other: usize| {
            let d2 = (centres[other] - centres[one]).norm_squared() / (edge * edge);
            (-0.5 * d2).exp()
        };
        let cells = rows
            .into_iter()
            .enumerate()
            .map(|(i, rows)| Cell {
                centre: centres[i],
                rows: rows.into(),
                around: neighbours(keys[i]).map(|other| (other as u32, closeness(i, other))).collect(),
                moments: Moments::default(),
                pose: Similarity::identity(),
                shared: [0.0; 2],
                reached: false,
                at_rest: false,
            })
            .collect();
        // No corner of a cell is two edges from a fruit in it.
        let reach = points.iter().map(Vector3::norm).fold(0.0, f64::max) + 2.0 * edge;
        Self { edge, reach, cells, cell_of, index }
    }
}
