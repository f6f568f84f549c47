//! Where the right picture of a rectified pair shows a point of the left one: the most similar patch of the same row.
//!
//! Similarity is the normalised cross-correlation, which a different exposure of the two cameras does not change. A match
//! has to be similar, and clearly more so than any other place of the row: leaves repeat.

/// A grey picture, row by row.
#[derive(Debug, Clone, Copy)]
pub struct Grey<'a> {
    /// Pixels, `width` a row.
    pub pixels: &'a [u8],
    /// Pixels of a row.
    pub width: usize,
}

impl Grey<'_> {
    /// Rows.
    pub fn height(&self) -> usize {
        self.pixels.len() / self.width.max(1)
    }
}

/// What counts as a match.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RowSearch {
    /// The patch reaches this far from its centre, 7 pixels at most. 11 x 11 pixels are a quarter of a leaf at 1.5 m with f = 417 px.
    pub radius_px: usize,
    /// Least similarity. On foliage 3 of 4 matches above it are right to a pixel.
    pub min_similarity: f64,
    /// How much less similar the second best place has to be, that is any more than 2 px from the best one.
    pub distinct: f64,
    /// Largest disparity that is looked for, pixels.
    pub farthest_px: usize,
}

impl Default for RowSearch {
    fn default() -> Self {
        Self { radius_px: 5, min_similarity: 0.6, distinct: 0.02, farthest_px: 128 }
    }
}

/// Places that belong to the best one's own peak.
const PEAK_PX: usize = 2;

/// Whole-pixel disparity of a point (column, row), `None` where nothing is similar enough, two places are nearly alike,
/// or the patch reaches over the edge.
pub fn disparity(left: Grey<'_>, right: Grey<'_>, (column, row): (usize, usize), search: &RowSearch) -> Option<usize> {
    let r = search.radius_px.min(7);
    let height = left.height();
    if column < r || row < r || column + r >= left.width || row + r >= height || right.pixels.len() != left.pixels.len()
    {
        return None;
    }
    let places = (column - r).min(search.farthest_px) + 1;
    let first = column + 1 - places - r;
    let similarity = similarities(left, right, (column - r, row - r), first, places, 2 * r + 1)?;
    let best = (0..places).max_by(|&a, &b| similarity[a].total_cmp(&similarity[b]))?;
    let apart = |&place: &usize| place.abs_diff(best) > PEAK_PX;
    let second = (0..places).filter(apart).map(|place| similarity[place]).fold(-1.0, f64::max);
    let matches = similarity[best] >= search.min_similarity && second <= similarity[best] - search.distinct;
    matches.then_some(places - 1 - best)
}

/// Similarity of the patch of the left picture at `corner` with those of the right one in the same rows that begin at the
/// columns from `first` on. `None` for a patch without contrast.
///
/// Sums of up to 255^2 * 15^2 are whole numbers below 2^24, which f32 holds exactly and multiplies four at a time.
fn similarities(
    left: Grey<'_>,
    right: Grey<'_>,
    corner: (usize, usize),
    first: usize,
    places: usize,
    side: usize,
) -> Option<Vec<f64>> {
    let width = places + side - 1;
    let (mut sums, mut squares) = (vec![0_f32; width], vec![0_f32; width]);
    // What is beyond the last place is black, and its products are thrown away.
    let room = places.next_multiple_of(LANES) + side - 1;
    let (mut strips, mut patch) = (vec![0_f32; room * side], Vec::with_capacity(side * side));
    for (row, strip) in (corner.1..).zip(strips.chunks_exact_mut(room)) {
        patch.extend(left.pixels[row * left.width + corner.0..][..side].iter().map(|&pixel| f32::from(pixel)));
        for (value, &pixel) in strip.iter_mut().zip(&right.pixels[row * right.width + first..][..width]) {
            *value = f32::from(pixel);
        }
        for ((sum, square), value) in sums.iter_mut().zip(&mut squares).zip(&*strip) {
            *sum += value;
            *square += value * value;
        }
    }
    let products: Vec<f32> =
        (0..places).step_by(LANES).flat_map(|place| products(&patch, side, &strips, room, place)).collect();
    let (sum, square) =
        patch.iter().fold((0.0, 0.0), |(sum, square), &one| (sum + f64::from(one), square + f64::from(one * one)));
    let n = (side * side) as f64;
    let own = square - sum * sum / n;
    let (sums, squares) = (running(&sums), running(&squares));
    let similarity = |place: usize| {
        let over = |columns: &[f64]| columns[place + side] - columns[place];
        let (other_sum, other_square) = (over(&sums), over(&squares));
        let other = other_square - other_sum * other_sum / n;
        let common = f64::from(products[place]) - sum * other_sum / n;
        if other < 1.0 { -1.0 } else { common / (own * other).sqrt() }
    };
    (own >= 1.0).then(|| (0..places).map(similarity).collect())
}

/// Places that are compared at once: their sums stay in registers.
const LANES: usize = 16;

/// Sums of the products of a patch with those that begin at `place` and after it, in rows of `room` values.
fn products(patch: &[f32], side: usize, strips: &[f32], room: usize, place: usize) -> [f32; LANES] {
    let mut sums = [0.0; LANES];
    for (values, strip) in patch.chunks_exact(side).zip(strips.chunks_exact(room)) {
        for (offset, &value) in values.iter().enumerate() {
            let Some(others) = strip[place + offset..].first_chunk::<LANES>() else { break };
            for (sum, other) in sums.iter_mut().zip(others) {
                *sum += value * other;
            }
        }
    }
    sums
}

/// Sums of the values before each place; whole numbers, so that their differences are exact.
fn running(values: &[f32]) -> Vec<f64> {
    let mut sums = Vec::with_capacity(values.len() + 1);
    let mut total = 0.0;
    sums.push(total);
    for &value in values {
        total += f64::from(value);
        sums.push(total);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix;

    const WIDTH: usize = 160;

    /// Noise, and the same seen with a disparity, darker.
    fn pair(disparity: usize) -> (Vec<u8>, Vec<u8>) {
        let mut random = SplitMix(3);
        let left: Vec<u8> = (0..WIDTH * 40).map(|_| random.below(256) as u8).collect();
        let right = (0..left.len())
            .map(|at| if at % WIDTH + disparity < WIDTH { left[at + disparity] / 2 + 20 } else { 0 })
            .collect();
        (left, right)
    }

    fn grey(pixels: &[u8]) -> Grey<'_> {
        Grey { pixels, width: WIDTH }
    }

    #[test]
    fn finds_the_shift_of_a_darker_picture() {
        for shift in [0, 1, 37] {
            let (left, right) = pair(shift);
            let found = disparity(grey(&left), grey(&right), (90, 20), &RowSearch::default());
            assert_eq!(found, Some(shift));
        }
    }

    #[test]
    fn what_repeats_or_is_too_far_or_has_no_contrast_has_no_disparity() {
        let search = RowSearch::default();
        let (left, right) = pair(37);
        assert_eq!(disparity(grey(&left), grey(&right), (90, 20), &RowSearch { farthest_px: 30, ..search }), None);
        let stripes: Vec<u8> = (0..WIDTH * 40).map(|at| if at % WIDTH % 16 < 8 { 200 } else { 30 }).collect();
        assert_eq!(disparity(grey(&stripes), grey(&stripes), (90, 20), &search), None);
        let grey_only = vec![90; WIDTH * 40];
        assert_eq!(disparity(grey(&grey_only), grey(&grey_only), (90, 20), &search), None);
    }

    #[test]
    fn patches_over_the_edge_have_no_disparity() {
        let (left, right) = pair(0);
        for place in [(2, 20), (90, 4), (WIDTH - 1, 20), (90, 36)] {
            assert_eq!(disparity(grey(&left), grey(&right), place, &RowSearch::default()), None);
        }
    }
}
