//! The paper's method on seeded rows: what it finds, and what must not change the answer.

mod support;

use nalgebra::Point3;
use pomona::{Config, FruitCloud, MapIndex, Match, Method, Request, Scale, Verdict, Views, match_clouds};
use support::{Random, Scene, row, scene};

fn paper(scale: Scale) -> Request {
    Request { method: Method::Paper, scale, ..Request::default() }
}

fn solve(query: &FruitCloud, map: &FruitCloud) -> Match {
    match_clouds(query, map, &paper(Scale::Metric), &Config::default()).expect("valid input")
}

fn pairs(found: &Match) -> Vec<(usize, usize)> {
    found.pairs.iter().map(|pair| (pair.query, pair.map)).collect()
}

/// Share of the reported pairs that are true, and of the true pairs that are reported.
fn precision_recall(found: &Match, scene: &Scene) -> (f64, f64) {
    let right = found.pairs.iter().filter(|pair| scene.partner[pair.query] == Some(pair.map)).count() as f64;
    let exist = scene.partner.iter().flatten().count() as f64;
    (right / found.pairs.len().max(1) as f64, right / exist)
}

fn visits(seed: u64, missing: f64, noise_m: f64) -> Scene {
    let mut random = Random::new(seed);
    let fruits = row(&mut random, 3);
    scene(&mut random, &fruits, missing, noise_m)
}

#[test]
fn a_clean_copy_is_found_whole() {
    let scene = visits(1, 0.0, 0.0);
    let found = solve(&scene.query, &scene.map);
    let registration = found.registration.expect("found");
    assert_eq!(found.verdict, Verdict::Found);
    assert_eq!(precision_recall(&found, &scene), (1.0, 1.0));
    assert!((registration.map_from_query.to_matrix() - scene.map_from_query.to_matrix()).norm() < 1e-9);
    assert!(found.noise_m < 1e-9);
}

#[test]
fn hidden_fruits_and_noise_are_borne() {
    let scene = visits(2, 0.25, 0.01);
    let found = solve(&scene.query, &scene.map);
    let (precision, recall) = precision_recall(&found, &scene);
    assert!(precision > 0.95 && recall > 0.95, "precision {precision}, recall {recall}");
    assert!((0.007..0.014).contains(&found.noise_m), "{}", found.noise_m);
    assert!(found.pairs.iter().all(|pair| (0.0..=1.0).contains(&pair.probability)));
}

#[test]
fn an_unknown_scale_is_found() {
    let mut scene = visits(3, 0.2, 0.005);
    for p in &mut scene.query.positions {
        p.coords *= 1.7;
    }
    let found = match_clouds(&scene.query, &scene.map, &paper(Scale::Free), &Config::default()).expect("valid input");
    let (precision, recall) = precision_recall(&found, &scene);
    assert!(precision > 0.95 && recall > 0.95, "precision {precision}, recall {recall}");
    let scale = found.registration.expect("found").map_from_query.scale;
    assert!((scale * 1.7 - 1.0).abs() < 0.005, "{scale}");
}

#[test]
fn strangers_are_no_match() {
    for seed in 0..5 {
        let (one, other) = (visits(10 + seed, 0.1, 0.0), visits(20 + seed, 0.1, 0.0));
        let found = solve(&one.query, &other.map);
        assert_eq!((found.verdict, found.registration), (Verdict::NoMatch, None));
        assert!(found.pairs.is_empty() && found.noise_m.is_nan());
    }
}

#[test]
fn a_mirror_image_matches_in_its_plane_alone() {
    let mut scene = visits(4, 0.0, 0.0);
    for p in &mut scene.query.positions {
        p.x = -p.x;
    }
    let found = solve(&scene.query, &scene.map);
    // Fruits near a plane are near their mirror images: a slab as thick as the gate of 8 cm in a row of 3.6 m.
    let (_, recall) = precision_recall(&found, &scene);
    assert!(recall < 0.25, "recall {recall}");
}

#[test]
fn the_order_of_rows_changes_nothing() {
    let scene = visits(5, 0.2, 0.01);
    let found = solve(&scene.query, &scene.map);
    let turned = |cloud: &FruitCloud| cloud.select(&(0..cloud.len()).rev().collect::<Vec<_>>());
    let again = solve(&turned(&scene.query), &turned(&scene.map));
    let (last_query, last_map) = (scene.query.len() - 1, scene.map.len() - 1);
    let mut back: Vec<_> = pairs(&again).iter().map(|&(q, m)| (last_query - q, last_map - m)).collect();
    back.sort_unstable();
    assert_eq!(back, pairs(&found));
    assert_eq!(again.registration, found.registration);
}

#[test]
fn forward_and_inverse_agree() {
    let scene = visits(6, 0.2, 0.003);
    let (there, back) = (solve(&scene.query, &scene.map), solve(&scene.map, &scene.query));
    let there_pairs = pairs(&there);
    let both = pairs(&back).iter().filter(|&&(m, q)| there_pairs.contains(&(q, m))).count();
    // A fruit that only one visit saw may hang near another that only the other saw, at the edge of the gate.
    let most = there.pairs.len().max(back.pairs.len());
    assert!(both as f64 >= 0.98 * most as f64, "{both} of {most}");
    let transform = |found: &Match| found.registration.expect("found").map_from_query;
    let round = transform(&back).compose(&transform(&there));
    assert!(scene.query.positions.iter().all(|p| (round.apply(p) - p).norm() < 0.003));
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let mut scene = visits(7, 0.3, 0.02);
    scene.query.views = Some(windows(&scene.query));
    let request = Request { per_frame: true, ..paper(Scale::Metric) };
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let by = |request: &Request| match_clouds(&scene.query, &scene.map, request, &Config::default());
        pool.install(|| (by(&paper(Scale::Metric)).expect("valid input"), by(&request).expect("valid input")))
    };
    assert_eq!(on(1), on(4));
}

/// Frames that see 60 fruits each, in steps of 15, along the first axis of the cloud.
fn windows(cloud: &FruitCloud) -> Views {
    let mut rows: Vec<_> = (0..cloud.len()).collect();
    let middle = cloud.positions.iter().fold(Point3::origin(), |sum, p| sum + p.coords) / cloud.len() as f64;
    let far = cloud.positions.iter().map(|p| p - middle).max_by(|a, b| a.norm().total_cmp(&b.norm())).expect("fruits");
    rows.sort_by(|&a, &b| cloud.positions[a].coords.dot(&far).total_cmp(&cloud.positions[b].coords.dot(&far)));
    let mut views = Views::default();
    for (frame, start) in (0..rows.len().saturating_sub(59)).step_by(15).enumerate() {
        for &row in &rows[start..start + 60] {
            views.frames.push(frame as i64);
            views.fruits.push(row);
        }
    }
    views
}

#[test]
fn frames_follow_a_row_that_bends() {
    let mut random = Random::new(8);
    let fruits = row(&mut random, 8);
    let mut scene = scene(&mut random, &fruits, 0.2, 0.005);
    // The map drifts by 5 cm per metre squared along the row: 4.6 m sideways at its end, no rigid transform fits.
    for p in &mut scene.map.positions {
        p.y += 0.05 * p.x * p.x;
    }
    scene.query.views = Some(windows(&scene.query));
    let by_frame = Request { per_frame: true, ..paper(Scale::Metric) };
    let found = match_clouds(&scene.query, &scene.map, &by_frame, &Config::default()).expect("valid input");
    let (precision, recall) = precision_recall(&found, &scene);
    let (_, whole) = precision_recall(&solve(&scene.query, &scene.map), &scene);
    assert!(precision > 0.9 && recall > 1.3 * whole, "precision {precision}, recall {recall}, whole {whole}");
}

#[test]
fn frames_must_be_known() {
    let scene = visits(9, 0.0, 0.0);
    let request = Request { per_frame: true, ..paper(Scale::Metric) };
    let error = match_clouds(&scene.query, &scene.map, &request, &Config::default()).unwrap_err();
    assert_eq!(error.to_string(), "per_frame: the query does not know which frame saw which fruit");
}

#[test]
fn too_few_is_a_result() {
    let scene = visits(11, 0.0, 0.0);
    let few = scene.query.select(&[0, 1, 2, 3]);
    assert_eq!(solve(&few, &scene.map).verdict, Verdict::TooFew);
    assert_eq!(solve(&scene.query, &few).verdict, Verdict::TooFew);
    assert_eq!(solve(&FruitCloud::default(), &FruitCloud::default()).verdict, Verdict::TooFew);
}

#[test]
fn fruits_in_a_line_are_no_match_and_in_one_place_too_few() {
    let line: Vec<_> = (0..30).map(|i| Point3::new(0.1 * f64::from(i), 0.0, 0.0)).collect();
    let place = vec![Point3::new(1.0, 2.0, 3.0); 30];
    for (positions, verdict) in [(line, Verdict::NoMatch), (place, Verdict::TooFew)] {
        let cloud = FruitCloud::from_positions(positions);
        assert_eq!(solve(&cloud, &cloud).verdict, verdict);
    }
}

#[test]
fn a_lattice_whose_constellations_look_alike_is_searched_in_the_time_of_others() {
    let place = |i: u32| Point3::new(f64::from(i % 60), f64::from(i / 60), 0.0) * 0.2;
    let lattice = FruitCloud::from_positions((0..3600).map(place).collect());
    let index = MapIndex::new(&lattice, Method::Paper, Scale::Metric, Config::default()).expect("valid input");
    let found = index.search(&lattice, None, None).expect("valid input");
    let stages: std::collections::BTreeMap<_, _> = found.stages.iter().copied().collect();
    // Half a million sets, of a few hundred shapes.
    assert!(stages["query constellations"] > 400_000.0);
    assert!(stages["map constellations"] < 20_000.0, "{}", stages["map constellations"]);
}

#[test]
fn every_size_of_constellation_works() {
    let scene = visits(12, 0.1, 0.002);
    for (k, n) in [(4, 8), (5, 10), (6, 8), (7, 8)] {
        let mut config = Config::default();
        (config.constellation.k, config.constellation.n) = (k, n);
        let index = MapIndex::new(&scene.map, Method::Paper, Scale::Metric, config).expect("valid input");
        let found = index.search(&scene.query, None, None).expect("valid input");
        let (precision, recall) = precision_recall(&found, &scene);
        assert!(precision > 0.95 && recall > 0.95, "k {k}: precision {precision}, recall {recall}");
    }
}

#[test]
fn more_constellations_than_memory_are_refused() {
    let many = FruitCloud::from_positions(
        (0..2_000_000).map(|i| Point3::new(f64::from(i % 1000), f64::from(i / 1000), 0.0)).collect(),
    );
    let error = MapIndex::new(&many, Method::Paper, Scale::Metric, Config::default()).unwrap_err().to_string();
    assert!(error.contains("2000000 fruits of the map give up to 420000000 constellations"), "{error}");
}
