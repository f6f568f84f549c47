//! The disc of a fruit and what the pair says of its disparity.
//!
//! The outline of a box fixes a sphere up to its distance, so a pixel with the ray q sees it at the depth t Z (equation
//! (2) of `lifting::surface`), and in the right picture lies
//!
//! ```text
//! d(q) = f B / (t Z) = d_c / t                                                                    (1)
//! ```
//!
//! farther left, with one unknown for the whole fruit: the disparity `d_c` of its centre. So the disc is matched as one,
//! with the roundness of the fruit in it: near its rim t is 1, in its middle 1 - R/Z, which is most of a pixel.

use super::picture::{Bounds, CHANNELS, Picture, TRUNCATION};
use crate::camera::{Camera, PixelBox};
use crate::lifting::outline::Outline;
use crate::lifting::surface::UnitSphere;
use crate::look::FruitColour;

/// Part of the radius that is matched: up to the rim, where the edge of the fruit says most.
const PART: f64 = 0.97;

/// Weights are whole, so that costs sum without rounding: this is one.
const UNIT_WEIGHT: f64 = 64.0;

/// Bytes that are worked on at once.
const LANES: usize = 16;

/// So many weighted costs sum up in 16 bits.
const FEW: usize = (u16::MAX / (UNIT_WEIGHT as u16 * TRUNCATION as u16)) as usize;

/// Least weight of a pixel, over one: colour is a hint and no proof.
const MIN_WEIGHT: f64 = 0.02;

/// Fewer pixels than this match by chance.
const MIN_SPOTS: usize = 12;

/// More pixels of a box say no more: of a larger one every second, third, ... is taken, evenly.
const MOST_SPOTS: usize = 1200;

/// The least cost is sought this far about the best whole disparity, in steps of `STEP_PX`: how far the median pixel's
/// disparity misleads, and how far apart two places are between which colours still change evenly.
const REACH_PX: f64 = 1.5;
const STEP_PX: f64 = 0.25;

/// One pixel of a disc.
#[derive(Debug, Clone, Copy)]
struct Spot {
    column: usize,
    row: usize,
    colour: [u8; CHANNELS],
    /// t of equation (1).
    t: f64,
    weight: u16,
}

/// The pixels of a fruit's outline.
pub(crate) struct Disc {
    spots: Vec<Spot>,
    /// 1 / t at the median pixel: turns the disparity of the centre into that of the surface.
    pub(crate) front: f64,
    /// R / Z.
    pub(crate) radius: f64,
    weight: f64,
}

impl Disc {
    /// None where fewer than `MIN_SPOTS` pixels are in the outline.
    pub(crate) fn new(
        left: Picture,
        camera: &Camera,
        pixels: PixelBox,
        outline: &Outline,
        colours: &FruitColour,
    ) -> Option<Self> {
        let sphere = UnitSphere::new(outline.centre, outline.radius, PART);
        let every = (pixels.width() * pixels.height()).div_ceil(MOST_SPOTS).max(1);
        // Rows begin two fifths of the way farther, so that no direction is seen less often.
        let spots: Vec<Spot> = pixels
            .pixels()
            .filter(|(column, row)| (column + row * (2 * every).div_ceil(5)).is_multiple_of(every))
            .filter_map(|(column, row)| {
                let t = sphere.depth(camera.pixel_ray(column, row))?;
                let colour = left.at(column, row);
                // Squared: half a chance of being fruit is a quarter of a vote.
                let weight = (f64::from(colours.of(colour)).powi(2)).max(MIN_WEIGHT);
                Some(Spot { column, row, colour, t, weight: (UNIT_WEIGHT * weight).round().max(1.0) as u16 })
            })
            .collect();
        if spots.len() < MIN_SPOTS {
            return None;
        }
        let mut ts: Vec<f64> = spots.iter().map(|spot| spot.t).collect();
        let middle = ts.len() / 2;
        let front = 1.0 / *ts.select_nth_unstable_by(middle, f64::total_cmp).1;
        let weight = spots.iter().map(|spot| f64::from(spot.weight)).sum();
        Some(Self { spots, front, radius: outline.radius, weight })
    }

    /// Mean costs, 0 to 1, with all of the disc at the disparities 0, 1, ... of its median pixel.
    pub(crate) fn whole_costs(&self, right: &Bounds, count: usize) -> Vec<f64> {
        self.mean_costs(right, self.spots.iter().map(|spot| (spot.column, spot.row, spot.colour, spot.weight)), count)
    }

    /// Mean cost, 0 to 1, of the disparity `centre_px` under equation (1).
    fn cost(&self, right: Picture, centre_px: f64) -> f64 {
        let weighted = |spot: &Spot| f64::from(spot.weight) * spot.difference(right, centre_px);
        self.spots.iter().map(weighted).sum::<f64>() / (self.weight * f64::from(TRUNCATION))
    }

    /// Mean costs, 0 to 1, of bringing the disc, matched at `centre_px`, back to the left picture at 0, 1, ...
    pub(crate) fn costs_back(&self, left: &Bounds, right: Picture, centre_px: f64, count: usize) -> Vec<f64> {
        let matched = |spot: &Spot| {
            let column = (spot.column as f64 - centre_px / spot.t).round();
            (column >= 0.0).then(|| (column as usize, spot.row, right.at(column as usize, spot.row), spot.weight))
        };
        self.mean_costs(left, self.spots.iter().filter_map(matched), count)
    }

    fn mean_costs(
        &self,
        other: &Bounds,
        spots: impl Iterator<Item = (usize, usize, [u8; CHANNELS], u16)>,
        count: usize,
    ) -> Vec<f64> {
        // Whole registers: what is beyond the count is thrown away.
        let filled = count.next_multiple_of(LANES);
        let (mut sums, mut few, mut costs) = (vec![0_u32; filled], vec![0_u16; filled], vec![0_u8; filled]);
        let mut begun = 0;
        for (column, row, colour, weight) in spots {
            other.costs(colour, column, row, 0, &mut costs);
            for (sum, &cost) in few.iter_mut().zip(&costs) {
                *sum += weight * u16::from(cost);
            }
            begun += 1;
            if begun == FEW {
                empty_into(&mut sums, &mut few);
                begun = 0;
            }
        }
        empty_into(&mut sums, &mut few);
        let scale = 1.0 / (self.weight * f64::from(TRUNCATION));
        sums.into_iter().take(count).map(|sum| f64::from(sum) * scale).collect()
    }

    /// Disparity of the centre to a part of a pixel, from the least cost within `REACH_PX` of `start_px`.
    pub(crate) fn settled(&self, right: Picture, start_px: f64) -> f64 {
        let steps = (REACH_PX / STEP_PX) as i32;
        let costs: Vec<f64> = (-steps..=steps).map(|k| self.cost(right, start_px + STEP_PX * f64::from(k))).collect();
        let least = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or_default();
        let at = start_px - REACH_PX + STEP_PX * least as f64;
        if least == 0 || least + 1 == costs.len() {
            return at;
        }
        at + STEP_PX * vertex([costs[least - 1], costs[least], costs[least + 1]])
    }

    /// Part of the weight whose colour agrees with the right picture at `centre_px`.
    pub(crate) fn support(&self, right: Picture, centre_px: f64) -> f64 {
        let agrees = |spot: &&Spot| spot.difference(right, centre_px) < f64::from(TRUNCATION) / 2.0;
        self.spots.iter().filter(agrees).map(|spot| f64::from(spot.weight)).sum::<f64>() / self.weight
    }
}

fn empty_into(sums: &mut [u32], few: &mut [u16]) {
    for (sum, few) in sums.iter_mut().zip(few) {
        *sum += u32::from(std::mem::take(few));
    }
}

impl Spot {
    /// Difference of colour from the right picture under equation (1), summed over the channels and cut.
    fn difference(&self, right: Picture, centre_px: f64) -> f64 {
        let truncation = f64::from(TRUNCATION);
        right.between(self.column as f64 - centre_px / self.t, self.row).map_or(truncation, |colour| {
            (0..CHANNELS).map(|c| (f64::from(self.colour[c]) - colour[c]).abs()).sum::<f64>().min(truncation)
        })
    }
}

/// Where the parabola through three costs at -1, 0, 1 is least; the one in the middle is the least of them.
pub(crate) fn vertex([before, least, after]: [f64; 3]) -> f64 {
    let bend = before - 2.0 * least + after;
    if bend > 0.0 { 0.5 * (before - after) / bend } else { 0.0 }
}
