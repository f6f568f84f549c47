//! Fruits that the picture shows where the detector gave no box.
//!
//! A fruit without a box may be hidden by leaves, or missed by the detector. The picture tells: within its predicted
//! outline, and outside of all boxes, it shows the colours that the boxes have, or not. How much of an outline must look
//! like fruit the recording says itself: as much as in three of four fruits that have a box, and more than in nearly all
//! places that have none. Where fruits have the colour of leaves, that is never.

use super::observation::Observation;
use super::prediction::Appearance;
use super::sphere::Interval;
use crate::camera::PixelBox;
use crate::look::{FRUIT, FruitColour};
use crate::stereo::Picture;

/// Steps of the share of an outline: 5 % each, less than a pixel's width of an edge.
const STEPS: usize = 20;

/// Fruits with a box, and places without one, that must have been looked at.
const ENOUGH: usize = 50;

/// Part of the fruits with a box that may show less than a fruit that is clear without one must, by which missed boxes are
/// counted, and than one that is seen at all.
const LESS_CLEAR: f64 = 0.5;
const LESS_THAN_SEEN: f64 = 0.25;

/// Boxes missed over boxes given, from which on a fruit that is seen without a box counts as seen. Where the detector
/// misses fewer, it mostly left those out rightly.
const MANY_MISSED: f64 = 0.05;

/// Part of the places without a fruit that may look as much like one.
const STRAYS: f64 = 0.02;

/// Of fewer fruits with a box nothing follows for those without one.
const LEAST_RECALL: f64 = 0.1;

/// The outline must be known to this part of its radius, one standard deviation: else another place is looked at.
const KNOWN: f64 = 0.5;

/// A fruit that should show in a frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Expected {
    pub landmark: usize,
    pub outline: [Interval; 2],
    /// Its box, if it has one.
    pub row: Option<usize>,
}

impl Expected {
    /// None where its outline is not known well enough.
    pub fn new(landmark: usize, appearance: &Appearance, row: Option<usize>) -> Option<Self> {
        let outline = appearance.outline;
        let is_known = |axis: usize| appearance.covariance[(axis, axis)].sqrt() < KNOWN * outline[axis].half();
        (is_known(0) && is_known(1)).then_some(Self { landmark, outline, row })
    }

    /// xmin, ymin, xmax, ymax.
    fn edges(&self) -> [f64; 4] {
        let [across, down] = self.outline;
        [across.low, down.low, across.high, down.high]
    }

    /// Moved by its own width and height: a place that is as likely as any to hold no fruit.
    fn beside(&self) -> [Self; 2] {
        let moved = |axis: usize| {
            let mut other = *self;
            let by = 2.0 * (other.outline[axis].high - other.outline[axis].low);
            other.outline[axis] = Interval { low: other.outline[axis].low + by, high: other.outline[axis].high + by };
            other.row = None;
            other
        };
        [moved(0), moved(1)]
    }
}

/// The picture of a frame that is still to be looked at.
#[derive(Debug, Clone)]
pub(crate) struct OwnedPicture {
    pub frame: i64,
    values: Vec<u8>,
    width: usize,
}

impl OwnedPicture {
    pub fn new(frame: i64, picture: Picture) -> Self {
        Self { frame, values: picture.values().to_vec(), width: picture.width() }
    }

    pub fn picture(&self) -> Picture<'_> {
        Picture::new(&self.values, self.width)
    }
}

/// How much of outlines looks like fruit, as learned while tracking.
#[derive(Debug, Clone, Default)]
pub(crate) struct Glimpses {
    with_box: [usize; STEPS],
    beside: [usize; STEPS],
    /// Boxes of the frames that were looked at, and those of them whose fruit would have been seen without its box.
    boxes: usize,
    clear: usize,
    /// Fruits without a box that were looked for, and those that were seen.
    looks: usize,
    found: usize,
}

impl Glimpses {
    /// The fruits without a box that the picture shows all the same.
    pub fn seen(&mut self, picture: Picture, observations: &[Observation], expected: &[Expected]) -> Vec<usize> {
        let (width, height) = (picture.width(), picture.height());
        let boxes: Vec<_> = observations.iter().map(|one| PixelBox::new(one.edges(), 0, width, height)).collect();
        if boxes.is_empty() {
            return Vec::new();
        }
        let colours = FruitColour::new(picture, &boxes);
        let share = |one: &Expected| {
            let pixels = PixelBox::new(one.edges(), 0, width, height);
            let is_other = |(row, other): &(usize, &PixelBox)| Some(*row) != one.row && other.touches(&pixels);
            let others: Vec<_> = boxes.iter().enumerate().filter(is_other).map(|(_, other)| other).collect();
            shown(picture, one.outline, &colours, |column, row| others.iter().any(|other| other.contains(column, row)))
        };
        let clear_so_far = self.least(LESS_CLEAR);
        self.boxes += boxes.len();
        let mut without = Vec::new();
        for one in expected {
            let Some(found) = share(one).map(step) else { continue };
            if one.row.is_some() {
                self.with_box[found] += 1;
                self.clear += usize::from(found >= clear_so_far);
                one.beside().iter().filter_map(share).for_each(|beside| self.beside[step(beside)] += 1);
            } else {
                without.push((one.landmark, found));
            }
        }
        let [seen, clear] = [LESS_THAN_SEEN, LESS_CLEAR].map(|part| self.least(part));
        self.looks += without.len();
        self.found += without.iter().filter(|&&(_, found)| found >= clear).count();
        without.into_iter().filter(|&(_, found)| found >= seen).map(|(landmark, _)| landmark).collect()
    }

    /// Whether so many boxes are missing that glimpses count.
    pub fn are_many_missed(&self) -> bool {
        self.missed_boxes() > MANY_MISSED * self.boxes as f64
    }

    /// Boxes that the detector missed: of fruits that show, a known part is seen without its box, and some places look
    /// like a fruit by chance.
    pub fn missed_boxes(&self) -> f64 {
        let recall = self.clear as f64 / self.boxes.max(1) as f64;
        let by_chance = STRAYS * self.looks as f64;
        if recall < LEAST_RECALL { 0.0 } else { (self.found as f64 - by_chance).max(0.0) / recall }
    }

    /// The step from which on an outline shows its fruit; beyond the last while too little is known.
    fn least(&self, less_clear: f64) -> usize {
        let total = |counts: &[usize; STEPS]| counts.iter().sum::<usize>();
        if total(&self.with_box) < ENOUGH || total(&self.beside) < ENOUGH {
            return STEPS;
        }
        quantile(&self.with_box, less_clear).max(quantile(&self.beside, 1.0 - STRAYS) + 1)
    }
}

fn step(share: f64) -> usize {
    ((share * STEPS as f64) as usize).min(STEPS - 1)
}

/// The step that holds this part of all.
fn quantile(counts: &[usize; STEPS], part: f64) -> usize {
    let wanted = part * counts.iter().sum::<usize>() as f64;
    let mut below = 0;
    counts
        .iter()
        .position(|&count| {
            below += count;
            below as f64 > wanted
        })
        .unwrap_or(STEPS - 1)
}

/// Part of an outline that looks like fruit and is not covered; None where the picture does not hold all of it.
fn shown(
    picture: Picture,
    outline: [Interval; 2],
    colours: &FruitColour,
    is_covered: impl Fn(usize, usize) -> bool,
) -> Option<f64> {
    let [across, down] = outline;
    let size = [picture.width() as f64, picture.height() as f64];
    if across.low < 0.0 || down.low < 0.0 || across.high > size[0] || down.high > size[1] {
        return None;
    }
    let pixels = PixelBox::new([across.low, down.low, across.high, down.high], 0, picture.width(), picture.height());
    let off = |at: usize, of: Interval| (at as f64 + 0.5 - f64::midpoint(of.low, of.high)) / of.half();
    let (mut all, mut fruit) = (0_usize, 0_usize);
    for (row, columns) in pixels.rows_in(|column, row| off(column, across).hypot(off(row, down)) <= 1.0) {
        all += columns.len();
        for (column, &colour) in columns.clone().zip(&picture.row(row)[columns]) {
            fruit += usize::from(colours.of(colour) > FRUIT && !is_covered(column, row));
        }
    }
    (all > 0).then(|| fruit as f64 / all as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::tracking::observation::{Boxes, LiftedBoxes, observations};

    const CAMERA: Camera =
        Camera { width: 320, height: 180, fx: 300.0, fy: 300.0, cx: 160.0, cy: 90.0, baseline_m: None };

    fn places() -> Vec<[f64; 4]> {
        let place = |k: usize| [16.0 + 60.0 * (k % 5) as f64, 20.0 + 60.0 * (k / 5) as f64];
        (0..15).map(place).map(|[x, y]| [x, y, x + 16.0, y + 16.0]).collect()
    }

    /// Discs on leaves; a fruit is red where `is_red`, else as green as the leaves.
    fn picture(is_red: bool) -> Vec<u8> {
        let inside = |column: usize, row: usize| {
            let in_one = |[left, top, _, _]: &[f64; 4]| {
                let off = |at: usize, from: &f64| (at as f64 + 0.5 - from - 8.0) / 8.0;
                off(column, left).hypot(off(row, top)) < 1.0
            };
            is_red && places().iter().any(in_one)
        };
        (0..180 * 320)
            .flat_map(|k| {
                let (column, row) = (k % 320, k / 320);
                let green = 90 + ((column * 7 + row * 13) % 90) as u8;
                if inside(column, row) { [30, 40, 200] } else { [40, green, green / 2] }
            })
            .collect()
    }

    fn missed(is_red: bool) -> Vec<usize> {
        let (values, all) = (picture(is_red), places());
        let boxes = Boxes { edges_px: &all[1..], scores: &vec![1.0; all.len() - 1] };
        let observations = observations(&CAMERA, &boxes, &LiftedBoxes::NONE).unwrap();
        let expected: Vec<_> = all
            .iter()
            .enumerate()
            .map(|(landmark, &[left, top, right, bottom])| Expected {
                landmark,
                outline: [Interval { low: left, high: right }, Interval { low: top, high: bottom }],
                row: landmark.checked_sub(1),
            })
            .collect();
        let mut glimpses = Glimpses::default();
        (0..6).map(|_| glimpses.seen(Picture::new(&values, 320), &observations, &expected)).last().unwrap()
    }

    #[test]
    fn a_red_fruit_that_the_detector_missed_is_seen() {
        assert_eq!(missed(true), [0]);
    }

    #[test]
    fn a_green_one_among_leaves_is_not() {
        assert!(missed(false).is_empty());
    }
}
