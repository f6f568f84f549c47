//! Which triangle each sample of a picture shows: bands of rows in parallel, triangles in their order in each, so that
//! the number of threads changes nothing.

use crate::Vec3;
use crate::shapes::{Mesh, Part, Thing};
use rayon::prelude::*;

/// In place of a triangle where a sample shows none.
pub const NOTHING: u32 = u32::MAX;

/// Rows of samples that one thread fills.
const BAND: usize = 24;

/// Parts that one thread projects at a time.
const PARTS: usize = 512;

/// Of a triangle's height; what lies so close to an edge belongs to both triangles, or rounding would leave gaps.
const ON_EDGE: f32 = 1e-5;

/// How places come to samples.
pub trait View: Sync {
    /// Columns and rows of samples; the centre of the first lies at (1/2, 1/2).
    fn size(&self) -> [usize; 2];
    /// Whether anything within a radius of a place can be in the picture.
    fn may_show(&self, centre: &Vec3, radius_m: f32) -> bool;
    /// Column, row and nearness: above 0, greater in front, and flat over the picture of a flat triangle.
    fn project(&self, place: &Vec3) -> Option<Vec3>;
    /// How far a part stands from its place in the mesh.
    fn moved(&self, _part: &Part) -> Vec3 {
        Vec3::zeros()
    }
}

/// What the samples of a picture show, row by row.
#[derive(Debug)]
pub struct Samples {
    /// Columns.
    pub width: usize,
    /// As [`View::project`] says; 0 where there is nothing.
    pub nearness: Vec<f32>,
    /// Its triangle, or [`NOTHING`].
    pub triangle: Vec<u32>,
}

/// A triangle in the picture.
struct Flat {
    corners: [Vec3; 3],
    triangle: u32,
}

/// Triangles of some parts, and which of them touch each band.
struct Projected {
    flats: Vec<Flat>,
    bands: Vec<Vec<u32>>,
}

/// Finds the nearest triangle of each sample.
pub fn draw(mesh: &Mesh, view: &impl View) -> Samples {
    let [width, height] = view.size();
    let projected: Vec<_> = mesh.parts.par_chunks(PARTS).map(|parts| project(mesh, parts, view)).collect();
    let mut nearness = vec![0.0; width * height];
    let mut triangle = vec![NOTHING; width * height];
    let bands = nearness.par_chunks_mut(width * BAND).zip(triangle.par_chunks_mut(width * BAND));
    bands.enumerate().for_each(|(number, (nearness, triangle))| {
        let mut band = Band { first_row: number * BAND, width, nearness, triangle };
        for part in &projected {
            for &flat in &part.bands[number] {
                band.fill(&part.flats[flat as usize]);
            }
        }
    });
    Samples { width, nearness, triangle }
}

fn project(mesh: &Mesh, parts: &[Part], view: &impl View) -> Projected {
    let [width, height] = view.size();
    let mut found = Projected { flats: Vec::new(), bands: vec![Vec::new(); height.div_ceil(BAND)] };
    let mut corners = Vec::new();
    for part in parts {
        let moved = view.moved(part);
        if !view.may_show(&(part.centre + moved), part.radius_m) {
            continue;
        }
        let places = &mesh.corners[part.corners.start as usize..part.corners.end as usize];
        corners.clear();
        corners.extend(places.iter().map(|corner| view.project(&(corner.position + moved))));
        let is_solid = !matches!(part.thing, Thing::Leaf(_));
        for triangle in part.triangles.clone() {
            let numbers = mesh.triangles[triangle as usize];
            let [Some(a), Some(b), Some(c)] = numbers.map(|corner| corners[(corner - part.corners.start) as usize])
            else {
                continue;
            };
            // Seen along the third axis of a right-handed frame, what faces the viewer turns clockwise.
            let turn = cross(&(b - a), &(c - a));
            if !(is_solid && turn >= 0.0) && turn != 0.0 {
                found.add(Flat { corners: [a, b, c], triangle }, [width, height]);
            }
        }
    }
    found
}

fn cross(a: &Vec3, b: &Vec3) -> f32 {
    a.x * b.y - a.y * b.x
}

/// First sample whose centre lies at `low` or after, and the one after the last that lies at `high` or before.
fn covered(low: f32, high: f32, count: usize) -> (usize, usize) {
    let first = (low - 0.5).ceil().max(0.0) as usize;
    let end = ((high - 0.5).floor() + 1.0).max(0.0) as usize;
    (first, end.min(count))
}

fn bounds(corners: &[Vec3; 3], axis: usize) -> (f32, f32) {
    let [a, b, c] = [corners[0][axis], corners[1][axis], corners[2][axis]];
    (a.min(b).min(c) - ON_EDGE, a.max(b).max(c) + ON_EDGE)
}

impl Projected {
    fn add(&mut self, flat: Flat, size: [usize; 2]) {
        let (left, right) = bounds(&flat.corners, 0);
        let (top, bottom) = bounds(&flat.corners, 1);
        let (first_column, end_column) = covered(left, right, size[0]);
        let (first_row, end_row) = covered(top, bottom, size[1]);
        if first_column >= end_column || first_row >= end_row {
            return;
        }
        for band in first_row / BAND..=(end_row - 1) / BAND {
            self.bands[band].push(self.flats.len() as u32);
        }
        self.flats.push(flat);
    }
}

/// Some rows of the picture.
struct Band<'a> {
    first_row: usize,
    width: usize,
    nearness: &'a mut [f32],
    triangle: &'a mut [u32],
}

impl Band<'_> {
    /// Takes the samples that a triangle covers and that show nothing nearer; of two as near the first one stays.
    fn fill(&mut self, flat: &Flat) {
        let [a, b, c] = flat.corners;
        let (ab, ac) = (b - a, c - a);
        let area = cross(&ab, &ac);
        let (left, right) = bounds(&flat.corners, 0);
        let (top, bottom) = bounds(&flat.corners, 1);
        let (first_column, end_column) = covered(left, right, self.width);
        let (first_row, end_row) = covered(top, bottom, self.first_row + self.nearness.len() / self.width);
        let (to_b, to_c) = ([ac.y / area, -ac.x / area], [-ab.y / area, ab.x / area]);
        for row in first_row.max(self.first_row)..end_row {
            let down = row as f32 + 0.5 - a.y;
            let start = (row - self.first_row) * self.width;
            let samples = start + first_column..start + end_column;
            let shown = self.nearness[samples.clone()].iter_mut().zip(&mut self.triangle[samples]);
            for (column, (nearness, triangle)) in shown.enumerate() {
                let right = (first_column + column) as f32 + 0.5 - a.x;
                let of_b = right * to_b[0] + down * to_b[1];
                let of_c = right * to_c[0] + down * to_c[1];
                let here = a.z + of_b * ab.z + of_c * ac.z;
                if of_b >= -ON_EDGE && of_c >= -ON_EDGE && of_b + of_c <= 1.0 + ON_EDGE && here > *nearness {
                    *nearness = here;
                    *triangle = flat.triangle;
                }
            }
        }
    }
}
