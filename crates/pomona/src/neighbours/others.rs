//! The nearest other fruits of every fruit, looked up once.

use super::tree::Tree;
use rayon::prelude::*;

/// Neighbours kept per fruit: enough for the seeds (the nearest ten) and for the first look at a hypothesis.
pub(crate) const NEIGHBOURS: usize = 24;

/// The nearest other fruits of every fruit, the same number for each.
#[derive(Debug, Clone)]
pub(crate) struct Neighbours {
    pub(crate) each: usize,
    rows: Vec<u32>,
}

impl Neighbours {
    pub(crate) fn new(points: &[[f32; 3]], tree: &Tree) -> Self {
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
    pub(crate) fn of(&self, row: usize) -> &[u32] {
        &self.rows[row * self.each..(row + 1) * self.each]
    }
}

/// What `of` makes of each row, in order.
pub(crate) fn each_row<T: Send>(count: usize, of: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    (0..count).into_par_iter().with_min_len(SHARE_OF_ROWS).map(of).collect()
}

/// Rows at the least that are worth a thread of their own.
pub(crate) const SHARE_OF_ROWS: usize = 64;
