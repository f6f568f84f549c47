//! The map as codes: which constellation of the map looks most like one of the query, and what it votes for.

use crate::neighbours::index::Index;
use crate::paper::constellation::constellations;
use crate::paper::descriptor::{Described, describe_all};
use crate::paper::voting::Votes;
use nalgebra::Point3;
use rayon::prelude::*;
use std::collections::HashSet;
use std::fmt::Debug;

/// What one view of the query casts.
#[derive(Debug, Clone, Default)]
pub struct Ballot {
    /// Votes for pairs of fruits, as rows of the whole query and of the map.
    pub votes: Votes,
    /// Constellations of the view that are not degenerate.
    pub constellations: usize,
}

/// Constellations of a map behind their codes, whatever their size.
pub trait Codebook: Debug + Send + Sync {
    /// Constellations of the map that are not degenerate, one of each code.
    fn len(&self) -> usize;

    /// Whether the map has no constellation.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Matches the constellations of each view with the nearest code of the map and counts their votes.
    ///
    /// `views` are ascending rows of `positions`: the whole cloud, or the fruits that each frame saw. A code farther than
    /// `max_code_distance` from all of the map's casts no vote.
    fn vote(&self, positions: &[Point3<f64>], views: &[Vec<usize>], max_code_distance: Option<f64>) -> Vec<Ballot>;
}

/// The codebook of `k` fruits out of `n` neighbours.
///
/// # Panics
/// If `k` is not 4, 5, 6 or 7.
pub fn codebook(positions: &[Point3<f64>], k: usize, n: usize) -> Box<dyn Codebook> {
    match k {
        4 => Box::new(CodebookOf::<4, 5>::new(positions, n)),
        5 => Box::new(CodebookOf::<5, 8>::new(positions, n)),
        6 => Box::new(CodebookOf::<6, 11>::new(positions, n)),
        7 => Box::new(CodebookOf::<7, 14>::new(positions, n)),
        _ => panic!("constellations have 4 to 7 fruits, found {k}"),
    }
}

#[derive(Debug)]
struct CodebookOf<const K: usize, const D: usize> {
    n: usize,
    members: Vec<[u32; K]>,
    codes: Index<D>,
}

impl<const K: usize, const D: usize> CodebookOf<K, D> {
    fn new(positions: &[Point3<f64>], n: usize) -> Self {
        let Described { mut members, mut codes } = describe_all::<K, D>(positions, &constellations::<K>(positions, n));
        let first = first_of_each_code(&codes);
        retain(&mut members, &first);
        retain(&mut codes, &first);
        Self { n, members, codes: Index::new(codes) }
    }

    /// The constellations of a view as ascending rows of the whole query.
    fn sets_of(&self, positions: &[Point3<f64>], view: &[usize]) -> Vec<[u32; K]> {
        let seen: Vec<_> = view.iter().map(|&row| positions[row]).collect();
        constellations::<K>(&seen, self.n).into_iter().map(|set| set.map(|place| view[place as usize] as u32)).collect()
    }
}

impl<const K: usize, const D: usize> Codebook for CodebookOf<K, D> {
    fn len(&self) -> usize {
        self.members.len()
    }

    fn vote(&self, positions: &[Point3<f64>], views: &[Vec<usize>], max_code_distance: Option<f64>) -> Vec<Ballot> {
        let sets: Vec<_> = views.par_iter().map(|view| self.sets_of(positions, view)).collect();
        // Neighbouring frames see the same constellations: each is described and searched once.
        let mut unique = sets.concat();
        if views.len() > 1 {
            unique.par_sort_unstable();
            unique.dedup();
        }
        let described = describe_all::<K, D>(positions, &unique);
        let nearest = self.codes.nearest_all(&described.codes);
        let limit = max_code_distance.unwrap_or(f64::INFINITY);
        let partner = |i: usize| nearest[i].filter(|n| n.distance <= limit).map(|n| self.members[n.row]);
        let ballot = |chosen: &mut dyn Iterator<Item = usize>| {
            let (mut pairs, mut count) = (Vec::new(), 0);
            for i in chosen {
                count += 1;
                if let Some(partner) = partner(i) {
                    pairs.extend(described.members[i].into_iter().zip(partner));
                }
            }
            Ballot { votes: Votes::count(pairs), constellations: count }
        };
        if views.len() == 1 {
            return vec![ballot(&mut (0..nearest.len()))];
        }
        let mut row_of_set: Vec<_> = described.members.iter().enumerate().map(|(i, m)| (sorted(*m), i)).collect();
        row_of_set.par_sort_unstable();
        let find =
            |set: &[u32; K]| row_of_set.binary_search_by_key(set, |entry| entry.0).ok().map(|at| row_of_set[at].1);
        sets.par_iter().map(|sets| ballot(&mut sets.iter().filter_map(find))).collect()
    }
}

/// Codes that differ by less are one: rounding makes such differences, noise makes far larger ones.
const SAME_CODE: f64 = 1e-7;

/// For every code, whether it is the first of its kind.
///
/// Of equally near codes the first is the answer. A lattice has as many equal codes as cells, and a search would have to
/// look at all of them, time and again.
fn first_of_each_code<const D: usize>(codes: &[[f64; D]]) -> Vec<bool> {
    let mut known = HashSet::with_capacity(codes.len());
    codes.iter().map(|code| known.insert(code.map(|x| (x / SAME_CODE).round() as i64))).collect()
}

fn retain<T>(rows: &mut Vec<T>, kept: &[bool]) {
    let mut kept = kept.iter();
    rows.retain(|_| kept.next().is_some_and(|&is_kept| is_kept));
}

fn sorted<const K: usize>(mut set: [u32; K]) -> [u32; K] {
    set.sort_unstable();
    set
}
