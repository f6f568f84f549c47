//! Who belongs to whom where several claim one: all one-to-one sets of pairs at once, by belief propagation (Williams and
//! Lau 2014).

use crate::assignment::assign;
use std::ops::Range;

/// A fruit of the query and one of the map that may be the same.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Edge {
    pub(crate) query: u32,
    pub(crate) map: u32,
    /// Likelihood ratio of "the same fruit" against both being alone.
    pub(crate) ratio: f64,
}

/// What all one-to-one sets of pairs say, each weighing the product of its edges' ratios.
#[derive(Debug, Clone)]
pub(crate) struct Beliefs {
    pub(crate) edges: Vec<Edge>,
    /// Of each edge: the share of the sets that hold it.
    pub(crate) probabilities: Vec<f64>,
    /// Logarithm of the sum over all sets, by Bethe's approximation (Vontobel 2013): exact where no edges form a loop.
    pub(crate) log_sum: f64,
}

/// Rounds at the most, and the change of a message below which the rounds end.
const ROUNDS: usize = 40;
const SETTLED: f64 = 1e-5;

impl Beliefs {
    pub(crate) fn new(edges: Vec<Edge>, n_query: usize, n_map: usize) -> Self {
        let (map_of, met) = numbered(edges.iter().map(|edge| edge.map), n_map);
        let (order, ends) = by_groups(&edges, &map_of, n_query, met);
        let linked = |&at: &u32| Edge { map: map_of[at as usize], ..edges[at as usize] };
        let linked: Vec<Edge> = order.iter().map(linked).collect();
        let mut all = Messages {
            of_query: vec![1.0; n_query],
            of_map: vec![1.0; met],
            to_query: vec![1.0; edges.len()],
            to_map: vec![0.0; edges.len()],
        };
        // Those that no edge links to others settle by themselves, most of them at once.
        let mut first = 0;
        for end in ends {
            all.settle(&linked, first..end);
            first = end;
        }
        let Messages { of_query, of_map, to_query, to_map } = all;
        let mut probabilities = vec![0.0; edges.len()];
        for ((edge, back), &at) in linked.iter().zip(&to_query).zip(&order) {
            probabilities[at as usize] = edge.ratio * back / of_query[edge.query as usize];
        }
        let logarithms = |sums: &[f64]| sums.iter().map(|sum| sum.ln()).sum::<f64>();
        let shared: f64 = to_map.iter().zip(&to_query).map(|(there, back)| (there * back).ln_1p()).sum();
        Self { edges, probabilities, log_sum: logarithms(&of_query) + logarithms(&of_map) - shared }
    }

    /// The same of several lists of edges: of all one-to-one sets of all of them, by lists.
    pub(crate) fn together(lists: &[Vec<Edge>], n_query: usize, n_map: usize) -> Vec<Self> {
        let counts: Vec<usize> = lists.iter().map(Vec::len).collect();
        let Self { mut edges, mut probabilities, log_sum } = Self::new(lists.concat(), n_query, n_map);
        let of_list = |count: &usize| {
            let rest = (edges.split_off(*count), probabilities.split_off(*count));
            let (edges, probabilities) =
                (std::mem::replace(&mut edges, rest.0), std::mem::replace(&mut probabilities, rest.1));
            Self { edges, probabilities, log_sum }
        };
        counts.iter().map(of_list).collect()
    }

    /// Lists that belong together in one: an edge that several have is as probable as all of them say.
    pub(crate) fn of_lists<'a>(lists: impl Iterator<Item = &'a Self>) -> Self {
        let mut links: Vec<(Edge, f64)> = Vec::new();
        let mut log_sum = 0.0;
        for list in lists {
            links.extend(list.links().map(|(edge, probability)| (*edge, probability)));
            log_sum = list.log_sum;
        }
        links.sort_by_key(|(edge, _)| (edge.query, edge.map));
        links.dedup_by(|next, first| {
            let same = (next.0.query, next.0.map) == (first.0.query, first.0.map);
            if same {
                first.1 += next.1;
            }
            same
        });
        let (edges, probabilities) = links.into_iter().unzip();
        Self { edges, probabilities, log_sum }
    }

    /// The one-to-one edges that gain most expected right answers, by rows of the query, with their probabilities: a
    /// wrong one costs as much as one of `least` is worth.
    pub(crate) fn chosen(&self, n_query: usize, n_map: usize, least: f64) -> Vec<(Edge, f64)> {
        let gain = |(edge, p): (&Edge, f64)| (edge.query as usize, edge.map as usize, p - least);
        let partners = assign(n_query, n_map, &self.links().map(gain).collect::<Vec<_>>());
        let is_chosen = |(edge, _): &(&Edge, f64)| partners[edge.query as usize] == Some(edge.map as usize);
        let mut chosen: Vec<_> = self.links().filter(is_chosen).map(|(edge, p)| (*edge, p)).collect();
        chosen.sort_unstable_by_key(|(edge, _)| (edge.query, edge.map));
        chosen.dedup_by_key(|(edge, _)| (edge.query, edge.map));
        chosen
    }

    /// The edges with their probabilities.
    pub(crate) fn links(&self) -> impl Iterator<Item = (&Edge, f64)> {
        self.edges.iter().zip(self.probabilities.iter().copied())
    }
}

/// Messages along edges, and what fruits sum up to: each alone, and with each of its partners as far as they are free.
struct Messages {
    of_query: Vec<f64>,
    of_map: Vec<f64>,
    to_query: Vec<f64>,
    to_map: Vec<f64>,
}

impl Messages {
    /// Sends them along some of the edges, whose fruits have no others, until they settle.
    fn settle(&mut self, edges: &[Edge], some: Range<usize>) {
        let Self { of_query, of_map, to_query, to_map } = self;
        let edges = &edges[some.clone()];
        let (to_query, to_map) = (&mut to_query[some.clone()], &mut to_map[some]);
        for _ in 0..ROUNDS {
            sum_up(edges, to_query, of_query);
            for ((edge, back), out) in edges.iter().zip(&*to_query).zip(&mut *to_map) {
                *out = edge.ratio / (of_query[edge.query as usize] - edge.ratio * back).max(1e-12);
            }
            for edge in edges {
                of_map[edge.map as usize] = 1.0;
            }
            for (edge, message) in edges.iter().zip(&*to_map) {
                of_map[edge.map as usize] += message;
            }
            let mut change = 0.0f64;
            for ((edge, message), back) in edges.iter().zip(&*to_map).zip(&mut *to_query) {
                let next = 1.0 / (of_map[edge.map as usize] - message).max(1e-12);
                change = change.max((next - *back).abs());
                *back = next;
            }
            if change < SETTLED {
                break;
            }
        }
        sum_up(edges, to_query, of_query);
    }
}

fn sum_up(edges: &[Edge], to_query: &[f64], of_query: &mut [f64]) {
    for edge in edges {
        of_query[edge.query as usize] = 1.0;
    }
    for (edge, back) in edges.iter().zip(to_query) {
        of_query[edge.query as usize] += edge.ratio * back;
    }
}

/// Numbers of the edges, those together that fruits link to each other, and where each such group ends.
fn by_groups(edges: &[Edge], map_of: &[u32], n_query: usize, met: usize) -> (Vec<u32>, Vec<usize>) {
    // Fruits of the query that an edge leads to the same fruit of the map, each knowing one of its group.
    let mut known: Vec<u32> = (0..n_query as u32).collect();
    let mut first = vec![u32::MAX; met];
    for (edge, &map) in edges.iter().zip(map_of) {
        let before = std::mem::replace(&mut first[map as usize], edge.query);
        if before != u32::MAX {
            let [one, other] = [before, edge.query].map(|row| leader(&mut known, row));
            known[one.max(other) as usize] = one.min(other);
        }
    }
    let (group_of, groups) = numbered(edges.iter().map(|edge| leader(&mut known, edge.query)), n_query);
    let mut ends = vec![0usize; groups];
    for &group in &group_of {
        ends[group as usize] += 1;
    }
    let mut end = 0;
    for count in &mut ends {
        end += *count;
        *count = end;
    }
    let mut order = vec![0; edges.len()];
    let mut next = ends.clone();
    // From the last to the first, so that a group keeps the order of its edges.
    for (at, &group) in group_of.iter().enumerate().rev() {
        next[group as usize] -= 1;
        order[next[group as usize]] = at as u32;
    }
    (order, ends)
}

/// The one of its group that knows itself.
fn leader(known: &mut [u32], row: u32) -> u32 {
    let mut row = row;
    while known[row as usize] != row {
        known[row as usize] = known[known[row as usize] as usize];
        row = known[row as usize];
    }
    row
}

/// Those of `n` rows that occur, numbered as they come, and how many they are: a map has many more rows than have edges.
fn numbered(rows: impl Iterator<Item = u32>, n: usize) -> (Vec<u32>, usize) {
    let mut number_of = vec![u32::MAX; n];
    let mut count = 0;
    let number = |row: u32| {
        let number = &mut number_of[row as usize];
        if *number == u32::MAX {
            *number = count;
            count += 1;
        }
        *number
    };
    let numbers = rows.map(number).collect();
    (numbers, count as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Marginals, and the logarithm of the sum, by going through all one-to-one sets of pairs.
    fn exact(edges: &[Edge]) -> (Vec<f64>, f64) {
        let mut sums = vec![0.0; edges.len()];
        let mut total = 0.0;
        for set in 0u32..1 << edges.len() {
            let chosen: Vec<usize> = (0..edges.len()).filter(|i| set >> i & 1 == 1).collect();
            let clash = chosen.iter().enumerate().any(|(at, &i)| {
                chosen[at + 1..].iter().any(|&j| edges[i].query == edges[j].query || edges[i].map == edges[j].map)
            });
            if clash {
                continue;
            }
            let weight: f64 = chosen.iter().map(|&i| edges[i].ratio).product();
            total += weight;
            for i in chosen {
                sums[i] += weight;
            }
        }
        (sums.iter().map(|sum| sum / total).collect(), total.ln())
    }

    fn assert_close(edges: &[Edge], within: f64) {
        let (found, (marginals, sum)) = (Beliefs::new(edges.to_vec(), 2, 2), exact(edges));
        for (found, truth) in found.probabilities.iter().zip(marginals) {
            assert!((found - truth).abs() < within, "{found} {truth}");
        }
        assert!((found.log_sum - sum).abs() < 3.0 * within, "{} {sum}", found.log_sum);
    }

    #[test]
    fn lists_share_the_fruits_and_an_edge_of_two_lists_is_as_probable_as_both_say() {
        let edge = |query, map, ratio| Edge { query, map, ratio };
        let lists = [vec![edge(0, 0, 5.0), edge(1, 1, 3.0)], vec![edge(0, 0, 2.0), edge(0, 1, 0.7)]];
        let [one, other] = Beliefs::together(&lists, 2, 2).try_into().expect("two lists");
        let all = Beliefs::new(lists.concat(), 2, 2);
        assert_eq!([one.probabilities.clone(), other.probabilities.clone()].concat(), all.probabilities);
        let merged = Beliefs::of_lists([&one, &other].into_iter());
        let pairs: Vec<(u32, u32)> = merged.edges.iter().map(|edge| (edge.query, edge.map)).collect();
        assert_eq!(pairs, [(0, 0), (0, 1), (1, 1)]);
        let said = one.probabilities[0] + other.probabilities[0];
        assert!((merged.probabilities[0] - said).abs() < 1e-12);
    }

    #[test]
    fn beliefs_are_exact_on_a_tree_and_close_on_a_loop() {
        let edge = |query, map, ratio| Edge { query, map, ratio };
        assert_close(&[edge(0, 0, 5.0), edge(0, 1, 0.7), edge(1, 1, 9.0)], 1e-5);
        assert_close(&[edge(0, 0, 5.0), edge(0, 1, 2.0), edge(1, 0, 1.0), edge(1, 1, 3.0)], 0.05);
    }

    #[test]
    fn fruits_that_nothing_links_settle_as_they_would_alone() {
        let edge = |query, map, ratio| Edge { query, map, ratio };
        // A chain, a loop whose messages settle slowly, and a pair, mixed.
        let chain = [edge(0, 0, 5.0), edge(2, 0, 0.7), edge(2, 3, 9.0)];
        let ring = [edge(1, 1, 40.0), edge(1, 2, 30.0), edge(3, 1, 35.0), edge(3, 2, 45.0)];
        let pair = [edge(4, 4, 2.0)];
        let all = [ring[0], chain[0], pair[0], ring[1], chain[1], ring[2], chain[2], ring[3]];
        let [of_chain, of_ring, of_pair, of_all] =
            [&chain[..], &ring, &pair, &all].map(|some| Beliefs::new(some.to_vec(), 5, 5));
        let probability = |of: &Beliefs, wanted: &Edge| {
            let at = of.edges.iter().position(|one| (one.query, one.map) == (wanted.query, wanted.map));
            of.probabilities[at.expect("an edge of these")]
        };
        for (of, edges) in [(&of_chain, &chain[..]), (&of_ring, &ring), (&of_pair, &pair)] {
            let off = |edge: &Edge| (probability(of, edge) - probability(&of_all, edge)).abs();
            assert!(edges.iter().all(|edge| off(edge) < 1e-15));
        }
        assert!((of_chain.log_sum + of_ring.log_sum + of_pair.log_sum - of_all.log_sum).abs() < 1e-12);
    }
}
