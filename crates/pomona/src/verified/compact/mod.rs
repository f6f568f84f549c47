//! Maps of a million fruits: fewer seeds, in fewer bytes, that only say where to look.
//!
//! The index of a smaller map keeps every seed with a code in single precision, and all that verification asks of every
//! fruit: 7 kB each. Most of that is never used in a large map. A shape that thousands of places show says nothing about
//! the place, and only few places are ever looked at closely. So here
//!
//! 1. the map keeps the seeds of rare shape, 48 a fruit on average, and which shapes are common (`making`);
//! 2. a query looks up its own seeds, those of the rarest shape first, with all labelings that noise could have made, until it
//!    has met as many candidates as a budget allows (`proposing`); most are dropped after a look at what hangs next to the
//!    fruit that they belong to (`glance`), which lies in one line of memory (`surroundings`);
//! 3. the best of what is left are refined on the index (`closer`);
//! 4. the map around the best of these is cut out, and what is cut out is verified as a small map is, against what chance
//!    reaches in the whole one (`judging`).
//!
//! The index is a few columns of numbers (`columns`), in memory or in a file that is mapped (`format`). It only proposes:
//! places, covariances and diameters that decide are the caller's.

mod closer;
mod columns;
mod format;
mod glance;
mod ground;
mod judging;
mod making;
mod proposing;
mod seed_blocks;
mod shapes;
mod surroundings;
#[cfg(test)]
mod tests;

pub use columns::Bytes;
pub(crate) use format::fingerprint;
pub(crate) use judging::{pairs_under, search};

use crate::neighbours::code_grid::Cells;
use columns::Column;
use nalgebra::Vector3;
use seed_blocks::Block;
use surroundings::{Surroundings, density_of};

/// Fruits of a map at the most: rows have 32 bits, and so have seeds.
pub(crate) const MOST: usize = 10_000_000;

/// The index of a large map. Fruits are numbered in the order of the buckets of `ground`.
#[derive(Debug)]
pub(crate) struct CompactMap {
    facts: Facts,
    /// The caller's row of each fruit.
    rows: Column<u32>,
    /// About the middle of the map, metres.
    points: Column<[f32; 3]>,
    /// Number of each bucket's first fruit, one more than there are buckets.
    buckets: Column<u32>,
    /// The nearest others of each fruit, [`Facts::each`] of them.
    companions: Column<u32>,
    /// What hangs next to each fruit, in one line of memory.
    surroundings: Column<Surroundings>,
    /// Number of each cell's first seed, one more than there are cells of shapes.
    starts: Column<u32>,
    /// A bit for each cell of shapes: whether it is so common that its seeds are not kept.
    common: Column<u32>,
    /// The seeds, in the order of the cells.
    seeds: Column<Block>,
}

/// The numbers of an index that are no column.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Facts {
    /// Fruits of the caller's cloud, and a sum over their places.
    pub(crate) given: usize,
    pub(crate) fingerprint: u64,
    /// The origin in the caller's frame, metres.
    pub(crate) middle: Vector3<f64>,
    /// Spacing of the conditioned cloud, metres.
    pub(crate) sampled_spacing: f64,
    /// Median distance to the sixth-nearest fruit, metres.
    pub(crate) spacing: f64,
    /// Metres of one step of a stored shape.
    step: f64,
    /// Companions of each fruit.
    each: usize,
    /// The space of shapes, in steps.
    cells: Cells,
}

impl CompactMap {
    pub(crate) fn facts(&self) -> &Facts {
        &self.facts
    }

    /// The caller's row of each fruit.
    pub(crate) fn rows(&self) -> &[u32] {
        self.rows.get()
    }

    /// Strangers in a cubic metre about each fruit; without end where a damaged file says what cannot be.
    pub(crate) fn densities(&self) -> Vec<f64> {
        let sound = |density: f64| if density.is_normal() && density > 0.0 { density } else { f64::INFINITY };
        self.surroundings.get().iter().map(|one| sound(density_of(one))).collect()
    }
}
