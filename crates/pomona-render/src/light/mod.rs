//! Light: the sun with its shadows, the sky, and what leaves leave of it.
//!
//! Radiance is counted against a white sky's, 1; a white wall that sees nothing but that sky shows 1 too.

mod canopy;
mod shadow;
mod sky;

use crate::Vec3;
use crate::row::Row;
use crate::shapes::Mesh;
use canopy::Canopy;
use shadow::ShadowMap;
pub use sky::Sky;

/// The light of a visit.
#[derive(Debug, Clone, Copy)]
pub struct Weather {
    /// Unit vector towards the sun.
    pub to_sun: Vec3,
    /// Irradiance of the sun on what faces it, against a white sky's.
    pub sun_strength: f32,
    /// Linear RGB.
    pub sun_colour: Vec3,
    /// Linear RGB overhead.
    pub sky_colour: Vec3,
    /// Linear RGB low down.
    pub horizon_colour: Vec3,
    /// Standard deviation of how far leaves are moved in a frame, metres.
    pub wind_m: f32,
}

impl Weather {
    fn sun(&self) -> Vec3 {
        self.sun_colour * self.sun_strength
    }

    fn has_sun(&self) -> bool {
        self.sun_strength > 0.0 && self.to_sun.z > 0.0
    }
}

/// How a place sends light on.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    /// Unit vector, on the side of the viewer.
    pub normal: Vec3,
    /// Share of the light that is scattered back.
    pub albedo: Vec3,
    /// Share of the light from behind that comes through.
    pub transmitted: Vec3,
    /// Share that is mirrored head-on.
    pub gloss: f32,
    /// 0 a mirror, 1 dull.
    pub roughness: f32,
}

impl Surface {
    /// One that only scatters.
    pub fn dull(normal: Vec3, albedo: Vec3) -> Self {
        Self { normal, albedo, transmitted: Vec3::zeros(), gloss: 0.0, roughness: 1.0 }
    }
}

/// All light that falls on a row.
#[derive(Debug)]
pub struct Light {
    weather: Weather,
    /// What is seen above the ground.
    pub sky: Sky,
    shadow: Option<ShadowMap>,
    canopy: Canopy,
}

impl Light {
    /// Light for a row at rest.
    pub fn new(row: &Row, mesh: &Mesh, weather: Weather, seed: u32) -> Self {
        let sky = Sky::new(weather, seed);
        let shadow = weather.has_sun().then(|| ShadowMap::new(mesh, &weather.to_sun)).flatten();
        let canopy = Canopy::new(row, &sky, weather.sun() * weather.to_sun.z.max(0.0));
        Self { weather, sky, shadow, canopy }
    }

    /// Radiance that leaves a place towards the viewer; `rest` is where the place is in still air.
    pub fn leaving(&self, surface: &Surface, rest: &Vec3, to_viewer: &Vec3) -> Vec3 {
        let normal = surface.normal;
        let ambient = self.canopy.around_place(rest);
        let mut radiance = ambient.falling_on(&normal).component_mul(&surface.albedo);
        if surface.transmitted.max() > 0.0 {
            radiance += ambient.falling_on(&-normal).component_mul(&surface.transmitted);
        }
        if surface.gloss > 0.0 {
            let mirrored = normal * (2.0 * normal.dot(to_viewer)) - to_viewer;
            let share = mirrored_share(surface, normal.dot(to_viewer));
            radiance += ambient.falling_on(&mirrored) * share;
        }
        if self.weather.has_sun() {
            radiance += self.of_sun(surface, rest, to_viewer).component_mul(&self.weather.sun());
        }
        radiance
    }

    fn of_sun(&self, surface: &Surface, rest: &Vec3, to_viewer: &Vec3) -> Vec3 {
        let facing = surface.normal.dot(&self.weather.to_sun);
        let share = if facing > 0.0 { surface.albedo } else { surface.transmitted } * facing.abs();
        let glint = if facing > 0.0 { self.glint(surface, to_viewer) * facing } else { 0.0 };
        if glint <= 0.0 && share.max() <= 0.0 {
            return Vec3::zeros();
        }
        let side = surface.normal * facing.signum();
        let lit = self.shadow.as_ref().map_or(1.0, |shadow| shadow.lit(rest, &side));
        (share + Vec3::repeat(glint)) * lit
    }

    /// Highlight of the sun: GGX (Walter et al. 2007) with the visibility of Kelemen and Szirmay-Kalos (2001).
    fn glint(&self, surface: &Surface, to_viewer: &Vec3) -> f32 {
        if surface.gloss <= 0.0 {
            return 0.0;
        }
        let half = (self.weather.to_sun + to_viewer).normalize();
        let square = surface.roughness.powi(4);
        let along = surface.normal.dot(&half).max(0.0);
        let spread = square / (along * along * (square - 1.0) + 1.0).powi(2);
        let towards = half.dot(to_viewer).max(0.1);
        spread * fresnel(surface.gloss, towards) / (4.0 * towards * towards)
    }
}

/// Share of the light from all around that is mirrored: what is rough mirrors less at low angles (Lagarde 2011).
fn mirrored_share(surface: &Surface, cosine: f32) -> f32 {
    let at_edge = (1.0 - surface.roughness).max(surface.gloss);
    surface.gloss + (at_edge - surface.gloss) * (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
}

/// Share that is mirrored under an angle (Schlick 1994).
fn fresnel(head_on: f32, cosine: f32) -> f32 {
    head_on + (1.0 - head_on) * (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
}
