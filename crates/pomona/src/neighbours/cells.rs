//! Cells of space: cubes of one edge, numbered along each axis.

use nalgebra::Vector3;
use std::collections::HashMap;
use std::hash::BuildHasherDefault;

/// Numbers of a cell along x, y and z.
pub(crate) type CellKey = [i64; 3];

/// What is known of cells; the order of its entries is nowhere used.
pub(crate) type CellMap<T> = HashMap<CellKey, T, BuildHasherDefault<Mixing>>;

#[inline]
pub(crate) fn cell_of(p: &Vector3<f64>, inverse_cell: f64) -> CellKey {
    [p.x, p.y, p.z].map(|x| floor(x * inverse_cell))
}

/// All cells within `reach` of one along each axis, in order.
pub(crate) fn around([x, y, z]: CellKey, reach: i64) -> impl Iterator<Item = CellKey> {
    let steps = move |from: i64| from.saturating_sub(reach)..=from.saturating_add(reach);
    steps(x).flat_map(move |x| steps(y).flat_map(move |y| steps(z).map(move |z| [x, y, z])))
}

/// By truncation: not every processor has an instruction that rounds down, and a call costs more than the rest of a
/// look.
#[inline]
fn floor(x: f64) -> i64 {
    let truncated = x as i64;
    truncated.saturating_sub(i64::from(truncated as f64 > x))
}

#[inline]
pub(crate) fn hash(cell: CellKey, mask: u64) -> usize {
    let mixed = (cell[0] as u64)
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add((cell[1] as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F))
        .wrapping_add((cell[2] as u64).wrapping_mul(0x1656_67B1_9E37_79F9));
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 32 & mask) as usize
}

/// Hashes a cell by mixing: cells are no attack surface, and the answer must not change from run to
/// run.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Mixing(u64);

impl std::hash::Hasher for Mixing {
    fn finish(&self) -> u64 {
        (self.0 ^ (self.0 >> 32)).wrapping_mul(0xBF58_476D_1CE4_E5B9)
    }
    fn write(&mut self, bytes: &[u8]) {
        for word in bytes.chunks(8) {
            let mut whole = [0; 8];
            whole[..word.len()].copy_from_slice(word);
            self.write_u64(u64::from_le_bytes(whole));
        }
    }
    fn write_i64(&mut self, value: i64) {
        self.write_u64(value as u64);
    }
    fn write_u64(&mut self, value: u64) {
        self.0 = (self.0.rotate_left(21) ^ value).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }
    fn write_usize(&mut self, value: usize) {
        self.write_u64(value as u64);
    }
}
