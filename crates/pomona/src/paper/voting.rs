//! Votes: every matched constellation speaks once for each of its fruit pairs (the paper, section III-C).

/// Votes for one pair of fruits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Vote {
    /// Row in the query.
    pub query: u32,
    /// Row in the map.
    pub map: u32,
    /// Constellations that speak for the pair.
    pub count: u32,
}

/// The sparse count matrix, ordered by query row, then map row; pairs without votes are not stored.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Votes(Vec<Vote>);

impl Votes {
    /// Counts the fruit pairs of all matched constellations.
    pub fn count(pairs: impl IntoIterator<Item = (u32, u32)>) -> Self {
        let mut keys: Vec<u64> =
            pairs.into_iter().map(|(query, map)| u64::from(query) << 32 | u64::from(map)).collect();
        keys.sort_unstable();
        let vote = |run: &[u64]| Vote { query: (run[0] >> 32) as u32, map: run[0] as u32, count: run.len() as u32 };
        Self(keys.chunk_by(|a, b| a == b).map(vote).collect())
    }

    /// All pairs with votes.
    pub fn iter(&self) -> impl Iterator<Item = &Vote> {
        self.0.iter()
    }

    /// Number of pairs with votes.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether no pair has a vote.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Votes for a pair; 0 where none was cast.
    pub fn of(&self, query: usize, map: usize) -> u32 {
        let key = (query, map);
        self.0.binary_search_by_key(&key, |v| (v.query as usize, v.map as usize)).map_or(0, |i| self.0[i].count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_each_pair() {
        let votes = Votes::count([(3, 1), (0, 7), (3, 1), (3, 0)]);
        let counts: Vec<_> = votes.iter().map(|v| (v.query, v.map, v.count)).collect();
        assert_eq!(counts, [(0, 7, 1), (3, 0, 1), (3, 1, 2)]);
        assert_eq!((votes.of(3, 1), votes.of(1, 3)), (2, 0));
    }
}
