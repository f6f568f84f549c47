//! The nearest other fruits of every fruit.

use crate::neighbours::tree::Tree;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Neighbours kept per fruit: enough for the seeds (the nearest ten) and for the first look at a hypothesis.
pub(crate) const NEIGHBOURS: usize = 24;

/// The nearest other fruits of every fruit, the same number for each.
#[derive(Debug, Clone)]
pub(super) struct Neighbours {
    pub(super) each: usize,
    rows: Vec<u32>,
}

impl Neighbours {
    pub(super) fn new(points: &[[f32; 3]], tree: &Tree) -> Self {
        let each = NEIGHBOURS.min(points.len().saturating_sub(1));
        let mut rows = vec![0; points.len() * each];
        if each > 0 {
            rows.par_chunks_mut(each).enumerate().with_min_len(SHARE_OF_ROWS).for_each_init(
                Vec::new,
                |found, (row, near)| {
                    tree.nearest(&points[row], each + 1, found);
                    let others = found.iter().map(|entry| entry.0).filter(|&other| other as usize != row);
                    near.iter_mut().zip(others).for_each(|(slot, other)| *slot = other);
                },
            );
        }
        Self { each, rows }
    }

    #[inline]
    pub(super) fn of(&self, row: usize) -> &[u32] {
        &self.rows[row * self.each..(row + 1) * self.each]
    }
}

/// Rows at the least that are worth a thread of their own.
pub(crate) const SHARE_OF_ROWS: usize = 256;

#[inline]
pub(crate) fn single(p: &Vector3<f64>) -> [f32; 3] {
    [p.x as f32, p.y as f32, p.z as f32]
}
