//! Points and their disparities, looked for where they are large enough to be seen.
//!
//! A tall picture shows the same leaves as its halving, only larger than the windows that tell them apart, and is slower
//! to look through. So corners and whole disparities are looked for in a halving; where exactly they are,
//! [`super::follow`] finds in the whole picture.

use super::config::PicturesConfig;
use super::corners::strongest;
use crate::row_search::{Grey, RowSearch, disparity};
use nalgebra::Vector2;

/// Corners that are not near those already `taken`, so many in each cell with these; by cells, the strongest first.
///
/// Pictures come with their halvings, finest first.
pub fn corners(
    pictures: &[Grey<'_>],
    taken: &[Vector2<f64>],
    per_cell: usize,
    config: &PicturesConfig,
) -> Vec<Vector2<f64>> {
    let Some((picture, scale)) = looked_in(pictures, config) else { return Vec::new() };
    let taken: Vec<_> = taken.iter().map(|place| place / scale).collect();
    strongest(picture, &taken, per_cell, config).into_iter().map(|place| place * scale).collect()
}

/// Disparities of points (x, y) of the left picture, to a pixel of the halving; none where nothing is found.
///
/// Pictures come with their halvings, finest first.
pub fn disparities(
    left: &[Grey<'_>],
    right: &[Grey<'_>],
    points: &[Vector2<f64>],
    farthest_px: f64,
    config: &PicturesConfig,
) -> Vec<Option<f64>> {
    let levels = left.len().min(right.len());
    let Some((left, scale)) = looked_in(&left[..levels], config) else { return vec![None; points.len()] };
    let Some((right, _)) = looked_in(&right[..levels], config) else { return vec![None; points.len()] };
    let search = RowSearch { farthest_px: (farthest_px / scale) as usize, ..RowSearch::default() };
    let place = |point: &Vector2<f64>| (point / scale).map(|at| at.round_ties_even() as usize);
    let found = |point| disparity(left, right, (place(point).x, place(point).y), &search);
    points.iter().map(|point| found(point).map(|disparity_px| disparity_px as f64 * scale)).collect()
}

/// The finest picture that is not too tall, and how much smaller than the whole one it is.
fn looked_in<'a>(pictures: &[Grey<'a>], config: &PicturesConfig) -> Option<(Grey<'a>, f64)> {
    let level = pictures.iter().position(|picture| picture.height() <= config.tallest_px);
    let level = level.unwrap_or(pictures.len().saturating_sub(1));
    pictures.get(level).map(|&picture| (picture, f64::from(1_u32 << level)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix;

    const SIZE: [usize; 2] = [320, 180];

    /// Noise, each value twice along and down, and its halving.
    fn noise(shift: usize) -> [Vec<u8>; 2] {
        let [width, height] = SIZE;
        let mut random = SplitMix(4);
        let half: Vec<u8> = (0..width * height / 4).map(|_| random.below(256) as u8).collect();
        let half: Vec<u8> = (0..half.len()).map(|at| half[(at + shift / 2) % half.len()]).collect();
        let whole = (0..width * height).map(|at| half[at / width / 2 * (width / 2) + at % width / 2]).collect();
        [whole, half]
    }

    fn greys(pictures: &[Vec<u8>; 2]) -> [Grey<'_>; 2] {
        let [width, _] = SIZE;
        [Grey { pixels: &pictures[0], width }, Grey { pixels: &pictures[1], width: width / 2 }]
    }

    #[test]
    fn a_tall_picture_is_looked_at_in_its_halving() {
        let (left, right) = (noise(0), noise(12));
        let tall = PicturesConfig { tallest_px: 90, ..PicturesConfig::default() };
        let found = corners(&greys(&left), &[], 3, &tall);
        let of_half: Vec<_> = strongest(greys(&left)[1], &[], 3, &tall).into_iter().map(|place| 2.0 * place).collect();
        assert!(found.len() > 50 && found == of_half, "{}", found.len());
        let points = [Vector2::new(201.0, 90.0), Vector2::new(160.0, 41.0)];
        let disparities = disparities(&greys(&left), &greys(&right), &points, 60.0, &tall);
        assert_eq!(disparities, [Some(12.0); 2]);
    }

    #[test]
    fn nothing_is_found_in_no_picture() {
        let config = PicturesConfig::default();
        assert!(corners(&[], &[], 3, &config).is_empty());
        assert_eq!(disparities(&[], &[], &[Vector2::new(3.0, 4.0)], 60.0, &config), [None]);
    }
}
