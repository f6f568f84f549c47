//! Seeds as they are kept: in blocks that are measured at once, twelve bytes a seed.
//!
//! A block has the first byte of all its seeds, then the second, and so on: the shape, the fruit that a seed belongs to, and its
//! label. So shapes are measured all at once, and what follows a hit lies next to it.

use super::shapes::{NUMBERS, Shape};
use crate::verified::seeds::STARS;

/// Seeds in a block.
pub(super) const LANES: usize = 16;

const ANCHOR: usize = NUMBERS;
const LABEL: usize = ANCHOR + 4;

/// So many seeds, byte by byte.
pub(super) type Block = [[u8; LANES]; LABEL + 2];

pub(super) const EMPTY: Block = [[0; LANES]; LABEL + 2];

/// The fruit that a seed belongs to, and four bits for each fruit of the seed: 0 is that fruit, else which of its companions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Anchored {
    pub(super) anchor: u32,
    pub(super) label: u16,
}

impl Anchored {
    /// Which companion each fruit of the seed is, from 1 on; 0 is the anchor itself.
    #[inline]
    pub(super) fn which(self) -> [usize; STARS] {
        std::array::from_fn(|place| usize::from(self.label >> (4 * place) & 15))
    }
}

/// The seed in a lane of a block.
#[inline]
pub(super) fn anchored(block: &Block, lane: usize) -> Anchored {
    let anchor = std::array::from_fn(|byte| block[ANCHOR + byte][lane]);
    let label = std::array::from_fn(|byte| block[LABEL + byte][lane]);
    Anchored { anchor: u32::from_le_bytes(anchor), label: u16::from_le_bytes(label) }
}

/// Puts a seed into a lane of a block.
pub(super) fn put(block: &mut Block, lane: usize, shape: Shape, Anchored { anchor, label }: Anchored) {
    let bytes = shape.into_iter().chain(anchor.to_le_bytes()).chain(label.to_le_bytes());
    block.iter_mut().zip(bytes).for_each(|(plane, byte)| plane[lane] = byte);
}

/// From a shape to those of a block, up to the largest number of 16 bits.
#[inline]
pub(super) fn squared_distances(block: &Block, shape: Shape) -> [u16; LANES] {
    let mut sums = [0u16; LANES];
    for (numbers, own) in block.iter().zip(shape) {
        for (sum, &number) in sums.iter_mut().zip(numbers) {
            let apart = u16::from(number.abs_diff(own));
            *sum = sum.saturating_add(apart * apart);
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_put_into_a_block_is_there_and_changes_no_other_lane() {
        let mut block = EMPTY;
        let seed = |lane: usize| Anchored { anchor: 0x0102_0304 * lane as u32, label: 0x1003 + lane as u16 };
        let shape = |lane: usize| std::array::from_fn(|number| (7 * lane + number) as u8);
        (0..LANES).for_each(|lane| put(&mut block, lane, shape(lane), seed(lane)));
        for lane in 0..LANES {
            assert_eq!(anchored(&block, lane), seed(lane));
            let distances = squared_distances(&block, shape(lane));
            assert!(distances.iter().enumerate().all(|(other, &distance)| (distance == 0) == (other == lane)));
        }
        assert_eq!(seed(2).which(), [5, 0, 0, 1]);
    }
}
