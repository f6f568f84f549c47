//! Fruits: a profile with dimples at stalk and calyx, turned around the axis.

use super::{Corner, Shape, across};
use crate::Vec3;
use crate::row::Fruit;
use std::f32::consts::{PI, TAU};

/// How deep the cavities are against half the height, at the stalk and at the calyx, and how wide, radians.
const STALK: (f32, f32) = (0.34, 0.32);
const CALYX: (f32, f32) = (0.16, 0.26);

/// How much farther from the calyx than the middle the fruit is widest.
const SHOULDERS: f32 = 0.05;

/// Distance from the axis and height over the middle of a profile of radius 1 and half height 1, `angle` from the stalk.
fn profile(angle: f32) -> (f32, f32) {
    let dimple = |(depth, width): (f32, f32), from: f32| depth * (-(from / width).powi(2)).exp();
    let out = angle.sin() * (1.0 + SHOULDERS * angle.cos());
    let up = angle.cos() * (1.0 - dimple(STALK, angle) - dimple(CALYX, PI - angle));
    (out, up)
}

/// Greatest distance from the axis, and lowest and highest place, of the profile.
fn extent() -> (f32, f32, f32) {
    let places = (0..=256).map(|number| profile(PI * number as f32 / 256.0));
    places.fold((0.0_f32, 0.0_f32, 0.0_f32), |(wide, low, high), (out, up)| (wide.max(out), low.min(up), high.max(up)))
}

/// Triangles whose outline stays within about a tenth of a pixel.
pub fn shape(fruit: &Fruit, px_per_m: f32) -> Shape {
    let radius_px = 0.5 * fruit.diameter_m * px_per_m;
    let around = (7.0 * radius_px.sqrt()).ceil().clamp(6.0, 36.0) as u32;
    let rings = (around / 2).max(4);
    let (wide, low, high) = extent();
    let (side, other) = across(&fruit.axis);
    let scale_m = (0.5 * fruit.diameter_m / wide, fruit.height_m / (high - low));
    let middle = 0.5 * (high + low);
    let place = |angle: f32, turn: f32| {
        let (out, up) = profile(angle);
        let aside = side * turn.cos() + other * turn.sin();
        fruit.centre + aside * (out * scale_m.0) + fruit.axis * ((up - middle) * scale_m.1)
    };
    let mut corners = vec![corner(place(0.0, 0.0), fruit.axis, 0.0, 0.0)];
    for ring in 1..rings {
        let angle = PI * ring as f32 / rings as f32;
        corners.extend((0..around).map(|number| {
            let turn = TAU * number as f32 / around as f32;
            let normal = normal(&place, angle, turn);
            corner(place(angle, turn), normal, angle, turn)
        }));
    }
    corners.push(corner(place(PI, 0.0), -fruit.axis, PI, 0.0));
    Shape { corners, triangles: turned(rings, around) }
}

fn corner(position: Vec3, normal: Vec3, angle: f32, turn: f32) -> Corner {
    Corner { position, normal, at: [angle, turn] }
}

fn normal(place: &impl Fn(f32, f32) -> Vec3, angle: f32, turn: f32) -> Vec3 {
    const STEP: f32 = 1e-2;
    let down = place(angle + STEP, turn) - place(angle - STEP, turn);
    let around = place(angle, turn + STEP) - place(angle, turn - STEP);
    down.cross(&around).normalize()
}

/// Triangles of a turned profile, their corners counterclockwise from outside: a pole, rings, the other pole.
fn turned(rings: u32, around: u32) -> Vec<[u32; 3]> {
    let at = |ring: u32, number: u32| 1 + (ring - 1) * around + number % around;
    let last = 1 + (rings - 1) * around;
    let top = (0..around).map(|number| [0, at(1, number), at(1, number + 1)]);
    let sides = (1..rings - 1).flat_map(|ring| {
        (0..around).flat_map(move |number| {
            let (a, b) = (at(ring, number), at(ring, number + 1));
            let (c, d) = (at(ring + 1, number), at(ring + 1, number + 1));
            [[a, c, b], [b, c, d]]
        })
    });
    let bottom = (0..around).map(|number| [last, at(rings - 1, number + 1), at(rings - 1, number)]);
    top.chain(sides).chain(bottom).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fruit() -> Fruit {
        Fruit {
            id: 1,
            centre: Vec3::new(1.0, 2.0, 3.0),
            diameter_m: 0.08,
            height_m: 0.07,
            axis: Vec3::new(0.0, 0.6, 0.8),
            ground_colour: Vec3::zeros(),
            blush_colour: Vec3::zeros(),
            blush_share: 0.0,
            blush_direction: Vec3::z(),
        }
    }

    #[test]
    fn a_fruit_is_as_wide_and_high_as_it_is_said_to_be() {
        let fruit = fruit();
        let shape = shape(&fruit, 1000.0);
        let from_centre = || shape.corners.iter().map(|corner| corner.position - fruit.centre);
        let up = |offset: Vec3| offset.dot(&fruit.axis);
        let widest = from_centre().map(|offset| (offset - fruit.axis * up(offset)).norm()).fold(0.0, f32::max);
        let (low, high) = from_centre().map(up).fold((0.0_f32, 0.0_f32), |(low, high), z| (low.min(z), high.max(z)));
        assert!((2.0 * widest - 0.08).abs() < 5e-4, "found {widest}");
        assert!((high - low - 0.07).abs() < 1e-3, "found {low} to {high}");
    }

    #[test]
    fn triangles_look_outwards() {
        let shape = shape(&fruit(), 300.0);
        for triangle in &shape.triangles {
            let [a, b, c] = triangle.map(|corner| shape.corners[corner as usize]);
            let faced = (b.position - a.position).cross(&(c.position - a.position));
            assert!(faced.dot(&(a.normal + b.normal + c.normal)) > 0.0);
        }
    }
}
