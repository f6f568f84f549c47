//! What must not matter to a match: unit, origin, axes, copies and strays, by either method.

mod support;

use nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use pomona::{Config, FruitCloud, Match, Method, Request, Scale, Verdict, Views, match_clouds};
use proptest::prelude::*;
use support::{Random, Scene};

const METHODS: [Method; 2] = [Method::Paper, Method::Verified];

fn visits(seed: u64) -> Scene {
    let mut random = Random::new(seed + 1);
    let fruits = support::row(&mut random, 2);
    support::scene(&mut random, &fruits, 0.2, 0.01)
}

fn search(query: &FruitCloud, map: &FruitCloud, method: Method, scale: Scale) -> Match {
    let request = Request { method, scale, ..Request::default() };
    match_clouds(query, map, &request, &Config::default()).expect("valid clouds")
}

fn rows(found: &Match) -> Vec<(usize, usize)> {
    found.pairs.iter().map(|pair| (pair.query, pair.map)).collect()
}

fn placed(cloud: &FruitCloud, scale: f64, offset: Vector3<f64>) -> FruitCloud {
    FruitCloud::from_positions(cloud.positions.iter().map(|p| Point3::from(p.coords * scale + offset)).collect())
}

/// Inputs that one test turns into others.
fn method() -> impl Strategy<Value = Method> {
    prop::sample::select(METHODS.to_vec())
}

/// A factor of 10^-3 to 10^3.
fn factor() -> impl Strategy<Value = f64> {
    (-3.0..3.0f64).prop_map(|power| 10f64.powf(power))
}

fn offset() -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-1e7..1e7f64).prop_map(Vector3::from)
}

fn turn() -> impl Strategy<Value = Rotation3<f64>> {
    prop::array::uniform3(-3.0..3.0f64).prop_map(|turn| Rotation3::new(Vector3::from(turn)))
}

/// Far from everything, to where coordinates end.
fn strays() -> impl Strategy<Value = Vec<Point3<f64>>> {
    let far = (prop::array::uniform3(-1.0..1.0f64), 2.0..300.0f64)
        .prop_filter("a direction", |(direction, _)| Vector3::from(*direction).norm() > 0.1)
        .prop_map(|(direction, power)| Point3::from(Vector3::from(direction) * 10f64.powf(power)));
    prop::collection::vec(far, 1..6)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn the_unit_of_a_cloud_of_free_scale(
        method in method(), seed in 0..8u64, here in factor(), there in factor(), origins in [offset(), offset()],
    ) {
        let scene = visits(seed);
        let plain = search(&scene.query, &scene.map, method, Scale::Free);
        prop_assert_eq!(plain.verdict, Verdict::Found);
        let query = placed(&scene.query, here, origins[0]);
        let map = placed(&scene.map, there, origins[1]);
        let found = search(&query, &map, method, Scale::Free);
        prop_assert_eq!(rows(&found), rows(&plain));
        let (pose, plain_pose) = (found.registration.expect("found").map_from_query, plain.registration.expect("found").map_from_query);
        prop_assert!((pose.scale * here / there / plain_pose.scale - 1.0).abs() < 1e-3);
        prop_assert!((found.noise_m / there / plain.noise_m - 1.0).abs() < 1e-2);
        for (row, pair) in found.pairs.iter().zip(&plain.pairs) {
            let apart = (pose.apply(&query.positions[row.query]) - map.positions[row.map]).norm();
            prop_assert!(apart < 0.3 * there, "{apart}");
            prop_assert!((row.distance_m / there - pair.distance_m).abs() < 1e-3);
        }
    }

    #[test]
    fn the_origin_of_a_cloud_in_metres(method in method(), seed in 0..8u64, origins in [offset(), offset()]) {
        let scene = visits(seed);
        let plain = search(&scene.query, &scene.map, method, Scale::Metric);
        let found =
            search(&placed(&scene.query, 1.0, origins[0]), &placed(&scene.map, 1.0, origins[1]), method, Scale::Metric);
        prop_assert_eq!(rows(&found), rows(&plain));
    }

    #[test]
    fn how_the_axes_of_a_cloud_are_turned(method in method(), seed in 0..8u64, turns in [turn(), turn()]) {
        let scene = visits(seed);
        let plain = search(&scene.query, &scene.map, method, Scale::Metric);
        let [query, map] = [(&scene.query, turns[0]), (&scene.map, turns[1])].map(|(cloud, turn)| {
            FruitCloud::from_positions(cloud.positions.iter().map(|p| turn * p).collect())
        });
        let found = search(&query, &map, method, Scale::Metric);
        prop_assert_eq!(rows(&found), rows(&plain));
        for (found, plain) in found.pairs.iter().zip(&plain.pairs) {
            let apart = (found.probability - plain.probability).abs();
            // Some distances are compared in single precision.
            prop_assert!(apart < 1e-4, "{apart}");
        }
    }

    #[test]
    fn strays_in_either_cloud(
        method in method(), scale in prop::sample::select(vec![Scale::Metric, Scale::Free]), seed in 0..8u64,
        origin in offset(), extra in [strays(), strays()],
    ) {
        let scene = visits(seed);
        let plain = search(&scene.query, &scene.map, method, scale);
        let [mut query, mut map] = [&scene.query, &scene.map].map(|cloud| placed(cloud, 1.0, origin));
        query.positions.extend(&extra[0]);
        map.positions.extend(&extra[1]);
        // As a reader that fills gaps with zeros makes them.
        map.positions.push(Point3::origin());
        prop_assert_eq!(rows(&search(&query, &map, method, scale)), rows(&plain));
    }

    #[test]
    fn copies_in_either_cloud(
        method in method(), seed in 0..8u64, times in 1..200usize, of in any::<prop::sample::Index>(),
    ) {
        let scene = visits(seed);
        let plain = search(&scene.query, &scene.map, method, Scale::Metric);
        let copied = |cloud: &FruitCloud| {
            let fruit = cloud.positions[of.index(cloud.len())];
            FruitCloud::from_positions(cloud.positions.iter().copied().chain(vec![fruit; times]).collect())
        };
        let (query, map) = (copied(&scene.query), copied(&scene.map));
        prop_assert_eq!(rows(&search(&query, &scene.map, method, Scale::Metric)), rows(&plain));
        prop_assert_eq!(rows(&search(&scene.query, &map, method, Scale::Metric)), rows(&plain));
    }
}

/// Covariances and verticals turn with the cloud that they are of.
#[test]
fn what_is_known_in_a_frame_turns_with_it() {
    let mut scene = visits(3);
    let covariance = |row: usize| Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 1e-3 * (1 + row % 3) as f64));
    scene.query.covariances = Some((0..scene.query.len()).map(covariance).collect());
    let up = |cloud: Vector3<f64>| [scene.map_from_query.rotation.inverse() * cloud, cloud];
    let request = Request { up: Some(up(Vector3::z())), ..Request::default() };
    let ask = |query: &FruitCloud, request: &Request| {
        match_clouds(query, &scene.map, request, &Config::default()).expect("valid clouds")
    };
    let turn = Rotation3::new(Vector3::new(0.7, -2.0, 1.1));
    let mut turned = scene.query.clone();
    turned.positions.iter_mut().for_each(|p| *p = turn * *p);
    turned.covariances.iter_mut().flatten().for_each(|c| *c = turn * *c * turn.inverse());
    let [of_query, of_map] = up(Vector3::z());
    let (plain, found) =
        (ask(&scene.query, &request), ask(&turned, &Request { up: Some([turn * of_query, of_map]), ..request }));
    assert_eq!(plain.verdict, Verdict::Found);
    assert_eq!(rows(&found), rows(&plain));
    assert!(found.pairs.iter().zip(&plain.pairs).all(|(a, b)| (a.probability - b.probability).abs() < 1e-4));
}

#[test]
fn a_copy_is_seen_where_its_fruit_is() {
    let scene = visits(3);
    let n = scene.query.len();
    let mut query = scene.query.clone();
    query.positions.push(query.positions[5]);
    // Half of the frames name the copy.
    let frames: Vec<i64> = (0..6).flat_map(|frame| vec![frame; n]).collect();
    let fruits = |frame: i64| (0..n).map(move |row| if row == 5 && frame % 2 == 1 { n } else { row });
    query.views = Some(Views { frames, fruits: (0..6).flat_map(fruits).collect() });
    let request = Request { method: Method::Paper, per_frame: true, ..Request::default() };
    let found = match_clouds(&query, &scene.map, &request, &Config::default()).expect("valid clouds");
    assert_eq!(found.verdict, Verdict::Found);
    assert!(found.pairs.iter().all(|pair| pair.query != n));
    assert!(rows(&found).contains(&(5, scene.partner[5].expect("seen twice"))));
}

#[test]
fn clouds_beyond_any_orchard_end_without_an_answer() {
    let scene = visits(4);
    let huge = placed(&scene.query, 1e200, Vector3::zeros());
    let tiny = placed(&scene.query, 1e-200, Vector3::zeros());
    let one_place = FruitCloud::from_positions(vec![Point3::new(1.0, 2.0, 3.0); 10_000]);
    for cloud in [&huge, &tiny, &one_place] {
        for method in METHODS {
            for scale in [Scale::Metric, Scale::Free] {
                for (query, map) in [(cloud, &scene.map), (&scene.query, cloud), (cloud, cloud)] {
                    let found = search(query, map, method, scale);
                    assert!(matches!(found.verdict, Verdict::TooFew | Verdict::NoMatch), "{:?}", found.verdict);
                }
            }
        }
    }
}
