//! Bark: furrows along the wood.

use super::Spot;
use crate::Vec3;
use crate::light::Surface;
use crate::noise::{octaves, step};
use crate::row::Limb;

/// A limb at a place; thin ones, stalks and wires, are smooth.
pub fn surface(limb: &Limb, spot: &Spot) -> Surface {
    let axis = (limb.end - limb.start).try_normalize(1e-6).unwrap_or(Vec3::z());
    let from_start = spot.rest - limb.start;
    // Noise that is stretched along the wood.
    let squeezed = spot.rest - axis * (0.75 * from_start.dot(&axis));
    let rough = step(0.004, 0.02, limb.start_radius_m);
    let furrows = octaves(squeezed * 90.0, 2, 3) * spot.shows(0.012) + 0.5 * (1.0 - spot.shows(0.012));
    let lichen = step(0.6, 0.75, octaves(spot.rest * 14.0, 3, 11)) * rough;
    let shade = 1.0 + rough * (1.1 * (furrows - 0.5));
    let albedo = limb.colour * shade + Vec3::new(0.05, 0.06, 0.04) * (lichen * 0.7);
    Surface { gloss: 0.03 * (1.0 - rough), roughness: 0.6, ..Surface::dull(spot.normal, albedo) }
}
