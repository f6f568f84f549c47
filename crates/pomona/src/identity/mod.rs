//! One identity for each fruit over all visits: what is heavy in it.
//!
//! 1. A visit is looked for in a large map by a few seeds of each of its stretches (`whereabouts`), so that it need be
//!    matched with what is near alone.
//! 2. Pairs of all matches are put into one assignment (`contraction`).
//!
//! Equations and what surrounds this are in `docs/identities.md`.

mod contraction;
mod whereabouts;

pub use contraction::{Evidence, contracted};
pub use whereabouts::{Whereabouts, whereabouts};
