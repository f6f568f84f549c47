//! RANSAC with Procrustes: the transform that most of the given pairs agree on.

use crate::geometry::{Scale, Similarity, fit};
use crate::meanings::settings;
use crate::random::SplitMix;
use nalgebra::Point3;
use serde::{Deserialize, Serialize};

settings! {
/// How hard to look.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RansacConfig {
    /// Wanted probability that one sample of three true pairs was drawn. At 0.999 one run in a thousand may stop early.
    pub confidence: f64,
    /// Samples drawn at most. Enough for one true pair in ten at the confidence of 0.999 (6,900), see Fischler and Bolles.
    pub max_samples: usize,
    /// Seed of the samples.
    pub seed: u64,
}
}

impl Default for RansacConfig {
    fn default() -> Self {
        Self { confidence: 0.999, max_samples: 7000, seed: 2602 }
    }
}

/// The transform with the most support.
#[derive(Debug, Clone, PartialEq)]
pub struct Consensus {
    /// Takes source points to the target.
    pub target_from_source: Similarity,
    /// Places of the agreeing pairs, ascending.
    pub inliers: Vec<usize>,
    /// Samples drawn.
    pub samples: usize,
}

/// Rounds of refitting to the inliers; they settle after two or three.
const REFITS: usize = 8;

/// The transform that brings the most pairs within `inlier_m` (metres of the target), refitted to them.
///
/// `None` where no three pairs agree. The same pairs in the same order with the same seed give the same answer.
pub fn ransac(
    source: &[Point3<f64>],
    target: &[Point3<f64>],
    scale: Scale,
    inlier_m: f64,
    config: &RansacConfig,
) -> Option<Consensus> {
    let n = source.len();
    let mut random = SplitMix(config.seed);
    let (mut best, mut best_cost) = (None, f64::INFINITY);
    let (mut samples, mut needed) = (0, config.max_samples);
    while samples < needed && n >= 3 {
        samples += 1;
        let sample = random.three(n);
        let (from, to) = (sample.map(|i| source[i]), sample.map(|i| target[i]));
        if !is_congruent(&from, &to, scale, inlier_m) {
            continue;
        }
        let Some(candidate) = fit(&from, &to, None, scale) else { continue };
        let (cost, count) = support(&candidate, source, target, inlier_m);
        if cost < best_cost {
            (best, best_cost) = (Some(candidate), cost);
            needed = needed.min(samples_needed(count as f64 / n as f64, config));
        }
    }
    let mut best = best?;
    let mut inliers = agreeing(&best, source, target, inlier_m);
    for _ in 0..REFITS {
        let pick = |points: &[Point3<f64>]| inliers.iter().map(|&i| points[i]).collect::<Vec<_>>();
        let Some(refit) = fit(&pick(source), &pick(target), None, scale) else { break };
        let agree = agreeing(&refit, source, target, inlier_m);
        if agree.len() < inliers.len() {
            break;
        }
        let settled = agree == inliers;
        (best, inliers) = (refit, agree);
        if settled {
            break;
        }
    }
    (inliers.len() >= 3).then_some(Consensus { target_from_source: best, inliers, samples })
}

/// Samples that hold three true pairs at least once with the wanted confidence, where the share `inliers` is true.
fn samples_needed(inliers: f64, config: &RansacConfig) -> usize {
    let all_true = inliers.powi(3);
    if all_true >= 1.0 {
        return 1;
    }
    ((1.0 - config.confidence).ln() / (-all_true).ln_1p()).ceil() as usize
}

/// Whether the two triangles have the same sides, up to one scale where it is free, and sides long enough to fix a
/// rotation: the error of two corners must not exceed their distance.
fn is_congruent(from: &[Point3<f64>; 3], to: &[Point3<f64>; 3], scale: Scale, inlier_m: f64) -> bool {
    let sides = |p: &[Point3<f64>; 3]| [(p[0] - p[1]).norm(), (p[1] - p[2]).norm(), (p[2] - p[0]).norm()];
    let (from, to) = (sides(from), sides(to));
    let ratio = match scale {
        Scale::Metric => 1.0,
        Scale::Free => to.iter().sum::<f64>() / from.iter().sum::<f64>(),
    };
    ratio.is_finite()
        && from.iter().zip(&to).all(|(a, b)| *b > 2.0 * inlier_m && (a * ratio - b).abs() < 2.0 * inlier_m)
}

/// Truncated squared residuals (Torr and Zisserman's MSAC) and the number of agreeing pairs.
fn support(transform: &Similarity, source: &[Point3<f64>], target: &[Point3<f64>], inlier_m: f64) -> (f64, usize) {
    let limit = inlier_m * inlier_m;
    let (mut cost, mut count) = (0.0, 0);
    let linear = transform.rotation.matrix() * transform.scale;
    for (s, t) in source.iter().zip(target) {
        let squared = (linear * s.coords + transform.translation - t.coords).norm_squared();
        cost += squared.min(limit);
        count += usize::from(squared <= limit);
    }
    (cost, count)
}

fn agreeing(transform: &Similarity, source: &[Point3<f64>], target: &[Point3<f64>], inlier_m: f64) -> Vec<usize> {
    (0..source.len()).filter(|&i| (transform.apply(&source[i]) - target[i]).norm() <= inlier_m).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Vector3};
    use proptest::prelude::*;

    fn pairs(seed: u64, n: usize, truth: &Similarity, false_share: f64) -> (Vec<Point3<f64>>, Vec<Point3<f64>>) {
        let mut random = SplitMix(seed);
        let mut number = || random.below(1_000_000) as f64 / 1e6;
        let mut point = || Point3::new(6.0 * number(), 3.0 * number(), number());
        let source: Vec<_> = (0..n).map(|_| point()).collect();
        let wrong = (false_share * n as f64) as usize;
        let target = source.iter().enumerate().map(|(i, p)| if i < wrong { point() } else { truth.apply(p) }).collect();
        (source, target)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn finds_the_truth_among_false_pairs(
            seed in any::<u64>(), turn in prop::array::uniform3(-3.0..3.0f64), scale in 0.5..2.0f64, free in any::<bool>()
        ) {
            let (kind, scale) = if free { (Scale::Free, scale) } else { (Scale::Metric, 1.0) };
            let rotation = Rotation3::new(Vector3::from(turn));
            let truth = Similarity { rotation, translation: Vector3::new(1.0, -2.0, 3.0), scale };
            let (source, target) = pairs(seed, 80, &truth, 0.7);
            let found = ransac(&source, &target, kind, 0.02, &RansacConfig::default()).expect("24 true pairs");
            prop_assert!((found.target_from_source.to_matrix() - truth.to_matrix()).norm() < 1e-2);
            prop_assert!((56..80).all(|i| found.inliers.contains(&i)));
        }
    }

    #[test]
    fn nothing_agrees() {
        let (source, _) = pairs(1, 3, &Similarity::identity(), 0.0);
        let (target, _) = pairs(2, 3, &Similarity::identity(), 0.0);
        assert_eq!(ransac(&source, &target, Scale::Metric, 0.01, &RansacConfig::default()), None);
        assert_eq!(ransac(&source[..2], &source[..2], Scale::Metric, 0.01, &RansacConfig::default()), None);
    }
}
