//! What surfaces look like at a place: colour, gloss and relief.

pub mod ground;
mod leaf;
mod skin;
mod wood;

use crate::Vec3;
use crate::light::Surface;
use crate::row::Row;
use crate::shapes::{Corner, Thing};

/// A place that a sample shows.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    /// Where it is in still air, metres.
    pub rest: Vec3,
    /// Between those of the corners, of length 1.
    pub normal: Vec3,
    /// Place on a blade, as its corners have it.
    pub at: [f32; 2],
    /// Unit vector to the camera.
    pub to_viewer: Vec3,
    /// Width of a pixel there, metres: finer texture is left out.
    pub pixel_m: f32,
}

impl Spot {
    /// The place where a ray meets the plane of a triangle; beyond its edges by rounding only.
    pub fn new(corners: [&Corner; 3], moved: &Vec3, eye: &Vec3, ray: &Vec3, pixel_m: f32) -> Self {
        let [a, b, c] = corners;
        let (ab, ac) = (b.position - a.position, c.position - a.position);
        let (from, across) = (eye - moved - a.position, ray.cross(&ac));
        let volume = ab.dot(&across);
        let of_b = (from.dot(&across) / volume).clamp(0.0, 1.0);
        let of_c = (ray.dot(&from.cross(&ab)) / volume).clamp(0.0, 1.0 - of_b);
        let of_a = 1.0 - of_b - of_c;
        Self {
            rest: a.position + ab * of_b + ac * of_c,
            normal: (a.normal * of_a + b.normal * of_b + c.normal * of_c).normalize(),
            at: [0, 1].map(|axis| a.at[axis] * of_a + b.at[axis] * of_b + c.at[axis] * of_c),
            to_viewer: -ray.normalize(),
            pixel_m,
        }
    }

    /// 1 where a pixel shows details of this size, 0 where it holds many of them.
    fn shows(&self, detail_m: f32) -> f32 {
        crate::noise::step(1.2 * detail_m, 0.4 * detail_m, self.pixel_m)
    }
}

/// What a thing looks like at a place.
pub fn surface(row: &Row, thing: Thing, spot: &Spot) -> Surface {
    match thing {
        Thing::Fruit(number) => skin::surface(&row.fruits[number as usize], number, spot),
        Thing::Limb(number) => wood::surface(&row.limbs[number as usize], spot),
        Thing::Leaf(number) => leaf::surface(&row.leaves[number as usize], number, spot),
    }
}
