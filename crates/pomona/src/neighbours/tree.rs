//! Search among fruits in single precision: a balanced k-d tree with bucket leaves, visited in an order that is its own.

use nalgebra::Vector3;

/// A k-d tree over points in single precision.
///
/// Leaves hold up to [`LEAF`] points in the order of the tree, so that a leaf is scanned in one sweep.
#[derive(Debug, Clone)]
pub(crate) struct Tree {
    points: Vec<[f32; 3]>,
    /// Row in the caller's order of each point in the tree's order.
    rows: Vec<u32>,
    nodes: Vec<Node>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    split: f32,
    axis: u8,
    /// Index of the right child; the left one follows its parent. 0 marks a leaf.
    right: u32,
    start: u32,
    end: u32,
}

const LEAF: usize = 12;

/// A place in single precision.
#[inline]
pub(crate) fn single(p: &Vector3<f64>) -> [f32; 3] {
    [p.x as f32, p.y as f32, p.z as f32]
}

impl Tree {
    /// Builds the tree; the order of `points` decides the rows that queries return.
    pub(crate) fn new(points: &[[f32; 3]]) -> Self {
        let mut rows: Vec<u32> = (0..points.len() as u32).collect();
        let mut nodes = Vec::with_capacity(4 * points.len() / LEAF + 1);
        if !points.is_empty() {
            build(points, &mut rows, 0, &mut nodes);
        }
        Self { points: rows.iter().map(|&row| points[row as usize]).collect(), rows, nodes }
    }

    /// Calls `visit(row, squared distance)` for every point within `radius`, in the order of the tree.
    pub(crate) fn within(&self, centre: &[f32; 3], radius: f32, mut visit: impl FnMut(u32, f32)) {
        if self.nodes.is_empty() {
            return;
        }
        let limit = radius * radius;
        let mut stack = [(0u32, 0f32); 64];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let mut at = stack[depth].0;
            loop {
                let node = self.nodes[at as usize];
                if node.right == 0 {
                    for i in node.start as usize..node.end as usize {
                        let d2 = squared_distance(&self.points[i], centre);
                        if d2 <= limit {
                            visit(self.rows[i], d2);
                        }
                    }
                    break;
                }
                let offset = centre[node.axis as usize] - node.split;
                let (near, far) = if offset < 0.0 { (at + 1, node.right) } else { (node.right, at + 1) };
                if offset * offset <= limit {
                    stack[depth] = (far, 0.0);
                    depth += 1;
                }
                at = near;
            }
        }
    }

    /// The `count` nearest points, nearest first, ties by row: `(row, squared distance)`.
    pub(crate) fn nearest(&self, centre: &[f32; 3], count: usize, found: &mut Vec<(u32, f32)>) {
        found.clear();
        if self.nodes.is_empty() || count == 0 {
            return;
        }
        let mut stack = [(0u32, 0f32); 64];
        let mut depth = 1;
        let mut worst = f32::INFINITY;
        while depth > 0 {
            depth -= 1;
            let (mut at, bound) = stack[depth];
            if bound > worst {
                continue;
            }
            loop {
                let node = self.nodes[at as usize];
                if node.right == 0 {
                    for i in node.start as usize..node.end as usize {
                        let entry = (self.rows[i], squared_distance(&self.points[i], centre));
                        if entry.1 <= worst {
                            worst = put_in(found, count, entry);
                        }
                    }
                    break;
                }
                let offset = centre[node.axis as usize] - node.split;
                let (near, far) = if offset < 0.0 { (at + 1, node.right) } else { (node.right, at + 1) };
                stack[depth] = (far, offset * offset);
                depth += 1;
                at = near;
            }
        }
    }
}

/// Puts an entry where it belongs among the nearest, of which no more than `count` are kept; returns beyond which squared
/// distance none is taken. From the end: a few dozen are passed faster one by one than a search among them finds its place.
#[inline]
fn put_in(found: &mut Vec<(u32, f32)>, count: usize, entry: (u32, f32)) -> f32 {
    let is_before = |other: &(u32, f32)| (entry.1, entry.0) < (other.1, other.0);
    if found.len() < count {
        found.push(entry);
    } else if !is_before(&found[count - 1]) {
        return found[count - 1].1;
    }
    let mut at = found.len() - 1;
    while at > 0 && is_before(&found[at - 1]) {
        found[at] = found[at - 1];
        at -= 1;
    }
    found[at] = entry;
    if found.len() < count { f32::INFINITY } else { found[count - 1].1 }
}

#[inline]
fn squared_distance(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    let mut sum = 0.0;
    for d in 0..3 {
        let difference = a[d] - b[d];
        sum += difference * difference;
    }
    sum
}

/// Appends the subtree over `rows`, the first of which is at `start` of the whole. Splits at the median of the widest
/// axis; leaves take their range as it is.
fn build(points: &[[f32; 3]], rows: &mut [u32], start: usize, nodes: &mut Vec<Node>) {
    let at = nodes.len();
    nodes.push(Node { split: 0.0, axis: 0, right: 0, start: start as u32, end: (start + rows.len()) as u32 });
    if rows.len() <= LEAF {
        return;
    }
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for &row in rows.iter() {
        for d in 0..3 {
            low[d] = low[d].min(points[row as usize][d]);
            high[d] = high[d].max(points[row as usize][d]);
        }
    }
    let axis = (0..3).max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b]))).unwrap_or(0);
    if high[axis] <= low[axis] {
        return; // all in one place: a leaf of any size is still exact
    }
    let middle = rows.len() / 2;
    let key = |row: u32| (points[row as usize][axis], row);
    rows.select_nth_unstable_by(middle, |&a, &b| key(a).0.total_cmp(&key(b).0).then(key(a).1.cmp(&key(b).1)));
    let split = points[rows[middle] as usize][axis];
    let (below, above) = rows.split_at_mut(middle);
    let right = if middle < SHARE_OF_POINTS {
        build(points, below, start, nodes);
        let right = nodes.len();
        build(points, above, start + middle, nodes);
        right
    } else {
        let alone = |rows: &mut [u32], start: usize| {
            let mut nodes = Vec::new();
            build(points, rows, start, &mut nodes);
            nodes
        };
        let (left, right) = rayon::join(|| alone(below, start), || alone(above, start + middle));
        append(nodes, left);
        let place = nodes.len();
        append(nodes, right);
        place
    };
    nodes[at] = Node { split, axis: axis as u8, right: right as u32, ..nodes[at] };
}

/// Appends a subtree that was built alone: its children move by what stands before it.
fn append(nodes: &mut Vec<Node>, subtree: Vec<Node>) {
    let moved = nodes.len() as u32;
    let node = |node: Node| Node { right: if node.right == 0 { 0 } else { node.right + moved }, ..node };
    nodes.extend(subtree.into_iter().map(node));
}

/// Points of a subtree that are worth a thread of their own.
const SHARE_OF_POINTS: usize = 8192;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn both_searches_equal_brute_force(
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f32), 1..200),
            centre in prop::array::uniform3(-1.0..1.0f32),
            radius in 0.01..1.0f32,
        ) {
            let tree = Tree::new(&points);
            let mut all: Vec<_> =
                points.iter().enumerate().map(|(i, p)| (i as u32, squared_distance(p, &centre))).collect();
            all.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
            let mut nearest = Vec::new();
            tree.nearest(&centre, 7, &mut nearest);
            prop_assert_eq!(&nearest[..], &all[..all.len().min(7)]);
            let mut within = Vec::new();
            tree.within(&centre, radius, |row, d2| within.push((row, d2)));
            within.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
            all.retain(|entry| entry.1 <= radius * radius);
            prop_assert_eq!(within, all);
        }
    }
}
