//! Finds the same fruits again.
//!
//! Two visits to one row of trees give two clouds of fruit centroids whose relative pose is unknown. This crate says
//! which fruit is which, where the visit lies in the map, and when there is no answer. It is pure geometry: no files,
//! no printing, no network; the same output for the same input on any number of threads.
//!
//! ```
//! use pomona::nalgebra::{Point3, Rotation3, Vector3};
//! use pomona::{Config, FruitCloud, Request, Similarity, Verdict, match_clouds};
//!
//! // Forty fruits of a tree, as the first visit placed them ...
//! let mut state = 7_u64;
//! let mut uniform = || {
//!     state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
//!     (state >> 33) as f64 / (1_u64 << 31) as f64
//! };
//! let map: Vec<_> = (0..40).map(|_| Point3::new(uniform(), 2.0 * uniform(), uniform())).collect();
//!
//! // ... and thirty of them as the second one did, which began elsewhere and counted from the other end.
//! let turn = Rotation3::from_euler_angles(0.1, -0.4, 2.0);
//! let query_from_map = Similarity::rigid(turn, Vector3::new(3.0, -1.0, 0.5));
//! let query = map.iter().rev().take(30).map(|fruit| query_from_map.apply(fruit)).collect();
//!
//! let (query, map) = (FruitCloud::from_positions(query), FruitCloud::from_positions(map));
//! let found = match_clouds(&query, &map, &Request::default(), &Config::default())?;
//!
//! assert_eq!(found.verdict, Verdict::Found);
//! assert_eq!(found.pairs.len(), 30);
//! assert!(found.pairs.iter().all(|pair| pair.map == 39 - pair.query && pair.probability > 0.9));
//! let map_from_query = found.registration.expect("found").map_from_query.to_matrix();
//! assert!((map_from_query - query_from_map.inverse().to_matrix()).norm() < 0.01);
//! # Ok::<(), pomona::Error>(())
//! ```
//!
//! # The data's way
//!
//! Each stage takes structs of arrays and gives one, so each can be used alone:
//!
//! | from | by | to |
//! |---|---|---|
//! | boxes, a stereo pair or a depth picture | [`stereo::read`], [`lifting::lift`] | fruits in the camera's frame |
//! | boxes in pictures | [`look::look_of`] | how much they look like fruit |
//! | boxes frame by frame, poses | [`tracking::Tracker`] | which box shows which fruit |
//! | pictures, places, relative poses | [`bundle::adjust`], [`bundle::locate`] | poses and points |
//! | sightings of one fruit | [`lifting::fusion`] | its place and diameter |
//! | two [`FruitCloud`]s | [`match_clouds`] | a [`Match`]: [`Verdict`], [`Registration`], [`Pair`]s |
//! | a map and many queries | [`MapIndex`] | the same, the map prepared once |
//! | a map and the fruits of a frame | [`Localizer`] | a [`Localization`]: where the camera is |
//!
//! # What holds everywhere
//!
//! - Lengths are metres, angles radians, times seconds. Frames are right-handed, cameras x right, y down, z forward. A
//!   transform `map_from_query` takes points of the query into the map; it is a [`Similarity`], and a camera's is a [`Pose`].
//! - That there is no match is a [`Verdict`]. An [`Error`] is wrong input, and its text one line that tells what to correct.
//! - Every threshold has a name, a unit and a reason. Those that are settings are in [`Config`], which serde reads and
//!   writes; a name that it does not know is an error.
//! - Work is shared among the threads of the rayon pool in which a function is called. Seeds are explicit.
//!
//! # Where to read on
//!
//! [`paper`] and [`verified`] are the two methods that match: [`Method`] chooses. [`neighbours`] tells which search
//! structure answers which question. `examples/match_two_visits.rs` reads two clouds and prints what a match gives;
//! `examples/map_and_camera.rs` asks one map many things: an index of a file, a pose that is known to some decimetres, a camera. The
//! equations, with their assumptions and limits, are in `docs/` of the repository: `algorithm.md`, `how-it-decides.md`,
//! `depth.md`, `tracking.md`.

pub mod answer;
pub mod assignment;
mod beliefs;
pub mod bundle;
pub mod camera;
pub mod cloud;
mod conditioning;
pub mod config;
pub mod error;
pub mod geometry;
pub mod identity;
pub mod lifting;
pub mod localization;
pub mod look;
pub mod matching;
mod meanings;
mod moments;
pub mod neighbours;
pub mod odometry;
pub mod paper;
pub mod pose;
mod principal;
mod random;
pub mod row_search;
mod statistics;
pub mod stereo;
pub mod tracking;
pub mod verified;

pub use answer::{Match, Pair, Registration, Verdict};
pub use camera::Camera;
pub use cloud::{FruitCloud, Views};
pub use config::Config;
pub use error::{Error, Result};
pub use geometry::{Scale, Similarity};
pub use localization::{Localization, Localizer, ToldMotion};
pub use matching::{MapIndex, Method, ReadyCloud, Request, match_clouds, match_expected};
pub use pose::Pose;
pub use verified::VerifiedConfig;

/// The linear algebra whose types the interface uses.
pub use nalgebra;
