//! A row in its light, and the pairs that a stereo camera sees of it.

use crate::Vec3;
use crate::eye::{Eye, Gust, SAMPLES};
use crate::light::{Light, Weather};
use crate::raster::{NOTHING, Samples, View, draw};
use crate::row::Row;
use crate::shapes::{Mesh, Thing};
use crate::surfaces::ground::Ground;
use crate::surfaces::{Spot, surface};
use pomona::{Camera, Pose};
use rayon::prelude::*;

/// Samples of a pixel.
const COUNT: usize = SAMPLES * SAMPLES;

/// Farther away the ground is not told from the far hedge.
const FARTHEST_GROUND_M: f32 = 150.0;

/// A pair and the truth of its left picture, row by row.
#[derive(Debug)]
pub struct Pair {
    /// Linear RGB as light arrives: red, green, blue of each pixel.
    pub left: Vec<f32>,
    /// The right camera's.
    pub right: Vec<f32>,
    /// Along the optical axis at the pixel's centre, metres; infinite for the sky.
    pub depth_m: Vec<f32>,
    /// Fruit at the pixel's centre, 0 for none.
    pub ids: Vec<u16>,
}

/// A row, its shapes and its light: made once for a recording.
#[derive(Debug)]
pub struct Scene {
    row: Row,
    mesh: Mesh,
    light: Light,
    ground: Ground,
    wind_m: f32,
    seed: u32,
}

/// One picture with its truth.
struct Picture {
    colours: Vec<f32>,
    depth_m: Vec<f32>,
    ids: Vec<u16>,
}

/// What a sample shows: where, and of what.
#[derive(Debug, Clone, Copy)]
struct Seen {
    of: Of,
    column: usize,
    row: usize,
    depth_m: f32,
}

/// What can be seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Of {
    Sky,
    Ground,
    /// The part of the mesh; its triangle is the sample's.
    Part(u32),
}

impl Scene {
    /// Builds shapes, shadows and the light among the leaves; `places` are all that the camera will be at, so that each
    /// thing has the shape that its nearest view deserves, in all of them.
    pub fn new(row: Row, camera: &Camera, places: &[Vec3], weather: Weather, seed: u32) -> Self {
        let focal_px = camera.fx.max(camera.fy) as f32;
        let px_per_m = |place: &Vec3| {
            let nearest = places.iter().map(|eye| (eye - place).norm_squared()).fold(f32::INFINITY, f32::min);
            focal_px / nearest.sqrt().max(0.2)
        };
        let mesh = Mesh::new(&row, px_per_m);
        let light = Light::new(&row, &mesh, weather, seed);
        Self { ground: Ground::new(&row, seed), row, mesh, light, wind_m: weather.wind_m, seed }
    }

    /// The pair that a camera takes; the number of the frame tells one gust of wind from another.
    pub fn pair(&self, camera: &Camera, session_from_camera: &Pose, frame: u32) -> Pair {
        let gust = Gust { sigma_m: self.wind_m, seed: self.seed ^ frame.wrapping_mul(0x9E37_79B9) };
        let eye = |aside_m| Eye::new(camera, session_from_camera, aside_m, gust);
        let left = self.picture(&eye(0.0));
        let right = self.picture(&eye(camera.baseline_m.unwrap_or(0.0)));
        Pair { left: left.colours, right: right.colours, depth_m: left.depth_m, ids: left.ids }
    }

    fn picture(&self, eye: &Eye) -> Picture {
        let samples = draw(&self.mesh, eye);
        let [width, height] = eye.size().map(|count| count / SAMPLES);
        let mut picture = Picture {
            colours: vec![0.0; 3 * width * height],
            depth_m: vec![0.0; width * height],
            ids: vec![0; width * height],
        };
        let rows = picture.colours.par_chunks_mut(3 * width);
        let rows = rows.zip(picture.depth_m.par_chunks_mut(width)).zip(picture.ids.par_chunks_mut(width));
        rows.enumerate().for_each(|(row, ((colours, depth_m), ids))| {
            for column in 0..width {
                let centre = self.pixel(eye, &samples, column, row, &mut colours[3 * column..3 * column + 3]);
                (depth_m[column], ids[column]) = (centre.depth_m, self.id(centre.of));
            }
        });
        picture
    }

    /// Writes the mean colour of a pixel's samples and gives the middle one; light is reckoned once for each thing in it.
    fn pixel(&self, eye: &Eye, samples: &Samples, column: usize, row: usize, colour: &mut [f32]) -> Seen {
        let seen: [Seen; COUNT] = std::array::from_fn(|number| {
            self.seen(eye, samples, SAMPLES * column + number % SAMPLES, SAMPLES * row + number / SAMPLES)
        });
        let mut sum = Vec3::zeros();
        for (number, first) in seen.iter().enumerate() {
            if seen[..number].iter().any(|before| before.of == first.of) {
                continue;
            }
            let same = || seen[number..].iter().filter(|other| other.of == first.of);
            let count = same().count();
            let amid = same().nth(count / 2).unwrap_or(first);
            sum += self.colour(eye, samples, amid) * count as f32;
        }
        colour.copy_from_slice((sum / COUNT as f32).as_slice());
        seen[COUNT / 2]
    }

    fn seen(&self, eye: &Eye, samples: &Samples, column: usize, row: usize) -> Seen {
        let at = row * samples.width + column;
        let down = eye.ray(column, row).z;
        let ground_m = if down < 0.0 { -eye.place().z / down } else { f32::INFINITY };
        let depth_m = 1.0 / samples.nearness[at];
        let triangle = samples.triangle[at];
        if triangle != NOTHING && !(0.0..depth_m).contains(&ground_m) {
            return Seen { of: Of::Part(self.mesh.part_of[triangle as usize]), column, row, depth_m };
        }
        if (0.0..FARTHEST_GROUND_M).contains(&ground_m) {
            return Seen { of: Of::Ground, column, row, depth_m: ground_m };
        }
        Seen { of: Of::Sky, column, row, depth_m: f32::INFINITY }
    }

    fn colour(&self, eye: &Eye, samples: &Samples, seen: &Seen) -> Vec3 {
        let ray = eye.ray(seen.column, seen.row);
        match seen.of {
            Of::Sky => self.light.sky.seen(&ray),
            Of::Ground => self.ground(eye, &ray, seen.depth_m),
            Of::Part(_) => {
                self.thing(eye, samples.triangle[seen.row * samples.width + seen.column], &ray, seen.depth_m)
            }
        }
    }

    fn thing(&self, eye: &Eye, triangle: u32, ray: &Vec3, depth_m: f32) -> Vec3 {
        let part = self.mesh.part(triangle);
        let corners = self.mesh.triangle(triangle);
        let spot = Spot::new(corners, &eye.moved(part), &eye.place(), ray, eye.pixel_m(depth_m));
        let surface = surface(&self.row, part.thing, &spot);
        self.light.leaving(&surface, &spot.rest, &spot.to_viewer)
    }

    fn ground(&self, eye: &Eye, ray: &Vec3, depth_m: f32) -> Vec3 {
        let place = eye.place() + ray * depth_m;
        let surface = self.ground.surface(&place, eye.pixel_m(depth_m));
        self.light.leaving(&surface, &place, &-ray.normalize())
    }

    /// Label of a fruit, 0 of all else.
    fn id(&self, of: Of) -> u16 {
        let Of::Part(part) = of else { return 0 };
        let Thing::Fruit(number) = self.mesh.parts[part as usize].thing else { return 0 };
        self.row.fruits[number as usize].id
    }
}
