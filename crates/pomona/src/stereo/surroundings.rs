//! Depth around a fruit whose disparity is known: semi-global matching in a window (Hirschmueller 2008).
//!
//! It says what covers the edges of the fruit's box. Four paths, along rows and columns, sum the costs of a pixel with those
//! of its neighbours: a step of one disparity costs little, any other a fixed sum, so that edges of leaves stay sharp.

use super::disc::vertex;
use super::picture::{Bounds, Picture};
use crate::camera::PixelBox;

/// Cost of a step of one disparity, and of any greater one; a pixel's own cost goes to 90 (`TRUNCATION`).
const STEP: i16 = 15;
const JUMP: i16 = 60;

/// Disparities up to this multiple of the fruit's are tried: what is nearer covers it from a third of the way.
const NEARER: f64 = 1.6;

/// More pixels say no more: of a larger window every second, third, ... along both sides is matched.
const MOST_PIXELS: usize = 2500;

/// A window: the disparity of its pixels, row by row.
pub(crate) struct Surroundings {
    pub(crate) pixels: PixelBox,
    pub(crate) disparities_px: Vec<f32>,
}

impl Surroundings {
    /// Matches the pixels around a fruit at `fruit_px`, from the disparity `first` on.
    pub(crate) fn new(left: Picture, right: &Bounds, pixels: PixelBox, first: usize, fruit_px: f64) -> Self {
        let end = (NEARER * fruit_px).ceil() as usize + 1;
        let count = end.saturating_sub(first).max(3);
        let step = step_of(pixels);
        let (width, height) = (pixels.width().div_ceil(step), pixels.height().div_ceil(step));
        let mut costs = vec![0_u8; count];
        let mut volume = Vec::with_capacity(width * height * count);
        for row in (pixels.top..pixels.bottom).step_by(step) {
            for column in (pixels.left..pixels.right).step_by(step) {
                right.costs(left.at(column, row), column, row, first, &mut costs);
                volume.extend(costs.iter().map(|&cost| i16::from(cost)));
            }
        }
        let sums = aggregated(&volume, width, height, count);
        let matched: Vec<f32> = sums.chunks_exact(count).map(|sums| (first as f64 + least(sums)) as f32).collect();
        let nearest =
            |(column, row): (usize, usize)| matched[(row - pixels.top) / step * width + (column - pixels.left) / step];
        Self { pixels, disparities_px: pixels.pixels().map(nearest).collect() }
    }
}

/// Pixels from one that is matched to the next.
fn step_of(pixels: PixelBox) -> usize {
    let mut step = 1;
    while pixels.width().div_ceil(step) * pixels.height().div_ceil(step) > MOST_PIXELS {
        step += 1;
    }
    step
}

/// Sums of the four paths.
fn aggregated(volume: &[i16], width: usize, height: usize, count: usize) -> Vec<i16> {
    let mut sums = vec![0; volume.len()];
    let mut path = Path::new(count);
    for row in 0..height {
        let places = (0..width).map(|column| row * width + column);
        path.walk(volume, &mut sums, places.clone());
        path.walk(volume, &mut sums, places.rev());
    }
    for column in 0..width {
        let places = (0..height).map(|row| row * width + column);
        path.walk(volume, &mut sums, places.clone());
        path.walk(volume, &mut sums, places.rev());
    }
    sums
}

/// Costs of one path at the pixel before and at this one, with a border on both sides.
struct Path {
    before: Vec<i16>,
    here: Vec<i16>,
}

/// Never the least, and far from overflow with a step added; signed, as every processor compares those at once.
const BORDER: i16 = i16::MAX / 2;

impl Path {
    fn new(count: usize) -> Self {
        Self { before: vec![BORDER; count + 2], here: vec![BORDER; count + 2] }
    }

    fn walk(&mut self, volume: &[i16], sums: &mut [i16], places: impl Iterator<Item = usize>) {
        let count = self.here.len() - 2;
        self.before[1..=count].fill(0);
        for place in places {
            let range = place * count..(place + 1) * count;
            let least = self.before[1..=count].iter().fold(BORDER, |least, &one| least.min(one));
            let jump = least + JUMP;
            let (below, same, above) = (&self.before[..count], &self.before[1..=count], &self.before[2..]);
            let around = below.iter().zip(same).zip(above);
            let costs = volume[range.clone()].iter().zip(&mut sums[range]).zip(&mut self.here[1..=count]);
            for (((&below, &same), &above), ((cost, sum), here)) in around.zip(costs) {
                *here = cost + same.min(below.min(above) + STEP).min(jump) - least;
                *sum += *here;
            }
            std::mem::swap(&mut self.before, &mut self.here);
        }
    }
}

/// Where the sums are least, to a part of a step.
fn least(sums: &[i16]) -> f64 {
    let least = (0..sums.len()).min_by_key(|&d| sums[d]).unwrap_or_default();
    if least == 0 || least + 1 == sums.len() {
        return least as f64;
    }
    least as f64 + vertex([least - 1, least, least + 1].map(|d| f64::from(sums[d])))
}
