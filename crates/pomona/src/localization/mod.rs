//! Where the camera is, from the fruits that it sees: six degrees of freedom in the map, with an honest covariance.
//!
//! 1. From nothing, the verified method finds the fruits of a frame in the map ([`crate::matching`]).
//! 2. With a pose to start from, found, or the last one and the motion since, every sighting is weighed against the
//!    map's fruits around it, each with its own covariance, and against a stranger; the pose follows from the weights
//!    and the weights from the pose (`alignment`).
//! 3. What neighbouring fruits share, sag and drift, does not average out: the covariance counts it (`shared`),
//!    as far as residuals show it (`residuals`).
//! 4. A frame with few fruits is joined by the frames before it (`window`); where there are none at all, the motion
//!    alone carries the pose as long as it is sure (`belief`).
//! 5. Motions that are told and fall short alike are noticed and put right (`told_motions`, `slip`).
//! 6. A pose that the fruits of the newest frame contradict is lost, and looked for from nothing (`own`, `doubt`).
//!
//! Equations, assumptions and limits: `docs/localization.md`.

mod alignment;
mod answer;
mod belief;
mod config;
mod doubt;
mod known;
mod localizer;
mod own;
mod residuals;
mod shared;
mod sightings;
mod slip;
mod strangers;
mod told_motions;
mod window;

pub use answer::{Localization, MapPair, ToldMotion};
pub use config::LocalizationConfig;
pub use localizer::Localizer;
