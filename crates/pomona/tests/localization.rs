//! A camera before a row, from Rust: found from nothing, followed, lost, found again.

mod support;

use pomona::nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use pomona::{Config, Error, FruitCloud, Localizer, Pose, ToldMotion, Verdict};
use support::{Random, row};

/// Standard deviation of a sighting per axis, metres.
const NOISE_M: f64 = 0.005;

fn camera_at(x_m: f64) -> Pose {
    // The row lies along x, z is up: the camera looks along y.
    let rotation = Rotation3::from_axis_angle(&Vector3::x_axis(), -std::f64::consts::FRAC_PI_2);
    Pose { rotation, translation: Vector3::new(x_m, -2.0, 1.7) }
}

/// Fruits before the camera, within 0.8 m to its sides, as it sees them; some are hidden.
fn seen(fruits: &[Point3<f64>], pose: &Pose, random: &mut Random) -> FruitCloud {
    let mut frame = Vec::new();
    for fruit in fruits {
        let place = pose.to_camera(&fruit.coords);
        if place.x.abs() < 0.8 && random.uniform() < 0.7 {
            let noise = Vector3::new(random.normal(), random.normal(), random.normal()) * NOISE_M;
            frame.push(Point3::from(place + noise));
        }
    }
    with_covariances(frame)
}

fn with_covariances(places: Vec<Point3<f64>>) -> FruitCloud {
    let covariances = vec![Matrix3::identity() * (NOISE_M * NOISE_M); places.len()];
    FruitCloud { covariances: Some(covariances), ..FruitCloud::from_positions(places) }
}

fn error_m(found: Option<Pose>, pose: &Pose) -> f64 {
    (found.expect("found").translation - pose.translation).norm()
}

#[test]
fn a_frame_is_found_from_nothing_and_the_next_ones_follow() {
    let random = &mut Random::new(3);
    let fruits = row(random, 4);
    let mut localizer = Localizer::new(&with_covariances(fruits.clone()), Config::default()).expect("a map");
    for step in 0..8 {
        let pose = camera_at(1.0 + 0.3 * f64::from(step));
        let frame = seen(&fruits, &pose, random);
        let moved = (step > 0).then(|| ToldMotion::from(pose.seen_from(&camera_at(0.7 + 0.3 * f64::from(step)))));
        let found = localizer.update(&frame, moved.as_ref(), None).expect("a frame");
        assert_eq!((found.verdict, found.tracked), (Verdict::Found, step > 0));
        assert!(error_m(found.pose, &pose) < 0.02);
        assert!(found.covariance.symmetric_eigenvalues().min() > 0.0);
    }
}

#[test]
fn a_frame_alone_leaves_what_is_known_as_it_was() {
    let random = &mut Random::new(4);
    let fruits = row(random, 4);
    let mut localizer = Localizer::new(&with_covariances(fruits.clone()), Config::default()).expect("a map");
    let elsewhere = localizer.locate(&seen(&fruits, &camera_at(3.5), random), None).expect("a frame");
    assert!(error_m(elsewhere.pose, &camera_at(3.5)) < 0.03);
    let first = localizer.update(&seen(&fruits, &camera_at(1.0), random), None, None).expect("a frame");
    assert!(!first.tracked);
}

#[test]
fn a_camera_that_was_carried_away_is_lost_and_found_again() {
    let random = &mut Random::new(5);
    let fruits = row(random, 4);
    let mut localizer = Localizer::new(&with_covariances(fruits.clone()), Config::default()).expect("a map");
    for (x_m, tracked) in [(1.0, false), (1.05, true), (3.6, false)] {
        let found = localizer.update(&seen(&fruits, &camera_at(x_m), random), None, None).expect("a frame");
        assert_eq!((found.verdict, found.tracked), (Verdict::Found, tracked));
        assert!(error_m(found.pose, &camera_at(x_m)) < 0.03);
    }
}

#[test]
fn strangers_have_no_pose() {
    let random = &mut Random::new(6);
    let localizer = Localizer::new(&with_covariances(row(random, 4)), Config::default()).expect("a map");
    let other = row(random, 4);
    let found = localizer.locate(&seen(&other, &camera_at(2.4), random), None).expect("a frame");
    assert_ne!(found.verdict, Verdict::Found);
    // Zeros would be a camera that is known exactly.
    assert!(found.pose.is_none() && found.covariance.iter().all(|x| x.is_nan()));
}

/// Frames of three fruits, told motions too long by `lie_m` along the row: errors of the poses, metres.
fn errors_of_a_drive(lie_m: f64, random: &mut Random) -> Vec<f64> {
    let fruits = row(random, 8);
    let mut localizer = Localizer::new(&with_covariances(fruits.clone()), Config::default()).expect("a map");
    let way_m = |step: i32| 1.0 + 0.1 * f64::from(step);
    let mut errors_m = Vec::new();
    for step in 0..40 {
        let pose = camera_at(way_m(step));
        let mut frame = seen(&fruits, &pose, random);
        let mut moved = pose.seen_from(&camera_at(way_m(step - 1)));
        if step > 3 {
            frame = with_covariances(frame.positions[..frame.len().min(3)].to_vec());
            moved.translation.x += lie_m;
        }
        let found = localizer.update(&frame, (step > 0).then_some(&moved.into()), None).expect("a frame");
        errors_m.extend(found.pose.map(|pose| error_m(Some(pose), &camera_at(way_m(step)))));
    }
    errors_m
}

#[test]
fn odometry_that_lies_steadily_is_noticed() {
    for (seed, lie_m) in [(7, 0.0), (8, 0.02), (9, 0.05), (10, -0.05), (11, 0.1)] {
        let errors_m = errors_of_a_drive(lie_m, &mut Random::new(seed));
        assert!(errors_m.len() > 30, "{lie_m}: {}", errors_m.len());
        let worst_m = errors_m.iter().copied().fold(0.0, f64::max);
        assert!(worst_m < 0.25, "{lie_m}: {worst_m}");
    }
}

#[test]
fn a_motion_that_is_none_and_points_of_a_surface_are_refused_and_leave_what_is_known_as_it_was() {
    let random = &mut Random::new(6);
    let fruits = row(random, 4);
    let mut localizer = Localizer::new(&with_covariances(fruits.clone()), Config::default()).expect("a map");
    let pose = camera_at(1.5);
    localizer.update(&seen(&fruits, &pose, random), None, None).expect("a frame");
    let still = Pose::IDENTITY;
    let turned = |matrix: Matrix3<f64>| Pose { rotation: Rotation3::from_matrix_unchecked(matrix), ..still };
    let nowhere = Pose { translation: Vector3::new(f64::NAN, 0.0, 0.0), ..still };
    let mirrored = turned(Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0)));
    for wrong in [nowhere, mirrored, turned(Matrix3::zeros()), turned(Matrix3::from_element(f64::NAN))] {
        let told = ToldMotion::from(wrong);
        let refused = localizer.update(&FruitCloud::default(), Some(&told), None);
        assert_eq!(refused, Err(Error::Pose));
    }
    let surface = FruitCloud::from_positions((0..5001).map(|i| Point3::new(f64::from(i) * 0.01, 0.0, 2.0)).collect());
    assert!(localizer.locate(&surface, None).is_err_and(|error| error.to_string().contains("5001 fruits")));
    let found = localizer.update(&seen(&fruits, &pose, random), Some(&ToldMotion::from(still)), None).expect("a frame");
    assert!(found.tracked && error_m(found.pose, &pose) < 0.02);
}
