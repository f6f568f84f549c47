//! What is near: one structure for each way of asking.
//!
//! - [`index`]: points of any dimension that stay, asked for the nearest by many queries; exact in double precision. Codes
//!   of constellations, and fruits of the paper's method.
//! - `tree`: the same question of fruits in single precision, answered point by point, in an order that never changes.
//!   The verified method sums over what it visits.
//! - `others`: the nearest other fruits of every fruit, looked up once with that tree.
//! - `code_grid`: codes of six numbers in single precision that stay, asked for all within a radius, a million times.
//!   Seeds of the verified method.
//! - `grid`: fruits that stay, asked for all within a gate that a cell holds.
//! - `vicinity`: fruits that stay, asked for the nearest within a reach that is known beforehand, by one look at a list.
//! - `moving`: points that move, come and go, asked for all in a box.
//! - `cells`: the cells that the three before, and whoever else counts by place, number and hash alike.

pub(crate) mod cells;
pub(crate) mod code_grid;
pub(crate) mod grid;
pub mod index;
pub(crate) mod moving;
pub(crate) mod others;
pub(crate) mod tree;
pub(crate) mod vicinity;
