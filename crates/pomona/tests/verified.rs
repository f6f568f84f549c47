//! The verified method from outside: what it finds, what it refuses, what must not matter.

mod support;

use nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use pomona::{Config, FruitCloud, MapIndex, Match, Method, Request, Scale, Similarity, Verdict, match_clouds};
use support::{Random, Scene};

fn search(query: &FruitCloud, map: &FruitCloud, request: &Request) -> Match {
    match_clouds(query, map, request, &Config::default()).expect("valid clouds")
}

fn default_search(query: &FruitCloud, map: &FruitCloud) -> Match {
    search(query, map, &Request::default())
}

/// Two visits to a row of its own for each seed.
fn visits(seed: u64, trees: usize, missing: f64, noise_m: f64) -> Scene {
    let mut random = Random::new(seed + 1);
    let fruits = support::row(&mut random, trees);
    support::scene(&mut random, &fruits, missing, noise_m)
}

/// Pairs that are right, pairs in all, pairs there are.
fn score(scene: &Scene, found: &Match) -> (usize, usize, usize) {
    let right = found.pairs.iter().filter(|pair| scene.partner[pair.query] == Some(pair.map)).count();
    (right, found.pairs.len(), scene.partner.iter().flatten().count())
}

/// How far two transforms put the fruits apart at the most, metres.
fn apart(cloud: &FruitCloud, a: &Similarity, b: &Similarity) -> f64 {
    cloud.positions.iter().map(|p| (a.apply(p) - b.apply(p)).norm()).fold(0.0, f64::max)
}

fn pose(found: &Match) -> Similarity {
    found.registration.expect("a registration").map_from_query
}

#[test]
fn finds_the_pose_and_the_pairs() {
    for seed in 0..5 {
        let scene = visits(seed, 3, 0.3, 0.02);
        let found = default_search(&scene.query, &scene.map);
        assert_eq!(found.verdict, Verdict::Found, "seed {seed}");
        assert!(apart(&scene.query, &pose(&found), &scene.map_from_query) < 0.05, "seed {seed}");
        let (right, reported, there) = score(&scene, &found);
        assert!(right as f64 > 0.93 * reported as f64, "seed {seed}: {right} of {reported} are right");
        assert!(right as f64 > 0.93 * there as f64, "seed {seed}: {right} of {there} are found");
    }
}

#[test]
fn finds_the_scale_where_it_is_free() {
    let scene = visits(7, 3, 0.3, 0.02);
    let mut query = scene.query.clone();
    for p in &mut query.positions {
        p.coords *= 0.6;
    }
    let request = Request { scale: Scale::Free, ..Request::default() };
    let found = search(&query, &scene.map, &request);
    assert_eq!(found.verdict, Verdict::Found);
    assert!((pose(&found).scale * 0.6 - 1.0).abs() < 0.01);
}

#[test]
fn other_trees_are_no_match() {
    for seed in 0..10 {
        let (one, other) = (visits(seed, 3, 0.3, 0.02), visits(seed + 100, 3, 0.3, 0.02));
        let found = default_search(&one.query, &other.map);
        assert_eq!(found.verdict, Verdict::NoMatch, "seed {seed}");
        assert!(found.pairs.is_empty() && found.registration.is_none());
    }
}

#[test]
fn the_order_of_the_fruits_changes_nothing() {
    let scene = visits(3, 2, 0.3, 0.02);
    let found = default_search(&scene.query, &scene.map);
    let reverse = |cloud: &FruitCloud| cloud.select(&(0..cloud.len()).rev().collect::<Vec<_>>());
    let again = default_search(&reverse(&scene.query), &reverse(&scene.map));
    let (last_query, last_map) = (scene.query.len() - 1, scene.map.len() - 1);
    let mut back: Vec<(usize, usize, u64)> = again
        .pairs
        .iter()
        .map(|pair| (last_query - pair.query, last_map - pair.map, pair.probability.to_bits()))
        .collect();
    back.sort_unstable();
    let pairs: Vec<_> = found.pairs.iter().map(|pair| (pair.query, pair.map, pair.probability.to_bits())).collect();
    assert_eq!(pairs, back);
    assert_eq!(pose(&found), pose(&again));
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let scene = visits(4, 3, 0.45, 0.02);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| default_search(&scene.query, &scene.map))
    };
    let (one, four) = (with(1), with(4));
    assert_eq!(one, four);
    assert_eq!(one.verdict, Verdict::Found);
}

#[test]
fn forward_and_inverse_agree() {
    let scene = visits(5, 3, 0.3, 0.02);
    let forward = default_search(&scene.query, &scene.map);
    let inverse = default_search(&scene.map, &scene.query);
    assert!(apart(&scene.query, &pose(&forward), &pose(&inverse).inverse()) < 0.03);
    let back: std::collections::HashSet<_> = inverse.pairs.iter().map(|pair| (pair.map, pair.query)).collect();
    let both = forward.pairs.iter().filter(|pair| back.contains(&(pair.query, pair.map))).count();
    assert!(both as f64 > 0.93 * forward.pairs.len() as f64, "{both} of {}", forward.pairs.len());
}

#[test]
fn moving_and_turning_a_visit_changes_no_pair() {
    let scene = visits(6, 3, 0.3, 0.01);
    let far = Similarity::rigid(Rotation3::new(Vector3::new(0.4, -1.1, 2.0)), Vector3::new(5e5, 4.2e6, 120.0));
    let mut query = scene.query.clone();
    for p in &mut query.positions {
        *p = far.apply(p);
    }
    let (found, moved) = (default_search(&scene.query, &scene.map), default_search(&query, &scene.map));
    assert!(apart(&scene.query, &pose(&found), &pose(&moved).compose(&far)) < 0.02);
    let pairs = |found: &Match| found.pairs.iter().map(|p| (p.query, p.map)).collect::<std::collections::HashSet<_>>();
    let (a, b) = (pairs(&found), pairs(&moved));
    assert!(a.intersection(&b).count() as f64 > 0.97 * a.len() as f64);
}

#[test]
fn too_few_a_line_and_one_place_have_no_answer() {
    let few =
        FruitCloud::from_positions(vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)]);
    assert_eq!(default_search(&few, &few).verdict, Verdict::TooFew);
    for count in [20, 200] {
        let mut random = Random::new(count);
        let line: Vec<Point3<f64>> = (0..count).map(|i| Point3::new(0.3 * i as f64, 0.0, 0.0)).collect();
        let turned = random.similarity();
        let query = FruitCloud::from_positions(line.iter().map(|p| turned.apply(p)).collect());
        assert_ne!(default_search(&query, &FruitCloud::from_positions(line)).verdict, Verdict::Found);
    }
    let one_place = FruitCloud::from_positions(vec![Point3::new(1.0, 2.0, 3.0); 30]);
    assert_ne!(default_search(&one_place, &one_place).verdict, Verdict::Found);
}

#[test]
fn a_regular_grid_is_never_sure() {
    let mut random = Random::new(8);
    let mut grid = Vec::new();
    for i in 0..216 {
        grid.push(Point3::new(f64::from(i % 6), f64::from(i / 6 % 6), f64::from(i / 36)) * 0.3);
    }
    let turned = random.similarity();
    let mut visit = |keep: f64| -> Vec<Point3<f64>> {
        grid.iter().filter(|_| random.uniform() < keep).copied().collect::<Vec<_>>()
    };
    let (query, map) = (visit(0.8), visit(0.8));
    let query = FruitCloud::from_positions(query.iter().map(|p| turned.apply(p)).collect());
    assert_ne!(default_search(&query, &FruitCloud::from_positions(map)).verdict, Verdict::Found);
}

#[test]
fn two_equal_trees_are_ambiguous() {
    let mut random = Random::new(9);
    let tree = support::row(&mut random, 1);
    let twin: Vec<_> = tree.iter().map(|p| p + Vector3::new(4.0, 0.0, 0.0)).collect();
    let map = FruitCloud::from_positions(tree.iter().chain(&twin).copied().collect());
    let found = default_search(&FruitCloud::from_positions(tree), &map);
    assert_eq!(found.verdict, Verdict::Ambiguous);
    let shift = (pose(&found).translation - found.alternatives[0].map_from_query.translation).norm();
    assert!((shift - 4.0).abs() < 0.05, "the two answers lie {shift} m apart");
}

#[test]
fn a_row_is_found_after_most_of_its_fruits_were_picked() {
    let found = (0..12).filter(|&seed| {
        let scene = visits(seed, 3, 0.3, 0.02);
        let left: Vec<usize> = (0..scene.query.len()).filter(|i| i % 5 == 0).collect();
        let found = default_search(&scene.query.select(&left), &scene.map);
        let is_right = || apart(&scene.query, &pose(&found), &scene.map_from_query) < 0.1;
        assert!(found.verdict != Verdict::Found || is_right(), "seed {seed}");
        found.verdict == Verdict::Found
    });
    let found = found.count();
    assert!(found >= 6, "{found} of 12 are found");
}

/// The camera lost its way in the middle of the row: what lies behind is off by a metre and turned.
fn torn_apart(scene: &Scene) -> [Vec<bool>; 2] {
    let along = |p: &Point3<f64>| scene.map_from_query.apply(p).x;
    let mut places: Vec<f64> = scene.query.positions.iter().map(along).collect();
    places.sort_by(f64::total_cmp);
    let behind: Vec<bool> = scene.query.positions.iter().map(|p| along(p) > places[places.len() / 2]).collect();
    [behind.iter().map(|behind| !behind).collect(), behind]
}

/// Moves what lies behind the middle of the row by `moved`, in the map; returns the truth of both parts.
fn tear(scene: &mut Scene, parts: &[Vec<bool>; 2], moved: &Similarity) -> [Similarity; 2] {
    let of_behind = scene.map_from_query.inverse().compose(moved).compose(&scene.map_from_query);
    for (p, _) in scene.query.positions.iter_mut().zip(&parts[1]).filter(|(_, behind)| **behind) {
        *p = of_behind.apply(p);
    }
    [scene.map_from_query, scene.map_from_query.compose(&of_behind.inverse())]
}

#[test]
fn a_row_that_is_torn_apart_is_one_answer_of_two_parts() {
    // Off by a metre and turned; and laid over what lies before, as by a camera that begins anew.
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.17);
    let off = Similarity::rigid(turn, Vector3::new(1.0, 0.2, 0.0));
    let over = Similarity::rigid(Rotation3::identity(), Vector3::new(-3.6, 0.05, 0.0));
    for (seed, moved, least) in (0..3).flat_map(|seed| [(seed, off, 0.95), (seed, over, 0.75)]) {
        let mut scene = visits(seed, 6, 0.2, 0.02);
        let parts = torn_apart(&scene);
        let truths = tear(&mut scene, &parts, &moved);
        let found = default_search(&scene.query, &scene.map);
        assert_eq!(found.verdict, Verdict::Found, "seed {seed}");
        let (right, reported, _) = score(&scene, &found);
        assert!(right as f64 > 0.9 * reported as f64, "seed {seed}: {right} of {reported} are right");
        let share_found = |part: &[bool]| {
            let due = (0..part.len()).filter(|&i| part[i] && scene.partner[i].is_some()).count();
            found.pairs.iter().filter(|pair| part[pair.query]).count() as f64 / due as f64
        };
        let shares = [&parts[0], &parts[1]].map(|part| share_found(part));
        assert!(shares.iter().all(|&share| share > least), "seed {seed}: {shares:?}");
        // The pose is that of a part, and none between the two.
        let [before, behind] = [0, 1].map(|part: usize| {
            let fruits = (0..scene.query.len()).filter(|&i| parts[part][i]).collect::<Vec<_>>();
            apart(&scene.query.select(&fruits), &pose(&found), &truths[part])
        });
        assert!(before.min(behind) < 0.08 && before.max(behind) > 0.5, "seed {seed}: {before} {behind}");
    }
}

#[test]
fn a_known_vertical_refuses_what_stands_on_its_head() {
    let scene = visits(11, 3, 0.3, 0.02);
    let up_in_map = Vector3::z();
    let up_in_query = scene.map_from_query.rotation.inverse() * up_in_map;
    let right = Request { up: Some([up_in_query, up_in_map]), ..Request::default() };
    assert_eq!(search(&scene.query, &scene.map, &right).verdict, Verdict::Found);
    let wrong = Request { up: Some([-up_in_query, up_in_map]), ..Request::default() };
    assert_eq!(search(&scene.query, &scene.map, &wrong).verdict, Verdict::NoMatch);
}

#[test]
fn sizes_raise_precision_where_positions_are_blind() {
    let (mut with, mut without) = (0.0, 0.0);
    for seed in 0..4 {
        let mut scene = visits(20 + seed, 3, 0.3, 0.05);
        let blind = default_search(&scene.query, &scene.map);
        let mut random = Random::new(seed);
        let map_sizes: Vec<f64> = scene.map.positions.iter().map(|_| 0.06 * (1.0 + 0.12 * random.normal())).collect();
        let query_sizes = scene
            .partner
            .iter()
            .map(|partner| partner.map_or_else(|| 0.06 * (1.0 + 0.12 * random.normal()), |row| map_sizes[row]) * 1.16)
            .collect();
        scene.map.diameters_m = Some(map_sizes);
        scene.query.diameters_m = Some(query_sizes);
        let sized = default_search(&scene.query, &scene.map);
        let precision = |found: &Match| score(&scene, found).0 as f64 / found.pairs.len() as f64;
        with += precision(&sized);
        without += precision(&blind);
    }
    assert!(with > without + 0.2, "sum of four precisions: {with} with diameters, {without} without");
}

/// Right pairs under the true pose with covariances and without, of visits whose noise is 8 cm along one of these axes of the
/// map, in turns, and 1 cm across.
fn right_pairs_with_and_without_covariances(axes: &[Vector3<f64>]) -> [usize; 2] {
    let mut right = [0; 2];
    for seed in 0..4 {
        let mut scene = visits(40 + seed, 3, 0.2, 0.01);
        let mut random = Random::new(seed);
        let into_query = scene.map_from_query.rotation.inverse();
        let along: Vec<Vector3<f64>> =
            axes.iter().cycle().take(scene.query.len()).map(|axis| into_query * axis).collect();
        for (p, along) in scene.query.positions.iter_mut().zip(&along) {
            *p += along * (0.08 * random.normal());
        }
        let under_pose = |scene: &Scene| {
            let index = MapIndex::new(&scene.map, Method::Verified, Scale::Metric, Config::default()).expect("valid");
            score(scene, &index.pairs_under(&scene.query, &scene.map_from_query, Some(0.05)).expect("valid")).0
        };
        right[1] += under_pose(&scene);
        let across = Matrix3::identity() * 1e-4;
        let covariance = |along: &Vector3<f64>| across + along * along.transpose() * 0.0064;
        scene.query.covariances = Some(along.iter().map(covariance).collect());
        scene.map.covariances = Some(vec![across; scene.map.len()]);
        right[0] += under_pose(&scene);
    }
    right
}

#[test]
fn covariances_say_which_way_the_noise_of_each_fruit_points() {
    let [with, without] = right_pairs_with_and_without_covariances(&[Vector3::x(), Vector3::y(), Vector3::z()]);
    assert!(with as f64 > 1.05 * without as f64, "{with} right pairs with covariances, {without} without");
}

#[test]
fn pairs_show_which_way_the_noise_of_all_points() {
    // With the shape known, neighbours across are told apart; round noise of the same size leaves a twentieth of them.
    let [with, without] = right_pairs_with_and_without_covariances(&[Vector3::y()]);
    assert!(without as f64 > 0.98 * with as f64, "{with} right pairs with covariances, {without} without");
}

#[test]
fn pairs_under_a_known_pose_need_the_verified_method() {
    let scene = visits(12, 1, 0.2, 0.01);
    let index = MapIndex::new(&scene.map, Method::Paper, Scale::Metric, Config::default()).expect("valid");
    let error = index.pairs_under(&scene.query, &scene.map_from_query, None).expect_err("the paper has no such stage");
    assert!(error.to_string().contains("verified"));
}
