//! Tracking on made-up rows: every fruit once, whatever hides, divides or joins its boxes.

use pomona::nalgebra::{Matrix3, Matrix4, Vector3};
use pomona::tracking::{Boxes, Camera, LiftedBoxes, Pose, Tracker, TrackingConfig, Tracks};
use pomona::{Config, Error};

const CAMERA: Camera = Camera { focal_px: [417.0, 417.0], principal_px: [320.0, 180.0], size_px: [640.0, 360.0] };
const RADIUS_M: f64 = 0.035;
const STEP_M: f64 = 0.15;

/// A small generator of numbers (xorshift), so that the tests need no crate for it.
struct Dice(u64);

impl Dice {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// One frame: boxes, and which of them have a depth.
#[derive(Default)]
struct Seen {
    edges_px: Vec<[f64; 4]>,
    rows: Vec<usize>,
    centres: Vec<Vector3<f64>>,
    covariances: Vec<Matrix3<f64>>,
    diameters_m: Vec<f64>,
    diameter_sigmas_m: Vec<f64>,
}

impl Seen {
    fn lifted_box(&mut self, edges_px: [f64; 4], centre: Vector3<f64>, sigma_z_m: f64, radius_m: f64) {
        let ray = centre / centre.z;
        let across = (centre.z / CAMERA.focal_px[0]).powi(2) / 2.0;
        self.rows.push(self.edges_px.len());
        self.edges_px.push(edges_px);
        self.centres.push(centre);
        self.covariances.push(
            ray * ray.transpose() * sigma_z_m.powi(2) + Matrix3::from_diagonal(&Vector3::new(across, across, 0.0)),
        );
        self.diameters_m.push(2.0 * radius_m);
        self.diameter_sigmas_m.push(0.2 * radius_m);
    }

    fn take(&self, tracker: &mut Tracker, frame: i64, pose: &Pose) -> Vec<Option<usize>> {
        let scores = vec![1.0; self.edges_px.len()];
        let lifted = LiftedBoxes {
            rows: &self.rows,
            centres_in_camera: &self.centres,
            covariances: &self.covariances,
            diameters_m: &self.diameters_m,
            diameter_sigmas_m: &self.diameter_sigmas_m,
            support: &vec![0.7; self.rows.len()],
        };
        tracker.update(frame, pose, &Boxes { edges_px: &self.edges_px, scores: &scores }, &lifted).expect("fits")
    }
}

fn pose(place: f64) -> Pose {
    let matrix = Matrix4::new_translation(&Vector3::new(place * STEP_M, 0.0, 0.0));
    Pose::from_matrix(&matrix).expect("rigid")
}

fn tracker() -> Tracker {
    Tracker::new(CAMERA, TrackingConfig::default()).expect("defaults are valid")
}

/// Edges of a sphere's box, None where the picture does not hold it whole.
fn outline(in_camera: &Vector3<f64>) -> Option<[f64; 4]> {
    let edges = |axis: usize| {
        let theta = in_camera[axis].atan2(in_camera.z);
        let alpha = (RADIUS_M / in_camera[axis].hypot(in_camera.z)).asin();
        let edge = |angle: f64| 417.0 * angle.tan() + CAMERA.principal_px[axis];
        (edge(theta - alpha), edge(theta + alpha))
    };
    let ((xmin, xmax), (ymin, ymax)) = (edges(0), edges(1));
    let inside = xmin > 2.0 && ymin > 2.0 && xmax < 638.0 && ymax < 358.0;
    inside.then_some([xmin, ymin, xmax, ymax])
}

/// Pairs of touching fruits along a row.
fn row(dice: &mut Dice, pairs: usize) -> Vec<Vector3<f64>> {
    let mut fruits = Vec::new();
    for pair in 0..pairs {
        let first =
            Vector3::new(-0.5 + 0.1 * pair as f64, 0.35 * (2.0 * dice.uniform() - 1.0), 1.3 + 0.5 * dice.uniform());
        fruits.extend([first, first + Vector3::new(0.05, 0.05, 0.0)]);
    }
    fruits
}

/// What a frame at `place` shows of `fruits`: each with probability `shown`, its depth with a noise of `sigma_z_m`.
fn seen(dice: &mut Dice, fruits: &[Vector3<f64>], place: f64, shown: f64, sigma_z_m: f64) -> (Seen, Vec<usize>) {
    let (mut seen, mut names) = (Seen::default(), Vec::new());
    for (name, fruit) in fruits.iter().enumerate() {
        let in_camera = fruit - pose(place).translation;
        let Some(edges_px) = outline(&in_camera) else { continue };
        if dice.uniform() < shown {
            let noisy = in_camera * (1.0 + sigma_z_m * dice.normal() / in_camera.z);
            seen.lifted_box(edges_px.map(|edge| (edge + 0.5 * dice.normal()).round()), noisy, sigma_z_m, RADIUS_M);
            names.push(name);
        }
    }
    (seen, names)
}

/// Tracks of a row, and the name of the fruit behind each sighting.
fn tracked(seed: u64, places: &[f64], shown: f64, sigma_z_m: f64) -> (Tracks, Vec<Vec<usize>>, Vec<Vector3<f64>>) {
    let mut dice = Dice(seed);
    let fruits = row(&mut dice, 40);
    let (mut tracker, mut names) = (tracker(), Vec::new());
    for (frame, &place) in places.iter().enumerate() {
        let (seen, shown) = seen(&mut dice, &fruits, place, shown, sigma_z_m);
        seen.take(&mut tracker, frame as i64, &pose(place));
        names.push(shown);
    }
    (tracker.finish(5), names, fruits)
}

fn names_of(tracks: &Tracks, names: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new(); tracks.numbers.len()];
    for sighting in &tracks.sightings {
        all[sighting.fruit].push(names[sighting.frame as usize][sighting.row]);
    }
    all
}

#[test]
fn every_fruit_is_followed_once() {
    let places: Vec<_> = (0..30).map(f64::from).collect();
    let (tracks, names, fruits) = tracked(7, &places, 1.0, 0.03);
    let found = names_of(&tracks, &names);
    assert!(found.iter().all(|of| of.iter().all(|&name| name == of[0])), "a track holds two fruits");
    let mut views = vec![0; fruits.len()];
    names.iter().flatten().for_each(|&name| views[name] += 1);
    assert_eq!(found.len(), views.iter().filter(|&&count| count >= 5).count());
    for (row, of) in found.iter().enumerate() {
        assert_eq!(of.len(), views[of[0]], "a sighting of fruit {} is lost", of[0]);
        assert!((tracks.centres[row] - fruits[of[0]]).norm() < 0.02);
    }
}

#[test]
fn fruits_are_known_again_after_a_gap() {
    // There, half of the row away, and back: the first trees are out of view for some 20 frames.
    let places: Vec<_> = (0..16).chain((0..16).rev()).map(f64::from).collect();
    let (tracks, names, _) = tracked(11, &places, 0.8, 0.03);
    let mut once: Vec<_> = names_of(&tracks, &names).into_iter().map(|of| of[0]).collect();
    once.sort_unstable();
    let n = once.len();
    once.dedup();
    assert!(n > 40);
    assert_eq!(once.len(), n, "a fruit came back as another");
}

#[test]
fn boxes_that_show_no_fruit_do_not_become_fruits() {
    let mut dice = Dice(3);
    let mut tracker = tracker();
    for frame in 0..40 {
        let mut seen = Seen::default();
        for _ in 0..8 {
            let (x, y, half) =
                (600.0 * dice.uniform() + 20.0, 320.0 * dice.uniform() + 20.0, 6.0 + 6.0 * dice.uniform());
            let z = 1.0 + dice.uniform();
            let centre = Vector3::new((x - 320.0) / 417.0 * z, (y - 180.0) / 417.0 * z, z);
            seen.lifted_box([x - half, y - half, x + half, y + half], centre, 0.02, half * z / 417.0);
        }
        seen.take(&mut tracker, frame, &pose(0.0));
    }
    // Eight a frame over one scene for 40 frames: by chance a place may be hit five times, no more than that.
    assert!(tracker.finish(5).numbers.len() <= 1);
}

/// Two fruits, ten frames; `change` edits what the sixth shows.
fn pair_of_fruits(change: impl Fn(&mut Seen)) -> (Tracks, Vec<Option<usize>>) {
    let fruits = [Vector3::new(0.6, 0.0, 1.4), Vector3::new(0.6, 0.072, 1.4)];
    let mut tracker = tracker();
    let mut answer = Vec::new();
    for frame in 0..10 {
        let place = f64::from(frame) / 2.0;
        let mut seen = Seen::default();
        for fruit in fruits {
            let in_camera = fruit - pose(place).translation;
            seen.lifted_box(outline(&in_camera).expect("in view"), in_camera, 0.02, RADIUS_M);
        }
        if frame == 5 {
            change(&mut seen);
        }
        let numbers = seen.take(&mut tracker, i64::from(frame), &pose(place));
        if frame == 5 {
            answer = numbers;
        }
    }
    (tracker.finish(1), answer)
}

#[test]
fn one_box_around_two_fruits_moves_neither() {
    let (plain, _) = pair_of_fruits(|_| {});
    let (tracks, answer) = pair_of_fruits(|seen| {
        let [top, bottom] = [seen.edges_px[0], seen.edges_px[1]];
        *seen = Seen { edges_px: vec![[top[0], top[1], top[2], bottom[3]]], ..Seen::default() };
    });
    assert_eq!(answer, [Some(0)]);
    assert_eq!(tracks.views, [10, 9]);
    assert_eq!(tracks.sightings.iter().filter(|sighting| sighting.shared).count(), 1);
    for fruit in 0..2 {
        assert!((tracks.centres[fruit] - plain.centres[fruit]).norm() < 1e-3);
    }
}

#[test]
fn a_second_piece_of_a_fruit_starts_none() {
    let (tracks, answer) = pair_of_fruits(|seen| {
        // A twig divides the upper fruit: a third of it left, a third right.
        let [xmin, ymin, xmax, ymax] = seen.edges_px[0];
        let third = (xmax - xmin) / 3.0;
        seen.edges_px[0] = [xmin, ymin, xmin + third, ymax];
        seen.edges_px.push([xmax - third, ymin, xmax, ymax]);
        seen.rows.remove(0);
        seen.centres.remove(0);
        seen.covariances.remove(0);
        seen.diameters_m.remove(0);
        seen.diameter_sigmas_m.remove(0);
    });
    assert_eq!(tracks.numbers, [0, 1]);
    assert_eq!(answer.iter().flatten().count(), 2, "one of the pieces counts: {answer:?}");
}

#[test]
fn boxes_without_depth_are_placed_by_their_size() {
    let mut dice = Dice(5);
    let fruits = row(&mut dice, 40);
    let (mut tracker, mut names) = (tracker(), Vec::new());
    for frame in 0..30 {
        let place = f64::from(frame);
        let (mut seen, shown) = seen(&mut dice, &fruits, place, 1.0, 0.02);
        if frame > 2 {
            // Once the size is known, two boxes in three lack a depth.
            let kept: Vec<_> = (0..seen.rows.len()).filter(|k| k % 3 == 0).collect();
            seen.rows = kept.iter().map(|&k| seen.rows[k]).collect();
            seen.centres = kept.iter().map(|&k| seen.centres[k]).collect();
            seen.covariances = kept.iter().map(|&k| seen.covariances[k]).collect();
            seen.diameters_m = kept.iter().map(|&k| seen.diameters_m[k]).collect();
            seen.diameter_sigmas_m = kept.iter().map(|&k| seen.diameter_sigmas_m[k]).collect();
        }
        let numbers = seen.take(&mut tracker, i64::from(frame), &pose(place));
        assert!(numbers.iter().all(Option::is_some));
        names.push(shown);
    }
    let tracks = tracker.finish(5);
    let mut views = vec![0; fruits.len()];
    names.iter().flatten().for_each(|&name| views[name] += 1);
    let expected = views.iter().filter(|&&count| count >= 5).count();
    assert!(tracks.numbers.len().abs_diff(expected) <= 2, "{} of {expected}", tracks.numbers.len());
}

#[test]
fn a_leaf_before_the_first_sighting_is_found_out() {
    let fruit = Vector3::new(0.5, 0.1, 1.5);
    let mut tracker = tracker();
    // The size of fruits must be known to doubt a depth.
    let mut dice = Dice(9);
    let others: Vec<_> =
        (0..12).map(|k| Vector3::new(-0.5 + 0.1 * f64::from(k), -0.3, 1.2 + 0.3 * dice.uniform())).collect();
    let mut numbers = Vec::new();
    for frame in 0..6 {
        let place = f64::from(frame);
        let (mut seen, _) = seen(&mut dice, &others, place, 1.0, 0.01);
        if frame > 0 {
            let in_camera = fruit - pose(place).translation;
            let nearer = if frame == 1 { 0.8 } else { 1.0 };
            let radius_m = nearer * RADIUS_M;
            seen.lifted_box(outline(&in_camera).expect("in view"), nearer * in_camera, 0.01, radius_m);
            numbers.extend(seen.take(&mut tracker, frame.into(), &pose(place)).pop());
        } else {
            seen.take(&mut tracker, frame.into(), &pose(place));
        }
    }
    assert!(numbers.iter().all(|number| number.is_some() && *number == numbers[0]), "{numbers:?}");
}

#[test]
fn wrong_input_is_named() {
    let mut tracker = tracker();
    let none = Boxes { edges_px: &[], scores: &[] };
    tracker.update(4, &pose(0.0), &none, &LiftedBoxes::NONE).expect("an empty frame is a frame");
    let twice = tracker.update(4, &pose(0.0), &none, &LiftedBoxes::NONE);
    assert_eq!(twice, Err(Error::FrameOrder { found: 4, last: 4 }));
    let one = Boxes { edges_px: &[[0.0, 0.0, 9.0, 9.0]], scores: &[] };
    assert!(matches!(
        tracker.update(5, &pose(0.0), &one, &LiftedBoxes::NONE),
        Err(Error::Length { what: "scores", .. })
    ));
    assert_eq!(tracker.finish(1), Tracks::default());
    let config = Config { tracking: TrackingConfig { min_views: 0, ..TrackingConfig::default() }, ..Config::default() };
    assert!(config.validate().is_err());
}
