//! Finds the same fruits again.
//!
//! Two visits to one row of trees give two clouds of fruit centroids whose relative pose is unknown. This crate says
//! which fruit is which, where the visit lies in the map, and when there is no answer. It is pure geometry: no files,
//! no printing, the same output for the same input on any number of threads.
//!
//! Lengths are metres, angles radians, frames right-handed. A transform `map_from_query` takes points of the query
//! into the map.

pub mod appearance;
pub mod assignment;
pub mod bundle;
pub mod camera;
pub mod clique;
pub mod cloud;
pub mod codebook;
pub mod completion;
mod conditioning;
pub mod config;
pub mod constellation;
pub mod descriptor;
pub mod error;
mod evidence;
pub mod geometry;
pub mod index;
pub mod lifting;
pub mod matching;
mod meanings;
pub mod odometry;
mod paper;
pub mod ransac;
pub mod row_search;
pub mod stereo;
pub mod tracking;
pub mod verified;
pub mod voting;

pub use cloud::{FruitCloud, Views};
pub use config::Config;
pub use error::{Error, Result};
pub use geometry::{Scale, Similarity};
pub use matching::{MapIndex, Match, Method, Pair, Registration, Request, Verdict, match_clouds};
pub use verified::VerifiedConfig;

/// The linear algebra whose types the interface uses.
pub use nalgebra;
