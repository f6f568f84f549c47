//! Which places the sun reaches: the nearest distance to it, seen from the sun.

use super::super::raster::{View, draw};
use crate::Vec3;
use crate::shapes::{Mesh, across};
use pomona::nalgebra::Matrix3;

/// Width of a texel, unless the map would grow too large.
const TEXEL_M: f32 = 0.004;
const MOST_TEXELS: f32 = 24e6;
const MOST_ACROSS: f32 = 16_384.0;

/// What lies no deeper behind the first surface is that surface itself: shapes are flat between their corners.
const SELF_M: f32 = 0.007;

/// Nearness to the sun over a plane across its light.
#[derive(Debug)]
pub struct ShadowMap {
    view: FromSun,
    nearness: Vec<f32>,
}

impl ShadowMap {
    /// Shadows of a mesh at rest; none where nothing stands.
    pub fn new(mesh: &Mesh, to_sun: &Vec3) -> Option<Self> {
        let view = FromSun::around(mesh, to_sun)?;
        let nearness = draw(mesh, &view).nearness;
        Some(Self { view, nearness })
    }

    /// Share of the sun that reaches a place, 0 to 1; `side` is the side of the surface that it falls on.
    pub fn lit(&self, place: &Vec3, side: &Vec3) -> f32 {
        let seen = self.view.turned(&(place + side * SELF_M));
        let (column, row) = (seen.x - 0.5, seen.y - 0.5);
        let (left, top) = (column.floor(), row.floor());
        let (right_share, low_share) = (column - left, row - top);
        let at = |right: f32, down: f32| self.open(left + right, top + down, seen.z + SELF_M);
        let upper = at(0.0, 0.0) * (1.0 - right_share) + at(1.0, 0.0) * right_share;
        let lower = at(0.0, 1.0) * (1.0 - right_share) + at(1.0, 1.0) * right_share;
        upper * (1.0 - low_share) + lower * low_share
    }

    /// Whether nothing stands in front of a nearness at a texel.
    fn open(&self, column: f32, row: f32, nearness: f32) -> f32 {
        let [width, height] = self.view.size;
        if column < 0.0 || row < 0.0 || column >= width as f32 || row >= height as f32 {
            return 1.0;
        }
        let blocker = self.nearness[row as usize * width + column as usize];
        f32::from(blocker <= nearness)
    }
}

/// Everything that stands there, seen from the sun.
#[derive(Debug)]
struct FromSun {
    size: [usize; 2],
    /// Across the light, across it, and along it away from the sun.
    sun_from_row: Matrix3<f32>,
    texels_per_m: f32,
    low: Vec3,
    far: f32,
}

impl FromSun {
    fn around(mesh: &Mesh, to_sun: &Vec3) -> Option<Self> {
        let axis = -to_sun;
        let (side, other) = across(&axis);
        let sun_from_row = Matrix3::from_rows(&[side.transpose(), other.transpose(), axis.transpose()]);
        let mut places = mesh.corners.iter().map(|corner| sun_from_row * corner.position);
        let first = places.next()?;
        let (low, high) = places.fold((first, first), |(low, high), place| (low.inf(&place), high.sup(&place)));
        let reach = high - low;
        let longest_m = reach.x.max(reach.y);
        let texel_m = TEXEL_M.max((reach.x * reach.y / MOST_TEXELS).sqrt()).max(longest_m / MOST_ACROSS);
        let size = [0, 1].map(|axis| (reach[axis] / texel_m).ceil() as usize + 1);
        Some(Self { size, sun_from_row, texels_per_m: 1.0 / texel_m, low, far: high.z + 1.0 })
    }

    /// Column, row and nearness to the sun.
    fn turned(&self, place: &Vec3) -> Vec3 {
        let seen = self.sun_from_row * place;
        let [column, row] = [0, 1].map(|axis| (seen[axis] - self.low[axis]) * self.texels_per_m);
        Vec3::new(column, row, self.far - seen.z)
    }
}

impl View for FromSun {
    fn size(&self) -> [usize; 2] {
        self.size
    }

    fn may_show(&self, _centre: &Vec3, _radius_m: f32) -> bool {
        true
    }

    fn project(&self, place: &Vec3) -> Option<Vec3> {
        Some(self.turned(place))
    }
}
