//! The index of a large map as a whole: what it finds, and what it makes of bytes that are not its own.

use super::*;
use crate::answer::{Match, Verdict};
use crate::cloud::FruitCloud;
use crate::config::Config;
use crate::error::Result;
use crate::geometry::Scale;
use crate::matching::{MapIndex, Method};
use crate::verified::fixture::visits;
use nalgebra::{Point3, Vector3};
use std::sync::Arc;

fn compact(map: &FruitCloud) -> MapIndex {
    MapIndex::compact(map, Config::default()).expect("a sound map")
}

fn kept(map: &FruitCloud) -> Vec<u8> {
    compact(map).pieces().expect("it is compact").flatten().collect()
}

/// Bytes at an address that is no multiple of anything, as those in a message are.
struct Somewhere(Vec<u8>);

impl AsRef<[u8]> for Somewhere {
    fn as_ref(&self) -> &[u8] {
        &self.0[1..]
    }
}

fn opened(content: &[u8], map: &FruitCloud) -> Result<MapIndex> {
    let bytes: Bytes = Arc::new(Somewhere([&[0], content].concat()));
    MapIndex::opened(&bytes, map, Config::default())
}

/// Where a visit was found, and its pairs.
fn told(found: &Match) -> (Verdict, Option<nalgebra::Matrix4<f64>>, Vec<(usize, usize)>) {
    let pose = found.registration.map(|one| one.map_from_query.to_matrix());
    (found.verdict, pose, found.pairs.iter().map(|pair| (pair.query, pair.map)).collect())
}

#[test]
fn a_compact_index_finds_what_the_other_does() {
    let (query, map) = visits(0.02);
    let whole = MapIndex::new(&map, Method::Verified, Scale::Metric, Config::default()).expect("a sound map");
    let [here, there] = [whole, compact(&map)].map(|index| index.search(&query, None, None).expect("a sound query"));
    assert_eq!(there.verdict, Verdict::Found);
    let [here, there] = [here, there].map(|found| found.registration.expect("found").map_from_query.to_matrix());
    assert!((here - there).norm() < 0.02, "{here} {there}");
}

#[test]
fn an_index_that_was_kept_answers_as_the_one_that_was_made() {
    let (query, map) = visits(0.02);
    let again = opened(&kept(&map), &map).expect("as it was written");
    let [made, again] = [compact(&map), again].map(|index| told(&index.search(&query, None, None).expect("sound")));
    assert_eq!(made, again);
}

#[test]
fn the_same_map_gives_the_same_bytes() {
    let (_, map) = visits(0.02);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    assert!(kept(&map) == one.install(|| kept(&map)));
}

#[test]
fn answers_do_not_depend_on_the_number_of_threads() {
    let (query, map) = visits(0.02);
    let index = compact(&map);
    let frame = query.select(&(0..40).collect::<Vec<_>>());
    for seen in [&query, &frame] {
        let asked = || told(&index.search(seen, None, None).expect("sound"));
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
        let many = rayon::ThreadPoolBuilder::new().num_threads(5).build().expect("threads");
        assert_eq!(one.install(asked), many.install(asked));
    }
}

#[test]
fn a_byte_that_changed_and_a_file_cut_short_are_refused() {
    let (_, map) = visits(0.02);
    let content = kept(&map);
    for at in (0..content.len()).step_by(content.len() / 97).chain([0, 8, 16, 511, 512, content.len() - 1]) {
        let mut changed = content.clone();
        changed[at] ^= 1 << (at % 8);
        assert!(opened(&changed, &map).is_err(), "byte {at}");
    }
    for length in [0, 7, 511, 512, content.len() / 2, content.len() - 1] {
        assert!(opened(&content[..length], &map).is_err(), "{length} bytes");
    }
}

#[test]
fn a_byte_between_the_columns_is_refused() {
    let (_, map) = visits(0.02);
    let content = kept(&map);
    // The lengths of the columns are the words of the header from this one on.
    let word = |at: usize| u64::from_le_bytes(content[8 * at..8 * at + 8].try_into().expect("eight bytes")) as usize;
    let (mut end, mut tried) = (512, 0);
    for length in (31..39).map(word) {
        for at in [end + length, (end + length).next_multiple_of(64) - 1] {
            if at >= end + length && at < content.len() && !(end + length).is_multiple_of(64) {
                let mut changed = content.clone();
                changed[at] = 1;
                assert!(opened(&changed, &map).is_err(), "byte {at}");
                tried += 1;
            }
        }
        end = (end + length).next_multiple_of(64);
    }
    assert!(end == content.len() && tried > 3, "{end} of {}, {tried} tried", content.len());
}

#[test]
fn an_index_of_another_map_is_refused() {
    let (_, map) = visits(0.02);
    let mut moved = map.clone();
    moved.positions[7].x += 1e-9;
    let refused = opened(&kept(&map), &moved).expect_err("the map has changed");
    assert!(refused.to_string().contains("another map"), "{refused}");
}

#[test]
fn an_index_whose_sums_are_right_and_whose_numbers_are_not_breaks_nothing() {
    let (query, map) = visits(0.02);
    let content = kept(&map);
    let whole = opened(&content, &map).expect("as it was written");
    drop(whole);
    for seed in 0..24u64 {
        let (mut index, conditioned) =
            CompactMap::new(&map, crate::conditioning::Conditioned::new(&map, Scale::Metric));
        spoil(&mut index, seed);
        let bytes: Vec<u8> = index.pieces().flatten().collect();
        if let Ok(index) = opened(&bytes, &map) {
            let found = index.search(&query, None, Some([Vector3::z(); 2])).expect("sound clouds");
            assert!(found.pairs.iter().all(|pair| pair.map < conditioned.cloud.len()));
        }
    }
}

/// Puts numbers that cannot be into one of the columns.
fn spoil(index: &mut CompactMap, seed: u64) {
    let wild = crate::random::shuffled(seed) as u32;
    let every = |numbers: &[u32]| {
        let mut numbers = numbers.to_vec();
        numbers.iter_mut().step_by(3).for_each(|number| *number = number.wrapping_add(wild));
        Column::Own(numbers)
    };
    match seed % 6 {
        0 => index.buckets = every(index.buckets.get()),
        1 => index.companions = every(index.companions.get()),
        2 => {
            index.seeds = Column::Own(
                index.seeds.get().iter().map(|block| block.map(|plane| plane.map(|byte| byte ^ wild as u8))).collect(),
            );
        }
        3 => index.starts = every(index.starts.get()),
        4 => {
            let spoiled = |around: &Surroundings| around.map(|byte| byte ^ wild as u8);
            index.surroundings = Column::Own(index.surroundings.get().iter().map(spoiled).collect());
        }
        _ => index.points = Column::Own(index.points.get().iter().map(|p| p.map(|x| f32::NAN * x)).collect()),
    }
}

#[test]
fn rows_are_the_callers_whatever_is_left_out() {
    let (query, map) = visits(0.02);
    let mut with_copies = FruitCloud::from_positions(vec![map.positions[3], Point3::new(9e5, 0.0, 0.0)]);
    with_copies.positions.extend(&map.positions);
    let plain = compact(&map).search(&query, None, None).expect("sound");
    let found = compact(&with_copies).search(&query, None, None).expect("sound");
    assert_eq!(found.verdict, Verdict::Found);
    let places = |found: &Match, map: &FruitCloud| {
        found.pairs.iter().map(|pair| (pair.query, map.positions[pair.map])).collect::<Vec<_>>()
    };
    let (here, there) = (places(&plain, &map), places(&found, &with_copies));
    let same = here.iter().filter(|pair| there.contains(pair)).count();
    assert!(10 * same >= 9 * here.len(), "{same} of {}", here.len());
}
