//! What the fruits of one frame say of a pose that others told.
//!
//! The pose is not known better than its covariance P says, so that fruits may lie beside by as much; but all of them lie
//! beside by one step d of the camera, not each by its own. By Laplace's rule the frame has the evidence
//!
//! L(d) - d^T P^-1 d / 2 - ln det(P H) / 2
//!
//! under the step that has most, H being the information of pose and frame together.

use super::alignment::{Laid, SHRINKING, Say, laid, say, whole};
use super::belief::Belief;
use super::known::KnownFruits;
use super::sightings::Sighting;
use super::slip::Slip;
use crate::bundle::steps::moved;
use nalgebra::{Matrix6, Vector6};

/// Turns in which the step is settled: the doubt is a hundredth of a fruit by then.
const TURNS: usize = 6;

/// Evidence of a frame, nats, `share` being the part of sightings that is in the map.
pub(super) fn own_nats(told: &Belief, frame: &[Sighting], map: &KnownFruits, share: f64) -> f64 {
    if frame.is_empty() {
        return 0.0;
    }
    let Some(known) = told.covariance.try_inverse() else { return f64::NEG_INFINITY };
    let laid = laid(frame, map, &told.pose, &Slip::none());
    let (mut step, mut doubt) = (Vector6::zeros(), told.covariance);
    for _ in 0..TURNS {
        let says = says(told, &step, &laid, map, &doubt, share);
        let (information, pull) = normal(&says, &known, &step);
        step += information.cholesky().map_or_else(Vector6::zeros, |factor| factor.solve(&pull));
        doubt *= SHRINKING;
    }
    let says = whole(says(told, &step, &laid, map, &Matrix6::zeros(), share), &laid, map);
    let (information, _) = normal(&says, &known, &step);
    let fitted = step.dot(&(known * step)) + (information * told.covariance).determinant().ln();
    says.iter().map(|say| say.evidence(share)).sum::<f64>() - 0.5 * fitted
}

fn says(
    told: &Belief,
    step: &Vector6<f64>,
    frame: &[Laid],
    map: &KnownFruits,
    doubt: &Matrix6<f64>,
    share: f64,
) -> Vec<Say> {
    let (pose, slip) = (moved(&told.pose, step), Slip::none());
    let doubt = slip.doubt(doubt);
    frame.iter().map(|seen| say(seen, map, &pose, &slip, &doubt, share, None)).collect()
}

/// Information of pose and frame, and the pull of both on a step.
fn normal(says: &[Say], known: &Matrix6<f64>, step: &Vector6<f64>) -> (Matrix6<f64>, Vector6<f64>) {
    let (mut information, mut pull) = (*known, -(known * step));
    for say in says {
        let slopes = say.slopes.fixed_columns::<6>(0);
        information += slopes.transpose() * say.information * slopes;
        pull += slopes.transpose() * say.pull;
    }
    (information, pull)
}
