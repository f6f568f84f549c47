//! The disparity of fruits in a rectified pair, and the depth around them.
//!
//! Each fruit is matched as one disc (`disc`): the outline of its box leaves only the disparity open. Colours that the
//! boxes share weigh the pixels (`look`), so that a leaf in the box says little; sizes of surely matched fruits help the
//! unsure (`sizes`). The best disparity is then fixed to a part of a pixel, and kept where the way back from the right
//! picture agrees and no other disparity is nearly as good. How nearly, the margin, is also what says how sure it is. Of a
//! fruit that does not match, hidden from the right camera or from both, the size still says roughly how far it is.

pub mod alignment;
mod disc;
pub mod exposure;
mod picture;
mod sizes;
mod surroundings;

pub use picture::{CHANNELS, Picture};

use crate::camera::{Camera, PixelBox};
use crate::lifting::outline::Outline;
use crate::look::FruitColour;

use disc::Disc;
use picture::{Bounds, Side};
use sizes::Sizes;
use surroundings::Surroundings;

/// Farther fruits are smaller than detectors see, and a pixel of disparity is worth metres.
const FARTHEST_M: f64 = 20.0;

/// Costs this near the least, in pixels of disparity, belong to it; beyond, another disparity competes.
const VALLEY_PX: usize = 2;

/// The margin by which a match is sure enough to speak for the sizes of others.
const SURE_MARGIN: f64 = 0.1;

/// A match by less than this is a guess; set by eye on the rendered row.
const MIN_MARGIN: f64 = 0.05;

/// The disparity that leads back from the right picture differs by less than this, in pixels.
const BACK_PX: f64 = 1.5;

/// Standard deviation of a disparity times its margin, in pixels: on the rendered row 68 % of the errors are below
/// `SIGMA_MARGIN_PX / margin`, at all margins from 0.05 to 0.6, sizes and distances.
const SIGMA_MARGIN_PX: f64 = 0.095;

/// How far beyond a box depth is measured: what covers a fruit begins there.
const BESIDE_PX: usize = 5;

/// A rectified pair of cameras.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rig {
    /// The left one, with its baseline.
    pub camera: Camera,
    /// Nothing nearer is looked for.
    pub nearest_m: f64,
}

impl Rig {
    /// Disparities that are tried: the first, and one after the last.
    fn disparities(&self) -> (usize, usize) {
        // No disparity is wider than the picture, whatever the baseline.
        let reach = self.camera.focal_baseline_px_m();
        let first = ((reach / FARTHEST_M).ceil().max(1.0) as usize).min(self.camera.width.max(1));
        let end = ((reach / self.nearest_m).ceil() as usize).saturating_add(1);
        (first, end.clamp(first + 2 * VALLEY_PX + 2, self.camera.width.max(first + 2 * VALLEY_PX + 2)))
    }
}

/// What a pair says of one fruit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FruitDisparity {
    /// Disparity of its centre.
    pub centre_px: f64,
    /// Standard deviation.
    pub sigma_px: f64,
    /// Part of the outline, weighted by colour, that looks alike in both pictures; 0 where the fruit does not match and
    /// its disparity is what its size would have.
    pub support: f64,
}

impl FruitDisparity {
    /// Whether the pair shows it.
    pub fn is_matched(&self) -> bool {
        self.support > 0.0
    }
}

/// What a pair says of the fruits in boxes.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// Per box; none where the picture cuts it, or it does not match and too few others do to know a size.
    pub fruits: Vec<Option<FruitDisparity>>,
    /// Depth along the optical axis of the left camera, metres, 0 but around matched fruits.
    pub depth_m: Vec<f32>,
}

/// Matches the fruits in boxes (xmin, ymin, xmax, ymax).
///
/// # Panics
/// When the pictures differ in size from the camera's.
pub fn read(left: Picture, right: Picture, boxes_px: &[[f64; 4]], rig: &Rig) -> Reading {
    let camera = &rig.camera;
    for picture in [left, right] {
        assert_eq!((picture.width(), picture.height()), (camera.width, camera.height), "the camera's pictures");
    }
    let around = |beside| boxes_px.iter().map(move |&one| PixelBox::new(one, beside, camera.width, camera.height));
    let (inside, beside): (Vec<_>, Vec<_>) = (around(0).collect(), around(BESIDE_PX).collect());
    let colours = FruitColour::new(left, &inside);
    let rights = Bounds::new(right, Side::Left, &beside);
    let lefts = Bounds::new(left, Side::Right, &inside);
    let (first, end) = rig.disparities();
    let candidates: Vec<Option<Candidate>> = boxes_px
        .iter()
        .zip(&inside)
        .map(|(&box_px, &pixels)| {
            let outline = Outline::of_box(box_px, camera, [false; 4])?;
            let disc = Disc::new(left, camera, pixels, &outline, &colours)?;
            Some(Candidate::new(disc, &rights, first, end, camera.focal_baseline_px_m()))
        })
        .collect();
    let sizes = Sizes::of(candidates.iter().flatten().filter_map(Candidate::sure_diameter_m));
    let fruits: Vec<Option<FruitDisparity>> = candidates
        .iter()
        .map(|one| {
            let one = one.as_ref()?;
            one.decided(sizes.as_ref(), &lefts, right, end).or_else(|| Some(one.sized(sizes.as_ref()?)))
        })
        .collect();
    let windows: Vec<Option<Surroundings>> = fruits
        .iter()
        .zip(&beside)
        .map(|(fruit, &pixels)| {
            let fruit = fruit.as_ref().filter(|fruit| fruit.is_matched())?;
            Some(Surroundings::new(left, &rights, pixels, first, fruit.centre_px))
        })
        .collect();
    Reading { fruits, depth_m: picture_of(&windows, &inside, rig) }
}

/// A disc and its cost over the whole disparities.
struct Candidate {
    disc: Disc,
    /// Costs over their median, from the disparity `first` on.
    costs: Vec<f64>,
    first: usize,
    focal_baseline_px_m: f64,
}

impl Candidate {
    fn new(disc: Disc, rights: &Bounds, first: usize, end: usize, focal_baseline_px_m: f64) -> Self {
        let costs = disc.whole_costs(rights, end).split_off(first);
        let mut sorted = costs.clone();
        let middle = sorted.len() / 2;
        // A disc without any contrast costs nothing anywhere; then no margin is left, and it is refused.
        let median = sorted.select_nth_unstable_by(middle, f64::total_cmp).1.max(1e-6);
        let costs = costs.into_iter().map(|cost| cost / median).collect();
        Self { disc, costs, first, focal_baseline_px_m }
    }

    /// Disparity of the centre when the median pixel is at the `k`-th disparity.
    fn centre_px(&self, k: usize) -> f64 {
        (self.first + k) as f64 / self.disc.front
    }

    fn diameter_m(&self, k: usize) -> f64 {
        2.0 * self.disc.radius * self.focal_baseline_px_m / self.centre_px(k)
    }

    fn sure_diameter_m(&self) -> Option<f64> {
        let (best, margin) = best(&self.costs);
        (margin > SURE_MARGIN).then(|| self.diameter_m(best))
    }

    /// The disparity that it would have, were it of the usual size.
    fn sized(&self, sizes: &Sizes) -> FruitDisparity {
        let (diameter_m, spread) = sizes.usual();
        let centre_px = 2.0 * self.disc.radius * self.focal_baseline_px_m / diameter_m;
        FruitDisparity { centre_px, sigma_px: spread * centre_px, support: 0.0 }
    }

    /// None where no disparity is sure.
    fn decided(&self, sizes: Option<&Sizes>, lefts: &Bounds, right: Picture, end: usize) -> Option<FruitDisparity> {
        let size_cost = |k| sizes.map_or(0.0, |sizes| sizes.cost(self.diameter_m(k)));
        let costs: Vec<f64> = self.costs.iter().enumerate().map(|(k, cost)| cost + size_cost(k)).collect();
        let (best, margin) = best(&costs);
        if margin < MIN_MARGIN {
            return None;
        }
        let centre_px = self.disc.settled(right, self.centre_px(best));
        let back = self.disc.costs_back(lefts, right, centre_px, end).split_off(self.first);
        let back_px = self.centre_px((0..back.len()).min_by(|&a, &b| back[a].total_cmp(&back[b]))?);
        ((back_px - centre_px).abs() < BACK_PX).then(|| FruitDisparity {
            centre_px,
            sigma_px: SIGMA_MARGIN_PX / margin,
            support: self.disc.support(right, centre_px),
        })
    }
}

/// The least cost and the margin to the least of those beyond its valley.
fn best(costs: &[f64]) -> (usize, f64) {
    let best = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or_default();
    let rival =
        (0..costs.len()).filter(|k| k.abs_diff(best) > VALLEY_PX).map(|k| costs[k]).fold(f64::INFINITY, f64::min);
    (best, rival - costs[best])
}

/// Depth of the windows; where they overlap, a pixel in a box is of that box's window.
fn picture_of(windows: &[Option<Surroundings>], inside: &[PixelBox], rig: &Rig) -> Vec<f32> {
    let mut depth_m = vec![0.0; rig.camera.width * rig.camera.height];
    let scale = rig.camera.focal_baseline_px_m() as f32;
    let mut paint = |window: &Surroundings, wanted: &dyn Fn(usize, usize, f32) -> bool| {
        for ((column, row), disparity_px) in window.pixels.pixels().zip(&window.disparities_px) {
            let pixel = &mut depth_m[row * rig.camera.width + column];
            if wanted(column, row, *pixel) {
                *pixel = scale / disparity_px;
            }
        }
    };
    for window in windows.iter().flatten() {
        paint(window, &|_, _, before| before == 0.0);
    }
    for (window, own) in windows.iter().zip(inside).filter_map(|(window, own)| Some((window.as_ref()?, own))) {
        paint(window, &|column, row, _| own.contains(column, row));
    }
    depth_m
}
