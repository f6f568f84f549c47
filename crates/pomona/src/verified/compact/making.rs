//! How the index of a large map is made: which seeds it keeps.
//!
//! A code of the query meets by chance as many seeds as the map has of that shape, and each costs a look. Ten nearest
//! neighbours give some seventy seeds a fruit, most of them of shapes that a map of a million fruits shows ten thousand
//! times. So the cells of the space of shapes are counted, and the seeds of the emptiest are kept. Which these are follows
//! from the shape alone, so that the same four fruits are kept or not in whatever visit they are seen.

use super::columns::Column;
use super::ground::by_bucket;
use super::seed_blocks::{Anchored, Block, EMPTY, LANES, put};
use super::shapes::{STEPS, Shape, in_steps, rounded};
use super::surroundings::{Surroundings, packed, step_of};
use super::{CompactMap, Facts, fingerprint};
use crate::cloud::FruitCloud;
use crate::conditioning::Conditioned;
use crate::neighbours::code_grid::{Cells, Code};
use crate::neighbours::others::{Neighbours, each_row};
use crate::neighbours::tree::{Tree, single};
use crate::random::shuffled;
use crate::verified::chance::local_density;
use crate::verified::landscape::{floor_of, spacing_of};
use crate::verified::seeds::{COMPANIONS, canonical, sets_of};
use crate::verified::{SEED_SIGMA, SHORTEST};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// Seeds that a map keeps, a fruit, on average; a map of fewer fruits than `FEW` as many as one of so many.
pub(super) const KEPT: usize = 48;
const FEW: usize = 100_000;

/// Cells of the space of shapes, a fruit.
const CELLS: f64 = 8.0;

/// Fruits whose seeds tell how to cut that space.
const SAMPLE: usize = 512;

/// Fruits whose seeds are made before they are put in their places.
const PORTION: usize = 1 << 15;

/// A seed as it is kept.
struct Kept {
    cell: u32,
    shape: Shape,
    seed: Anchored,
}

impl CompactMap {
    /// The index of a cloud, and the conditioned cloud in its order.
    pub(crate) fn new(given: &FruitCloud, mut map: Conditioned) -> (Self, Conditioned) {
        // Fruits on one spot, or none, have no spacing; a file tells numbers that divide from those that do not.
        let sampled_spacing = if map.spacing().is_normal() { map.spacing() } else { f64::MIN_POSITIVE };
        let (order, buckets) = by_bucket(&map.cloud.positions, sampled_spacing);
        map.reorder(&order);
        let points: Vec<Vector3<f64>> = map.cloud.positions.iter().map(|p| p.coords).collect();
        let in_single: Vec<[f32; 3]> = points.iter().map(single).collect();
        let neighbours = Neighbours::new(&in_single, &Tree::new(&in_single));
        let spacing = spacing_of(&points, &neighbours);
        let density = local_density(&points, &neighbours, spacing, floor_of(spacing));
        let each = COMPANIONS.min(neighbours.each);
        let companions: Vec<u32> =
            (0..points.len()).flat_map(|row| neighbours.of(row)[..each].iter().copied()).collect();
        let surroundings = surroundings(&points, &neighbours, &density, step_of(spacing));
        drop(neighbours);
        let seeds = Seeds { points: &points, companions: &companions, each, step: spacing / STEPS, spacing };
        let cells = seeds.cells();
        let (starts, common) = seeds.counted(&cells);
        let kept = seeds.placed(&cells, &starts, &common);
        let facts = Facts {
            given: given.len(),
            fingerprint: fingerprint(given),
            middle: map.middle(),
            sampled_spacing,
            spacing,
            step: seeds.step,
            each,
            cells,
        };
        let rows: Vec<u32> = map.rows().iter().map(|&row| row as u32).collect();
        let index = Self {
            facts,
            rows: rows.into(),
            points: in_single.into(),
            buckets: buckets.into(),
            companions: Column::Own(companions),
            surroundings: surroundings.into(),
            starts: starts.into(),
            common: common.into(),
            seeds: kept.into(),
        };
        (index, map)
    }
}

/// All seeds of a map.
struct Seeds<'a> {
    points: &'a [Vector3<f64>],
    companions: &'a [u32],
    each: usize,
    step: f64,
    spacing: f64,
}

impl Seeds<'_> {
    fn near(&self, row: usize) -> &[u32] {
        &self.companions[row * self.each..(row + 1) * self.each]
    }

    /// The labelled sets of a fruit with their codes in steps.
    fn of(&self, row: u32, mut visit: impl FnMut([u32; 4], Code)) {
        for set in sets_of(&|row| self.near(row), COMPANIONS, row) {
            let Some((quad, code)) = canonical(self.points, set) else { continue };
            if f64::from(code[0]) >= SHORTEST * SEED_SIGMA * self.spacing {
                visit(quad, in_steps(&code, self.step));
            }
        }
    }

    fn cells(&self) -> Cells {
        let stride = self.points.len().div_ceil(SAMPLE).max(1) as u64;
        let mut sample = Vec::new();
        for row in (0..self.points.len() as u32).filter(|&row| shuffled(u64::from(row)).is_multiple_of(stride)) {
            self.of(row, |_, code| sample.push(code));
        }
        Cells::cut(sample.len(), CELLS * self.points.len() as f64, &|at| sample[at])
    }

    /// Where the seeds of each cell start, and which cells are too full to be kept.
    fn counted(&self, cells: &Cells) -> (Vec<u32>, Vec<u32>) {
        let counts: Vec<AtomicU32> = (0..=cells.len()).map(|_| AtomicU32::new(0)).collect();
        (0..self.points.len() as u32).into_par_iter().for_each(|row| {
            self.of(row, |_, code| {
                if rounded(&code).is_some() {
                    counts[cells.of(&code) as usize].fetch_add(1, Ordering::Relaxed);
                }
            });
        });
        let mut starts: Vec<u32> = counts.into_iter().map(AtomicU32::into_inner).collect();
        let most = fullest(&starts, KEPT * self.points.len().max(FEW));
        let mut common = vec![0u32; cells.len().div_ceil(32)];
        let mut next = 0;
        for (cell, start) in starts.iter_mut().enumerate() {
            let count = *start;
            *start = next;
            if count <= most {
                next += count;
            } else {
                common[cell / 32] |= 1 << (cell % 32);
            }
        }
        (starts, common)
    }

    /// The seeds that are kept, in the order of cells and, within one, of fruits.
    fn placed(&self, cells: &Cells, starts: &[u32], common: &[u32]) -> Vec<Block> {
        let count = starts.last().copied().unwrap_or_default() as usize;
        let mut blocks = vec![EMPTY; count.div_ceil(LANES)];
        let mut next = starts.to_vec();
        let rows: Vec<u32> = (0..self.points.len() as u32).collect();
        for portion in rows.chunks(PORTION) {
            let kept: Vec<Vec<Kept>> = portion.par_chunks(256).map(|rows| self.kept(rows, cells, common)).collect();
            for Kept { cell, shape, seed } in kept.into_iter().flatten() {
                let at = next[cell as usize] as usize;
                next[cell as usize] += 1;
                put(&mut blocks[at / LANES], at % LANES, shape, seed);
            }
        }
        blocks
    }

    fn kept(&self, rows: &[u32], cells: &Cells, common: &[u32]) -> Vec<Kept> {
        let mut kept = Vec::new();
        for &anchor in rows {
            let near = self.near(anchor as usize);
            self.of(anchor, |quad, code| {
                let cell = cells.of(&code);
                let Some(shape) = rounded(&code).filter(|_| common[cell as usize / 32] >> (cell % 32) & 1 == 0) else {
                    return;
                };
                let which = |row: &u32| near.iter().position(|other| other == row).map_or(0, |at| at as u16 + 1);
                let label = quad.iter().rev().fold(0, |label, row| label << 4 | which(row));
                kept.push(Kept { cell, shape, seed: Anchored { anchor, label } });
            });
        }
        kept
    }
}

/// What hangs next to each fruit.
fn surroundings(points: &[Vector3<f64>], neighbours: &Neighbours, density: &[f64], step: f64) -> Vec<Surroundings> {
    let of = |row: usize| {
        let offsets = neighbours.of(row).iter().map(|&other| points[other as usize] - points[row]);
        packed(offsets, density[row], step)
    };
    each_row(points.len(), of)
}

/// The largest count of a cell such that all cells with no more have at most `most` together.
fn fullest(counts: &[u32], most: usize) -> u32 {
    let mut of_count = vec![0usize; 1 << 16];
    for &count in counts {
        of_count[(count as usize).min((1 << 16) - 1)] += 1;
    }
    let mut sum = 0;
    for (count, cells) in of_count.into_iter().enumerate() {
        sum += count * cells;
        if sum > most {
            return count.saturating_sub(1) as u32;
        }
    }
    u32::MAX
}
