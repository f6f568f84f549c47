//! Draws stereo pictures of orchard rows, fast and with exact truth: depth and fruit of the left picture at the centre
//! of each pixel.
//!
//! A [`Row`] of fruits, limbs and leaves becomes triangles; a depth buffer says which of them each sample shows; light
//! comes from the sun with its shadows, from the sky as far as leaves leave it open, and through leaves. A pixel is the
//! mean of 3 x 3 samples, the middle one at its centre. The same input gives the same pictures on any number of threads.
//!
//! Frames: the row's is x along it, y in depth, z up; cameras look along z, x right, y down. Metres; linear RGB.

mod eye;
mod light;
mod noise;
mod raster;
pub mod row;
mod scene;
mod shapes;
mod surfaces;

pub use light::Weather;
pub use row::{Fruit, Leaf, Limb, Row};
pub use scene::{Pair, Scene};

/// A place, a direction or a colour.
pub type Vec3 = pomona::nalgebra::Vector3<f32>;
