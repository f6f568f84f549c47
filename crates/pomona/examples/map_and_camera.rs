//! One map, many questions: `cargo run --release --example map_and_camera`.
//!
//! An index that is made once and kept as a file, visits that are looked for in it, one whose place is known to some decimetres,
//! and a camera that drives along the row: found from nothing, then followed.

use pomona::nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use pomona::verified::compact::Bytes;
use pomona::{
    Config, FruitCloud, Localizer, MapIndex, Match, Method, Pose, ReadyCloud, Scale, Similarity, ToldMotion,
    match_expected,
};
use std::error::Error;
use std::sync::Arc;

/// Standard deviation of a fruit's place in a visit, per axis, metres.
const NOISE_M: f64 = 0.007;

/// The vertical in every cloud here.
const UP: Vector3<f64> = Vector3::new(0.0, 0.0, 1.0);

fn main() -> Result<(), Box<dyn Error>> {
    let mut random = Random(2026);
    let fruits: Vec<_> =
        (0..400).map(|_| Point3::new(8.0 * random.uniform(), random.uniform(), 2.0 * random.uniform())).collect();
    let (map, visit) = (cloud(random.visit(&fruits)), random.visit(&fruits));
    queries(&map, &visit)?;
    expected(&map, &visit)?;
    camera(&map, &fruits, &mut random)
}

/// Many queries of one map, prepared once: in memory, and as it opens from a file.
fn queries(map: &FruitCloud, visit: &[Point3<f64>]) -> Result<(), Box<dyn Error>> {
    let config = Config::default();
    let elsewhere =
        Similarity::rigid(Rotation3::from_axis_angle(&Vector3::z_axis(), 2.0), Vector3::new(3.0, -7.0, 0.2));
    let moved = |some: &[Point3<f64>], by: &Similarity| cloud(some.iter().map(|fruit| by.apply(fruit)).collect());

    let index = MapIndex::new(map, Method::Verified, Scale::Metric, config)?;
    tell("a visit", &index.search(&moved(visit, &elsewhere), None, None)?);
    tell("40 fruits, upright", &index.search(&moved(&visit[..40], &elsewhere), None, Some([UP, UP]))?);

    let free = MapIndex::new(map, Method::Verified, Scale::Free, config)?;
    tell("in other units", &free.search(&moved(visit, &Similarity { scale: 0.37, ..elsewhere }), None, None)?);

    let path = std::env::temp_dir().join(format!("pomona-{}.index", std::process::id()));
    std::fs::write(&path, MapIndex::compact(map, config)?.pieces()?.collect::<Vec<_>>().concat())?;
    let bytes: Bytes = Arc::new(std::fs::read(&path)?);
    std::fs::remove_file(&path)?;
    tell("an index of a file", &MapIndex::opened(&bytes, map, config)?.search(&moved(visit, &elsewhere), None, None)?);
    Ok(())
}

/// A visit of which odometry says where it lies, give or take 20 cm: at half the cost, where that leaves no doubt.
fn expected(map: &FruitCloud, visit: &[Point3<f64>]) -> Result<(), Box<dyn Error>> {
    let (query, map) = (ReadyCloud::new(&cloud(visit.to_vec()))?, ReadyCloud::new(map)?);
    let nearly = Similarity::rigid(Rotation3::identity(), Vector3::new(0.15, -0.1, 0.05));
    tell("where it is expected", &match_expected(&query, &map, &nearly, None, &Config::default())?);
    Ok(())
}

/// Frames of a camera that moves on by 20 cm; its odometry says 22.
fn camera(map: &FruitCloud, fruits: &[Point3<f64>], random: &mut Random) -> Result<(), Box<dyn Error>> {
    let mut localizer = Localizer::new(map, Config::default())?;
    let told = ToldMotion::from(Pose { translation: Vector3::new(0.22, 0.0, 0.0), ..Pose::IDENTITY });
    for frame in 0..5 {
        // The row lies along x: the camera, x right, y down, z forward, looks along y.
        let rotation = Rotation3::from_axis_angle(&Vector3::x_axis(), -std::f64::consts::FRAC_PI_2);
        let truth = Pose { rotation, translation: Vector3::new(3.0 + 0.2 * f64::from(frame), -2.0, 1.0) };
        let near: Vec<_> = fruits.iter().filter(|fruit| (fruit.x - truth.translation.x).abs() < 0.8).copied().collect();
        let seen = random.visit(&near).iter().map(|fruit| Point3::from(truth.to_camera(&fruit.coords))).collect();
        let found = localizer.update(&cloud(seen), (frame > 0).then_some(&told), None)?;
        let Some(pose) = found.pose else {
            println!("frame {frame}: {:?}", found.verdict);
            continue;
        };
        let (off_mm, sigma_mm) = (
            1000.0 * (pose.translation - truth.translation).norm(),
            1000.0 * found.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt(),
        );
        let how = if found.tracked { "followed" } else { "found from nothing" };
        println!("frame {frame}: {how} by {} fruits, {off_mm:.1} mm off, +- {sigma_mm:.1} mm", found.pairs.len());
    }
    Ok(())
}

fn tell(what: &str, found: &Match) {
    let scale = found.registration.map_or(f64::NAN, |registration| registration.map_from_query.scale);
    println!("{what}: {:?}, {} pairs, scale {scale:.3}", found.verdict, found.pairs.len());
}

/// Fruits with what is known of their places.
fn cloud(places: Vec<Point3<f64>>) -> FruitCloud {
    let covariances = vec![Matrix3::identity() * (NOISE_M * NOISE_M); places.len()];
    FruitCloud { covariances: Some(covariances), ..FruitCloud::from_positions(places) }
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

    /// Four fruits in five, with noise.
    fn visit(&mut self, fruits: &[Point3<f64>]) -> Vec<Point3<f64>> {
        let mut seen = Vec::new();
        for fruit in fruits {
            if self.uniform() < 0.8 {
                let noise = Vector3::from_fn(|_, _| (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0);
                seen.push(fruit + noise * NOISE_M);
            }
        }
        seen
    }
}
