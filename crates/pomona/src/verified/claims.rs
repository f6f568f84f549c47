//! Fruits of the map that several of the query claim: the strongest claim counts, of equals the first.

/// Claims on the fruits of a map.
#[derive(Debug)]
pub(super) struct Claims {
    /// Of each fruit: the round in which it was claimed last, by whom, and how strongly.
    last: Vec<(u32, u32, f64)>,
    round: u32,
}

impl Claims {
    pub(super) fn on(fruits: usize) -> Self {
        Self { last: vec![(0, 0, 0.0); fruits], round: 1 }
    }

    /// Begins a new round without claims.
    pub(super) fn forget(&mut self) {
        self.round += 1;
    }

    pub(super) fn claim(&mut self, fruit: u32, by: usize, strength: f64) {
        let last = &mut self.last[fruit as usize];
        if last.0 != self.round || strength > last.2 {
            *last = (self.round, by as u32, strength);
        }
    }

    /// Whose a fruit is; nobody's where it is not claimed.
    pub(super) fn owner(&self, fruit: u32) -> Option<usize> {
        let (round, by, _) = self.last[fruit as usize];
        (round == self.round).then_some(by as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_claim_counts_and_of_equals_the_first_until_all_are_forgotten() {
        let mut claims = Claims::on(2);
        for (by, strength) in [(5, -2.0), (6, -1.0), (7, -1.0), (8, -3.0)] {
            claims.claim(1, by, strength);
        }
        assert_eq!([0, 1].map(|fruit| claims.owner(fruit)), [None, Some(6)]);
        claims.forget();
        assert_eq!(claims.owner(1), None);
        claims.claim(1, 8, -3.0);
        assert_eq!(claims.owner(1), Some(8));
    }
}
