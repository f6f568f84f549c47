//! Corners, spread over the picture: the strongest of each cell (Shi and Tomasi, 1994).
//!
//! The strength of a pixel is the least eigenvalue of sum g g^T over 5 x 5 pixels around it, g being the gradient (Sobel), of
//! a picture with values from 0 to 1. A corner is stronger than all that is near, and not near one that is taken.

use super::config::PicturesConfig;
use crate::row_search::Grey;
use nalgebra::Vector2;

/// Rows and columns of the window.
const WINDOW: usize = 5;

/// From the centre of the window to the pixels that its outermost gradients see.
const REACH: usize = WINDOW / 2 + 1;

/// Of a sum of gradients: Sobel's weights are four times the mean, values go to 255, and the sum is divided by the side.
const UNIT: f32 = 1.0 / (4.0 * 5.0 * 255.0);

/// Corners of a picture that are not near those already `taken`, so many in each cell with these; by cells, the strongest
/// first.
pub(super) fn strongest(
    picture: Grey<'_>,
    taken: &[Vector2<f64>],
    per_cell: usize,
    config: &PicturesConfig,
) -> Vec<Vector2<f64>> {
    let (width, height) = (picture.width, picture.height());
    if width <= 2 * REACH || height <= 2 * REACH {
        return Vec::new();
    }
    let side = (width / config.cells_across).max(1);
    let cell = |column: usize, row: usize| row / side * (width / side + 1) + column / side;
    let mut free = vec![per_cell; (height / side + 1) * (width / side + 1)];
    let mut is_near = vec![false; width * height];
    for place in taken {
        let inside = |at: f64, size: usize| at.round_ties_even().clamp(0.0, (size - 1) as f64) as usize;
        let (column, row) = (inside(place.x, width), inside(place.y, height));
        let room = &mut free[cell(column, row)];
        *room = room.saturating_sub(1);
        let reach = config.min_distance_px;
        for row in row.saturating_sub(reach)..(row + reach + 1).min(height) {
            is_near[row * width..][column.saturating_sub(reach)..(column + reach + 1).min(width)].fill(true);
        }
    }
    let strengths = strengths(picture);
    let mut found: Vec<(usize, f32, usize)> = peaks(&strengths, width, config)
        .into_iter()
        .filter(|&at| !is_near[at])
        .map(|at| (cell(at % width, at / width), strengths[at], at))
        .collect();
    found.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)).then(a.2.cmp(&b.2)));
    found.retain(|one| {
        let has_room = free[one.0] > 0;
        free[one.0] -= usize::from(has_room);
        has_room
    });
    found.into_iter().map(|(_, _, at)| Vector2::new((at % width) as f64, (at / width) as f64)).collect()
}

/// Pixels that are strong, as strong as all around, and not at the edge, in order.
fn peaks(strengths: &[f32], width: usize, config: &PicturesConfig) -> Vec<usize> {
    let (height, reach, edge) = (strengths.len() / width, config.min_distance_px, config.edge_px);
    let mut across = vec![0.0; strengths.len()];
    for (row, widest) in strengths.chunks_exact(width).zip(across.chunks_exact_mut(width)) {
        widest.copy_from_slice(row);
        for shift in 1..=reach.min(width) {
            raise(widest, &row[shift..]);
            raise(&mut widest[shift..], row);
        }
    }
    let mut found = Vec::new();
    let mut around = vec![0.0; width];
    for row in edge..height.saturating_sub(edge) {
        around.fill(0.0);
        for other in row.saturating_sub(reach)..(row + reach + 1).min(height) {
            raise(&mut around, &across[other * width..(other + 1) * width]);
        }
        let here = &strengths[row * width..(row + 1) * width];
        for column in edge..width.saturating_sub(edge) {
            if here[column] >= around[column] && f64::from(here[column]) > config.min_corner {
                found.push(row * width + column);
            }
        }
    }
    found
}

/// Raises values to others where those are greater.
fn raise(values: &mut [f32], others: &[f32]) {
    for (value, &other) in values.iter_mut().zip(others) {
        *value = if other > *value { other } else { *value };
    }
}

/// Sums of products of gradients along a row: x x, x y, y y.
type Products = [Vec<i32>; 3];

/// Least eigenvalues, 0 at the edge. Sums of products are whole: 25 times 1020^2 are below 2^31.
fn strengths(picture: Grey<'_>) -> Vec<f32> {
    let (width, height) = (picture.width, picture.height());
    let zeros = || -> Products { std::array::from_fn(|_| vec![0; width]) };
    let mut rows: [Products; WINDOW] = std::array::from_fn(|_| zeros());
    let (mut sums, mut gradients) = (zeros(), Gradients::new(width));
    let mut all = vec![0.0; width * height];
    for row in 1..height - 1 {
        let oldest = &mut rows[row % WINDOW];
        for (sum, old) in sums.iter_mut().zip(oldest.iter()) {
            sum.iter_mut().zip(old).for_each(|(sum, old)| *sum -= old);
        }
        gradients.products(picture, row, oldest);
        for (sum, new) in sums.iter_mut().zip(oldest.iter()) {
            sum.iter_mut().zip(new).for_each(|(sum, new)| *sum += new);
        }
        if row >= WINDOW {
            let centre = row - WINDOW / 2;
            eigenvalues(&sums, &mut all[centre * width..(centre + 1) * width]);
        }
    }
    all
}

fn eigenvalues([xx, xy, yy]: &Products, row: &mut [f32]) {
    let inside = REACH..row.len() - REACH;
    let products = xx[inside.clone()].iter().zip(&xy[inside.clone()]).zip(&yy[inside.clone()]);
    for (strength, ((&xx, &xy), &yy)) in row[inside].iter_mut().zip(products) {
        let (xx, xy, yy) =
            (xx as f32 * (0.5 * UNIT * UNIT), xy as f32 * (UNIT * UNIT), yy as f32 * (0.5 * UNIT * UNIT));
        *strength = (xx + yy) - ((xx - yy) * (xx - yy) + xy * xy).sqrt();
    }
}

/// Room for the gradients of one row.
struct Gradients {
    smooth: Vec<i16>,
    slope: Vec<i16>,
    single: Vec<i32>,
}

impl Gradients {
    fn new(width: usize) -> Self {
        Self { smooth: vec![0; width], slope: vec![0; width], single: vec![0; width] }
    }

    /// Writes the products of a row, summed over the columns of the window.
    fn products(&mut self, picture: Grey<'_>, row: usize, products: &mut Products) {
        let width = picture.width;
        let line = |row: usize| &picture.pixels[row * width..(row + 1) * width];
        let lines = line(row - 1).iter().zip(line(row)).zip(line(row + 1));
        for ((smooth, slope), ((&above, &here), &below)) in self.smooth.iter_mut().zip(&mut self.slope).zip(lines) {
            let [above, here, below] = [above, here, below].map(i16::from);
            (*smooth, *slope) = (above + 2 * here + below, below - above);
        }
        for (which, sums) in products.iter_mut().enumerate() {
            self.multiply(which);
            let n = width - 2 - (WINDOW - 1);
            let at = |shift: usize| self.single[1 + shift..][..n].iter();
            let five = at(0).zip(at(1)).zip(at(2)).zip(at(3)).zip(at(4));
            for (sum, ((((a, b), c), d), e)) in sums[REACH..].iter_mut().zip(five) {
                *sum = a + b + c + d + e;
            }
        }
    }

    /// Products of x x, x y or y y at each pixel but the first and the last.
    fn multiply(&mut self, which: usize) {
        let n = self.single.len() - 2;
        let (left, right) = (&self.smooth[..n], &self.smooth[2..]);
        let (before, here, after) = (&self.slope[..n], &self.slope[1..=n], &self.slope[2..]);
        let seen = left.iter().zip(right).zip(before.iter().zip(here).zip(after));
        for (product, ((left, right), ((before, here), after))) in self.single[1..=n].iter_mut().zip(seen) {
            let (x, y) = (i32::from(right - left), i32::from(before + 2 * here + after));
            *product = match which {
                0 => x * x,
                1 => x * y,
                _ => y * y,
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 160;

    /// Bright squares on black, each with four corners.
    fn squares(at: &[(usize, usize)]) -> Vec<u8> {
        let mut pixels = vec![20; WIDTH * 90];
        for &(left, top) in at {
            for row in top..top + 20 {
                pixels[row * WIDTH + left..row * WIDTH + left + 20].fill(200);
            }
        }
        pixels
    }

    fn found(pixels: &[u8], taken: &[Vector2<f64>], per_cell: usize) -> Vec<Vector2<f64>> {
        strongest(Grey { pixels, width: WIDTH }, taken, per_cell, &PicturesConfig::default())
    }

    #[test]
    fn a_square_has_four_corners() {
        let pixels = squares(&[(40, 30)]);
        let all = found(&pixels, &[], 3);
        for corner in [[39.5, 29.5], [59.5, 29.5], [39.5, 49.5], [59.5, 49.5]].map(Vector2::from) {
            assert!(all.iter().any(|one| (one - corner).norm() < 3.0), "{corner}: {all:?}");
        }
        assert!(all.iter().all(|one| [39.5, 59.5].iter().any(|x| (one.x - x).abs() < 3.0)), "{all:?}");
    }

    #[test]
    fn a_cell_gives_so_many_with_those_that_are_taken() {
        // Cells are 10 px wide; noise fills them all.
        let mut random = crate::random::SplitMix(8);
        let pixels: Vec<u8> = (0..WIDTH * 90).map(|_| random.below(256) as u8).collect();
        let in_cell = |all: &[Vector2<f64>]| {
            all.iter().filter(|one| (50.0..60.0).contains(&one.x) && (40.0..50.0).contains(&one.y)).count()
        };
        assert_eq!(in_cell(&found(&pixels, &[], 1)), 1);
        assert_eq!(in_cell(&found(&pixels, &[Vector2::new(50.0, 40.0)], 1)), 0);
        let many = found(&pixels, &[], 100);
        let taken = [many[many.len() / 2]];
        let others = found(&pixels, &taken, 100);
        let near = |one: &Vector2<f64>| (one - taken[0]).abs().max() <= 4.0;
        assert_eq!(others.len(), many.iter().filter(|one| !near(one)).count());
    }

    #[test]
    fn flat_pictures_edges_and_tiny_pictures_have_none() {
        assert!(found(&squares(&[]), &[], 5).is_empty());
        let bar: Vec<u8> = (0..WIDTH * 90).map(|at| if at % WIDTH < 80 { 20 } else { 200 }).collect();
        assert!(found(&bar, &[], 5).is_empty());
        assert!(found(&squares(&[(0, 0)]), &[], 5).iter().all(|one| one.x >= 8.0 && one.y >= 8.0));
        assert!(strongest(Grey { pixels: &[9; 25], width: 5 }, &[], 1, &PicturesConfig::default()).is_empty());
    }
}
