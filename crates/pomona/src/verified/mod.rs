//! The verified method: seeds propose poses, the fruits around them decide.
//!
//! 1. Seeds of four fruits, their metric codes (invariant ones where the scale is free), near-tie labelings included,
//!    find candidates in the map (`seeds`, `search`).
//! 2. Each candidate's pose is weighed by the log-odds of the fruits around it against what chance predicts at the
//!    local density, with an early exit (`proposal`, `vertical`); the best of different poses (`contender`) are refined
//!    (`hypothesis`). A fruit that several claim is the strongest claim's (`claims`).
//! 3. Verified seeds grow over the overlap in rigid patches with a smooth displacement (`growth`), and beyond gaps (`bridges`).
//! 4. A pose is accepted when its log-odds exceed what the number of tries lets chance reach (`acceptance`), hold when every
//!    fruit is predicted without its own partner (`evidence`), and are twice those of any other pose (`doubts`); or when it
//!    stands out of all others of the search (`outlier`).
//! 5. Where no constellation survives, for the noise or for want of fruits in common, the offsets of all fruits of two rows are
//!    counted under the turns that their axes leave (`laid`, `offsets`, `votes`, `axes`). All fruits at once pull such a pose into place
//!    (`soft`), and each counts as far as the other visit can have seen it (`sight`).
//! 6. What is reported is settled: the noise from distances alone (`scatter`) and which way it points from the pairs
//!    (`direction`), one-to-one pairs with probabilities (`pairing`) and patches fitted to them, in turns (`settlement`).
//!
//! Where it is known about where the query lies, seeds are looked up there in place of steps 1 and 5 (`expected`).

mod acceptance;
mod axes;
mod bearing;
mod bridges;
mod case;
mod chance;
mod claims;
pub mod compact;
mod conclusion;
mod congruent;
mod contender;
mod cut;
mod decision;
mod direction;
mod displacement;
mod doubts;
mod evidence;
mod expected;
#[cfg(test)]
mod fixture;
mod footing;
mod growth;
mod hypothesis;
mod laid;
mod landscape;
mod layers;
mod line;
mod moved;
mod offsets;
mod outlier;
mod overlap;
mod pairing;
mod parts;
mod patches;
mod proposal;
mod replaced;
mod rest;
mod scatter;
mod search;
mod seeds;
mod settlement;
mod shares;
mod sight;
mod size;
mod soft;
mod stems;
mod support;
mod translations;
mod vertical;
mod votes;

pub use acceptance::VerifiedConfig;
pub(crate) use case::{SEED_SIGMA, VerifiedMap};
pub(crate) use chance::{SEEN, kernels_among};
pub(crate) use contender::first_of_each;
pub(crate) use decision::{MAX_FRUITS, pairs_under, search};
pub(crate) use expected::search_expected;
pub(crate) use landscape::Landscape;
pub(crate) use seeds::{COMPANIONS, Quad, SHORTEST, SeedIndex, WITHIN, canonical, frame, near_ties};
