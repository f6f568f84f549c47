//! Drives past made-up points, seen without pictures.

use super::*;
use crate::random::SplitMix;
use nalgebra::{Point3, Rotation3};
use std::collections::HashMap;
use std::convert::Infallible;

#[derive(Debug)]
struct Wrong(#[expect(dead_code, reason = "shown when a test fails")] crate::Error);

impl From<crate::Error> for Wrong {
    fn from(error: crate::Error) -> Self {
        Self(error)
    }
}

impl From<Infallible> for Wrong {
    fn from(never: Infallible) -> Self {
        match never {}
    }
}

/// What a picture shows: each point by its place.
type Shown = HashMap<[u64; 2], usize>;

/// Points that stand still, and the newest keyframe's picture of them.
struct World {
    points: Vec<Point3<f64>>,
    odometry: Odometry,
    keyframe: Shown,
}

/// One frame: where its camera truly is, and which points can be told from others in it.
struct Frame<'a> {
    world: &'a [Point3<f64>],
    lens: Lens,
    pose: Pose,
    keyframe: &'a Shown,
    told_apart: &'a dyn Fn(usize) -> bool,
    shown: Shown,
}

fn key(place: &Vector2<f64>) -> [u64; 2] {
    [place.x.to_bits(), place.y.to_bits()]
}

impl Frame<'_> {
    fn seen(&self, point: usize) -> Option<Vector3<f64>> {
        let place = self.pose.to_camera(&self.world[point].coords);
        let seen = self.lens.seen(&place, 0.1)?;
        Some(Vector3::new(seen.x, seen.y, self.lens.reach_px_m() / place.z))
    }
}

impl Eyes for Frame<'_> {
    type Error = Wrong;

    fn follow(
        &mut self,
        from_px: &[Vector2<f64>],
        expected_px: &[Vector2<f64>],
    ) -> Result<Vec<Option<Vector2<f64>>>, Wrong> {
        assert_eq!(from_px.len(), expected_px.len());
        let found = |from: &Vector2<f64>| {
            let point = self.keyframe[&key(from)];
            // A point that looks like others is found somewhere, which agrees with nothing.
            let astray = Vector2::new((point * 37 % 41) as f64 - 60.0, (point * 53 % 43) as f64 - 60.0);
            let off = if (self.told_apart)(point) { Vector2::zeros() } else { astray };
            Some(self.seen(point)?.xy() + off)
        };
        Ok(from_px.iter().map(found).collect())
    }

    fn find_again(&mut self) -> Result<Vec<FoundAgain>, Wrong> {
        Ok(Vec::new())
    }

    fn measure(
        &mut self,
        known_px: &[Vector2<f64>],
        expected_px: &[f64],
        per_cell: usize,
    ) -> Result<Vec<Vector3<f64>>, Wrong> {
        assert_eq!(known_px.len(), expected_px.len());
        let all: Vec<(usize, Vector3<f64>)> =
            (0..self.world.len()).filter_map(|point| Some((point, self.seen(point)?))).collect();
        let by_place: Shown = all.iter().map(|(point, seen)| (key(&seen.xy()), *point)).collect();
        let known: Vec<usize> = known_px.iter().map(|place| by_place[&key(place)]).collect();
        let new = all.iter().map(|one| one.0).filter(|point| !known.contains(point)).take(10 * per_cell);
        let rows: Vec<usize> = known.iter().copied().chain(new).collect();
        let seen: Vec<_> = rows.iter().filter_map(|&point| self.seen(point)).collect();
        self.shown = rows.iter().zip(&seen).map(|(&point, seen)| (key(&seen.xy()), point)).collect();
        Ok(seen)
    }
}

fn lens() -> Lens {
    let camera = Camera { width: 320, height: 240, fx: 260.0, fy: 260.0, cx: 160.0, cy: 120.0, baseline_m: Some(0.1) };
    Lens::new(&camera, &OdometryConfig::default())
}

impl World {
    /// `n` points two metres ahead of a drive along x.
    fn new(n: usize) -> Self {
        let mut random = SplitMix(4);
        let mut unit = || random.below(1 << 20) as f64 / f64::from(1 << 20) - 0.5;
        let points = (0..n).map(|_| Point3::new(1.6 * unit(), 1.2 * unit(), 2.0 + 0.2 * unit())).collect();
        Self { points, odometry: Odometry::new(lens(), OdometryConfig::default()), keyframe: Shown::new() }
    }

    fn take(&mut self, pose: Pose) -> Motion {
        self.take_where(pose, &|_| true)
    }

    fn take_where(&mut self, pose: Pose, told_apart: &dyn Fn(usize) -> bool) -> Motion {
        let mut frame = Frame {
            world: &self.points,
            lens: lens(),
            pose,
            keyframe: &self.keyframe,
            told_apart,
            shown: Shown::new(),
        };
        let motion = self.odometry.take(&mut frame).expect("valid numbers");
        let shown = frame.shown;
        if motion.keyframe {
            self.keyframe = shown;
        }
        motion
    }
}

fn sideways(x_m: f64) -> Pose {
    Pose { translation: Vector3::x() * x_m, ..Pose::IDENTITY }
}

fn turned(rad: f64) -> Pose {
    Pose { rotation: Rotation3::new(Vector3::y() * rad), ..Pose::IDENTITY }
}

/// Points of [`World::new`] that a keyframe takes: all where they are few.
const FEW: usize = 100;

#[test]
fn a_drive_is_followed_from_keyframe_to_keyframe() {
    let mut world = World::new(800);
    let motions: Vec<Motion> = (0..16).map(|step| world.take(sideways(0.05 * f64::from(step)))).collect();
    for (step, motion) in (0_u32..).zip(&motions) {
        let pose = motion.pose.expect("a place");
        let off = pose.seen_from(&sideways(0.05 * f64::from(step)));
        assert!(off.translation.norm() < 1e-4 && off.rotation.angle() < 1e-4, "{step}: {off:?}");
    }
    let keyframes: Vec<usize> = (0..16).filter(|&step| motions[step].keyframe).collect();
    // Due beyond a tenth of two metres, five steps of 5 cm after the last.
    assert_eq!(keyframes, [0, 4, 8, 12]);
    let all = world.odometry.trajectory();
    assert_eq!((all.frames.clone(), all.parts.clone()), ((0..16).collect(), vec![0; 16]));
    let firsts: Vec<usize> = all.pairs.iter().map(|pair| pair.0).collect();
    assert_eq!(firsts, [0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12]);
    assert_eq!(all.pairs.iter().map(|pair| pair.1).collect::<Vec<_>>(), (1..16).collect::<Vec<_>>());
    assert!(all.information.iter().all(|one| one.cholesky().is_some()));
    assert!((all.median_disparity_px - 13.0).abs() < 0.5, "{}", all.median_disparity_px);
}

#[test]
fn a_keyframe_is_due_after_nine_degrees() {
    for (rad, is_due) in [(0.14, false), (0.16, true)] {
        let mut world = World::new(FEW);
        world.take(Pose::IDENTITY);
        assert_eq!(world.take(turned(rad)).keyframe, is_due, "{rad}");
    }
}

#[test]
fn a_keyframe_is_due_after_a_tenth_of_the_depth() {
    for (shift_m, is_due) in [(0.19, false), (0.21, true)] {
        let mut world = World::new(FEW);
        world.take(Pose::IDENTITY);
        assert_eq!(world.take(sideways(shift_m)).keyframe, is_due, "{shift_m}");
    }
}

#[test]
fn a_keyframe_is_due_when_few_points_are_left() {
    for (left, is_due) in [(62, false), (58, true)] {
        let mut world = World::new(FEW);
        world.take(Pose::IDENTITY);
        let motion = world.take_where(Pose::IDENTITY, &|point| point < left);
        assert_eq!((motion.inliers, motion.keyframe), (left, is_due));
    }
}

#[test]
fn a_part_begins_with_eighteen_points() {
    let lost = World::new(17).take(Pose::IDENTITY).lost;
    assert_eq!(lost.as_deref(), Some("found 17 points with depth, expected at least 18"));
    assert!(World::new(18).take(Pose::IDENTITY).pose.is_some());
}

#[test]
fn a_smooth_motion_needs_less_evidence_than_a_jump() {
    let after_rest = |n: usize, at: Pose, agree: usize| {
        let mut world = World::new(n);
        world.take(Pose::IDENTITY);
        world.take(Pose::IDENTITY);
        world.take_where(at, &|point| point < agree)
    };
    let smooth = |n, agree| after_rest(n, sideways(0.01), agree);
    assert!(smooth(40, 18).pose.is_some());
    let few = smooth(40, 17).lost.expect("too few");
    assert_eq!(few, "found 17 of 40 points that agree, expected at least 18");
    assert!(smooth(FEW, 33).pose.is_some());
    assert_eq!(smooth(FEW, 32).pose, None);
    let jump = |n, agree| after_rest(n, turned(0.16), agree);
    assert_eq!(jump(40, 23).pose, None);
    let lost = jump(FEW, 20).lost.expect("a jump");
    assert!(lost.contains("0.00 m and 9 degrees from where the motion leads, expected at least"), "{lost}");
}

#[test]
fn a_frame_that_fails_is_left_out_and_the_next_goes_on() {
    let mut world = World::new(FEW);
    for step in 0..3 {
        world.take(sideways(0.04 * f64::from(step)));
    }
    let bad = world.take_where(sideways(0.12), &|_| false);
    assert_eq!((bad.pose, bad.part, bad.broken), (None, 0, None));
    assert!(bad.lost.expect("a reason").contains("agree"));
    assert_eq!(world.odometry.skip("unreadable".to_owned()).lost.as_deref(), Some("unreadable"));
    let next = world.take(sideways(0.2));
    let off = next.pose.expect("the part goes on").translation - Vector3::x() * 0.2;
    assert!(off.norm() < 1e-4 && next.part == 0, "{next:?}");
    assert_eq!(world.odometry.trajectory().frames, [0, 1, 2, 5]);
}

#[test]
fn two_frames_that_fail_begin_a_new_part_and_say_why() {
    let mut world = World::new(FEW);
    world.take(Pose::IDENTITY);
    let first = world.take_where(sideways(0.1), &|_| false);
    let second = world.take_where(sideways(0.2), &|_| false);
    assert_eq!((second.part, second.pose, second.keyframe), (1, Some(Pose::IDENTITY), true));
    let reason = second.broken.expect("why the part before ended");
    assert!(reason.starts_with(&format!("{}; then found", first.lost.expect("lost"))), "{reason}");
    let third = world.take(sideways(0.25));
    assert_eq!((third.part, third.broken), (1, None));
    let all = world.odometry.trajectory();
    assert_eq!((all.frames, all.parts, all.pairs), (vec![0, 2, 3], vec![0, 1, 1], vec![(1, 2)]));
}

#[test]
fn more_corners_are_wanted_where_few_agree() {
    struct Counting<'a>(Frame<'a>, Vec<usize>);
    impl Eyes for Counting<'_> {
        type Error = Wrong;
        fn follow(&mut self, a: &[Vector2<f64>], b: &[Vector2<f64>]) -> Result<Vec<Option<Vector2<f64>>>, Wrong> {
            self.0.follow(a, b)
        }
        fn find_again(&mut self) -> Result<Vec<FoundAgain>, Wrong> {
            self.0.find_again()
        }
        fn measure(&mut self, a: &[Vector2<f64>], b: &[f64], per_cell: usize) -> Result<Vec<Vector3<f64>>, Wrong> {
            self.1.push(per_cell);
            self.0.measure(a, b, per_cell)
        }
    }
    let mut world = World::new(200);
    world.take(Pose::IDENTITY);
    let mut asked = Vec::new();
    for (told, x_m) in [(120, 0.25), (90, 0.5)] {
        let told_apart = move |point: usize| point < told;
        let frame = Frame {
            world: &world.points,
            lens: lens(),
            pose: sideways(x_m),
            keyframe: &world.keyframe,
            told_apart: &told_apart,
            shown: Shown::new(),
        };
        let mut counting = Counting(frame, Vec::new());
        let motion = world.odometry.take(&mut counting).expect("valid");
        assert!(motion.keyframe);
        asked.push((motion.inliers, counting.1[0]));
        let shown = counting.0.shown;
        world.keyframe = shown;
    }
    let (first, second) = (asked[0], asked[1]);
    assert_eq!(first.1, (12 * 120_usize).div_ceil(first.0).clamp(3, 12));
    assert_eq!(second.1, (first.1 * 120).div_ceil(second.0).clamp(3, 12));
}
