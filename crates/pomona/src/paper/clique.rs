//! The largest set of pairs whose distances agree in both clouds: an exact maximum clique (Borges et al. 2020).
//!
//! Most pairs agree with most others, so the search works on the few disagreements: pairs that disagree with none belong
//! to a largest set, and groups of pairs that disagree only among themselves are searched one by one. Each group is
//! searched by branch and bound with greedy colouring on bit sets (San Segundo et al. 2011).
//!
//! The search stops after a set amount of work, counted in 64-bit words touched and not in time, so that the answer is
//! the same on every machine; it then returns the largest set found and says that it may not be the largest.

use nalgebra::Point3;
use rayon::prelude::*;

/// A set of pairs that all agree with one another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Clique {
    /// Members, ascending.
    pub members: Vec<usize>,
    /// Whether no larger set exists; false where the work ran out.
    pub is_maximum: bool,
    /// Words touched.
    pub work: u64,
}

/// How far the distance between two fruits may differ between the visits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// Constant part, metres.
    pub base_m: f64,
    /// Part that grows with the distance: drift and sag.
    pub per_metre: f64,
}

/// The largest set of pairs `(source[i], target[i])` with `|source distance - target distance| <= tolerance`.
///
/// Both clouds in the same unit. `max_work` bounds the words touched by the search.
pub fn largest_consistent(
    source: &[Point3<f64>],
    target: &[Point3<f64>],
    tolerance: Tolerance,
    max_work: u64,
) -> Clique {
    let n = source.len();
    let agree = |i: usize, j: usize| {
        let (a, b) = ((source[i] - source[j]).norm(), (target[i] - target[j]).norm());
        (a - b).abs() <= tolerance.base_m + tolerance.per_metre * a.min(b)
    };
    let rows: Vec<Bits> =
        (0..n).into_par_iter().map(|i| Bits::of(n, (0..n).filter(|&j| j != i && agree(i, j)))).collect();
    maximum_clique(&rows, max_work)
}

/// The maximum clique of the graph whose vertex `i` is joined to the members of `rows[i]`.
fn maximum_clique(rows: &[Bits], max_work: u64) -> Clique {
    let mut clique = Clique { members: Vec::new(), is_maximum: true, work: 0 };
    for group in disagreeing_groups(rows) {
        if let [alone] = group[..] {
            clique.members.push(alone);
            continue;
        }
        let mut search = CliqueSearch::new(rows, &group, max_work.saturating_sub(clique.work));
        search.run();
        clique.is_maximum &= search.work <= search.max_work;
        clique.work += search.work;
        clique.members.extend(search.best.iter().map(|&v| search.vertices[v]));
    }
    clique.members.sort_unstable();
    clique
}

/// Connected components of the graph of disagreements, each ascending, by first member.
fn disagreeing_groups(rows: &[Bits]) -> Vec<Vec<usize>> {
    let n = rows.len();
    let mut unseen = Bits::of(n, 0..n);
    let mut groups = Vec::new();
    while let Some(first) = unseen.first() {
        unseen.remove(first);
        let mut group = vec![first];
        let mut next = 0;
        while next < group.len() {
            let reached = unseen.without(&rows[group[next]]);
            for vertex in reached.iter() {
                unseen.remove(vertex);
                group.push(vertex);
            }
            next += 1;
        }
        group.sort_unstable();
        groups.push(group);
    }
    groups
}

/// Branch and bound in one group; vertices are numbered by falling degree.
struct CliqueSearch {
    /// Vertex of the whole graph of each number.
    vertices: Vec<usize>,
    rows: Vec<Bits>,
    current: Vec<usize>,
    best: Vec<usize>,
    work: u64,
    max_work: u64,
}

impl CliqueSearch {
    fn new(all: &[Bits], group: &[usize], max_work: u64) -> Self {
        let mut vertices = group.to_vec();
        let members = Bits::of(all.len(), group.iter().copied());
        vertices.sort_by_key(|&v| (std::cmp::Reverse(all[v].count_common(&members)), v));
        let n = vertices.len();
        let rows = vertices.iter().map(|&v| Bits::of(n, (0..n).filter(|&j| all[v].holds(vertices[j])))).collect();
        Self { vertices, rows, current: Vec::new(), best: Vec::new(), work: 0, max_work }
    }

    fn run(&mut self) {
        let n = self.vertices.len();
        // What the search falls back to: each vertex in turn, where it agrees with all before.
        for vertex in 0..n {
            if self.best.iter().all(|&chosen| self.rows[vertex].holds(chosen)) {
                self.best.push(vertex);
            }
        }
        self.expand(&Bits::of(n, 0..n));
    }

    /// Grows `current` by `candidates`, which all agree with it.
    fn expand(&mut self, candidates: &Bits) {
        let coloured = self.colour(candidates);
        let mut left = candidates.clone();
        for &(vertex, colours) in coloured.iter().rev() {
            // Vertices up to this one need `colours` colours: no clique among them is larger.
            if self.current.len() + colours <= self.best.len() || self.work > self.max_work {
                return;
            }
            self.current.push(vertex);
            let next = left.and(&self.rows[vertex]);
            if !next.is_empty() {
                self.expand(&next);
            } else if self.current.len() > self.best.len() {
                self.best.clone_from(&self.current);
            }
            self.current.pop();
            left.remove(vertex);
        }
    }

    /// Greedy colouring; vertices by rising colour.
    fn colour(&mut self, candidates: &Bits) -> Vec<(usize, usize)> {
        let mut coloured = Vec::new();
        let mut uncoloured = candidates.clone();
        let mut colour = 0;
        while !uncoloured.is_empty() {
            colour += 1;
            let mut class = uncoloured.clone();
            while let Some(vertex) = class.first() {
                uncoloured.remove(vertex);
                class.remove(vertex);
                class.retain_outside(&self.rows[vertex]);
                coloured.push((vertex, colour));
                self.work += candidates.0.len() as u64;
            }
        }
        coloured
    }
}

/// A set of small numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Bits(Vec<u64>);

impl Bits {
    fn of(size: usize, members: impl IntoIterator<Item = usize>) -> Self {
        let mut words = vec![0; size.div_ceil(64)];
        for member in members {
            words[member / 64] |= 1 << (member % 64);
        }
        Self(words)
    }

    fn holds(&self, member: usize) -> bool {
        self.0[member / 64] >> (member % 64) & 1 == 1
    }

    fn remove(&mut self, member: usize) {
        self.0[member / 64] &= !(1 << (member % 64));
    }

    fn first(&self) -> Option<usize> {
        let word = self.0.iter().position(|&word| word != 0)?;
        Some(64 * word + self.0[word].trailing_zeros() as usize)
    }

    fn is_empty(&self) -> bool {
        self.0.iter().all(|&word| word == 0)
    }

    fn iter(&self) -> impl Iterator<Item = usize> {
        (0..64 * self.0.len()).filter(|&member| self.holds(member))
    }

    fn and(&self, other: &Self) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(a, b)| a & b).collect())
    }

    fn without(&self, other: &Self) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(a, b)| a & !b).collect())
    }

    fn retain_outside(&mut self, other: &Self) {
        for (word, out) in self.0.iter_mut().zip(&other.0) {
            *word &= !out;
        }
    }

    fn count_common(&self, other: &Self) -> u32 {
        self.0.iter().zip(&other.0).map(|(a, b)| (a & b).count_ones()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn graph(n: usize, edges: &[bool]) -> Vec<Bits> {
        let joined = |i: usize, j: usize| i != j && edges[i.min(j) * n + i.max(j)];
        (0..n).map(|i| Bits::of(n, (0..n).filter(|&j| joined(i, j)))).collect()
    }

    fn is_clique(rows: &[Bits], members: &[usize]) -> bool {
        members.iter().all(|&i| members.iter().all(|&j| i == j || rows[i].holds(j)))
    }

    proptest! {
        #[test]
        fn as_large_as_trying_everything(
            edges in (0.2..0.95f64).prop_flat_map(|share| prop::collection::vec(prop::bool::weighted(share), 144))
        ) {
            let rows = graph(12, &edges);
            let found = maximum_clique(&rows, u64::MAX);
            let sets = (0u32..1 << 12).map(|set| (0..12).filter(|i| set >> i & 1 == 1).collect::<Vec<_>>());
            let largest = sets.filter(|set| is_clique(&rows, set)).map(|set| set.len()).max();
            prop_assert!(found.is_maximum && is_clique(&rows, &found.members));
            prop_assert_eq!(Some(found.members.len()), largest);
        }

        #[test]
        fn without_work_a_smaller_set_is_called_so(
            edges in prop::collection::vec(prop::bool::weighted(0.5), 3600)
        ) {
            let rows = graph(60, &edges);
            let hasty = maximum_clique(&rows, 0);
            let found = maximum_clique(&rows, u64::MAX);
            prop_assert!(is_clique(&rows, &hasty.members) && !hasty.is_maximum && !hasty.members.is_empty());
            prop_assert!(found.members.len() >= hasty.members.len());
        }
    }

    #[test]
    fn a_moved_fruit_is_left_out() {
        let source: Vec<_> = (0..6).map(|i| Point3::new(f64::from(i), f64::from(i * i % 3), 0.2)).collect();
        let mut target = source.clone();
        target[4].x += 0.5;
        let found = largest_consistent(&source, &target, Tolerance { base_m: 0.05, per_metre: 0.0 }, 1000);
        assert_eq!(found.members, [0, 1, 2, 3, 5]);
        assert!(found.is_maximum);
    }
}
