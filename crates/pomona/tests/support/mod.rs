//! A seeded row of fruits in clusters, and two visits to it. For tests and benchmarks of speed; the accuracy benchmark has
//! the full generator.

#![allow(dead_code, reason = "each test and benchmark uses a part")]

use nalgebra::{Point3, Rotation3, Vector3};
use pomona::{FruitCloud, Similarity};

/// Two visits to one row, with what is true of them.
pub struct Scene {
    pub query: FruitCloud,
    pub map: FruitCloud,
    pub map_from_query: Similarity,
    /// Row of each query fruit in the map, where it was seen there too.
    pub partner: Vec<Option<usize>>,
}

/// xorshift64*
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    /// Uniform in 0..1.
    pub fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Standard normal, as the sum of twelve uniform numbers.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal())
    }

    pub fn similarity(&mut self) -> Similarity {
        Similarity::rigid(Rotation3::new(self.vector()), self.vector() * 5.0)
    }
}

/// Fruits of `trees` trees 1.2 m apart, about 105 each in clusters of one to four, at least 6.8 cm apart.
pub fn row(random: &mut Random, trees: usize) -> Vec<Point3<f64>> {
    let mut fruits: Vec<Point3<f64>> = Vec::new();
    let length = 1.2 * trees as f64;
    while fruits.len() < 105 * trees {
        let cluster = Vector3::new(length * random.uniform(), random.uniform() - 0.5, 0.5 + 2.5 * random.uniform());
        let members = 1 + (random.uniform() * 2.6) as usize;
        for _ in 0..members {
            let fruit = Point3::from(cluster + random.vector() * 0.05);
            if fruits.iter().all(|other| (other - fruit).norm() > 0.068) {
                fruits.push(fruit);
            }
        }
    }
    fruits
}

/// Two visits to `fruits`, each missing a share, the query moved at random, with the relative noise in metres per axis.
pub fn scene(random: &mut Random, fruits: &[Point3<f64>], missing: f64, noise_m: f64) -> Scene {
    let query_from_map = random.similarity();
    let (mut query, mut map, mut partner) = (Vec::new(), Vec::new(), Vec::new());
    for fruit in fruits {
        let mut visit = |keep: bool, cloud: &mut Vec<_>| {
            let seen = fruit + random.vector() * (noise_m / 2f64.sqrt());
            keep.then(|| cloud.push(seen));
        };
        let (in_query, in_map) = (visit_kept(fruit, missing, 1), visit_kept(fruit, missing, 2));
        visit(in_query, &mut query);
        visit(in_map, &mut map);
        if in_query {
            partner.push(in_map.then(|| map.len() - 1));
        }
    }
    let query = query.iter().map(|p| query_from_map.apply(p)).collect();
    Scene {
        query: FruitCloud::from_positions(query),
        map: FruitCloud::from_positions(map),
        map_from_query: query_from_map.inverse(),
        partner,
    }
}

/// Whether a visit sees a fruit: a number drawn from its place, so that it needs no state.
fn visit_kept(fruit: &Point3<f64>, missing: f64, visit: u64) -> bool {
    Random::new(fruit.x.to_bits() ^ fruit.z.to_bits().rotate_left(visit as u32)).uniform() >= missing
}
