//! What a match gives: a verdict, a registration, pairs.

use crate::geometry::Similarity;

/// What a match says. All four are results, none is an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// One registration stands out and its pairs are reported.
    Found,
    /// Fewer fruits than a constellation needs.
    TooFew,
    /// Several different registrations explain the clouds equally well; they are reported as alternatives.
    Ambiguous,
    /// No registration explains the clouds better than chance.
    NoMatch,
}

/// One fruit found again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Row in the query.
    pub query: usize,
    /// Row in the map.
    pub map: usize,
    /// Probability that the two are one fruit; an ambiguous answer's are shared among its poses. Paper: of the residual under
    /// the noise, against a stranger at the density of fruits about it.
    pub probability: f64,
    /// Distance after the registration that the pair belongs to, metres of the map.
    pub distance_m: f64,
    /// What speaks for the pair: votes of constellations (paper) or log-odds in nats (verified).
    pub support: f64,
    /// Registration that the pair belongs to: 0 for that of the answer, others from 1 on for `further`.
    pub part: usize,
}

/// A registration with its evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// Takes points of the query into the map.
    pub map_from_query: Similarity,
    /// Evidence against chance, nats: of this part as it grew. Paper: log-odds of the pairs' residuals, summed over pairs.
    pub log_odds: f64,
}

/// The answer to one query.
#[derive(Debug, Clone, PartialEq)]
pub struct Match {
    /// What the match says.
    pub verdict: Verdict,
    /// The registration; `None` for `TooFew` and `NoMatch`.
    pub registration: Option<Registration>,
    /// Registrations of the other parts of a row that is torn apart, which all hold.
    pub further: Vec<Registration>,
    /// Other registrations as good as the first; empty unless `Ambiguous`.
    pub alternatives: Vec<Registration>,
    /// Fruits found again, sorted by query row; one to one.
    pub pairs: Vec<Pair>,
    /// Relative noise per axis, metres, as the distances of the pairs show it, the one given beforehand with them; of the paper's method
    /// as given. NaN where nothing was found.
    pub noise_m: f64,
    /// What happened, stage by stage: name and count, for `--explain`.
    pub stages: Vec<(&'static str, f64)>,
}

impl Registration {
    fn exchanged(self) -> Self {
        Self { map_from_query: self.map_from_query.inverse(), ..self }
    }
}

impl Match {
    /// The same answer where query and map, both in metres, change places.
    pub(crate) fn exchanged(self) -> Self {
        let all = |some: Vec<Registration>| some.into_iter().map(Registration::exchanged).collect();
        let mut pairs = self.pairs;
        for pair in &mut pairs {
            std::mem::swap(&mut pair.query, &mut pair.map);
        }
        pairs.sort_unstable_by_key(|pair| pair.query);
        Self {
            registration: self.registration.map(Registration::exchanged),
            further: all(self.further),
            alternatives: all(self.alternatives),
            pairs,
            stages: [("exchanged", 1.0)].into_iter().chain(self.stages).collect(),
            ..self
        }
    }

    /// A result without a registration.
    pub(crate) fn without_answer(verdict: Verdict, stages: Vec<(&'static str, f64)>) -> Self {
        Self {
            verdict,
            registration: None,
            further: Vec::new(),
            alternatives: Vec::new(),
            pairs: Vec::new(),
            noise_m: f64::NAN,
            stages,
        }
    }
}
