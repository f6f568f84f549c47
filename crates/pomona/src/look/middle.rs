//! The colour of a fruit: the median of the middle of its box, which is mostly fruit, whatever hides its rim.

use crate::stereo::{CHANNELS, Picture};
use std::ops::Range;

/// Middle part of a box, along each side.
const PART: f64 = 0.5;

/// Median of each channel, between two values the lower whole one. The box may reach out of the picture; its middle pixel
/// is kept inside.
pub(super) fn colour(picture: Picture, [left, top, right, bottom]: [f64; 4]) -> [u8; CHANNELS] {
    let (columns, rows) = (middle(left, right, picture.width()), middle(top, bottom, picture.height()));
    let mut counts = [[0_usize; 256]; CHANNELS];
    for row in rows.clone() {
        for colour in &picture.row(row)[columns.clone()] {
            for (counts, &value) in counts.iter_mut().zip(colour) {
                counts[usize::from(value)] += 1;
            }
        }
    }
    let n = rows.len() * columns.len();
    counts.map(|counts| value_at(&counts, (n - 1) / 2).midpoint(value_at(&counts, n / 2)))
}

fn middle(low: f64, high: f64, size: usize) -> Range<usize> {
    let (centre, half) = (f64::midpoint(low, high), PART * (high - low) / 2.0);
    let first = ((centre - half).floor().max(0.0) as usize).min(size - 1);
    first..((centre + half).ceil().max(0.0) as usize).clamp(first + 1, size)
}

/// The value with so many before it, of all in order.
fn value_at(counts: &[usize; 256], rank: usize) -> u8 {
    let mut below = 0;
    let is_reached = |&count: &usize| {
        below += count;
        below > rank
    };
    counts.iter().position(is_reached).unwrap_or_default() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 8 x 6 pixels, each blue by its column and green by its row.
    fn picture() -> Vec<u8> {
        (0..48_u8).flat_map(|at| [at % 8, at / 8, 7]).collect()
    }

    #[test]
    fn the_median_of_the_middle_of_a_box() {
        let values = picture();
        let of = |box_px| colour(Picture::new(&values, 8), box_px);
        // Columns 2 to 5, rows 1 to 4: between 3 and 4, and between 2 and 3.
        assert_eq!(of([0.0, 0.0, 8.0, 6.0]), [3, 2, 7]);
        assert_eq!(of([4.0, 2.0, 5.0, 3.0]), [4, 2, 7]);
    }

    #[test]
    fn a_box_beyond_the_edge_has_the_colour_there() {
        let values = picture();
        let of = |box_px| colour(Picture::new(&values, 8), box_px);
        assert_eq!(of([20.0, -9.0, 30.0, -5.0]), [7, 0, 7]);
    }
}
