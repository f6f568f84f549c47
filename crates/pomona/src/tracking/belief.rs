//! Which tracks are fruits, and how sure that is.
//!
//! A detector finds a fruit in part of the frames in which it stays in view, and takes leaves for fruits. So three
//! questions are asked of a track, and the probability that it is a fruit is the product of the answers.
//!
//! **Was it seen often enough?** `min_views` boxes are, however long it was in view. Where the camera moves on so fast
//! that a fruit stays in view for n <= 2 `min_views` frames, the same way past it shows it in fewer, in proportion:
//!
//! ```text
//! T = 1/2 + q (min_views - 1/2) min(1, n / (2 min_views + 1)),    k + g + v >= T
//! ```
//!
//! q is the part that is known of the frames that show a fruit: all boxes and glimpses over all boxes and those that the
//! detector missed, as pictures of fruits without a box tell. k boxes, g frames that show it without a box ([`super::glimpse`]), and v in [0, 1) the rank of the area that it shows:
//! a track of k boxes stands for a stretch of k to k + 1 frames, and the clearer it shows, the longer.
//!
//! **Does it look like a fruit?** With x the mean fruitness of its boxes ([`crate::look`]),
//!
//! ```text
//! p = w N(x; fruits) / (w N(x; fruits) + (1 - w) N(x; places without a box)),
//! ```
//!
//! where places without a box are measured, and w and the fruits' normal distribution are those that explain all boxes
//! best. Where fruits look like leaves both distributions are alike and p is w for all: nothing is dropped.
//!
//! **Is it as large as one fruit?** A cluster of the row behind in one box, or a fruit whose depth is that of what stands
//! behind it, is larger than any fruit beside it. With d the diameter of a track, s its standard deviation, m the median
//! diameter of the tracks that the first two questions leave and r their spread,
//!
//! ```text
//! p = w N(ln d; ln m, r^2 + s^2 / d^2) / (w N(ln d; ln m, r^2 + s^2 / d^2) + (1 - w) / ln 1000)    for d > m,
//! ```
//!
//! sizes of what is no single fruit being any from 1 mm to 1 m. What is smaller may be half of a fruit behind a leaf: p is 1.

use super::config::TrackingConfig;
use crate::camera::Camera;
use crate::pose::Pose;
use nalgebra::Vector3;

/// Tracks of which it is asked how long they stay in view.
const SAMPLED: usize = 200;

/// Fewer that came and went say nothing of the others.
const FEW: usize = 5;

/// A fruit is in view from as far as it was seen, and half as much again.
const IN_RANGE: f64 = 1.5;

/// Nats of one more box: beside the threshold four of five decisions are right.
const NATS_OF_A_BOX: f64 = 1.5;

/// Boxes, and places without one, that must have been looked at before colours say anything.
const ENOUGH: usize = 30;

/// Boxes that what is assumed at the start is worth: nine of ten show fruits.
const ASSUMED: f64 = 20.0;
const TRUE_BOXES: f64 = 0.9;

/// Least standard deviation of fruitness: of fewer the pixels of a small box make more.
const LEAST_SIGMA: f64 = 0.04;

/// Of a hundred tracks one is of something else than a fruit at its own depth.
const OF_ONE_FRUIT: f64 = 0.99;

/// Logarithm of the largest size over the smallest, 1 m and 1 mm.
const SIZES_LN: f64 = 6.908;

/// Least standard deviation of the logarithm of a diameter: fruits of one tree differ by 8 to 12 %.
const LEAST_SPREAD: f64 = 0.1;

/// From the lower to the upper quartile of a normal distribution, in standard deviations.
const QUARTILES_SIGMAS: f64 = 1.349;

/// Rounds of expectation and maximisation; it settles in ten.
const ROUNDS: usize = 30;

/// What is known of the tracks of a part, one row each.
#[derive(Debug, Clone, Copy)]
pub struct TrackViews<'a> {
    /// Centres in the session's frame, metres.
    pub centres: &'a [Vector3<f64>],
    /// Depth from which a track was seen, metres.
    pub depths_m: &'a [f64],
    /// Frames with a box.
    pub views: &'a [usize],
    /// Frames that show it without a box.
    pub glimpses: &'a [usize],
    /// Mean area that its boxes show, square metres at its depth; NaN where nobody knows.
    pub shown_m2: &'a [f64],
    /// Mean fruitness of its boxes; NaN where nobody knows.
    pub fruitness: &'a [f64],
    /// Diameters, metres, and their standard deviations; NaN where nothing was measured.
    pub diameters_m: &'a [f64],
    /// See `diameters_m`.
    pub diameter_sigmas_m: &'a [f64],
    /// Boxes that the detector missed; 0 where no picture was looked at.
    pub missed_boxes: f64,
}

/// Fruitness of all boxes, and of places without one.
#[derive(Debug, Clone, Copy)]
pub struct Colours<'a> {
    /// Of boxes.
    pub boxes: &'a [f64],
    /// Of places that no box touches.
    pub elsewhere: &'a [f64],
}

/// How far tracks are fruits.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Belief {
    /// Per track: probability that it is a fruit.
    pub probability: Vec<f64>,
    /// Per track: whether it is to be reported.
    pub is_believed: Vec<bool>,
    /// Frames for which a fruit stays in view, from its coming to its going; 0 where there is none.
    pub frames_in_view: f64,
}

/// Weighs the tracks of a part.
///
/// # Panics
/// If the slices differ in length.
pub fn belief(
    tracks: &TrackViews<'_>,
    colours: &Colours<'_>,
    (camera, poses): (&Camera, &[Pose]),
    config: &TrackingConfig,
) -> Belief {
    let n = tracks.centres.len();
    for length in [
        tracks.depths_m.len(),
        tracks.views.len(),
        tracks.glimpses.len(),
        tracks.shown_m2.len(),
        tracks.fruitness.len(),
        tracks.diameters_m.len(),
        tracks.diameter_sigmas_m.len(),
    ] {
        assert_eq!(length, n, "one row for each track");
    }
    let frames_in_view = frames_in_view(tracks, camera, poses);
    let wanted = wanted(frames_in_view, known_share(tracks), config.min_views);
    let colour = FruitOrLeaf::of(colours);
    let (mut probability, mut is_believed) = (Vec::with_capacity(n), Vec::with_capacity(n));
    for (row, rank) in ranks(tracks.shown_m2).into_iter().enumerate() {
        let seen = (tracks.views[row] + tracks.glimpses[row]) as f64 + rank;
        let often = 1.0 / (1.0 + (-NATS_OF_A_BOX * (seen - wanted)).exp());
        let looks = colour.as_ref().map_or(1.0, |colour| colour.probability(tracks.fruitness[row]));
        probability.push(often * looks);
        is_believed.push(often >= 0.5 && looks >= 0.5);
    }
    if let Some(sizes) = Sizes::of(tracks, &is_believed) {
        for row in 0..n {
            let single = sizes.probability(tracks.diameters_m[row], tracks.diameter_sigmas_m[row]);
            probability[row] *= single;
            is_believed[row] &= single >= 0.5;
        }
    }
    Belief { probability, is_believed, frames_in_view }
}

/// T.
fn wanted(frames_in_view: f64, known_share: f64, min_views: usize) -> f64 {
    let most = min_views as f64;
    0.5 + known_share * (most - 0.5) * (frames_in_view / (2.0 * most + 1.0)).min(1.0)
}

/// q.
fn known_share(tracks: &TrackViews<'_>) -> f64 {
    let sum = |of: &[usize]| of.iter().sum::<usize>() as f64;
    let (boxes, glimpses) = (sum(tracks.views), sum(tracks.glimpses));
    (boxes + glimpses) / (boxes + glimpses.max(tracks.missed_boxes)).max(1.0)
}

/// Number of frames from whose place a track would show in the picture, were it not hidden: mean of the middle half of
/// those that came and went. Of a part that is too short for that, as many as the longest stays.
fn frames_in_view(tracks: &TrackViews<'_>, camera: &Camera, poses: &[Pose]) -> f64 {
    let several: Vec<usize> = (0..tracks.views.len()).filter(|&row| tracks.views[row] > 1).collect();
    let rows = if several.is_empty() { (0..tracks.views.len()).collect() } else { several };
    let every = rows.len().div_ceil(SAMPLED).max(1);
    let stays: Vec<Stay> = rows.iter().step_by(every).map(|&row| Stay::of(row, tracks, camera, poses)).collect();
    let mut whole: Vec<usize> = stays.iter().filter(|stay| stay.is_whole).map(|stay| stay.frames).collect();
    if whole.len() < FEW {
        return stays.iter().map(|stay| stay.frames).max().unwrap_or(0) as f64;
    }
    whole.sort_unstable();
    let quarter = whole.len() / 4;
    let middle = &whole[quarter..whole.len() - quarter];
    middle.iter().sum::<usize>() as f64 / middle.len() as f64
}

/// For how many frames a track is in view, and whether it comes and goes while the part lasts.
struct Stay {
    frames: usize,
    is_whole: bool,
}

impl Stay {
    fn of(row: usize, tracks: &TrackViews<'_>, camera: &Camera, poses: &[Pose]) -> Self {
        let range = tracks.depths_m[row] / IN_RANGE..tracks.depths_m[row] * IN_RANGE;
        let is_in_view = |pose: &Pose| {
            let seen = camera.project(&pose.to_camera(&tracks.centres[row]));
            range.contains(&seen.z) && camera.sees(&seen, 0.0)
        };
        let is_cut = [poses.first(), poses.last()].into_iter().flatten().any(is_in_view);
        Self { frames: poses.iter().filter(|pose| is_in_view(pose)).count(), is_whole: !is_cut }
    }
}

/// Part of the others that show less, 0 to 1; one half where it is not known.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| !value.is_nan()).collect();
    sorted.sort_by(f64::total_cmp);
    let rank = |value: f64| sorted.partition_point(|&other| other < value) as f64 / sorted.len() as f64;
    values.iter().map(|&value| if value.is_nan() { 0.5 } else { rank(value) }).collect()
}

/// Two normal distributions of fruitness.
#[derive(Debug, Clone, Copy)]
struct FruitOrLeaf {
    fruits: Normal,
    elsewhere: Normal,
    share: f64,
}

impl FruitOrLeaf {
    /// None where too little was looked at.
    fn of(colours: &Colours<'_>) -> Option<Self> {
        if colours.boxes.len() < ENOUGH || colours.elsewhere.len() < ENOUGH {
            return None;
        }
        let elsewhere = Normal::of(colours.elsewhere.iter().map(|&value| (value, 1.0)));
        let fruits = Normal::of(colours.boxes.iter().map(|&value| (value, 1.0)));
        let mut found = Self { fruits, elsewhere, share: TRUE_BOXES };
        for _ in 0..ROUNDS {
            let weighted = || colours.boxes.iter().map(|&value| (value, found.probability(value)));
            let sum: f64 = weighted().map(|(_, weight)| weight).sum();
            let fruits = Normal::of(weighted());
            let share = (sum + ASSUMED * TRUE_BOXES) / (colours.boxes.len() as f64 + ASSUMED);
            found = Self { fruits, elsewhere, share };
        }
        Some(found)
    }

    /// That it is a fruit. What looks less like fruit than leaves do, or more than fruits do, is as sure as those.
    fn probability(&self, fruitness: f64) -> f64 {
        if fruitness.is_nan() || self.fruits.mean <= self.elsewhere.mean {
            return self.share;
        }
        let value = fruitness.clamp(self.elsewhere.mean, self.fruits.mean);
        let (fruit, leaf) =
            (self.share * self.fruits.density(value), (1.0 - self.share) * self.elsewhere.density(value));
        fruit / (fruit + leaf).max(f64::MIN_POSITIVE)
    }
}

/// How large the fruits are.
#[derive(Debug, Clone, Copy)]
struct Sizes {
    ln_median: f64,
    spread: f64,
}

impl Sizes {
    /// Of some of the tracks; None where too few of them are known.
    fn of(tracks: &TrackViews<'_>, chosen: &[bool]) -> Option<Self> {
        let known = tracks.diameters_m.iter().zip(chosen).filter(|(size_m, chosen)| **chosen && **size_m > 0.0);
        let mut logs: Vec<f64> = known.map(|(size_m, _)| size_m.ln()).collect();
        if logs.len() < ENOUGH {
            return None;
        }
        logs.sort_by(f64::total_cmp);
        let [low, ln_median, high] = [1, 2, 3].map(|quarter| logs[quarter * logs.len() / 4]);
        Some(Self { ln_median, spread: ((high - low) / QUARTILES_SIGMAS).max(LEAST_SPREAD) })
    }

    /// That a track of this size is one fruit.
    fn probability(&self, diameter_m: f64, sigma_m: f64) -> f64 {
        let off = diameter_m.ln() - self.ln_median;
        // Of what nobody measured nothing is said.
        if off.is_nan() || off <= 0.0 {
            return 1.0;
        }
        let sigma = self.spread.hypot(sigma_m / diameter_m);
        let density = (-0.5 * (off / sigma).powi(2)).exp() / (sigma * std::f64::consts::TAU.sqrt());
        let fruit = OF_ONE_FRUIT * density;
        fruit / (fruit + (1.0 - OF_ONE_FRUIT) / SIZES_LN)
    }
}

#[derive(Debug, Clone, Copy)]
struct Normal {
    mean: f64,
    sigma: f64,
}

impl Normal {
    fn of(weighted: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        let total: f64 = weighted.clone().map(|(_, weight)| weight).sum::<f64>().max(f64::MIN_POSITIVE);
        let mean = weighted.clone().map(|(value, weight)| weight * value).sum::<f64>() / total;
        let variance = weighted.map(|(value, weight)| weight * (value - mean).powi(2)).sum::<f64>() / total;
        Self { mean, sigma: variance.sqrt().max(LEAST_SIGMA) }
    }

    fn density(&self, value: f64) -> f64 {
        (-0.5 * ((value - self.mean) / self.sigma).powi(2)).exp() / self.sigma
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera =
        Camera { width: 640, height: 360, fx: 400.0, fy: 400.0, cx: 320.0, cy: 180.0, baseline_m: None };
    const NO_COLOUR: Colours<'static> = Colours { boxes: &[], elsewhere: &[] };

    /// Poses along a row, `step_m` apart, and tracks in its middle with these boxes and glimpses.
    fn believed(step_m: f64, views: &[usize], glimpses: &[usize], fruitness: &[f64], colours: &Colours<'_>) -> Belief {
        let poses: Vec<_> = (0..(8.0 / step_m) as usize)
            .map(|k| Pose { translation: Vector3::new(step_m * k as f64, 0.0, 0.0), ..Pose::IDENTITY })
            .collect();
        let n = views.len();
        let tracks = TrackViews {
            centres: &vec![Vector3::new(4.0, 0.0, 1.25); n],
            depths_m: &vec![1.25; n],
            views,
            glimpses,
            shown_m2: &vec![f64::NAN; n],
            fruitness,
            diameters_m: &vec![f64::NAN; n],
            diameter_sigmas_m: &vec![f64::NAN; n],
            missed_boxes: 0.0,
        };
        belief(&tracks, colours, (&CAMERA, &poses), &TrackingConfig::default())
    }

    #[test]
    fn what_is_larger_than_any_fruit_is_no_fruit_and_half_a_fruit_is_one() {
        let mut sizes_m: Vec<f64> = (0..60).map(|k| 0.07 * (1.0 + 0.01 * f64::from(k % 15 - 7))).collect();
        sizes_m.extend([0.09, 0.179, 0.179, 0.035, f64::NAN]);
        let mut sigmas_m = vec![0.004; sizes_m.len()];
        sigmas_m[62] = 0.09;
        let n = sizes_m.len();
        let tracks = TrackViews {
            centres: &vec![Vector3::new(4.0, 0.0, 1.25); n],
            depths_m: &vec![1.25; n],
            views: &vec![9; n],
            glimpses: &vec![0; n],
            shown_m2: &vec![f64::NAN; n],
            fruitness: &vec![f64::NAN; n],
            diameters_m: &sizes_m,
            diameter_sigmas_m: &sigmas_m,
            missed_boxes: 0.0,
        };
        let poses: Vec<_> = (0..50)
            .map(|k| Pose { translation: Vector3::new(0.15 * f64::from(k), 0.0, 0.0), ..Pose::IDENTITY })
            .collect();
        let found = belief(&tracks, &NO_COLOUR, (&CAMERA, &poses), &TrackingConfig::default());
        assert!(found.is_believed[..61].iter().all(|&one| one));
        // 179 mm, sure; 179 mm, give or take 90; 35 mm; nobody knows.
        assert_eq!(found.is_believed[61..], [false, true, true, true]);
        assert!(found.probability[61] < 1e-6, "{}", found.probability[61]);
    }

    #[test]
    fn five_boxes_make_a_fruit_where_it_stays_in_view_for_ten_frames() {
        let found = believed(0.15, &[3, 4, 5, 9], &[0; 4], &[f64::NAN; 4], &NO_COLOUR);
        assert_eq!(found.is_believed, [false, false, true, true]);
        assert!((12.0..=14.0).contains(&found.frames_in_view), "{}", found.frames_in_view);
        assert!(found.probability.is_sorted());
    }

    #[test]
    fn half_the_frames_ask_for_half_the_boxes() {
        let found = believed(0.36, &[1, 2, 3, 4], &[0; 4], &[f64::NAN; 4], &NO_COLOUR);
        assert_eq!(found.is_believed, [false, false, true, true]);
    }

    #[test]
    fn a_frame_that_shows_the_fruit_without_a_box_counts() {
        let found = believed(0.15, &[4, 4], &[0, 1], &[f64::NAN; 2], &NO_COLOUR);
        assert_eq!(found.is_believed, [false, true]);
    }

    #[test]
    fn what_looks_like_the_leaves_is_no_fruit_however_often_it_was_seen() {
        let spread = |mean: f64, n: usize| (0..n).map(move |k| mean + 0.1 * ((k % 11) as f64 / 5.0 - 1.0));
        let boxes: Vec<f64> = spread(0.75, 180).chain(spread(0.25, 20)).collect();
        let elsewhere: Vec<f64> = spread(0.25, 200).collect();
        let colours = Colours { boxes: &boxes, elsewhere: &elsewhere };
        let found = believed(0.15, &[10; 3], &[0; 3], &[0.25, 0.6, 0.8], &colours);
        assert_eq!(found.is_believed, [false, true, true]);
        assert!(found.probability[0] < 0.1 && found.probability[2] > 0.95, "{:?}", found.probability);
    }

    #[test]
    fn green_fruits_among_leaves_stay() {
        let alike: Vec<f64> = (0..200).map(|k| 0.5 + 0.01 * f64::from(k % 7)).collect();
        let colours = Colours { boxes: &alike, elsewhere: &alike };
        let found = believed(0.15, &[10; 3], &[0; 3], &[0.45, 0.5, 0.55], &colours);
        assert_eq!(found.is_believed, [true; 3]);
    }
}
