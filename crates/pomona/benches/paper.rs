//! Speed of the paper's method and its parts, one thread each: `cargo bench -p pomona --bench paper`.
//!
//! The pair is two visits to five trees with 30 % of the fruits hidden in each and 2 cm of noise, as the cell `base`.

#[path = "../tests/support/mod.rs"]
mod support;

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use pomona::neighbours::index::Index;
use pomona::paper::constellation::constellations;
use pomona::paper::descriptor::{Described, describe, describe_all};
use pomona::{Config, FruitCloud, MapIndex, Method, Request, Scale, match_clouds};
use support::{Random, Scene, row, scene};

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("no pool exists yet");
    divan::main();
}

fn base() -> Scene {
    let mut random = Random::new(1);
    let fruits = row(&mut random, 5);
    scene(&mut random, &fruits, 0.3, 0.02)
}

fn described(cloud: &FruitCloud) -> Described<5, 8> {
    describe_all(&cloud.positions, &constellations::<5>(&cloud.positions, 10))
}

#[divan::bench]
fn form_constellations(bencher: Bencher) {
    let scene = base();
    let count = constellations::<5>(&scene.map.positions, 10).len();
    bencher.counter(ItemsCount::new(count)).bench_local(|| constellations::<5>(black_box(&scene.map.positions), 10));
}

/// Codes alone, from sets of points.
#[divan::bench]
fn describe_constellations(bencher: Bencher) {
    let positions = base().map.positions;
    let sets: Vec<_> =
        constellations::<5>(&positions, 10).iter().map(|set| set.map(|row| positions[row as usize])).collect();
    bencher.counter(ItemsCount::new(sets.len())).bench_local(|| {
        let sum = |sum: f64, set| describe::<5, 8>(set).map_or(sum, |(_, code)| sum + code[0]);
        black_box(&sets).iter().fold(0.0, sum)
    });
}

#[divan::bench]
fn index_codes(bencher: Bencher) {
    let map = described(&base().map);
    bencher.counter(ItemsCount::new(map.codes.len())).with_inputs(|| map.codes.clone()).bench_local_values(Index::new);
}

#[divan::bench]
fn nearest_codes(bencher: Bencher) {
    let scene = base();
    let (query, index) = (described(&scene.query), Index::new(described(&scene.map).codes));
    bencher.counter(ItemsCount::new(query.codes.len())).bench_local(|| index.nearest_all(black_box(&query.codes)));
}

/// Both clouds to pairs, nothing prepared.
#[divan::bench]
fn base_pair(bencher: Bencher) {
    let scene = base();
    let request = Request { method: Method::Paper, ..Request::default() };
    bencher.bench_local(|| match_clouds(&scene.query, &scene.map, &request, &Config::default()));
}

/// The 40 fruits nearest to one fruit, as a camera sees them, in an indexed map of five trees.
#[divan::bench]
fn frame_of_40_fruits(bencher: Bencher) {
    let scene = base();
    let index = MapIndex::new(&scene.map, Method::Paper, Scale::Metric, Config::default()).expect("valid");
    let tree = Index::new(scene.query.positions.iter().map(|p| [p.x, p.y, p.z]).collect());
    let rows: Vec<_> = tree.nearest_few(&tree.points()[100], 40).iter().map(|n| n.row).collect();
    let frame = scene.query.select(&rows);
    bencher.bench_local(|| index.search(black_box(&frame), None, None));
}
