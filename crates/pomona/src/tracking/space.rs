//! Which fruits are near the view: a grid of cells, so that a frame costs what it shows and not what was seen before.

use crate::camera::Camera;
use crate::pose::Pose;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Edge of a cell, metres: some tens of fruits in a crown.
const CELL_M: f64 = 0.5;

/// Largest distance that is looked at beyond the farthest fruit, over its depth: its place is not known better.
const MARGIN: f64 = 1.2;

type Cell = [i64; 3];

/// Fruits by the cell of their centre.
#[derive(Debug, Clone, Default)]
pub(crate) struct Space {
    cells: BTreeMap<Cell, Vec<usize>>,
    /// Depth of the farthest fruit when it was born, metres.
    reach_m: f64,
}

fn cell_of(point: &Vector3<f64>) -> Cell {
    std::array::from_fn(|axis| (point[axis] / CELL_M).floor() as i64)
}

impl Space {
    pub fn insert(&mut self, index: usize, centre: &Vector3<f64>) {
        self.cells.entry(cell_of(centre)).or_default().push(index);
    }

    pub fn remove(&mut self, index: usize, centre: &Vector3<f64>) {
        let cell = cell_of(centre);
        if let Some(members) = self.cells.get_mut(&cell) {
            members.retain(|&member| member != index);
            if members.is_empty() {
                self.cells.remove(&cell);
            }
        }
    }

    pub fn moved(&mut self, index: usize, from: &Vector3<f64>, to: &Vector3<f64>) {
        if cell_of(from) != cell_of(to) {
            self.remove(index, from);
            self.insert(index, to);
        }
    }

    pub fn reach(&mut self, depth_m: f64) {
        self.reach_m = self.reach_m.max(depth_m);
    }

    /// Fruits in cells that touch the box around the camera's pyramid, in ascending order.
    pub fn near_view(&self, camera: &Camera, pose: &Pose) -> Vec<usize> {
        let depth_m = MARGIN * self.reach_m + CELL_M;
        let [width, height] = camera.size_px();
        let mut corners = vec![pose.translation];
        for (x, y) in [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)] {
            corners.push(pose.to_session(&camera.unproject(&Vector3::new(x, y, depth_m))));
        }
        let low: Cell = std::array::from_fn(|axis| bound(&corners, axis, f64::min).saturating_sub(1));
        let high: Cell = std::array::from_fn(|axis| bound(&corners, axis, f64::max).saturating_add(1));
        let inside = |cell: &Cell| (1..3).all(|axis| (low[axis]..=high[axis]).contains(&cell[axis]));
        // Cells are ordered by x first.
        let from = [low[0], i64::MIN, i64::MIN];
        let to = [high[0], i64::MAX, i64::MAX];
        let mut found: Vec<_> =
            self.cells.range(from..=to).filter(|(cell, _)| inside(cell)).flat_map(|(_, all)| all).copied().collect();
        found.sort_unstable();
        found
    }
}

fn bound(corners: &[Vector3<f64>], axis: usize, of: fn(f64, f64) -> f64) -> i64 {
    let value = corners.iter().map(|corner| corner[axis]).reduce(of).unwrap_or(0.0);
    (value / CELL_M).floor() as i64
}
