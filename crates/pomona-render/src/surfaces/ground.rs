//! The ground: grass between the rows, soil with weeds below the trees.

use crate::Vec3;
use crate::light::Surface;
use crate::noise::{blend, noise, octaves, step};
use crate::row::Row;

const SOIL: Vec3 = Vec3::new(0.115, 0.085, 0.058);
const GRASS: Vec3 = Vec3::new(0.085, 0.125, 0.035);
const DRY: Vec3 = Vec3::new(0.21, 0.18, 0.085);

/// Half the width of the strip without grass below a row.
const STRIP_M: f32 = 0.45;

/// A limb that begins so low stands on the ground.
const ROOTED_M: f32 = 0.1;

/// What is known of the ground of a row.
#[derive(Debug)]
pub struct Ground {
    /// Where rows stand, ascending.
    rows_y_m: Vec<f32>,
    seed: u32,
}

impl Ground {
    /// Soil where trunks and posts stand.
    pub fn new(row: &Row, seed: u32) -> Self {
        let rooted = row.limbs.iter().filter(|limb| limb.start.z.min(limb.end.z) < ROOTED_M);
        let mut all: Vec<f32> = rooted.map(|limb| limb.start.y).collect();
        all.sort_by(f32::total_cmp);
        let mut rows_y_m: Vec<f32> = Vec::new();
        for y_m in all {
            if rows_y_m.last().is_none_or(|last| y_m - last > STRIP_M) {
                rows_y_m.push(y_m);
            }
        }
        Self { rows_y_m, seed }
    }

    /// How much grass grows at a place, 0 to 1.
    pub fn grass(&self, place: &Vec3) -> f32 {
        let from_row = self.rows_y_m.iter().map(|y_m| (place.y - y_m).abs()).fold(f32::INFINITY, f32::min);
        let ragged = 0.5 * (octaves(place * 3.0, 3, self.seed) - 0.5);
        step(STRIP_M - 0.15, STRIP_M + 0.2, from_row + ragged)
    }

    /// The ground at a place, seen with pixels of this width.
    pub fn surface(&self, place: &Vec3, pixel_m: f32) -> Surface {
        let shown = |detail_m: f32| step(1.2 * detail_m, 0.4 * detail_m, pixel_m);
        let fine = |per_m: f32, seed: u32| {
            let shown = shown(1.0 / per_m);
            if shown > 0.0 { mixed(noise(place * per_m, self.seed + seed), shown) } else { 0.5 }
        };
        let crumbs = 0.5 * fine(60.0, 1) + 0.5 * fine(170.0, 2);
        let tufts = 0.6 * fine(25.0, 3) + 0.4 * fine(120.0, 4);
        let patches = octaves(place * 1.4, 3, self.seed + 5);
        let soil = SOIL * (0.5 + crumbs) * (0.8 + 0.4 * patches);
        let green = blend(GRASS, DRY, step(0.5, 0.95, patches)) * (0.35 + 1.3 * tufts);
        Surface::dull(Vec3::z(), blend(soil, green, self.grass(place)))
    }
}

fn mixed(noise: f32, shown: f32) -> f32 {
    0.5 + (noise - 0.5) * shown
}
