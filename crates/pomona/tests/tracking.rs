//! Tracking on made-up rows: every fruit once, whatever hides, divides or joins its boxes.

mod filmed_row;

use filmed_row::{Dice, RADIUS_M, Seen, outline, pose, row, seen, tracker};
use pomona::Pose;
use pomona::nalgebra::{Matrix4, Rotation3, Vector3};
use pomona::tracking::{Boxes, LiftedBoxes, TrackingConfig, Tracks};
use pomona::{Config, Error};

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
fn frames_may_follow_closely() {
    // 1.5 cm a frame, as a video at a walk: one frame says nothing about depth that the one before did not say.
    let places: Vec<_> = (0..200).map(|frame| f64::from(frame) / 10.0).collect();
    let (tracks, names, _) = tracked(29, &places, 0.7, 0.05);
    let found = names_of(&tracks, &names);
    let mut once: Vec<_> = found.iter().map(|of| of[0]).collect();
    once.sort_unstable();
    once.dedup();
    assert!(once.len() > 50);
    assert_eq!(once.len(), found.len(), "a fruit is split");
    let strange: usize = found.iter().map(|of| of.iter().filter(|&&name| name != of[0]).count()).sum();
    assert!(strange * 100 <= found.iter().map(Vec::len).sum(), "{strange} boxes of other fruits");
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

/// Poses that are wrong by a few millimetres and a tenth of a degree more with every step.
struct Drift {
    dice: Dice,
    wrong: Matrix4<f64>,
}

impl Drift {
    fn next(&mut self, place: f64) -> Pose {
        let mut three = |sigma: f64| Vector3::from_fn(|_, _| sigma * self.dice.normal());
        let step = Matrix4::new_translation(&three(0.004)) * Rotation3::new(three(0.002)).to_homogeneous();
        self.wrong *= step;
        Pose::from_matrix(&(Matrix4::new_translation(&(pose(place).translation)) * self.wrong)).expect("rigid")
    }
}

#[test]
fn fruits_hold_against_poses_that_drift() {
    let mut dice = Dice(17);
    let fruits = row(&mut dice, 40);
    let mut drift = Drift { dice: Dice(23), wrong: Matrix4::identity() };
    let (mut tracker, mut names) = (tracker(), Vec::new());
    for (frame, place) in (0..16).chain((0..16).rev()).map(f64::from).enumerate() {
        let (seen, shown) = seen(&mut dice, &fruits, place, 0.9, 0.02);
        seen.take(&mut tracker, frame as i64, &drift.next(place));
        names.push(shown);
    }
    let off_m: Vector3<f64> = drift.wrong.fixed_view::<3, 1>(0, 3).into();
    assert!(off_m.norm() > 0.01, "the poses did not drift");
    let found = names_of(&tracker.finish(5), &names);
    let mut once: Vec<_> = found.iter().map(|of| of[0]).collect();
    once.sort_unstable();
    once.dedup();
    assert_eq!(once.len(), found.len(), "a fruit came back as another");
    assert!(found.iter().all(|of| of.iter().all(|&name| name == of[0])), "a track holds two fruits");
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

/// Evidence of one fruit that a camera drives past, with a box in some of the frames.
fn evidence_of(shown: &[bool], score: f64) -> f64 {
    let (fruit, mut tracker) = (Vector3::new(0.3, 0.1, 1.4), tracker());
    for (frame, &is_shown) in shown.iter().enumerate() {
        let place = frame as f64 / 2.0;
        let in_camera = fruit - pose(place).translation;
        let mut seen = Seen::default();
        if is_shown {
            seen.lifted_box(outline(&in_camera).expect("in view"), in_camera, 0.02, RADIUS_M);
        }
        seen.take_scored(&mut tracker, frame as i64, &pose(place), score);
    }
    let tracks = tracker.finish(1);
    assert_eq!(tracks.evidence.len(), 1, "one fruit");
    tracks.evidence[0]
}

#[test]
fn evidence_begins_with_the_box_falls_with_every_miss_and_rises_with_every_hit() {
    let config = TrackingConfig::default();
    let born = |score: f64| (config.new_per_frame / config.false_per_frame).ln() + (score / (1.0 - score)).ln();
    for score in [0.3, 0.8] {
        assert!((evidence_of(&[true], score) - born(score)).abs() < 1e-9);
    }
    // No score is trusted beyond nine in ten.
    assert!((evidence_of(&[true], 1.0) - born(0.9)).abs() < 1e-9);
    let missed = evidence_of(&[true, false, false, false], 0.8);
    assert!((missed - born(0.8) - 3.0 * (1.0 - config.detection_probability).ln()).abs() < 1e-9, "{missed}");
    let mut last = born(0.8);
    for n in 2..8 {
        let evidence = evidence_of(&vec![true; n], 0.8);
        // Boxes of one fruit err alike: none of them says more than e^3 to 1.
        assert!(evidence > last + 1.0 && evidence < last + 3.0 + 1e-9, "{n} boxes: {evidence} after {last}");
        last = evidence;
    }
}

#[test]
fn a_box_around_two_fruits_is_no_evidence_of_either_and_no_miss() {
    let with_sixth = |edit: fn(&mut Seen)| pair_of_fruits(edit).0.evidence;
    let plain = with_sixth(|_| {});
    let shared = with_sixth(|seen| {
        let [top, bottom] = [seen.edges_px[0], seen.edges_px[1]];
        *seen = Seen { edges_px: vec![[top[0], top[1], top[2], bottom[3]]], ..Seen::default() };
    });
    let missed = with_sixth(|seen| *seen = Seen::default());
    let miss = (1.0 - TrackingConfig::default().detection_probability).ln();
    for fruit in 0..2 {
        assert!(plain[fruit] > shared[fruit] + 1.0, "{plain:?}, {shared:?}");
        assert!((missed[fruit] - shared[fruit] - miss).abs() < 0.2, "{missed:?}, {shared:?}");
    }
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

#[test]
fn a_pose_that_is_none_is_refused_and_moves_no_fruit() {
    let mut dice = Dice(8);
    let fruits = row(&mut dice, 10);
    let mut tracker = tracker();
    for frame in 0..6 {
        let (seen, _) = seen(&mut dice, &fruits, 0.0, 1.0, 0.02);
        seen.take(&mut tracker, frame, &pose(0.0));
    }
    let before = tracker.finish(3);
    let still = pose(0.0);
    let turned = |matrix| Pose { rotation: Rotation3::from_matrix_unchecked(matrix), ..still };
    let nowhere = Pose { translation: Vector3::new(f64::NAN, 0.0, 0.0), ..still };
    let twice = turned(still.rotation.matrix() * 2.0);
    let none = Boxes { edges_px: &[], scores: &[] };
    for wrong in [nowhere, twice, turned(still.rotation.matrix() * -1.0)] {
        assert_eq!(tracker.update(6, &wrong, &none, &LiftedBoxes::NONE), Err(Error::Pose));
    }
    assert_eq!(tracker.finish(3), before);
}
