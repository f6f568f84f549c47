//! What is seen far away: the sky, clouds, and a hedge at the horizon.

use super::Weather;
use crate::Vec3;
use crate::noise::{blend, octaves, step};

/// Radiance by direction.
#[derive(Debug)]
pub struct Sky {
    weather: Weather,
    seed: u32,
}

/// Share of the light that far trees scatter, and how much of the air's own light lies over them.
const FAR_TREES: Vec3 = Vec3::new(0.045, 0.075, 0.03);
const HAZE: f32 = 0.16;

impl Sky {
    /// The sky of a visit.
    pub fn new(weather: Weather, seed: u32) -> Self {
        Self { weather, seed: seed ^ 0x51C1 }
    }

    /// The sky without clouds or hedge, for light from all sides.
    pub fn smooth(&self, direction: &Vec3) -> Vec3 {
        let weather = &self.weather;
        let up = step(-0.05, 0.9, direction.z).sqrt();
        let glow = direction.dot(&weather.to_sun).max(0.0).powi(12) * weather.sun_strength.min(1.0);
        blend(weather.horizon_colour, weather.sky_colour, up) + weather.sun_colour * (0.25 * glow)
    }

    /// What a camera sees there.
    pub fn seen(&self, direction: &Vec3) -> Vec3 {
        let direction = direction.normalize();
        let hedge = self.hedge(&direction);
        let clear = self.clouded(&direction);
        if hedge <= 0.0 { clear } else { blend(clear, self.trees(&direction), hedge) }
    }

    fn clouded(&self, direction: &Vec3) -> Vec3 {
        let clear = self.smooth(direction);
        let ceiling = direction / direction.z.max(0.08);
        let cloud = octaves(Vec3::new(0.8 * ceiling.x, 0.8 * ceiling.y, 0.3), 4, self.seed);
        if self.weather.sun_strength > 0.0 {
            let white = self.weather.horizon_colour + self.weather.sun_colour * 0.25;
            return blend(clear, white, 0.6 * step(0.52, 0.75, cloud));
        }
        clear * (0.75 + 0.5 * cloud)
    }

    /// Whether far trees stand there, 0 to 1.
    fn hedge(&self, direction: &Vec3) -> f32 {
        let around = Vec3::new(direction.x, direction.y, 0.0).normalize();
        let height = 0.03 + 0.09 * octaves(around * 5.0, 2, self.seed + 9) * octaves(around * 60.0, 3, self.seed + 17);
        step(height + 0.004, height - 0.004, direction.z)
    }

    fn trees(&self, direction: &Vec3) -> Vec3 {
        let leaves = 0.4 + 1.2 * octaves(direction * 170.0, 3, self.seed + 31);
        let light = self.weather.sky_colour + self.weather.sun() * 0.5;
        blend(FAR_TREES.component_mul(&light) * leaves, self.weather.horizon_colour, HAZE)
    }
}
