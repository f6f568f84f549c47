//! In which order poses are eliminated.
//!
//! Reverse Cuthill-McKee (George and Liu, 1981): breadth first from one end of the drive, so that poses which see the
//! same points come close together. A row that is driven there and back is folded: its band gets twice as wide instead
//! of as wide as the drive is long.

use super::problem::Problem;
use std::collections::VecDeque;

/// Place of each free pose in the elimination, `None` for fixed ones, and for each place the first one that it is
/// connected with.
pub(super) struct Order {
    pub place: Vec<Option<usize>>,
    pub first: Vec<usize>,
}

/// Poses by point, points by pose, poses by pose.
struct Graph {
    poses_of_point: Vec<Vec<usize>>,
    points_of_pose: Vec<Vec<usize>>,
    neighbours: Vec<Vec<usize>>,
}

impl Graph {
    fn of(problem: &Problem, n_points: usize) -> Self {
        let n_poses = problem.fixed.len();
        let mut graph = Self {
            poses_of_point: vec![Vec::new(); n_points],
            points_of_pose: vec![Vec::new(); n_poses],
            neighbours: vec![Vec::new(); n_poses],
        };
        for seen in problem.observations.iter().filter(|seen| !problem.fixed[seen.pose]) {
            graph.poses_of_point[seen.point].push(seen.pose);
            graph.points_of_pose[seen.pose].push(seen.point);
        }
        for pair in &problem.relative_poses {
            if !problem.fixed[pair.first] && !problem.fixed[pair.second] {
                graph.neighbours[pair.first].push(pair.second);
                graph.neighbours[pair.second].push(pair.first);
            }
        }
        graph
    }

    fn degree(&self, pose: usize) -> usize {
        self.points_of_pose[pose].len() + self.neighbours[pose].len()
    }

    /// Poses that hang together with `root`, breadth first, weakly connected ones first.
    fn breadth_first(&self, root: usize) -> Vec<usize> {
        let mut seen_pose = vec![false; self.points_of_pose.len()];
        let mut seen_point = vec![false; self.poses_of_point.len()];
        let (mut order, mut queue) = (Vec::new(), VecDeque::from([root]));
        seen_pose[root] = true;
        while let Some(pose) = queue.pop_front() {
            order.push(pose);
            let mut next: Vec<usize> = self.neighbours[pose].clone();
            for &point in &self.points_of_pose[pose] {
                if !std::mem::replace(&mut seen_point[point], true) {
                    next.extend(&self.poses_of_point[point]);
                }
            }
            next.retain(|&pose| !std::mem::replace(&mut seen_pose[pose], true));
            next.sort_by_key(|&pose| (self.degree(pose), pose));
            queue.extend(next);
        }
        order
    }

    /// First connected place of each place.
    fn first(&self, place: &[Option<usize>], n: usize) -> Vec<usize> {
        let mut first: Vec<usize> = (0..n).collect();
        let mut connect = |poses: &mut dyn Iterator<Item = usize>| {
            let places: Vec<usize> = poses.filter_map(|pose| place[pose]).collect();
            let least = places.iter().copied().min();
            for at in places {
                first[at] = first[at].min(least.unwrap_or(at));
            }
        };
        for poses in &self.poses_of_point {
            connect(&mut poses.iter().copied());
        }
        for (pose, others) in self.neighbours.iter().enumerate() {
            connect(&mut others.iter().copied().chain([pose]));
        }
        first
    }
}

/// The order with the smaller envelope: as given, or reverse Cuthill-McKee.
pub(super) fn order(problem: &Problem, n_points: usize) -> Order {
    let graph = Graph::of(problem, n_points);
    let free: Vec<usize> = (0..problem.fixed.len()).filter(|&pose| !problem.fixed[pose]).collect();
    let candidates = [free.clone(), cuthill_mckee(&graph, &free)].map(|order| placed(&graph, &order));
    let work = |order: &Order| -> usize { order.first.iter().enumerate().map(|(at, first)| (at - first).pow(2)).sum() };
    let [natural, folded] = candidates;
    if work(&folded) < work(&natural) { folded } else { natural }
}

fn placed(graph: &Graph, order: &[usize]) -> Order {
    let mut place = vec![None; graph.points_of_pose.len()];
    for (at, &pose) in order.iter().enumerate() {
        place[pose] = Some(at);
    }
    let first = graph.first(&place, order.len());
    Order { place, first }
}

fn cuthill_mckee(graph: &Graph, free: &[usize]) -> Vec<usize> {
    let mut done = vec![false; graph.points_of_pose.len()];
    let mut order = Vec::with_capacity(free.len());
    for &pose in free {
        if done[pose] {
            continue;
        }
        // The last pose of a search is far from its root: an end of the drive.
        let far = *graph.breadth_first(pose).last().unwrap_or(&pose);
        let part = graph.breadth_first(far);
        for &pose in &part {
            done[pose] = true;
        }
        order.extend(part);
    }
    order.reverse();
    order
}

#[cfg(test)]
mod tests {
    use super::super::problem::{Measured, PointView};
    use super::*;
    use crate::camera::Camera;
    use nalgebra::{Matrix3, Vector3};

    /// `n` poses there and `n` back along `n` places, each seeing the points of three places.
    fn there_and_back(n: usize) -> Problem {
        let observations = (0..2 * n)
            .flat_map(|pose| {
                let place = if pose < n { pose } else { 2 * n - 1 - pose };
                (place..place + 3).map(move |point| PointView {
                    pose,
                    point,
                    measured: Measured::Place(Vector3::zeros()),
                    whitening: Matrix3::identity(),
                })
            })
            .collect();
        let mut fixed = vec![false; 2 * n];
        fixed[0] = true;
        Problem { camera: Camera::UNIT, fixed, observations, relative_poses: Vec::new() }
    }

    #[test]
    fn a_row_driven_there_and_back_is_folded() {
        let order = order(&there_and_back(100), 102);
        let widest = order.first.iter().enumerate().map(|(at, first)| at - first).max();
        assert!(widest.is_some_and(|widest| widest <= 8), "{widest:?}");
        let mut places: Vec<usize> = order.place.iter().filter_map(|&place| place).collect();
        places.sort_unstable();
        assert_eq!(places, (0..199).collect::<Vec<_>>());
        assert_eq!(order.place[0], None);
    }
}
