//! Leaves: two halves along a bent midrib.

use super::{Corner, Shape};
use crate::Vec3;
use crate::row::Leaf;
use std::f32::consts::PI;

/// Half the width of the blade, `along` from base 0 to tip 1, against its greatest: ovate, with a drawn-out tip.
fn outline(along: f32) -> f32 {
    (PI * along.powf(0.8)).sin().max(0.0).powf(0.75) * (1.0 - 0.12 * along)
}

/// Triangles of a blade, 4 to 20.
pub fn shape(leaf: &Leaf, px_per_m: f32) -> Shape {
    let steps = match leaf.length_m * px_per_m {
        ..=9.0 => 2,
        ..=28.0 => 3,
        ..=70.0 => 4,
        _ => 6,
    };
    let across = leaf.tip.cross(&leaf.normal);
    let mut corners = vec![corner(leaf.base, leaf.normal, 0.0, 0.0)];
    for step in 1..steps {
        let along = step as f32 / steps as f32;
        let (middle, normal) = midrib(leaf, along);
        let half_m = 0.5 * leaf.width_m * outline(along);
        let (sine, cosine) = leaf.fold_rad.sin_cos();
        let half = |side: f32| {
            let position = middle + (across * (side * cosine) + normal * sine) * half_m;
            corner(position, normal * cosine - across * (side * sine), along, side)
        };
        corners.extend([half(-1.0), corner(middle, normal, along, 0.0), half(1.0)]);
    }
    let (tip, normal) = midrib(leaf, 1.0);
    corners.push(corner(tip, normal, 1.0, 0.0));
    Shape { corners, triangles: halves(steps) }
}

fn corner(position: Vec3, normal: Vec3, along: f32, side: f32) -> Corner {
    Corner { position, normal, at: [along, side] }
}

/// Place and upper side of the midrib, an arc that turns by `bend_rad` from base to tip.
fn midrib(leaf: &Leaf, along: f32) -> (Vec3, Vec3) {
    let turned = leaf.bend_rad * along;
    let (sine, cosine) = turned.sin_cos();
    let normal = leaf.normal * cosine + leaf.tip * sine;
    if leaf.bend_rad.abs() < 1e-3 {
        return (leaf.base + leaf.tip * (leaf.length_m * along), normal);
    }
    let radius_m = leaf.length_m / leaf.bend_rad;
    (leaf.base + leaf.tip * (radius_m * sine) - leaf.normal * (radius_m * (1.0 - cosine)), normal)
}

/// Triangles between base, rows of left edge, midrib and right edge, and tip.
fn halves(steps: u32) -> Vec<[u32; 3]> {
    let at = |step: u32, side: u32| 1 + (step - 1) * 3 + side;
    let tip = 1 + (steps - 1) * 3;
    let mut triangles = vec![[0, at(1, 1), at(1, 0)], [0, at(1, 2), at(1, 1)]];
    for step in 1..steps - 1 {
        for side in 0..2 {
            let (a, b) = (at(step, side), at(step, side + 1));
            let (c, d) = (at(step + 1, side), at(step + 1, side + 1));
            triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    triangles.extend([[at(steps - 1, 0), at(steps - 1, 1), tip], [at(steps - 1, 1), at(steps - 1, 2), tip]]);
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blade_is_as_long_and_wide_as_it_is_said_to_be() {
        let leaf = Leaf {
            base: Vec3::new(1.0, 0.0, 2.0),
            tip: Vec3::x(),
            normal: Vec3::z(),
            length_m: 0.08,
            width_m: 0.05,
            fold_rad: 0.0,
            bend_rad: 0.0,
            colour: Vec3::zeros(),
        };
        let shape = shape(&leaf, 1000.0);
        let reach = |axis: usize| {
            let places = shape.corners.iter().map(|corner| corner.position[axis]);
            places.clone().fold(f32::MIN, f32::max) - places.fold(f32::MAX, f32::min)
        };
        assert!((reach(0) - 0.08).abs() < 1e-6 && (reach(1) - 0.05).abs() < 0.004 && reach(2).abs() < 1e-6);
    }
}
