//! Which share of what a visit shows of an overlap the other shows too.

use super::cut::Cell;
use super::hypothesis::SHARES;
use super::patches::Patchwork;
use crate::beliefs::Beliefs;

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

/// Probabilities that fruits of the query are there in what the map could have shown of them, each as the pairs around it show it, its
/// own left out: a tree may have been replaced, and its neighbour not.
///
/// Shares of places scatter about the `common` one. How much, neighbouring cells say: what chance has in one says nothing of the next.
/// With a variance `v` of that, the share of a place has the prior of `k = common (1 - common) / v - 1` fruits.
pub(super) fn of_places(laid: &Patchwork, beliefs: &Beliefs, common: f64, due: &[f64]) -> Vec<f64> {
    let mut found = vec![0.0; due.len()];
    for (edge, probability) in beliefs.links() {
        found[edge.query as usize] += probability;
    }
    let sum = |rows: &[u32], of: &[f64]| rows.iter().map(|&row| of[row as usize]).sum::<f64>();
    let cells: Vec<[f64; 2]> = laid.cells.iter().map(|cell| [sum(&cell.rows, &found), sum(&cell.rows, due)]).collect();
    let excess = |[found, due]: [f64; 2]| found - common * due;
    let (mut products, mut fruits) = (0.0, 0.0);
    for (at, cell) in laid.cells.iter().enumerate() {
        for &(other, weight) in cell.around.iter().filter(|(other, _)| *other as usize != at) {
            let [one, two] = [cells[at], cells[other as usize]];
            products += weight * excess(one) * excess(two);
            fruits += weight * one[1] * two[1];
        }
    }
    if products <= 0.0 {
        return vec![common; due.len()];
    }
    let prior = (common * (1.0 - common) * fruits / products - 1.0).max(0.0);
    let around = |cell: &Cell| {
        cell.around.iter().fold([0.0; 2], |sum, &(other, weight)| {
            let [found, due] = cells[other as usize];
            [sum[0] + weight * found, sum[1] + weight * due]
        })
    };
    let near: Vec<[f64; 2]> = laid.cells.iter().map(around).collect();
    let share = |row: usize| {
        let [there, here] = near[laid.cut.cell_of[row] as usize];
        let (there, here) = ((there - found[row]).max(0.0), (here - due[row]).max(0.0));
        ((prior * common + there + common) / (prior + here + 1.0)).clamp(SHARES.0, SHARES.1)
    };
    (0..due.len()).map(share).collect()
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
    use crate::beliefs::Edge;
    use crate::geometry::{Scale, Similarity};
    use crate::verified::fixture::visits;
    use crate::verified::hypothesis::{DETECTION, Model};
    use crate::verified::landscape::Landscape;

    /// Shares of the fruits before the middle of the row and behind, where so many of three are found before and behind.
    fn shares_of_halves(found: [usize; 2]) -> [f64; 2] {
        let (query, map) = visits(0.02);
        let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
        let model = Model { sigma: 0.02, detection: DETECTION, scale: Scale::Metric, vertical: None, row: None };
        let laid = Patchwork::new(&query, &map, Similarity::identity(), model.sigma, &model);
        let is_found = |row: usize| row % 3 < found[usize::from(query.points[row].x > 0.0)];
        let edge = |row: usize| Edge { query: row as u32, map: row as u32, ratio: 1e9 };
        let beliefs =
            Beliefs::new((0..query.len()).filter(|&row| is_found(row)).map(edge).collect(), query.len(), query.len());
        let common = beliefs.probabilities.iter().sum::<f64>() / query.len() as f64;
        let shares = of_places(&laid, &beliefs, common, &vec![1.0; query.len()]);
        let mean = |behind: bool| {
            let those = (0..query.len())
                .filter(|&row| query.points[row].x.abs() > 1.2 && (query.points[row].x > 0.0) == behind);
            let (sum, count) = those.fold((0.0, 0.0), |sum, row| (sum.0 + shares[row], sum.1 + 1.0));
            sum / count
        };
        [mean(false), mean(true)]
    }

    #[test]
    fn a_half_that_was_replaced_has_a_share_of_its_own_and_halves_alike_have_one() {
        let [before, behind] = shares_of_halves([2, 0]);
        assert!((before - 0.67).abs() < 0.06 && behind < 0.08, "{before} {behind}");
        let [before, behind] = shares_of_halves([1, 1]);
        assert!((before - 0.33).abs() < 0.03 && (behind - 0.33).abs() < 0.03, "{before} {behind}");
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
