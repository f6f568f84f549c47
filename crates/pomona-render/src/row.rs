//! What stands in a row: the row frame is x along the row, y in depth, z up, metres, the ground at z = 0.

use crate::Vec3;

/// A fruit as a solid of revolution; colours are linear RGB, 0 to 1.
#[derive(Debug, Clone, Copy)]
pub struct Fruit {
    /// 0 for a fruit without a label.
    pub id: u16,
    /// Middle, metres.
    pub centre: Vec3,
    /// Across the axis at the widest place.
    pub diameter_m: f32,
    /// Along the axis.
    pub height_m: f32,
    /// Unit vector from the calyx to the stalk.
    pub axis: Vec3,
    /// Colour of the skin in the shade.
    pub ground_colour: Vec3,
    /// Colour of the side that had the sun.
    pub blush_colour: Vec3,
    /// How much of the skin the blush covers, 0 to 1.
    pub blush_share: f32,
    /// Unit vector to the middle of the blush.
    pub blush_direction: Vec3,
}

/// A tapered rod with round ends.
#[derive(Debug, Clone, Copy)]
pub struct Limb {
    /// One end, metres.
    pub start: Vec3,
    /// The other end, metres.
    pub end: Vec3,
    /// Radius at the start.
    pub start_radius_m: f32,
    /// Radius at the end.
    pub end_radius_m: f32,
    /// Linear RGB.
    pub colour: Vec3,
}

/// A blade, folded along its middle and bent towards its tip.
#[derive(Debug, Clone, Copy)]
pub struct Leaf {
    /// Where the blade begins, metres.
    pub base: Vec3,
    /// Unit vector from the base towards the tip.
    pub tip: Vec3,
    /// Unit vector of the upper side.
    pub normal: Vec3,
    /// From base to tip along the blade.
    pub length_m: f32,
    /// Across, at the widest place.
    pub width_m: f32,
    /// How far each half rises from the flat.
    pub fold_rad: f32,
    /// How far the tip turns away from the normal.
    pub bend_rad: f32,
    /// Linear RGB of the upper side.
    pub colour: Vec3,
}

impl Leaf {
    /// Area of the blade, square metres: an ellipse.
    pub fn area_m2(&self) -> f32 {
        std::f32::consts::FRAC_PI_4 * self.length_m * self.width_m
    }

    /// Middle of the blade as if it were flat.
    pub fn middle(&self) -> Vec3 {
        self.base + self.tip * (0.5 * self.length_m)
    }
}

/// All that stands there.
#[derive(Debug, Clone, Default)]
pub struct Row {
    /// With and without labels.
    pub fruits: Vec<Fruit>,
    /// Trunks, branches, stalks, posts, wires.
    pub limbs: Vec<Limb>,
    /// Of trees; grass is the renderer's.
    pub leaves: Vec<Leaf>,
}
