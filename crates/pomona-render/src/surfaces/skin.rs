//! Skin of a fruit: a blush with stripes on a ground colour, lenticels, russet at the stalk, remains at the calyx.

use super::Spot;
use crate::Vec3;
use crate::light::Surface;
use crate::noise::{blend, noise, octaves, step};
use crate::row::Fruit;
use crate::shapes::across;

const RUSSET: Vec3 = Vec3::new(0.20, 0.13, 0.05);
const CALYX: Vec3 = Vec3::new(0.035, 0.025, 0.015);
const LENTICEL: Vec3 = Vec3::new(0.55, 0.45, 0.28);

/// Of wax, whose index of refraction is 1.45.
const GLOSS: f32 = 0.034;
const ROUGHNESS: f32 = 0.38;

/// Distance between lenticels, metres.
const LENTICELS_M: f32 = 0.0045;

/// Skin at a place.
pub fn surface(fruit: &Fruit, number: u32, spot: &Spot) -> Surface {
    let out = (spot.rest - fruit.centre).normalize();
    let up = out.dot(&fruit.axis);
    let albedo = blend(coloured(fruit, number, &out, up), LENTICEL, 0.35 * lenticels(fruit, number, spot));
    let russet = step(0.86, 0.97, up + 0.08 * (noise(out * 9.0, number) - 0.5));
    let calyx = step(0.965, 0.985, -up);
    let albedo = blend(blend(albedo, RUSSET, 0.8 * russet), CALYX, calyx);
    Surface {
        normal: spot.normal,
        albedo,
        transmitted: Vec3::zeros(),
        gloss: GLOSS * (1.0 - 0.7 * russet.max(calyx)),
        roughness: ROUGHNESS,
    }
}

/// Ground colour and blush: as much of the skin as its share, soft at the border and striped along the axis.
fn coloured(fruit: &Fruit, number: u32, out: &Vec3, up: f32) -> Vec3 {
    let (side, other) = across(&fruit.axis);
    let turn = other.dot(out).atan2(side.dot(out));
    let stripes = noise(Vec3::new(8.0 * turn, 1.3 * up, 0.0), number);
    let patches = octaves(out * 2.5, 3, number + 77);
    let towards = out.dot(&fruit.blush_direction) + 0.55 * (stripes - 0.5) + 0.7 * (patches - 0.5);
    let border = 1.0 - 2.0 * fruit.blush_share;
    let blush = step(border - 0.4, border + 0.4, towards);
    let mottled = 0.86 + 0.28 * patches;
    blend(fruit.ground_colour, fruit.blush_colour * (0.85 + 0.3 * stripes), blush) * mottled
}

/// Small pale dots on a lattice in space, pushed from their places.
fn lenticels(fruit: &Fruit, number: u32, spot: &Spot) -> f32 {
    let shown = spot.shows(0.0016);
    if shown <= 0.0 {
        return 0.0;
    }
    let at = (spot.rest - fruit.centre) / LENTICELS_M;
    let cell = at.map(f32::floor);
    let pushed = |axis: f32| 0.3 + 0.4 * noise(cell + Vec3::repeat(0.5 + axis), number);
    let dot = cell + Vec3::new(pushed(0.0), pushed(10.0), pushed(20.0));
    shown * step(0.24, 0.12, (at - dot).norm())
}
