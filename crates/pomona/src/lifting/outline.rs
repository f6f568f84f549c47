//! From a box to the cone in which a round fruit sits.
//!
//! A sphere of radius R at (X, Y, Z), seen by a pinhole camera. In the plane x-z it is a circle of radius R at (X, Z),
//! and the planes through the camera's y axis that touch it make the angles `theta_x -+ alpha_x` with the optical axis,
//! where
//!
//! ```text
//! tan theta_x = X / Z,     sin alpha_x = R / sqrt(X^2 + Z^2) = (R / Z) cos theta_x.          (1)
//! ```
//!
//! These planes are the left and right edges of the sphere's box: with `a_0 = atan((xmin - cx) / fx)`, `a_1` likewise,
//! `theta_x = (a_0 + a_1) / 2` and `alpha_x = (a_1 - a_0) / 2`. So a box gives, with no approximation off the axis,
//!
//! ```text
//! X / Z = tan theta_x,     Y / Z = tan theta_y,     R / Z = sin alpha / cos theta of either axis.
//! ```
//!
//! Scale and distance stay open: depth gives them. Not every edge of a box is the fruit's own. The edge of the picture
//! and a leaf in front leave only a bound: the fruit ends there or beyond. Size and place come from the edges that are
//! the fruit's: an axis with both gives R / Z, one edge and R / Z give the centre. Where a side has no edge of its own,
//! and where a box is longer one way than fruits are, the centre may lie anywhere from flush with one short edge to
//! flush with the other.

use crate::camera::Camera;

/// One edge of a box: half a pixel of rounding, and what people and detectors disagree by on a clear outline.
const EDGE_SIGMA_PX: f64 = 1.0;

/// Long side over short side above which a fruit counts as partly hidden; whole Fuji apples stay below 1.12.
const ROUNDNESS: f64 = 1.15;

/// How much too small R / Z may be, over R / Z, when no axis has both edges free of leaves.
const COVERED_SIGMA: f64 = 0.06;

/// A box edge this near the edge of the picture is the picture's, not the fruit's.
const PICTURE_EDGE_PX: f64 = 1.0;

/// Part of the diameter that the picture must hold: with less than half, the other side of the box is only a chord.
const MIN_SEEN: f64 = 0.5;

/// Edges of a box where something nearer than the fruit begins: xmin, ymin, xmax, ymax.
pub type Covered = [bool; 4];

/// Cone around a fruit; all numbers are ratios to the depth Z of its centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outline {
    /// X / Z, Y / Z.
    pub centre: [f64; 2],
    /// R / Z.
    pub radius: f64,
    /// Standard deviation of `centre` from the edges of the box.
    pub centre_sigma: [f64; 2],
    /// The same of `radius`.
    pub radius_sigma: f64,
    /// 0 or 1 where the fruit is partly hidden along x or y.
    pub hidden_axis: Option<usize>,
    /// How far the centre can lie from `centre` along `hidden_axis`, either way; 0 without one.
    pub slack: f64,
    /// How many axes have both edges of the fruit itself, 0 to 2.
    pub whole_axes: usize,
}

/// One axis of a box: angles of its edges, which the picture cuts, which are the fruit's own; a sigma.
#[derive(Debug, Clone, Copy)]
struct AngularSide {
    angles: [f64; 2],
    cut: [bool; 2],
    own: [bool; 2],
    edge_sigma: f64,
}

impl AngularSide {
    fn new(edges_px: [f64; 2], covered: [bool; 2], size_px: f64, focal_px: f64, centre_px: f64) -> Self {
        let cut = [edges_px[0] <= PICTURE_EDGE_PX, edges_px[1] >= size_px - PICTURE_EDGE_PX];
        Self {
            angles: edges_px.map(|edge| ((edge - centre_px) / focal_px).atan()),
            cut,
            own: [!(cut[0] || covered[0]), !(cut[1] || covered[1])],
            edge_sigma: EDGE_SIGMA_PX / focal_px,
        }
    }

    fn whole(&self) -> bool {
        self.own[0] && self.own[1]
    }

    fn cuts(&self) -> usize {
        usize::from(self.cut[0]) + usize::from(self.cut[1])
    }

    fn middle(&self) -> f64 {
        f64::midpoint(self.angles[0], self.angles[1]).tan()
    }

    fn radius(&self) -> f64 {
        let [low, high] = self.angles;
        ((high - low) / 2.0).sin() / f64::midpoint(low, high).cos()
    }

    /// Standard deviation of the mean of two edges, or of half their difference.
    fn half_sigma(&self) -> f64 {
        self.edge_sigma / std::f64::consts::SQRT_2
    }
}

impl Outline {
    /// The cone of a box, none where the edge of the picture leaves size or place open.
    pub fn of_box(box_px: [f64; 4], camera: &Camera, covered: Covered) -> Option<Self> {
        let [xmin, ymin, xmax, ymax] = box_px;
        let sides = [
            AngularSide::new([xmin, xmax], [covered[0], covered[2]], camera.width as f64, camera.fx, camera.cx),
            AngularSide::new([ymin, ymax], [covered[1], covered[3]], camera.height as f64, camera.fy, camera.cy),
        ];
        if !decided(&sides) {
            None
        } else if sides.iter().all(AngularSide::whole) {
            Some(whole(&sides))
        } else {
            Some(bounded(&sides))
        }
    }
}

/// Whether the picture leaves enough of the fruit: at most one edge cut, and over half of that side there.
fn decided(sides: &[AngularSide; 2]) -> bool {
    let cuts = sides.map(|side| side.cuts());
    match cuts {
        [0, 0] => true,
        [1, 0] => sides[0].radius() >= MIN_SEEN * sides[1].radius(),
        [0, 1] => sides[1].radius() >= MIN_SEEN * sides[0].radius(),
        _ => false,
    }
}

/// All four edges are the fruit's own.
fn whole(sides: &[AngularSide; 2]) -> Outline {
    let radii = sides.map(|side| side.radius());
    let long = usize::from(radii[1] > radii[0]);
    let centre_sigma = sides.map(|side| side.half_sigma());
    let centre = sides.map(|side| side.middle());
    let slack = radii[long] - radii[1 - long];
    // Rounding alone makes a fruit of few pixels elongated.
    let (radius, radius_sigma, hidden_axis, slack) =
        if radii[long] > ROUNDNESS * radii[1 - long] && slack > centre_sigma[0].max(centre_sigma[1]) {
            (radii[long], centre_sigma[long], Some(1 - long), slack)
        } else {
            // Half the difference of two edges, averaged over two sides.
            ((radii[0] * radii[1]).sqrt(), centre_sigma[0].hypot(centre_sigma[1]) / 2.0, None, 0.0)
        };
    Outline { centre, radius, centre_sigma, radius_sigma, hidden_axis, slack, whole_axes: 2 }
}

/// Takes size from the longer side and place from edges of the fruit's own, where others are only bounds.
///
/// A box as round as fruits are was drawn around the whole fruit, leaf or not: it counts as it is.
fn bounded(sides: &[AngularSide; 2]) -> Outline {
    let radii = sides.map(|side| side.radius());
    let (short, long) = (radii[0].min(radii[1]), radii[0].max(radii[1]));
    let is_cut = sides.iter().any(|side| side.cuts() > 0);
    let is_round = !is_cut && long <= ROUNDNESS * short;
    let radius = if is_round { (short * long).sqrt() } else { long };
    let whole_axes = usize::from(sides[0].whole()) + usize::from(sides[1].whole());
    let axis = if whole_axes == 0 { usize::from(radii[1] > radii[0]) } else { usize::from(sides[1].whole()) };
    let edge_sigma = sides[axis].half_sigma();
    let radius_sigma = if whole_axes > 0 { edge_sigma } else { edge_sigma.hypot(COVERED_SIGMA * radius) };
    let other = &sides[1 - axis];
    let (mut centre, mut centre_sigma) = ([0.0; 2], [0.0; 2]);
    (centre[axis], centre_sigma[axis]) = (sides[axis].middle(), edge_sigma.max(radius_sigma));
    (centre[1 - axis], centre_sigma[1 - axis]) = (other.middle(), other.half_sigma());
    let mut outline = Outline { centre, radius, centre_sigma, radius_sigma, hidden_axis: None, slack: 0.0, whole_axes };
    if is_round || other.whole() {
        return outline;
    }
    match other.own {
        [false, false] => {
            (outline.hidden_axis, outline.slack) = (Some(1 - axis), (radius - other.radius()).max(0.0));
        }
        [low, _] => {
            let (edge, inwards) = if low { (0, 1.0) } else { (1, -1.0) };
            outline.centre[1 - axis] = centre_from_edge(other.angles[edge], radius, inwards);
            outline.centre_sigma[1 - axis] = other.edge_sigma.hypot(radius_sigma);
        }
    }
    outline
}

/// Solves `angle = theta -+ asin(radius cos theta)` for `tan theta`; equation (1) with one edge.
fn centre_from_edge(angle: f64, radius: f64, inwards: f64) -> f64 {
    let mut theta = angle;
    // A contraction with factor radius * |sin theta|, 0.1 for the nearest fruits.
    for _ in 0..20 {
        theta = angle + inwards * (radius * theta.cos()).min(1.0).asin();
    }
    theta.tan()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    const CAMERA: Camera =
        Camera { width: 640, height: 480, fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0, baseline_m: None };
    const FREE: Covered = [false; 4];

    /// Smallest box around the outline of a sphere: extremes of the circle where rays from the camera touch it.
    fn box_of(centre: Vector3<f64>, radius_m: f64, camera: &Camera) -> [f64; 4] {
        let distance2 = centre.norm_squared();
        let middle = centre * (1.0 - radius_m * radius_m / distance2);
        let radius_of_circle = radius_m * (1.0 - radius_m * radius_m / distance2).sqrt();
        let first = centre.cross(&Vector3::y()).normalize();
        let second = centre.cross(&first).normalize();
        let mut found = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        for step in 0..20_000 {
            let (sin, cos) = (f64::from(step) * std::f64::consts::TAU / 20_000.0).sin_cos();
            let point = middle + (first * cos + second * sin) * radius_of_circle;
            let (x, y) = (camera.fx * point.x / point.z + camera.cx, camera.fy * point.y / point.z + camera.cy);
            found = [found[0].min(x), found[1].min(y), found[2].max(x), found[3].max(y)];
        }
        found
    }

    fn assert_near(found: f64, expected: f64, within: f64) {
        assert!((found - expected).abs() <= within, "found {found}, expected {expected}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn the_outline_of_a_sphere_is_exact_off_the_axis(
            x in -0.3..0.3_f64, y in -0.2..0.2_f64, depth_m in 0.8..3.0_f64, diameter_m in 0.03..0.15_f64,
        ) {
            let sphere = box_of(Vector3::new(x, y, 1.0) * depth_m, diameter_m / 2.0, &CAMERA);
            let outline = Outline::of_box(sphere, &CAMERA, FREE).expect("it lies inside the picture");
            prop_assert_eq!((outline.hidden_axis, outline.whole_axes), (None, 2));
            prop_assert!((outline.centre[0] - x).abs() < 1e-6 && (outline.centre[1] - y).abs() < 1e-6);
            prop_assert!((outline.radius * depth_m / (diameter_m / 2.0) - 1.0).abs() < 1e-5);
        }

        #[test]
        fn a_covered_edge_leaves_the_place_to_the_opposite_one(edge in 0..4_usize) {
            let mut sphere = box_of(Vector3::new(0.1, -0.1, 1.2), 0.04, &CAMERA);
            sphere[edge] += if edge < 2 { 14.0 } else { -14.0 };
            let mut covered = FREE;
            covered[edge] = true;
            let outline = Outline::of_box(sphere, &CAMERA, covered).expect("it lies inside the picture");
            prop_assert!((outline.centre[0] * 1.2 - 0.1).abs() < 1e-4 && (outline.centre[1] * 1.2 + 0.1).abs() < 1e-4);
            prop_assert!((outline.radius * 1.2 / 0.04 - 1.0).abs() < 1e-3);
            prop_assert_eq!(outline.whole_axes, 1);
        }
    }

    #[test]
    fn a_wide_angle_box_is_not_elongated() {
        // At 45 degrees off the axis the outline of a sphere is an ellipse, 1.4 times as long as wide.
        let wide = Camera { width: 2000, cx: 1000.0, ..CAMERA };
        let sphere = box_of(Vector3::new(1.0, 0.0, 1.0), 0.04, &wide);
        assert!((sphere[2] - sphere[0]) / (sphere[3] - sphere[1]) > 1.3);
        let outline = Outline::of_box(sphere, &wide, FREE).expect("it lies inside the picture");
        assert_eq!(outline.hidden_axis, None);
        assert_near(outline.radius, 0.04, 1e-6);
    }

    #[test]
    fn sigma_follows_the_edges() {
        let outline = Outline::of_box([300.0, 220.0, 340.0, 260.0], &CAMERA, FREE).expect("inside");
        // One pixel on each edge: the middle of two edges, and half the mean of two sides.
        for sigma in outline.centre_sigma {
            assert_near(sigma, 1.0 / 600.0 / 2.0_f64.sqrt(), 1e-12);
        }
        assert_near(outline.radius_sigma, 1.0 / 600.0 / 2.0, 1e-12);
    }

    #[test]
    fn an_elongated_box_is_partly_hidden_along_its_short_side() {
        let outline = Outline::of_box([310.0, 200.0, 330.0, 240.0], &CAMERA, FREE).expect("inside");
        let whole = Outline::of_box([300.0, 200.0, 340.0, 240.0], &CAMERA, FREE).expect("inside");
        assert_eq!(outline.hidden_axis, Some(0));
        assert_near(outline.radius, whole.radius, 1e-3 * whole.radius);
        assert_near(outline.slack, 10.0 / 600.0, 1e-2 * 10.0 / 600.0);
    }

    #[test]
    fn a_few_pixels_are_round_whatever_rounding_does() {
        let outline = Outline::of_box([310.0, 200.0, 313.0, 203.6], &CAMERA, FREE).expect("inside");
        assert_eq!(outline.hidden_axis, None);
    }

    #[test]
    fn a_round_box_counts_as_it_is_whatever_covers_it() {
        let round = [300.0, 220.0, 340.0, 260.0];
        let free = Outline::of_box(round, &CAMERA, FREE).expect("inside");
        let covered = Outline::of_box(round, &CAMERA, [true, false, true, true]).expect("inside");
        assert_near(covered.centre[0], free.centre[0], 1e-12);
        assert_near(covered.centre[1], free.centre[1], 1e-12);
        assert_near(covered.radius, free.radius, 1e-12);
        assert!(covered.radius_sigma > free.radius_sigma);
    }

    #[test]
    fn the_edge_of_the_picture_is_no_edge_of_the_fruit() {
        // Its right third is outside.
        let sphere = box_of(Vector3::new(0.62, 0.0, 1.2), 0.04, &CAMERA);
        assert!(sphere[2] > CAMERA.width as f64);
        let outline =
            Outline::of_box([sphere[0], sphere[1], 640.0, sphere[3]], &CAMERA, FREE).expect("half of it is seen");
        assert_near(outline.centre[0] * 1.2, 0.62, 1e-4);
        assert_near(outline.centre[1] * 1.2, 0.0, 1e-4);
        assert_near(outline.radius * 1.2, 0.04, 1e-3 * 0.04);
    }

    #[test]
    fn a_box_that_the_picture_leaves_open_has_no_outline() {
        // In the corner; a quarter of it in the picture; cut on both sides.
        for open in [[600.0, 440.0, 640.0, 480.0], [630.0, 200.0, 640.0, 240.0], [0.0, 200.0, 640.0, 240.0]] {
            assert_eq!(Outline::of_box(open, &CAMERA, FREE), None);
        }
    }
}
