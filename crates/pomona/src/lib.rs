//! Finds the same fruits again.
//!
//! Two visits to one row of trees give two clouds of fruit centroids whose relative pose is unknown. This crate says
//! which fruit is which, where the visit lies in the map, and when there is no answer. It is pure geometry: no files,
//! no printing, the same output for the same input on any number of threads.
//!
//! Lengths are metres, angles radians, frames right-handed. A transform `map_from_query` takes points of the query
//! into the map.

pub mod answer;
pub mod assignment;
pub mod bundle;
pub mod camera;
pub mod cloud;
mod conditioning;
pub mod config;
pub mod error;
pub mod geometry;
pub mod lifting;
pub mod look;
pub mod matching;
mod meanings;
pub mod neighbours;
pub mod paper;
pub mod pose;
mod random;
pub mod row_search;
pub mod stereo;
pub mod tracking;
pub mod verified;

pub use answer::{Match, Pair, Registration, Verdict};
pub use camera::Camera;
pub use cloud::{FruitCloud, Views};
pub use config::Config;
pub use error::{Error, Result};
pub use geometry::{Scale, Similarity};
pub use matching::{MapIndex, Method, Request, match_clouds};
pub use pose::Pose;
pub use verified::VerifiedConfig;

/// The linear algebra whose types the interface uses.
pub use nalgebra;
