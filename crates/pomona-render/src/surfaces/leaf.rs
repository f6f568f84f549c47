//! Leaves: glossy above, pale below, light shines through; veins.

use super::Spot;
use crate::Vec3;
use crate::light::Surface;
use crate::noise::{blend, hash, noise, unit};
use crate::row::Leaf;

/// Light that comes through a leaf lacks the blue and is yellower than what its upper side scatters.
const THROUGH: Vec3 = Vec3::new(1.0, 1.0, 0.35);
const PALE: Vec3 = Vec3::new(0.19, 0.24, 0.15);

/// Factors of the colour of the darkest and the lightest leaves of a tree.
const OLD: Vec3 = Vec3::new(0.72, 0.76, 0.80);
const YOUNG: Vec3 = Vec3::new(1.32, 1.18, 0.95);

/// Side veins from base to tip.
const VEINS: f32 = 9.0;

/// A leaf at a place.
pub fn surface(leaf: &Leaf, number: u32, spot: &Spot) -> Surface {
    let faces = spot.normal.dot(&spot.to_viewer);
    let is_upper = faces > 0.0;
    let [along, aside] = spot.at;
    let (vein, relief) = veins(along, aside, spot.shows(0.004));
    let tilt = leaf.tip * (relief * 0.35);
    let normal = (spot.normal * faces.signum() + tilt).normalize();
    let mottled = 0.85 + 0.3 * noise(Vec3::new(along * 4.0, aside * 2.0, 0.0), number);
    let tint = unit(hash(number as i32, 0, 0, 5));
    let upper = leaf.colour.component_mul(&blend(OLD, YOUNG, tint)) * mottled;
    let albedo = if is_upper { blend(upper, PALE, 0.35 * vein) } else { blend(upper, PALE, 0.4 + 0.25 * vein) };
    let transmitted = leaf.colour.component_mul(&THROUGH) * (0.72 - 0.3 * vein);
    let (gloss, roughness) = if is_upper { (0.045, 0.42) } else { (0.02, 0.7) };
    Surface { normal, albedo, transmitted, gloss, roughness }
}

/// How much of a vein there is, and how the blade between two veins is tilted along the leaf.
fn veins(along: f32, aside: f32, shown: f32) -> (f32, f32) {
    let across = aside.abs();
    let phase = (VEINS * along - 2.6 * across).rem_euclid(1.0);
    let side = (1.0 - 9.0 * phase.min(1.0 - phase)).max(0.0) * (1.0 - across);
    let midrib = (1.0 - 14.0 * across).max(0.0);
    ((midrib + 0.6 * side * shown).min(1.0), (phase - 0.5) * shown * (1.0 - 0.5 * across))
}
