//! Which share of what a visit shows of an overlap the other shows too.

/// Shares of the fruits that any pose is taken to see again. Below, a wrong pose that meets few would lose little by what it
/// misses: of rows with 15 % in common 4 of 100 were no longer found.
const SEEN_AGAIN: (f64, f64) = (0.35, 0.9);

/// Shares of the fruits that the query and the map show in an overlap which are pairs, where they show `due` fruits there and the
/// one that shows fewer has this `share` of its own in common.
///
/// Of trees that the two see with probabilities a and b, b of what the query shows is in the map and a of what the map shows in the
/// query. A frame, or a visit after the harvest, shows far fewer fruits than the other.
pub(super) fn of_either(share: f64, due: [f64; 2]) -> [f64; 2] {
    due.map(|own| share * fewer(due) / own.max(1.0))
}

/// Fruits of the visit that shows fewer.
pub(super) fn fewer([here, there]: [f64; 2]) -> f64 {
    here.min(there).max(1.0)
}

/// The share under which evidence of this slope, which falls, is largest.
pub(super) fn likeliest_share(slope: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = SEEN_AGAIN;
    // Eight halvings of what it may be leave .002.
    for _ in 0..8 {
        let middle = 0.5 * (low + high);
        *(if slope(middle) > 0.0 { &mut low } else { &mut high }) = middle;
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shares_that_the_pairs_show_make_the_evidence_largest() {
        for due @ [here, there] in [[23.0, 76.0], [76.0, 23.0], [40.0, 40.0]] {
            let found = 19.0;
            let evidence = |share: f64| {
                let [p, q] = of_either(share, due);
                found * p.ln() + (here - found) * (1.0 - p).ln() + (there - found) * (1.0 - q).ln() + p * here
            };
            let share = found / fewer(due);
            let [p, q] = of_either(share, due);
            assert!((p * here - found).abs() < 1e-9 && (q * there - found).abs() < 1e-9);
            assert!([-0.01, 0.01].iter().all(|step| evidence(share + step) < evidence(share)));
        }
    }

    #[test]
    fn the_likeliest_share_is_where_the_slope_turns_and_never_beyond_what_is_believed() {
        let (least, most) = SEEN_AGAIN;
        for turn in [least + 0.05, 0.55, most - 0.05] {
            assert!((likeliest_share(|share| turn - share) - turn).abs() < 0.002);
        }
        assert!((likeliest_share(|_| 1.0) - most).abs() < 0.002 && (likeliest_share(|_| -1.0) - least).abs() < 0.002);
    }
}
