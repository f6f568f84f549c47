//! Which share of what a visit shows of an overlap the other shows too.

use super::hypothesis::SHARES;
use super::landscape::Landscape;
use crate::neighbours::others::SHARE_OF_ROWS;
use rayon::prelude::*;

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

/// What the pairs around each fruit of a cloud show.
pub(super) struct Places {
    /// Probability that the fruit is seen again where the other visit looked.
    pub(super) shares: Vec<f64>,
    /// Probability that another tree stands there by the other visit.
    pub(super) replaced: Vec<f64>,
}

/// Probabilities that fruits of a cloud are seen again where the other visit looked: each as the fruits around it are `found` of those
/// that were `due`, its own left out. A tree may have been replaced, and its neighbour not.
///
/// Shares of places scatter about the `common` one. How much, neighbours say: what chance has in one says nothing of the next. With a
/// variance `v` of that, the share of a place has the prior of `common (1 - common) / v - 1` fruits.
///
/// Where trees stand or were replaced, and those that stand have one share, that is `common + v / common`: such a share of a place is what
/// has the mean and the variance.
pub(super) fn of_places(cloud: &Landscape, found: &[f64], due: &[f64]) -> Places {
    let common = common(found, due);
    let shown: Vec<usize> = (0..cloud.len()).filter(|&row| due[row] > 0.0).collect();
    let excess = |row: usize| found[row] - common * due[row];
    let around = |&row: &usize| {
        let [mut products, mut fruits, mut near, mut of] = [0.0; 4];
        for (other, weight) in cloud.kin(row) {
            let other = other as usize;
            products += weight * excess(row) * excess(other);
            fruits += weight * due[row] * due[other];
            near += weight * found[other];
            of += weight * due[other];
        }
        [products, fruits, near, of]
    };
    let around: Vec<[f64; 4]> = shown.par_iter().with_min_len(SHARE_OF_ROWS).map(around).collect();
    let [products, fruits] = around.iter().fold([0.0; 2], |[a, b], [c, d, ..]| [a + c, b + d]);
    let mut places = Places { shares: vec![common; cloud.len()], replaced: vec![0.0; cloud.len()] };
    if products > 0.0 {
        let variance = products / fruits;
        let prior = (common * (1.0 - common) / variance - 1.0).max(0.0);
        let standing = common + variance / common;
        for (row, [.., near, of]) in shown.into_iter().zip(around) {
            let share = ((prior * common + near + common) / (prior + of + 1.0)).clamp(SHARES.0, SHARES.1);
            (places.shares[row], places.replaced[row]) = (share, (1.0 - share / standing).max(0.0));
        }
    }
    places
}

/// Share of all fruits that are due that are found.
fn common(found: &[f64], due: &[f64]) -> f64 {
    let [found, due] = [found, due].map(|all| all.iter().sum::<f64>());
    ((found + 1.0) / (due + 2.0)).clamp(SHARES.0, SHARES.1)
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
    use crate::verified::fixture::visits;

    /// Means of both before the middle of the row and behind, where so many of three are found before and behind.
    fn of_halves(found: [usize; 2]) -> [[f64; 2]; 2] {
        let query = Landscape::new(&visits(0.02).0);
        let is_found = |row: usize| row % 3 < found[usize::from(query.points[row].x > 0.0)];
        let found: Vec<f64> = (0..query.len()).map(|row| f64::from(u8::from(is_found(row)))).collect();
        let Places { shares, replaced } = of_places(&query, &found, &vec![1.0; query.len()]);
        let mean = |of: &[f64], behind: bool| {
            let those = (0..query.len())
                .filter(|&row| query.points[row].x.abs() > 1.2 && (query.points[row].x > 0.0) == behind);
            let (sum, count) = those.fold((0.0, 0.0), |sum, row| (sum.0 + of[row], sum.1 + 1.0));
            sum / count
        };
        [&shares, &replaced].map(|of| [mean(of, false), mean(of, true)])
    }

    #[test]
    fn a_half_that_was_replaced_has_a_share_of_its_own_and_halves_alike_have_one() {
        let [[before, behind], [stands, replaced]] = of_halves([2, 0]);
        assert!((before - 0.67).abs() < 0.1 && behind < 0.1, "{before} {behind}");
        assert!(stands < 0.1 && replaced > 0.85, "{stands} {replaced}");
        let [[before, behind], replaced] = of_halves([1, 1]);
        assert!((before - 0.33).abs() < 0.03 && (behind - 0.33).abs() < 0.03, "{before} {behind}");
        assert!(replaced.iter().all(|replaced| *replaced < 0.05), "{replaced:?}");
    }

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
