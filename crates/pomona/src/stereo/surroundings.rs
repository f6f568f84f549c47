//! Depth around a fruit whose disparity is known: semi-global matching in a window (Hirschmueller 2008).
//!
//! It says what covers the edges of the fruit's box. Four paths, along rows and columns, sum the costs of a pixel with those
//! of its neighbours: a step of one disparity costs little, any other a fixed sum, so that edges of leaves stay sharp.

use super::disc::vertex;
use super::picture::{Bounds, Picture, TRUNCATION};
use crate::camera::PixelBox;

/// Cost of a step of one disparity, and of any greater one; a pixel's own cost goes to 90 (`TRUNCATION`).
const STEP: u8 = 15;
const JUMP: u8 = 60;

/// Paths that are summed: none adds more than `JUMP` to a pixel's own cost, so what they add fits a byte.
const PATHS: u8 = 4;
const _: () = assert!(PATHS as u16 * JUMP as u16 <= u8::MAX as u16);

/// Disparities that are matched at once: bytes of a register that every processor has.
const LANES: usize = 16;

/// Cost of what fills the last register: so far above all others that a step from there costs a jump.
const NONE: u8 = u8::MAX - JUMP;
const _: () = assert!(NONE - (TRUNCATION + JUMP) + STEP >= JUMP);

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
        let filled = count.next_multiple_of(LANES);
        let mut volume = vec![0; width * height * filled];
        let places = (pixels.top..pixels.bottom)
            .step_by(step)
            .flat_map(|row| (pixels.left..pixels.right).step_by(step).map(move |column| (column, row)));
        for (costs, (column, row)) in volume.chunks_exact_mut(filled).zip(places) {
            right.costs(left.at(column, row), column, row, first, costs);
            costs[count..].fill(NONE);
        }
        let sums = aggregated(&volume, width, height, filled);
        let matched: Vec<f32> =
            sums.chunks_exact(filled).map(|sums| (first as f64 + least(&sums[..count])) as f32).collect();
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

/// Sums of the four paths; a pixel has `count` costs, whole registers.
fn aggregated(volume: &[u8], width: usize, height: usize, count: usize) -> Vec<u16> {
    let mut added = vec![0; volume.len()];
    let mut path = Path::new(count);
    for row in 0..height {
        let places = (0..width).map(|column| row * width + column);
        path.walk(volume, &mut added, places.clone());
        path.walk(volume, &mut added, places.rev());
    }
    for column in 0..width {
        let places = (0..height).map(|row| row * width + column);
        path.walk(volume, &mut added, places.clone());
        path.walk(volume, &mut added, places.rev());
    }
    let sum = |(&cost, &added): (&u8, &u8)| u16::from(PATHS) * u16::from(cost) + u16::from(added);
    volume.iter().zip(&added).map(sum).collect()
}

/// Costs of one path at the pixel before, over the least of them, with a border on both sides.
///
/// Bytes, sixteen of which every processor adds and compares at once.
struct Path {
    before: Vec<u8>,
    here: Vec<u8>,
}

/// Never the least.
const BORDER: u8 = u8::MAX;

impl Path {
    fn new(count: usize) -> Self {
        Self { before: vec![BORDER; count + 2], here: vec![BORDER; count + 2] }
    }

    /// Sums what a path adds to the costs of its places.
    fn walk(&mut self, volume: &[u8], sums: &mut [u8], places: impl Iterator<Item = usize>) {
        let count = self.here.len() - 2;
        self.before[1..=count].fill(0);
        for place in places {
            let range = place * count..(place + 1) * count;
            let (below, same, above) = (&self.before[..count], &self.before[1..=count], &self.before[2..]);
            let around = lanes(below).iter().zip(lanes(same)).zip(lanes(above));
            let given = lanes(&volume[range.clone()]).iter();
            let made = lanes_mut(&mut sums[range]).iter_mut().zip(lanes_mut(&mut self.here[1..=count]));
            let mut least = [BORDER; LANES];
            for ((((below, same), above), cost), (sum, here)) in around.zip(given).zip(made) {
                for k in 0..LANES {
                    let added = same[k].min(below[k].min(above[k]).saturating_add(STEP)).min(JUMP);
                    here[k] = cost[k] + added;
                    sum[k] += added;
                    least[k] = least[k].min(here[k]);
                }
            }
            let least = least.into_iter().fold(BORDER, u8::min);
            lanes_mut(&mut self.here[1..=count]).iter_mut().flatten().for_each(|one| *one -= least);
            std::mem::swap(&mut self.before, &mut self.here);
        }
    }
}

fn lanes(values: &[u8]) -> &[[u8; LANES]] {
    values.as_chunks().0
}

fn lanes_mut(values: &mut [u8]) -> &mut [[u8; LANES]] {
    values.as_chunks_mut().0
}

/// Where the sums are least, to a part of a step.
fn least(sums: &[u16]) -> f64 {
    let lowest = sums.iter().fold(u16::MAX, |lowest, &sum| lowest.min(sum));
    let least = sums.iter().position(|&sum| sum == lowest).unwrap_or_default();
    if least == 0 || least + 1 == sums.len() {
        return least as f64;
    }
    least as f64 + vertex([least - 1, least, least + 1].map(|d| f64::from(sums[d])))
}
