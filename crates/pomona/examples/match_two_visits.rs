//! Which fruit of one visit is which fruit of another: `cargo run --release --example match_two_visits [QUERY.csv MAP.csv]`.
//!
//! The files have a header with `x`, `y` and `z`, metres; other columns are passed over. Without files two visits are
//! made up, so that there is something to see.

use pomona::nalgebra::{Point3, Rotation3, Vector3};
use pomona::{Config, FruitCloud, Match, Request, Similarity, match_clouds};
use std::error::Error;

/// Pairs that are printed.
const SHOWN: usize = 10;

fn main() -> Result<(), Box<dyn Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    let (query, map) = match &paths[..] {
        [query, map] => (read(query)?, read(map)?),
        [] => two_visits(),
        _ => return Err("expected two files, or none".into()),
    };
    let found = match_clouds(&query, &map, &Request::default(), &Config::default())?;
    print(&found, query.len());
    Ok(())
}

fn print(found: &Match, n_query: usize) {
    println!("verdict: {:?}", found.verdict);
    let Some(registration) = found.registration else { return };
    println!("map_from_query, {:.0} nats against chance:", registration.log_odds);
    for row in registration.map_from_query.to_matrix().row_iter() {
        println!("  {:8.4} {:8.4} {:8.4} {:8.4}", row[0], row[1], row[2], row[3]);
    }
    println!("{} of {n_query} fruits found again:", found.pairs.len());
    for pair in found.pairs.iter().take(SHOWN) {
        let (probability, distance_mm) = (pair.probability, 1000.0 * pair.distance_m);
        println!("  {:4} is {:4}, probability {probability:.3}, {distance_mm:.1} mm apart", pair.query, pair.map);
    }
    if found.pairs.len() > SHOWN {
        println!("  and {} more", found.pairs.len() - SHOWN);
    }
}

fn read(path: &str) -> Result<FruitCloud, Box<dyn Error>> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{path}: {error}"))?;
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').map(str::trim).collect();
    let column = |name| header.iter().position(|&found| found == name).ok_or(format!("{path}: found no column {name}"));
    let columns = [column("x")?, column("y")?, column("z")?];
    let point = |(number, line): (usize, &str)| {
        let fields: Vec<&str> = line.split(',').collect();
        let number_at = |column: usize| fields.get(column).and_then(|field| field.trim().parse::<f64>().ok());
        match columns.map(number_at) {
            [Some(x), Some(y), Some(z)] => Ok(Point3::new(x, y, z)),
            _ => Err(format!("{path}: line {}: found {line:?}, expected numbers in x, y, z", number + 2)),
        }
    };
    Ok(FruitCloud::from_positions(lines.enumerate().map(point).collect::<Result<_, _>>()?))
}

/// A row of 300 fruits seen twice, with a centimetre of noise; each visit misses a fifth of them.
fn two_visits() -> (FruitCloud, FruitCloud) {
    let mut random = Random(2026);
    let fruits: Vec<_> =
        (0..300).map(|_| Point3::new(4.0 * random.uniform(), 2.0 * random.uniform(), random.uniform())).collect();
    let query_from_map =
        Similarity::rigid(Rotation3::from_euler_angles(0.02, -0.01, 0.6), Vector3::new(-2.0, 5.0, 0.3));
    let query = random.visit(&fruits).iter().map(|fruit| query_from_map.apply(fruit)).collect();
    (FruitCloud::from_positions(query), FruitCloud::from_positions(random.visit(&fruits)))
}

/// xorshift64, so that the example needs nothing else.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// About 1 cm.
    fn noise(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| 0.01 * ((0..12).map(|_| self.uniform()).sum::<f64>() - 6.0))
    }

    fn visit(&mut self, fruits: &[Point3<f64>]) -> Vec<Point3<f64>> {
        let mut seen = Vec::new();
        for fruit in fruits {
            if self.uniform() < 0.8 {
                seen.push(fruit + self.noise());
            }
        }
        seen
    }
}
