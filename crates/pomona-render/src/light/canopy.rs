//! Light from all sides among leaves: a coarse grid of how much leaf there is, and in each of its cells the light that
//! falls on a wall facing along each axis.

use super::Sky;
use crate::Vec3;
use crate::row::Row;
use rayon::prelude::*;
use std::f32::consts::PI;

/// Least side of a cell, and the most cells.
const CELL_M: f32 = 0.18;
const MOST_CELLS: f32 = 150e3;
const MOST_ALONG: f32 = 1000.0;

/// Free air kept around the leaves.
const MARGIN_M: f32 = 1.2;

/// How far leaves hide the sky, and in which steps that is looked at.
const REACH_STEPS: usize = 12;

/// Directions that light comes from.
const DIRECTIONS: usize = 48;

/// Leaves that face anywhere cover half their area (the projection function of Ross, 1981); wood adds to it.
const COVERED: f32 = 0.65;

/// Share of the light that leaves scatter on, and the ground.
const LEAVES: Vec3 = Vec3::new(0.04, 0.075, 0.02);
const GROUND: Vec3 = Vec3::new(0.10, 0.12, 0.05);

/// Share of the sun's light on the ground that comes through the trees.
const SUN_ON_GROUND: f32 = 0.45;

/// Light on walls that face +x, -x, +y, -y, +z, -z.
type Walls = [Vec3; 6];

/// The grid.
#[derive(Debug)]
pub struct Canopy {
    low: Vec3,
    cells_per_m: f32,
    size: [usize; 3],
    walls: Vec<Walls>,
}

/// What comes from outside the leaves.
struct Outside<'a> {
    sky: &'a Sky,
    ground: Vec3,
    leaves: Vec3,
}

impl Canopy {
    /// Light in still air; `sun_on_ground` is the sun's irradiance on the level.
    pub fn new(row: &Row, sky: &Sky, sun_on_ground: Vec3) -> Self {
        let mut grid = Self::around(row);
        let covers = grid.covers(row);
        let above = sky.smooth(&Vec3::z());
        let outside = Outside {
            sky,
            ground: GROUND.component_mul(&(above * 0.6 + sun_on_ground * SUN_ON_GROUND)),
            leaves: LEAVES.component_mul(&(above * 0.7 + sun_on_ground * 0.6)),
        };
        let directions = directions();
        let count = grid.size.iter().product();
        let walls = (0..count).into_par_iter();
        grid.walls = walls.map(|cell| grid.walls_of(grid.middle(cell), &covers, &directions, &outside)).collect();
        grid
    }

    fn around(row: &Row) -> Self {
        let none = (Vec3::zeros(), Vec3::zeros());
        let bounds = row.leaves.iter().map(|leaf| (leaf.base, leaf.base));
        let (low, high) = bounds.reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1))).unwrap_or(none);
        let low = Vec3::new(low.x - MARGIN_M, low.y - MARGIN_M, 0.0);
        let reach = high + Vec3::new(MARGIN_M, MARGIN_M, MARGIN_M) - low;
        let cell_m = CELL_M.max((reach.product() / MOST_CELLS).cbrt()).max(reach.max() / MOST_ALONG);
        let size = [0, 1, 2].map(|axis| (reach[axis] / cell_m).ceil().max(2.0) as usize);
        Self { low, cells_per_m: 1.0 / cell_m, size, walls: Vec::new() }
    }

    /// For each cell how much a metre of it covers.
    fn covers(&self, row: &Row) -> Vec<f32> {
        let mut covers = vec![0.0; self.size.iter().product()];
        let per_area = COVERED * self.cells_per_m.powi(3);
        for leaf in &row.leaves {
            if let Some(cell) = self.cell(&leaf.middle()) {
                covers[cell] += per_area * leaf.area_m2();
            }
        }
        covers
    }

    fn cell(&self, place: &Vec3) -> Option<usize> {
        let at = (place - self.low) * self.cells_per_m;
        let inside = (0..3).all(|axis| at[axis] >= 0.0 && at[axis] < self.size[axis] as f32);
        inside.then(|| self.number([at.x as usize, at.y as usize, at.z as usize]))
    }

    fn number(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    fn middle(&self, cell: usize) -> Vec3 {
        let [width, depth, _] = self.size;
        let at = Vec3::new((cell % width) as f32, (cell / width % depth) as f32, (cell / width / depth) as f32);
        self.low + at.add_scalar(0.5) / self.cells_per_m
    }

    fn walls_of(&self, place: Vec3, covers: &[f32], directions: &[Vec3], outside: &Outside<'_>) -> Walls {
        let (mut walls, mut weights) = ([Vec3::zeros(); 6], [0.0; 6]);
        for direction in directions {
            let radiance = self.arriving(place, direction, covers, outside);
            for (face, (wall, weight)) in walls.iter_mut().zip(&mut weights).enumerate() {
                let facing = direction[face / 2] * if face % 2 == 0 { 1.0 } else { -1.0 };
                *wall += radiance * facing.max(0.0);
                *weight += facing.max(0.0);
            }
        }
        std::array::from_fn(|face| walls[face] / weights[face])
    }

    /// Radiance from a direction: of the sky or the ground, as far as leaves let it through, else of the leaves.
    fn arriving(&self, place: Vec3, direction: &Vec3, covers: &[f32], outside: &Outside<'_>) -> Vec3 {
        let step_m = 1.0 / self.cells_per_m;
        let mut covered = 0.0;
        for step in 1..=REACH_STEPS {
            match self.cell(&(place + direction * (step as f32 * step_m))) {
                Some(cell) => covered += covers[cell] * step_m,
                None => break,
            }
        }
        let open = (-covered).exp();
        let beyond = if direction.z < 0.0 { outside.ground } else { outside.sky.smooth(direction) };
        beyond * open + outside.leaves * (1.0 - open)
    }

    /// Light around a place, between cells linearly.
    pub fn around_place(&self, place: &Vec3) -> Ambient {
        let at = ((place - self.low) * self.cells_per_m).add_scalar(-0.5);
        let clamped = [0, 1, 2].map(|axis| at[axis].clamp(0.0, (self.size[axis] - 2) as f32 + 0.999));
        let first = clamped.map(|x| x as usize);
        let share = [0, 1, 2].map(|axis| clamped[axis] - first[axis] as f32);
        let mut sum = [Vec3::zeros(); 6];
        for corner in 0..8_usize {
            let beside = [corner & 1, corner >> 1 & 1, corner >> 2];
            let weight: f32 =
                (0..3).map(|axis| if beside[axis] == 1 { share[axis] } else { 1.0 - share[axis] }).product();
            let walls = &self.walls[self.number([0, 1, 2].map(|axis| first[axis] + beside[axis]))];
            for (sum, wall) in sum.iter_mut().zip(walls) {
                *sum += wall * weight;
            }
        }
        Ambient(sum)
    }
}

/// Light from all sides at a place.
#[derive(Debug)]
pub struct Ambient(Walls);

impl Ambient {
    /// Light that falls on a surface, against a white sky's: between the walls by the squares of its normal
    /// (`McTaggart`, 2004).
    pub fn falling_on(&self, normal: &Vec3) -> Vec3 {
        let from = |axis: usize| self.0[2 * axis + usize::from(normal[axis] < 0.0)] * (normal[axis] * normal[axis]);
        from(0) + from(1) + from(2)
    }
}

/// Directions spread evenly over the sphere (a spiral of golden angles).
fn directions() -> Vec<Vec3> {
    let golden = PI * (3.0 - 5.0_f32.sqrt());
    let at = |number: usize| {
        let up = 1.0 - (2.0 * number as f32 + 1.0) / DIRECTIONS as f32;
        let (sine, cosine) = (golden * number as f32).sin_cos();
        let out = (1.0 - up * up).sqrt();
        Vec3::new(out * cosine, out * sine, up)
    };
    (0..DIRECTIONS).map(at).collect()
}
