//! Shapes as triangles: as many as their size in the pictures deserves.

mod blade;
mod rod;
mod solid;

use crate::Vec3;
use crate::row::Row;
use rayon::prelude::*;

/// A corner of triangles.
#[derive(Debug, Clone, Copy)]
pub struct Corner {
    /// Where, metres.
    pub position: Vec3,
    /// Unit vector outwards, or of a blade's upper side.
    pub normal: Vec3,
    /// Place on the surface: of a blade 0 to 1 along and -1 to 1 across, of a rod metres along and turns around.
    pub at: [f32; 2],
}

/// What a part of the mesh is, by its number in the row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Thing {
    /// A solid: seen from outside only.
    Fruit(u32),
    /// A solid: seen from outside only.
    Limb(u32),
    /// Seen from both sides; moved by the wind.
    Leaf(u32),
}

/// One thing of the row in the mesh.
#[derive(Debug, Clone)]
pub struct Part {
    /// What it is.
    pub thing: Thing,
    /// Its corners.
    pub corners: std::ops::Range<u32>,
    /// Its triangles.
    pub triangles: std::ops::Range<u32>,
    /// A sphere around it.
    pub centre: Vec3,
    /// Radius of the sphere, metres.
    pub radius_m: f32,
}

/// All triangles of a row.
#[derive(Debug, Default)]
pub struct Mesh {
    /// Corners of all parts.
    pub corners: Vec<Corner>,
    /// Three corners each.
    pub triangles: Vec<[u32; 3]>,
    /// For each triangle the part that it belongs to.
    pub part_of: Vec<u32>,
    /// In the order fruits, limbs, leaves.
    pub parts: Vec<Part>,
}

/// Corners and triangles of one thing, by their numbers in it.
#[derive(Debug, Default)]
struct Shape {
    corners: Vec<Corner>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Builds the shapes of a row; `px_per_m` says how large a place is in the picture that shows it largest.
    pub fn new(row: &Row, px_per_m: impl Fn(&Vec3) -> f32 + Sync) -> Self {
        let fruits = row.fruits.par_iter().map(|fruit| solid::shape(fruit, px_per_m(&fruit.centre)));
        let limbs = row.limbs.par_iter().map(|limb| rod::shape(limb, px_per_m(&(0.5 * (limb.start + limb.end)))));
        let leaves = row.leaves.par_iter().map(|leaf| blade::shape(leaf, px_per_m(&leaf.base)));
        let shapes: Vec<Shape> = fruits.chain(limbs).chain(leaves).collect();
        let mut mesh = Self::default();
        for (thing, shape) in things(row).zip(shapes) {
            mesh.add(thing, shape);
        }
        mesh
    }

    fn add(&mut self, thing: Thing, shape: Shape) {
        let (first_corner, first_triangle) = (self.corners.len() as u32, self.triangles.len() as u32);
        let (centre, radius_m) = sphere_around(&shape.corners);
        let part = self.parts.len() as u32;
        self.part_of.extend(std::iter::repeat_n(part, shape.triangles.len()));
        self.triangles.extend(shape.triangles.iter().map(|corners| corners.map(|corner| corner + first_corner)));
        self.corners.extend(shape.corners);
        let (corners, triangles) =
            (first_corner..self.corners.len() as u32, first_triangle..self.triangles.len() as u32);
        self.parts.push(Part { thing, corners, triangles, centre, radius_m });
    }

    /// The part of a triangle.
    pub fn part(&self, triangle: u32) -> &Part {
        &self.parts[self.part_of[triangle as usize] as usize]
    }

    /// The corners of a triangle.
    pub fn triangle(&self, triangle: u32) -> [&Corner; 3] {
        self.triangles[triangle as usize].map(|corner| &self.corners[corner as usize])
    }
}

fn things(row: &Row) -> impl Iterator<Item = Thing> {
    let count = |number: usize| 0..number as u32;
    let fruits = count(row.fruits.len()).map(Thing::Fruit);
    fruits.chain(count(row.limbs.len()).map(Thing::Limb)).chain(count(row.leaves.len()).map(Thing::Leaf))
}

fn sphere_around(corners: &[Corner]) -> (Vec3, f32) {
    let centre = corners.iter().map(|corner| corner.position).sum::<Vec3>() / corners.len().max(1) as f32;
    let radius_m = corners.iter().map(|corner| (corner.position - centre).norm()).fold(0.0, f32::max);
    (centre, radius_m)
}

/// Two unit vectors that make a right-handed frame with a third.
pub fn across(axis: &Vec3) -> (Vec3, Vec3) {
    let aside = if axis.x.abs() < 0.7 { Vec3::x() } else { Vec3::y() };
    let first = axis.cross(&aside).normalize();
    (first, axis.cross(&first))
}
