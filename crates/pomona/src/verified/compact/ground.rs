//! Where the fruits of a large map are: in buckets, by the cells of space.

use super::CompactMap;
use super::surroundings::{Surroundings, density_of};
use crate::neighbours::cells::{self, CellKey, cell_of, hash};
use crate::verified::proposal::Terrain;
use nalgebra::{Point3, Vector3};

/// What a search asks of the places of fruits. Numbers from a file may be wrong: none is trusted as a row.
pub(super) struct Ground<'a> {
    points: &'a [[f32; 3]],
    surroundings: &'a [Surroundings],
    buckets: &'a [u32],
    inverse_cell: f64,
}

/// Buckets for so many fruits: four cells in five are empty, and blocks of them share a place.
pub(super) fn n_buckets(fruits: usize) -> usize {
    (4 * fruits).next_power_of_two().max(1 << (3 * BLOCK))
}

/// Cells along the edge of a block, as a power of two. What is near in space is near in memory: most of the time goes into
/// waiting for it.
const BLOCK: u32 = 2;

/// The bucket of a cell: the place of its block, and its own in there.
#[inline]
fn bucket_of(cell: CellKey, n_buckets: usize) -> usize {
    let block = hash(cell.map(|x| x >> BLOCK), (n_buckets >> (3 * BLOCK)) as u64 - 1);
    cell.iter().fold(block, |at, x| at << BLOCK | (x & ((1 << BLOCK) - 1)) as usize)
}

/// The order of the fruits by bucket, and the first of each bucket; cells have the edge of one spacing.
pub(super) fn by_bucket(positions: &[Point3<f64>], spacing: f64) -> (Vec<usize>, Vec<u32>) {
    let n_buckets = n_buckets(positions.len());
    let bucket = |row: usize| bucket_of(cell_of(&positions[row].coords, 1.0 / spacing), n_buckets);
    let mut order: Vec<(u32, u32)> = (0..positions.len()).map(|row| (bucket(row) as u32, row as u32)).collect();
    order.sort_unstable();
    let mut starts = vec![0u32; n_buckets + 1];
    for &(bucket, _) in &order {
        starts[bucket as usize + 1] += 1;
    }
    for at in 0..n_buckets {
        starts[at + 1] += starts[at];
    }
    (order.into_iter().map(|(_, row)| row as usize).collect(), starts)
}

impl<'a> Ground<'a> {
    pub(super) fn new(map: &'a CompactMap) -> Self {
        Self {
            points: map.points.get(),
            surroundings: map.surroundings.get(),
            buckets: map.buckets.get(),
            inverse_cell: 1.0 / map.facts.sampled_spacing,
        }
    }

    /// Calls `visit` for every fruit of a cell, and for others.
    #[inline]
    fn in_cell(&self, cell: CellKey, mut visit: impl FnMut(u32, Vector3<f64>)) {
        let bucket = bucket_of(cell, self.buckets.len() - 1);
        let range = self.buckets[bucket] as usize..self.buckets[bucket + 1] as usize;
        for (row, point) in range.clone().zip(self.points.get(range).unwrap_or_default()) {
            visit(row as u32, double(point));
        }
    }

    /// The fruits of all cells within `reach` cells of the places, in order.
    pub(super) fn around(&self, places: impl Iterator<Item = Vector3<f64>>, reach: i64) -> Vec<u32> {
        let mut own: Vec<CellKey> = places.map(|place| cell_of(&place, self.inverse_cell)).collect();
        distinct(&mut own);
        let mut cells: Vec<CellKey> = own.into_iter().flat_map(|cell| cells::around(cell, reach)).collect();
        distinct(&mut cells);
        let mut rows = Vec::new();
        for cell in cells {
            self.in_cell(cell, |row, place| {
                if cell_of(&place, self.inverse_cell) == cell {
                    rows.push(row);
                }
            });
        }
        distinct(&mut rows);
        rows
    }
}

fn distinct<T: Ord>(all: &mut Vec<T>) {
    all.sort_unstable();
    all.dedup();
}

#[inline]
fn double(point: &[f32; 3]) -> Vector3<f64> {
    Vector3::from(point.map(f64::from))
}

impl Terrain for Ground<'_> {
    #[inline]
    fn place(&self, row: u32) -> Vector3<f64> {
        self.points.get(row as usize).map_or_else(Vector3::zeros, double)
    }

    #[inline]
    fn nearest(&self, place: &Vector3<f64>, gate: f64) -> Option<(u32, f64)> {
        let reach = Vector3::repeat(gate);
        let [low, high] = [place - reach, place + reach].map(|corner| cell_of(&corner, self.inverse_cell));
        let (mut limit, mut nearest) = (gate * gate, None);
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    self.in_cell([x, y, z], |row, other| {
                        let d2 = (other - place).norm_squared();
                        if d2 <= limit {
                            (limit, nearest) = (d2, Some((row, d2)));
                        }
                    });
                }
            }
        }
        nearest
    }

    #[inline]
    fn density(&self, row: u32) -> f64 {
        self.surroundings.get(row as usize).map_or(f64::INFINITY, density_of)
    }

    /// Proposals lie amid crowns.
    #[inline]
    fn support(&self, _: &Vector3<f64>) -> f64 {
        1.0
    }
}
