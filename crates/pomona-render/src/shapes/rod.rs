//! Limbs: tapered tubes with a pointed cap on either end.

use super::{Corner, Shape, across};
use crate::Vec3;
use crate::row::Limb;
use std::f32::consts::TAU;

/// A rod is cut into pieces no longer, so that one that reaches behind the camera is seen in front of it.
const LONGEST_PIECE_M: f32 = 0.4;
const MOST_PIECES: f32 = 2000.0;

/// Ends of thinner rods are not seen.
const THINNEST_CAPPED_PX: f32 = 0.7;

/// Triangles of a rod; three sides where it is thinner than a pixel.
pub fn shape(limb: &Limb, px_per_m: f32) -> Shape {
    let way = limb.end - limb.start;
    let length_m = way.norm();
    let axis = if length_m > 0.0 { way / length_m } else { Vec3::z() };
    let radius_px = limb.start_radius_m.max(limb.end_radius_m) * px_per_m;
    let sides = (3.0 + 1.5 * radius_px).clamp(3.0, 10.0) as u32;
    let pieces = (length_m / LONGEST_PIECE_M).ceil().clamp(1.0, MOST_PIECES) as u32;
    let (side, other) = across(&axis);
    let has_caps = radius_px > THINNEST_CAPPED_PX;
    let mut corners = vec![corner(limb.start - axis * limb.start_radius_m, -axis, 0.0, 0.0)];
    for ring in 0..=pieces {
        let along = ring as f32 / pieces as f32;
        let radius_m = limb.start_radius_m + (limb.end_radius_m - limb.start_radius_m) * along;
        corners.extend((0..sides).map(|number| {
            let turn = number as f32 / sides as f32;
            let normal = side * (TAU * turn).cos() + other * (TAU * turn).sin();
            corner(limb.start + way * along + normal * radius_m, normal, along * length_m, turn)
        }));
    }
    corners.push(corner(limb.end + axis * limb.end_radius_m, axis, length_m, 0.0));
    Shape { corners, triangles: tube(pieces + 1, sides, has_caps) }
}

fn corner(position: Vec3, normal: Vec3, along_m: f32, turn: f32) -> Corner {
    Corner { position, normal, at: [along_m, turn] }
}

/// Triangles of a tube of rings, and of its caps to two points, their corners counterclockwise from outside.
fn tube(rings: u32, sides: u32, has_caps: bool) -> Vec<[u32; 3]> {
    let at = |ring: u32, number: u32| 1 + ring * sides + number % sides;
    let last = 1 + rings * sides;
    let capped = if has_caps { 0..sides } else { 0..0 };
    let start = capped.clone().map(|number| [0, at(0, number + 1), at(0, number)]);
    let walls = (0..rings - 1).flat_map(|ring| {
        (0..sides).flat_map(move |number| {
            let (a, b) = (at(ring, number), at(ring, number + 1));
            let (c, d) = (at(ring + 1, number), at(ring + 1, number + 1));
            [[a, b, c], [b, d, c]]
        })
    });
    let end = capped.map(|number| [last, at(rings - 1, number), at(rings - 1, number + 1)]);
    start.chain(walls).chain(end).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_look_outwards() {
        let (start, end) = (Vec3::new(0.0, 1.0, 0.5), Vec3::new(0.3, 1.2, 1.5));
        let limb = Limb { start, end, start_radius_m: 0.02, end_radius_m: 0.01, colour: Vec3::zeros() };
        let shape = shape(&limb, 500.0);
        for triangle in &shape.triangles {
            let [a, b, c] = triangle.map(|corner| shape.corners[corner as usize]);
            let faced = (b.position - a.position).cross(&(c.position - a.position));
            assert!(faced.dot(&(a.normal + b.normal + c.normal)) > 0.0);
        }
    }
}
