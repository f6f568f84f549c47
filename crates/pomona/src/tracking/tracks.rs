//! What tracking found: the fruits of the visit and who saw them.

use super::config::TrackingConfig;
use super::known::Known;
use super::landmark::Landmark;
use super::merging::{Body, merge_duplicates};
use nalgebra::{Matrix3, Vector3};
use std::collections::{BTreeMap, BTreeSet};

/// A box of a frame that shows a fruit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sighting {
    /// Frame number.
    pub frame: i64,
    /// Row of the box in its frame.
    pub row: usize,
    /// Track number; in [`Tracks`] the row of the fruit.
    pub fruit: usize,
    /// Whether the box is around another fruit too: its size and middle are not this fruit's.
    pub shared: bool,
}

/// Fruits, one row each, in the order in which they were first seen.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tracks {
    /// Track number, as [`super::Tracker::update`] gave it.
    pub numbers: Vec<usize>,
    /// Centres in the session's frame, metres.
    pub centres: Vec<Vector3<f64>>,
    /// Their covariances, square metres.
    pub covariances: Vec<Matrix3<f64>>,
    /// Radii, metres.
    pub radii_m: Vec<f64>,
    /// Their standard deviations, metres.
    pub radius_sigmas_m: Vec<f64>,
    /// Number of frames that saw the fruit.
    pub views: Vec<usize>,
    /// Number of further frames that show it without a box.
    pub glimpses: Vec<usize>,
    /// Log-odds that it is a fruit and no false box, nats.
    pub evidence: Vec<f64>,
    /// Who saw which fruit, by frame and row.
    pub sightings: Vec<Sighting>,
    /// Boxes that the detector missed, estimated by what pictures show of fruits without one.
    pub missed_boxes: f64,
}

/// Joins duplicates, drops what was seen too rarely.
pub(crate) fn tracks(known: &Known, sightings: &[Sighting], min_views: usize, config: &TrackingConfig) -> Tracks {
    let landmarks = &known.landmarks;
    let roots: Vec<usize> = (0..landmarks.len()).filter(|&index| landmarks[index].merged_into.is_none()).collect();
    let mut row_of: BTreeMap<usize, usize> = roots.iter().enumerate().map(|(row, &root)| (root, row)).collect();
    let mut frames_of = vec![Vec::new(); roots.len()];
    for sighting in sightings {
        frames_of[row_of[&known.root(sighting.fruit)]].push(sighting.frame);
    }
    let bodies: Vec<Body> = roots.iter().map(|&index| Body::of(&landmarks[index])).collect();
    let labels = merge_duplicates(&bodies, &frames_of, config.max_drift_m, config);
    let mut joined: Vec<Landmark> = roots.iter().map(|&index| landmarks[index].clone()).collect();
    for (row, &label) in labels.iter().enumerate() {
        if label != row {
            let other = joined[row].clone();
            joined[label].absorb(&other);
        }
    }
    for row in row_of.values_mut() {
        *row = labels[*row];
    }
    let named = sightings.iter().map(|one| Sighting { fruit: row_of[&known.root(one.fruit)], ..*one });
    report(&roots, &joined, &once_a_frame(named), min_views)
}

/// Merged records may both have a box in one frame: the first stays, an own one before a shared one.
fn once_a_frame(sightings: impl Iterator<Item = Sighting>) -> Vec<Sighting> {
    let mut best: BTreeMap<(i64, usize), Sighting> = BTreeMap::new();
    for sighting in sightings {
        let kept = best.entry((sighting.frame, sighting.fruit)).or_insert(sighting);
        if kept.shared && !sighting.shared {
            *kept = sighting;
        }
    }
    let mut kept: Vec<_> = best.into_values().collect();
    kept.sort_by_key(|sighting| (sighting.frame, sighting.row));
    kept
}

fn report(roots: &[usize], landmarks: &[Landmark], sightings: &[Sighting], min_views: usize) -> Tracks {
    let mut frames: Vec<BTreeSet<i64>> = vec![BTreeSet::new(); landmarks.len()];
    for sighting in sightings {
        frames[sighting.fruit].insert(sighting.frame);
    }
    let views: Vec<usize> = frames.iter().map(BTreeSet::len).collect();
    let kept: Vec<usize> = (0..landmarks.len()).filter(|&row| views[row] >= min_views.max(1)).collect();
    let row_of: BTreeMap<usize, usize> = kept.iter().enumerate().map(|(row, &old)| (old, row)).collect();
    let mut found = Tracks::default();
    for &row in &kept {
        let landmark = &landmarks[row];
        found.numbers.push(roots[row]);
        found.centres.push(landmark.estimate.centre);
        found.covariances.push(landmark.estimate.covariance);
        found.radii_m.push(landmark.radius_m());
        found.radius_sigmas_m.push(landmark.radius_m() * landmark.size.variance.sqrt());
        found.views.push(views[row]);
        let glimpses: BTreeSet<i64> = landmark.glimpses.iter().copied().collect();
        found.glimpses.push(glimpses.difference(&frames[row]).count());
        found.evidence.push(landmark.evidence);
    }
    let reported = sightings.iter().filter_map(|one| row_of.get(&one.fruit).map(|&fruit| Sighting { fruit, ..*one }));
    found.sightings = reported.collect();
    debug_assert_eq!(
        found.sightings.iter().map(|one| (one.frame, one.row)).collect::<BTreeSet<_>>().len(),
        found.sightings.len(),
        "a box shows one fruit"
    );
    found
}
