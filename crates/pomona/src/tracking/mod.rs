//! Which box of which frame shows which fruit: fruits of one visit tracked in 3D.
//!
//! The paper's idea (Matos et al., CVPR Workshops 2024): known fruits are projected into the new frame and assigned to its
//! boxes, a box that no known fruit explains starts a fruit. Here every fruit carries a Gaussian of its place, so that
//! gates, costs and duplicates follow from covariances instead of counts of points. One frame goes as follows
//! ([`Tracker::update`]):
//!
//! 1. Fruits near the view are looked up by place (`near_view`), whenever they were last seen.
//! 2. Each is projected: the outline of its sphere, the covariance of its middle and depth (`prediction`).
//! 3. Each box is weighed against each such fruit by the log-odds against a box of something new (`likelihood`).
//! 4. The assignment with the largest sum of log-odds is taken ([`crate::assignment`]), once to see where the fruits say that
//!    the camera is (`alignment`; `jump` where the given pose has leapt), and then from there.
//! 5. Boxes left over may be a second piece of an assigned fruit, or the outline of two fruits (`sharing`); the others
//!    are born as fruits, by their depth or by their size (`birth`).
//! 6. Assigned fruits take up what was seen (`landmark`); two that cannot both be there become one (`merging`).
//! 7. Where there is a picture, it tells which fruits without a box it shows all the same (`glimpse`).
//! 8. The frame that is now `lag` frames old is looked at again, with what is known since (`settling`).
//!
//! In the end each track is weighed: is it a fruit, or what a detector takes for one (`belief`)?
//!
//! Equations, assumptions and limits: `docs/tracking.md`.

mod alignment;
mod association;
mod belief;
mod birth;
mod config;
mod glimpse;
mod jump;
mod known;
mod landmark;
mod likelihood;
mod merging;
mod near_view;
mod observation;
mod population;
mod prediction;
mod settling;
mod sharing;
mod sphere;
mod tracker;
mod tracks;
mod trust;
mod unknown;

pub use belief::{Belief, Colours, TrackViews, belief};
pub use config::TrackingConfig;
pub use merging::{Body, merge_duplicates};
pub use observation::{Boxes, LiftedBoxes};
pub use tracker::Tracker;
pub use tracks::{Sighting, Tracks};
