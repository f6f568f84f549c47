//! Counts per second of the stages that run most: `cargo bench -p pomona --bench throughput -- QUERY MAP`, two files of
//! `x y z` lines in metres.
//!
//! Prints JSON: constellations of the map formed and described per second, nearest codes of the query found in the
//! map's index per second. One thread, the fastest of some repetitions.

use nalgebra::Point3;
use pomona::neighbours::index::Index;
use pomona::paper::constellation::constellations;
use pomona::paper::descriptor::{Described, describe_all};
use std::hint::black_box;
use std::time::Instant;

const REPETITIONS: usize = 7;
const NEIGHBOURS: usize = 10;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Cargo adds `--bench`.
    let paths: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let [query, map] = &paths[..] else { return Err("expected two files of x y z lines".into()) };
    let (query, map) = (read(query)?, read(map)?);
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;

    let sets = constellations::<5>(&map, NEIGHBOURS);
    let described: Described<5, 8> = describe_all(&map, &sets);
    let queries: Described<5, 8> = describe_all(&query, &constellations::<5>(&query, NEIGHBOURS));
    let index = Index::new(described.codes.clone());
    println!(
        r#"{{"constellations_per_s": {:.0}, "descriptors_per_s": {:.0}, "indexed_per_s": {:.0}, "nearest_per_s": {:.0}}}"#,
        per_second(sets.len(), || constellations::<5>(&map, NEIGHBOURS)),
        per_second(sets.len(), || describe_all::<5, 8>(&map, &sets)),
        per_second(described.codes.len(), || Index::new(described.codes.clone())),
        per_second(queries.codes.len(), || index.nearest_all(&queries.codes)),
    );
    Ok(())
}

fn read(path: &str) -> Result<Vec<Point3<f64>>, Box<dyn std::error::Error>> {
    let text = std::fs::read_to_string(path)?;
    let point = |line: &str| match line.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?[..] {
        [x, y, z] => Ok(Point3::new(x, y, z)),
        _ => Err(format!("{path}: found {line:?}, expected x y z").into()),
    };
    text.lines().map(point).collect()
}

fn per_second<T>(count: usize, work: impl Fn() -> T) -> f64 {
    let fastest = (0..REPETITIONS)
        .map(|_| {
            let start = Instant::now();
            black_box(work());
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min);
    count as f64 / fastest
}
