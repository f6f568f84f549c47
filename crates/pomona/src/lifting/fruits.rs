//! The fruits of a session: all sightings of each, fused.
//!
//! A sighting's own depth is the worst thing that it says, so its diameter, which is its outline times a depth, is not
//! fused as it stands:
//!
//! 1. The sightings of a fruit give a place ([`fuse_centres`]).
//! 2. The place gives every sighting a better depth, and that its outline a better diameter; they are fused
//!    ([`fuse_diameters`]). What the place errs by along the axis they all share: it is added to the fused variance and
//!    does not fall with their number.
//! 3. A centre lies behind the surface by the radius. The better diameter moves it along its ray, and the place is fused
//!    again.

use super::fusion::{MeasuredCentre, MeasuredDiameter, fuse_centres, fuse_diameters};
use crate::error::{Error, Result};
use crate::pose::Pose;
use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

/// Boxes that were lifted, each of a fruit: one row each.
#[derive(Debug, Clone, Copy)]
pub struct FruitSightings<'a> {
    /// Row of the frame's pose.
    pub frames: &'a [usize],
    /// Row of the fruit; every fruit from 0 to the last has a sighting.
    pub fruits: &'a [usize],
    /// In the frame of the camera, metres.
    pub centres_in_camera: &'a [Point3<f64>],
    /// Square metres, positive definite.
    pub covariances: &'a [Matrix3<f64>],
    /// As the outline and the sighting's own depth have it, metres.
    pub diameters_m: &'a [f64],
    /// Their standard deviations.
    pub diameter_sigmas_m: &'a [f64],
    /// Mean part of the diameter that leaves are expected to hide.
    pub hidden: &'a [f64],
}

/// Fruits, one row each.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FusedFruits {
    /// In the session, metres.
    pub centres: Vec<Point3<f64>>,
    /// Square metres.
    pub covariances: Vec<Matrix3<f64>>,
    /// Metres.
    pub diameters_m: Vec<f64>,
    /// Their standard deviations.
    pub diameter_sigmas_m: Vec<f64>,
}

/// Fuses the sightings of every fruit; `poses` are `session_from_camera` of the frames.
///
/// # Errors
/// Arrays of different lengths, a row of a frame that does not exist, a fruit without a sighting, with a covariance that is
/// not positive definite, or with a diameter that is no length.
pub fn fuse_fruits(sightings: &FruitSightings<'_>, poses: &[Pose]) -> Result<FusedFruits> {
    sightings.check(poses.len())?;
    let fused: Vec<Fused> = (sightings.of_each_fruit().into_par_iter().enumerate())
        .map(|(fruit, rows)| sightings.fuse(&rows, poses).ok_or(Error::Unplaced { fruit }))
        .collect::<Result<_>>()?;
    Ok(FusedFruits {
        centres: fused.iter().map(|one| one.place.0).collect(),
        covariances: fused.iter().map(|one| one.place.1).collect(),
        diameters_m: fused.iter().map(|one| one.diameter_m).collect(),
        diameter_sigmas_m: fused.iter().map(|one| one.diameter_sigma_m).collect(),
    })
}

type Place = (Point3<f64>, Matrix3<f64>);

struct Fused {
    place: Place,
    diameter_m: f64,
    diameter_sigma_m: f64,
}

/// One sighting and where its camera was.
#[derive(Clone, Copy)]
struct Seen<'a> {
    pose: &'a Pose,
    centre_in_camera: Vector3<f64>,
    covariance: &'a Matrix3<f64>,
    diameter: MeasuredDiameter,
}

/// A diameter at the depth of the fruit's place, and its variance by what that depth errs by.
struct Placed {
    diameter: MeasuredDiameter,
    shared_variance: f64,
}

impl FruitSightings<'_> {
    fn check(&self, n_frames: usize) -> Result<()> {
        let expected = self.fruits.len();
        for (what, found) in [
            ("frames", self.frames.len()),
            ("centres_in_camera", self.centres_in_camera.len()),
            ("covariances", self.covariances.len()),
            ("diameters_m", self.diameters_m.len()),
            ("diameter_sigmas_m", self.diameter_sigmas_m.len()),
            ("hidden", self.hidden.len()),
        ] {
            if found != expected {
                return Err(Error::Length { what, found, expected });
            }
        }
        // No fruit is without a sighting, so there are no more fruits than sightings.
        for (what, rows, below) in [("frames", self.frames, n_frames), ("fruits", self.fruits, expected)] {
            if let Some(&found) = rows.iter().find(|&&row| row >= below) {
                return Err(Error::Row { what, found, below });
            }
        }
        Ok(())
    }

    /// Rows of the sightings of each fruit, in their order.
    fn of_each_fruit(&self) -> Vec<Vec<usize>> {
        let mut rows = vec![Vec::new(); self.fruits.iter().max().map_or(0, |last| last + 1)];
        for (row, &fruit) in self.fruits.iter().enumerate() {
            rows[fruit].push(row);
        }
        rows
    }

    fn seen<'a>(&'a self, row: usize, poses: &'a [Pose]) -> Seen<'a> {
        Seen {
            pose: &poses[self.frames[row]],
            centre_in_camera: self.centres_in_camera[row].coords,
            covariance: &self.covariances[row],
            diameter: MeasuredDiameter {
                diameter_m: self.diameters_m[row],
                sigma_m: self.diameter_sigmas_m[row],
                hidden: self.hidden[row],
            },
        }
    }

    fn fuse(&self, rows: &[usize], poses: &[Pose]) -> Option<Fused> {
        let seen: Vec<Seen<'_>> = rows.iter().map(|&row| self.seen(row, poses)).collect();
        let rough = place(seen.iter().map(|one| (one, one.centre_in_camera)))?;
        let placed: Vec<Placed> = seen.iter().map(|one| one.placed(&rough)).collect();
        let (diameter_m, own_sigma_m) = fuse_diameters(&placed.iter().map(|one| one.diameter).collect::<Vec<_>>())?;
        let shared = placed.iter().map(|one| one.shared_variance).sum::<f64>() / placed.len() as f64;
        let behind = |(one, placed): (&Seen<'_>, &Placed)| {
            one.centre_in_camera + (diameter_m - placed.diameter.diameter_m) / 2.0 * one.centre_in_camera.normalize()
        };
        let place = place(seen.iter().zip(seen.iter().zip(&placed).map(behind)))?;
        Some(Fused { place, diameter_m, diameter_sigma_m: (own_sigma_m.powi(2) + shared).sqrt() })
    }
}

/// The place of a fruit in the session, from sightings with their centres in the camera.
fn place<'a>(seen: impl Iterator<Item = (&'a Seen<'a>, Vector3<f64>)>) -> Option<Place> {
    let measured = |(one, centre): (&Seen<'_>, Vector3<f64>)| MeasuredCentre {
        centre: Point3::from(one.pose.to_session(&centre)),
        covariance: one.pose.covariance_to_session(one.covariance),
        ray: one.pose.rotation * centre,
    };
    fuse_centres(&seen.map(measured).collect::<Vec<_>>())
}

impl Seen<'_> {
    /// Depth of a place, and its variance. A place behind the camera is no place: that sighting keeps its own.
    fn depth(&self, (centre, covariance): &Place) -> (f64, f64) {
        let axis = self.pose.rotation.matrix().column(2).into_owned();
        let depth_m = (centre.coords - self.pose.translation).dot(&axis);
        if depth_m > 0.0 {
            (depth_m, axis.dot(&(covariance * axis)))
        } else {
            (self.centre_in_camera.z, self.covariance[(2, 2)])
        }
    }

    /// The diameter that the outline has at the depth of the fruit's place, and what the outline alone errs by.
    fn placed(&self, place: &Place) -> Placed {
        let (depth_m, depth_variance) = self.depth(place);
        let own_depth_m = self.centre_in_camera.z;
        let (stretch, ratio) = (depth_m / own_depth_m, self.diameter.diameter_m / own_depth_m);
        // What the sighting's own depth errs by is in its sigma.
        let of_outline = self.diameter.sigma_m.powi(2) - ratio.powi(2) * self.covariance[(2, 2)];
        let diameter = MeasuredDiameter {
            diameter_m: stretch * self.diameter.diameter_m,
            sigma_m: stretch * of_outline.max(0.0).sqrt(),
            hidden: self.diameter.hidden,
        };
        Placed { diameter, shared_variance: (stretch * ratio).powi(2) * depth_variance }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEPTH_M: f64 = 1.5;
    const DIAMETER_M: f64 = 0.07;
    /// What the outline errs by, over the depth.
    const OUTLINE_SIGMA: f64 = 0.0005;

    /// One fruit on the axis of `n` cameras at one place, its depth with a standard deviation.
    fn seen_from_one_place(n: usize, depth_sigma_m: f64) -> FusedFruits {
        let covariance = Matrix3::from_diagonal(&Vector3::new(1e-6, 1e-6, depth_sigma_m.powi(2)));
        let ratio = DIAMETER_M / DEPTH_M;
        let sigma_m = (OUTLINE_SIGMA * DEPTH_M).hypot(ratio * depth_sigma_m);
        let sightings = FruitSightings {
            frames: &vec![0; n],
            fruits: &vec![0; n],
            centres_in_camera: &vec![Point3::new(0.0, 0.0, DEPTH_M); n],
            covariances: &vec![covariance; n],
            diameters_m: &vec![DIAMETER_M; n],
            diameter_sigmas_m: &vec![sigma_m; n],
            hidden: &vec![0.01; n],
        };
        fuse_fruits(&sightings, &[Pose::IDENTITY]).expect("valid")
    }

    #[test]
    fn sightings_of_one_fruit_share_the_error_of_its_depth() {
        for n in [2, 8, 64] {
            // The outlines alone, and outlines with a depth of 5 cm: the difference is what the depth of the place errs by.
            let (sharp, vague) = (seen_from_one_place(n, 1e-6), seen_from_one_place(n, 0.05));
            let of_place = DIAMETER_M / DEPTH_M * vague.covariances[0][(2, 2)].sqrt();
            let expected = sharp.diameter_sigmas_m[0].hypot(of_place);
            assert!(of_place > 0.0005, "{n} sightings: {of_place}");
            let found = vague.diameter_sigmas_m[0];
            assert!((found / expected - 1.0).abs() < 0.01, "{n} sightings: found {found}, expected {expected}");
        }
        // Thirty-two times the sightings, and not a fifth of the error, as were they independent.
        let [few, many] = [2, 64].map(|n| seen_from_one_place(n, 0.05).diameter_sigmas_m[0]);
        assert!(many > 0.4 * few, "{few} and {many}");
    }

    #[test]
    fn outlines_get_the_diameter_and_the_centre_of_the_place_on_which_rays_agree() {
        // Two cameras at right angles; the second one has its depth 20 cm too far, and so its fruit too large.
        let turned = nalgebra::Rotation3::from_euler_angles(0.0, -std::f64::consts::FRAC_PI_2, 0.0);
        let beside = Pose { rotation: turned, translation: Vector3::new(DEPTH_M, 0.0, DEPTH_M) };
        let poses = [Pose::IDENTITY, beside];
        let (near, far) = (DEPTH_M, DEPTH_M + 0.2);
        let covariance = Matrix3::from_diagonal(&Vector3::new(1e-6, 1e-6, 0.1_f64.powi(2)));
        let ratio = DIAMETER_M / DEPTH_M;
        let sightings = FruitSightings {
            frames: &[0, 1],
            fruits: &[0, 0],
            centres_in_camera: &[Point3::new(0.0, 0.0, near), Point3::new(0.0, 0.0, far)],
            covariances: &[covariance; 2],
            diameters_m: &[ratio * near, ratio * far],
            diameter_sigmas_m: &[ratio * 0.1 + 0.001; 2],
            hidden: &[0.01; 2],
        };
        let found = fuse_fruits(&sightings, &poses).expect("valid");
        assert!((found.centres[0] - Point3::new(0.0, 0.0, DEPTH_M)).norm() < 0.005, "{}", found.centres[0]);
        assert!((found.diameters_m[0] - DIAMETER_M).abs() < 0.003, "{}", found.diameters_m[0]);
    }

    #[test]
    fn rows_that_do_not_exist_and_fruits_that_nobody_saw_are_named() {
        let centres = [Point3::new(0.0, 0.0, DEPTH_M)];
        let sightings = FruitSightings {
            frames: &[0],
            fruits: &[0],
            centres_in_camera: &centres,
            covariances: &[Matrix3::identity()],
            diameters_m: &[DIAMETER_M],
            diameter_sigmas_m: &[1.0],
            hidden: &[0.0],
        };
        let poses = [Pose::IDENTITY];
        assert_eq!(fuse_fruits(&sightings, &poses).expect("valid").centres, centres);
        let told = |wrong: FruitSightings<'_>| fuse_fruits(&wrong, &poses).unwrap_err();
        assert_eq!(
            told(FruitSightings { frames: &[1], ..sightings }),
            Error::Row { what: "frames", found: 1, below: 1 }
        );
        assert_eq!(
            told(FruitSightings { fruits: &[9], ..sightings }),
            Error::Row { what: "fruits", found: 9, below: 1 }
        );
        let (what, found, expected) = ("hidden", 0, 1);
        assert_eq!(told(FruitSightings { hidden: &[], ..sightings }), Error::Length { what, found, expected });
        let flat = [Matrix3::zeros(); 2];
        let twice = FruitSightings {
            frames: &[0, 0],
            fruits: &[0, 0],
            centres_in_camera: &[centres[0]; 2],
            covariances: &flat,
            diameters_m: &[DIAMETER_M; 2],
            diameter_sigmas_m: &[1.0; 2],
            hidden: &[0.0; 2],
        };
        assert_eq!(told(twice), Error::Unplaced { fruit: 0 });
    }
}
