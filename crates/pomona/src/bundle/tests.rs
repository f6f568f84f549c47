//! Adjustments of made-up drives whose truth is known.

use super::*;
use crate::camera::Camera;
use crate::pose::Pose;
use crate::random::SplitMix;
use nalgebra::{Point3, Rotation3, UnitQuaternion, Vector2, Vector3, Vector6};

struct Random(SplitMix);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0.below(1 << 53) as f64 / (1u64 << 53) as f64
    }

    /// Box and Muller.
    fn normal(&mut self) -> f64 {
        let (a, b) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }
}

const SIGMA_PX: f64 = 0.5;

fn camera() -> Camera {
    Camera { width: 640, height: 360, fx: 417.0, fy: 417.0, cx: 320.0, cy: 180.0, baseline_m: Some(0.12) }
}

/// A camera that looks sideways at a row of points 1 to 3 m away and drives 0.2 m from pose to pose.
fn drive(random: &mut Random, n_poses: usize) -> State {
    let poses = (0..n_poses)
        .map(|i| {
            let turn = Vector3::from_fn(|_, _| 0.03 * random.normal());
            Pose {
                rotation: Rotation3::new(turn),
                translation: Vector3::new(0.2 * i as f64, 0.01 * random.normal(), 0.0),
            }
        })
        .collect();
    let points = (0..30 * n_poses)
        .map(|_| {
            let x = 0.2 * n_poses as f64 * random.uniform();
            Point3::new(x, 1.2 * random.uniform() - 0.6, 1.0 + 2.0 * random.uniform())
        })
        .collect();
    State { poses, points }
}

/// Noisy pictures of all points in view; a share of them wrong.
fn pictures(random: &mut Random, truth: &State, wrong: f64) -> Vec<PointView> {
    let camera = camera();
    let mut all = Vec::new();
    for (pose, session_from_camera) in truth.poses.iter().enumerate() {
        for (point, place) in truth.points.iter().enumerate() {
            let Some((seen, _)) = camera.project_pair(&session_from_camera.to_camera(&place.coords)) else {
                continue;
            };
            if !(0.0..640.0).contains(&seen.x) || !(0.0..360.0).contains(&seen.y) {
                continue;
            }
            let spread = if random.uniform() < wrong { 30.0 } else { SIGMA_PX };
            let measured = Measured::Picture(seen + Vector3::from_fn(|_, _| spread * random.normal()));
            all.push(PointView { pose, point, measured, whitening: Matrix3::identity() / SIGMA_PX });
        }
    }
    all
}

/// The truth, moved by `shift` metres and a third of it in radians; fixed poses stay.
fn disturbed(random: &mut Random, truth: &State, fixed: &[bool], shift: f64) -> State {
    let mut state = truth.clone();
    for (pose, _) in state.poses.iter_mut().zip(fixed).filter(|(_, fixed)| !**fixed) {
        let xi = Vector6::from_fn(|axis, _| random.normal() * if axis < 3 { shift } else { shift / 3.0 });
        *pose = steps::moved(pose, &xi);
    }
    for point in &mut state.points {
        *point += Vector3::from_fn(|_, _| shift * random.normal());
    }
    state
}

fn pictured_problem(random: &mut Random, truth: &State, wrong: f64) -> Problem {
    let fixed = (0..truth.poses.len()).map(|pose| pose == 0).collect();
    Problem { camera: camera(), fixed, observations: pictures(random, truth, wrong), relative_poses: Vec::new() }
}

fn errors(found: &Pose, truth: &Pose) -> Vector6<f64> {
    steps::logarithm(&found.seen_from(truth))
}

#[test]
fn a_window_comes_back_among_wrong_matches() {
    let mut random = Random(SplitMix(1));
    let truth = drive(&mut random, 8);
    let problem = pictured_problem(&mut random, &truth, 0.2);
    let start = disturbed(&mut random, &truth, &problem.fixed, 0.03);
    let found = adjust(&problem, start, &Settings::default()).expect("a valid problem");
    assert!(found.costs[1] < found.costs[0], "{:?}", found.costs);
    for (pose, true_pose) in found.state.poses.iter().zip(&truth.poses) {
        let error = errors(pose, true_pose);
        assert!(error.fixed_rows::<3>(0).norm() < 0.005, "{error}");
        assert!(error.fixed_rows::<3>(3).norm() < 0.003, "{error}");
    }
    assert_eq!(found.state.poses[0], truth.poses[0], "the fixed pose stays");
}

#[test]
fn covariances_are_those_of_the_errors() {
    // Mean of e^T I e over drives is 6 where the information is true. 40 drives x 3 pairs scatter by 0.32.
    let (mut sum, mut n, mut points, mut n_points) = (0.0, 0.0, 0.0, 0.0);
    for seed in 0..40 {
        let mut random = Random(SplitMix(seed));
        let truth = drive(&mut random, 4);
        let problem = pictured_problem(&mut random, &truth, 0.0);
        let plain = Settings { picture_scale2: 1e9, ..Settings::default() };
        let found = adjust(&problem, truth.clone(), &plain).expect("a valid problem");
        let pairs = [(0, 1), (1, 2), (2, 3)];
        for ((first, second), information) in pairs.iter().zip(found.relative_information(&pairs)) {
            let relative = |state: &State| state.poses[*second].seen_from(&state.poses[*first]);
            let error = errors(&relative(&found.state), &relative(&truth));
            sum += error.dot(&(information.expect("neighbours share points") * error));
            n += 1.0;
        }
        let all_fixed = Problem { fixed: vec![true; 4], ..problem };
        let found = adjust(&all_fixed, truth.clone(), &plain).expect("a valid problem");
        for ((point, place), covariance) in found.state.points.iter().zip(&truth.points).zip(&found.point_covariances) {
            if let Some(factor) = covariance.cholesky() {
                points += (point - place).dot(&factor.solve(&(point - place)));
                n_points += 1.0;
            }
        }
    }
    assert!((sum / n - 6.0).abs() < 1.3, "{}", sum / n);
    assert!(n_points > 1000.0 && (points / n_points - 3.0).abs() < 0.3, "{}", points / n_points);
}

#[test]
fn sightings_of_the_same_fruit_close_a_loop() {
    // Odometry drifts by 2 cm a step there and back; fruits seen again on the way back bring it home.
    let mut random = Random(SplitMix(3));
    let (there, n) = (30, 60);
    let place = |i: i32| Vector3::new(0.2 * f64::from(if i < there { i } else { n - 1 - i }), 0.0, 0.0);
    let truth: Vec<Pose> = (0..n).map(|i| Pose { translation: place(i), ..Pose::IDENTITY }).collect();
    let fruits: Vec<Point3<f64>> =
        (0..90).map(|i| Point3::new(f64::from(i) / 15.0, random.uniform() - 0.5, 1.0 + random.uniform())).collect();
    let truth = State { poses: truth, points: fruits };
    let spread = Matrix3::from_diagonal(&Vector3::new(0.004, 0.004, 0.008));
    let whitening = spread.try_inverse().expect("regular");
    let mut observations = Vec::new();
    for (pose, session_from_camera) in truth.poses.iter().enumerate() {
        for (point, fruit) in truth.points.iter().enumerate() {
            let place = session_from_camera.to_camera(&fruit.coords);
            if place.x.abs() < 0.7 {
                let seen = place + spread * Vector3::from_fn(|_, _| random.normal());
                observations.push(PointView { pose, point, measured: Measured::Place(seen), whitening });
            }
        }
    }
    let deviations = Vector6::new(0.02, 0.02, 0.02, 0.005, 0.005, 0.005);
    let information = Matrix6::from_diagonal(&deviations.map(|sigma| 1.0 / (sigma * sigma)));
    let mut start = State { poses: vec![truth.poses[0]], points: truth.points.clone() };
    let mut relative_poses = Vec::new();
    for second in 1..truth.poses.len() {
        let noise = deviations.map(|sigma| sigma * random.normal());
        let first_from_second = steps::moved(&truth.poses[second].seen_from(&truth.poses[second - 1]), &noise);
        relative_poses.push(RelativePose {
            first: second - 1,
            second,
            first_from_second,
            information,
            doubtful: false,
        });
        start.poses.push(start.poses[second - 1].after(&first_from_second));
    }
    let mut fixed = vec![false; truth.poses.len()];
    fixed[0] = true;
    let problem = Problem { camera: camera(), fixed, observations, relative_poses };
    let drift = errors(start.poses.last().expect("poses"), truth.poses.last().expect("poses"));
    let found = adjust(&problem, start, &Settings::after_drift()).expect("a valid problem");
    let left = errors(found.state.poses.last().expect("poses"), truth.poses.last().expect("poses"));
    assert!(drift.norm() > 0.1, "{drift}");
    // Ten fruits in common turn the last camera to 7 mrad, which is 1 cm at 1.5 m.
    assert!(left.norm() < 0.03, "{left}");
}

#[test]
fn a_drift_of_sixty_sigma_is_closed() {
    // Three fruits are seen again from where the drive began, 0.6 m off. With the final loss at once they pull less than
    // odometry holds, though their place costs less in all: the drift would stay.
    let fruits = [Point3::new(0.0, 0.0, 1.5), Point3::new(0.3, 0.2, 1.6), Point3::new(-0.2, 0.3, 1.4)];
    let pairs = (0..2).flat_map(|pose| (0..3).map(move |point| (pose, point)));
    let observations = pairs.map(|(pose, point)| PointView {
        pose,
        point,
        measured: Measured::Place(fruits[point].coords),
        whitening: Matrix3::identity() / 0.01,
    });
    let drifted = Pose { translation: Vector3::x() * 0.6, ..Pose::IDENTITY };
    let deviations = Vector6::new(0.09, 0.09, 0.09, 0.001, 0.001, 0.001);
    let information = Matrix6::from_diagonal(&deviations.map(|sigma| 1.0 / (sigma * sigma)));
    let problem = Problem {
        camera: camera(),
        fixed: vec![true, false],
        observations: observations.collect(),
        relative_poses: vec![RelativePose {
            first: 0,
            second: 1,
            first_from_second: drifted,
            information,
            doubtful: false,
        }],
    };
    let left_m = |settings: &Settings| {
        let start = State { poses: vec![Pose::IDENTITY, drifted], points: fruits.to_vec() };
        adjust(&problem, start, settings).expect("a valid problem").state.poses[1].translation.norm()
    };
    assert!(left_m(&Settings::default()) > 0.2, "{}", left_m(&Settings::default()));
    assert!(left_m(&Settings::after_drift()) < 0.03, "{}", left_m(&Settings::after_drift()));
}

#[test]
fn a_doubtful_relative_pose_that_is_false_is_let_go() {
    // A chain of five, a loop that agrees with it, and one that is a metre off.
    let place = |i: usize| Pose { translation: Vector3::x() * (0.5 * i as f64), ..Pose::IDENTITY };
    let information = Matrix6::identity() * 1e4;
    let pair = |first: usize, second: usize, beside_m: f64, doubtful: bool| RelativePose {
        first,
        second,
        first_from_second: Pose {
            translation: place(second).seen_from(&place(first)).translation + Vector3::z() * beside_m,
            ..Pose::IDENTITY
        },
        information,
        doubtful,
    };
    let adjusted = |doubtful: bool| {
        let mut relative_poses: Vec<_> = (1..6).map(|second| pair(second - 1, second, 0.0, false)).collect();
        relative_poses.extend([pair(0, 5, 0.0, true), pair(1, 4, 1.0, doubtful)]);
        let fixed = (0..6).map(|pose| pose == 0).collect();
        let problem = Problem { camera: camera(), fixed, observations: Vec::new(), relative_poses };
        let start = State { poses: (0..6).map(place).collect(), points: Vec::new() };
        adjust(&problem, start, &Settings::after_drift()).expect("a valid problem")
    };
    let (refused, trusted) = (adjusted(true), adjusted(false));
    assert!(refused.state.poses[4].translation.z.abs() < 0.01, "{}", refused.state.poses[4].translation);
    assert!(refused.relative_squared_errors[6] > 5000.0 && refused.relative_squared_errors[5] < 1.0);
    assert!(trusted.state.poses[4].translation.z > 0.1, "{}", trusted.state.poses[4].translation);
    let sigma2 = refused.pose_covariances().expect("all hang together")[1][(0, 0)];
    // Of a chain of six sides that closes, one side: 5 / 6 of its variance.
    assert!((sigma2 * 1e4 - 5.0 / 6.0).abs() < 0.01, "{sigma2}");
}

#[test]
fn a_picture_is_located_among_many_wrong_matches() {
    let mut random = Random(SplitMix(7));
    let truth = drive(&mut random, 1).poses[0];
    let camera = camera();
    let mut known = KnownPoints { points: Vec::new(), covariances: Vec::new(), pixels: Vec::new() };
    for i in 0..200 {
        let place = Vector3::new(1.4 * random.uniform() - 0.7, random.uniform() - 0.5, 1.0 + 2.0 * random.uniform());
        let (seen, _) = camera.project_pair(&place).expect("in front");
        let wrong = if i < 140 { 40.0 } else { SIGMA_PX };
        known.points.push(Point3::from(truth.to_session(&place)));
        known.covariances.push(Matrix3::identity() * 1e-6);
        known.pixels.push(Vector2::new(seen.x + wrong * random.normal(), seen.y + wrong * random.normal()));
    }
    let turn = UnitQuaternion::from_euler_angles(0.02, -0.05, 0.03).to_rotation_matrix();
    let expected = truth.after(&Pose { rotation: turn, translation: Vector3::new(0.15, -0.05, 0.1) });
    let found =
        locate(&camera, &known, &expected, &LocateSettings::default()).expect("valid").expect("60 true matches");
    let error = errors(&found.pose, &truth);
    assert!(error.norm() < 0.003, "{error}");
    assert!(found.inliers[140..].iter().filter(|&&agrees| agrees).count() >= 56);
    assert!(found.inliers[..140].iter().filter(|&&agrees| agrees).count() <= 5);
    let known = KnownPoints {
        points: known.points[..3].to_vec(),
        covariances: known.covariances[..3].to_vec(),
        pixels: known.pixels[..3].to_vec(),
    };
    assert!(locate(&camera, &known, &expected, &LocateSettings::default()).expect("valid").is_none());
}

#[test]
fn rows_that_do_not_exist_are_named() {
    let mut random = Random(SplitMix(1));
    let truth = drive(&mut random, 2);
    let mut problem = pictured_problem(&mut random, &truth, 0.0);
    problem.observations[5].point = 60;
    let error = adjust(&problem, truth.clone(), &Settings::default()).expect_err("row 60 of 60");
    assert_eq!(error.to_string(), "observations.point: found row 60, expected one below 60");
    problem.observations[5].point = 0;
    problem.fixed.pop();
    assert!(adjust(&problem, truth, &Settings::default()).is_err());
}
