//! At which edges of a box something nearer than the fruit begins.

use super::outline::Covered;
use crate::camera::{DepthPicture, PixelBox};

/// A fruit that comes this near an edge of its box reaches it.
const REACH_PX: usize = 2;

/// The strip beyond the edge that is asked for what begins.
const BEYOND_PX: usize = 3;

/// An edge is covered when most of what lies beyond it is nearer than the fruit.
const COVERED_SHARE: f64 = 0.5;

/// Looks at the rows (columns) in which the fruit reaches each edge.
///
/// What lies beyond a fruit's own edge is farther than its rim, which is as far as its centre, or has no depth; a leaf
/// that hides the rest is nearer.
pub(crate) fn covered_edges(depth: DepthPicture, box_px: [f64; 4], fruit_m: f64, radius: f64) -> Covered {
    let inner = PixelBox::new(box_px, 0, depth.width(), depth.height());
    let outer = PixelBox::new(box_px, BEYOND_PX, depth.width(), depth.height());
    let rows = inner.top..inner.bottom;
    let columns = inner.left..inner.right;
    // From half a radius in front of the fruit to half a radius behind its centre.
    let on_fruit = |column, row| (depth.at(column, row) / fruit_m - 1.0 + radius / 2.0).abs() < radius;
    let nearer = |column, row| {
        let depth_m = depth.at(column, row);
        depth_m > 0.0 && depth_m < fruit_m
    };
    let reach_x = REACH_PX.min(inner.width());
    let reach_y = REACH_PX.min(inner.height());
    let in_row = |from: usize, to: usize| move |row: usize| (from..to).any(|column| on_fruit(column, row));
    let in_column = |from: usize, to: usize| move |column: usize| (from..to).any(|row| on_fruit(column, row));
    [
        covered(rows.clone(), outer.left..inner.left, in_row(inner.left, inner.left + reach_x), |row, column| {
            nearer(column, row)
        }),
        covered(columns.clone(), outer.top..inner.top, in_column(inner.top, inner.top + reach_y), nearer),
        covered(rows, inner.right..outer.right, in_row(inner.right - reach_x, inner.right), |row, column| {
            nearer(column, row)
        }),
        covered(columns, inner.bottom..outer.bottom, in_column(inner.bottom - reach_y, inner.bottom), nearer),
    ]
}

/// Whether most of `beyond` is nearer in those lines `along` the edge in which the fruit reaches it.
fn covered(
    along: std::ops::Range<usize>,
    beyond: std::ops::Range<usize>,
    reaches: impl Fn(usize) -> bool,
    nearer: impl Fn(usize, usize) -> bool,
) -> bool {
    let (mut seen, mut near) = (0.0, 0.0);
    for line in along.filter(|&line| reaches(line)) {
        for across in beyond.clone() {
            seen += 1.0;
            near += f64::from(u8::from(nearer(line, across)));
        }
    }
    near > COVERED_SHARE * seen
}
