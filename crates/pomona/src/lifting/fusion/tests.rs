use super::*;
use crate::random::SplitMix;
use nalgebra::Vector3;
use proptest::prelude::*;

struct Random(SplitMix);

impl Random {
    fn uniform(&mut self) -> f64 {
        (self.0.below(1 << 53) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    /// Box and Muller.
    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.normal())
    }
}

fn long_along(direction: &Vector3<f64>, along_m: f64, across_m: f64) -> Matrix3<f64> {
    let u = direction.normalize();
    let along = u * u.transpose();
    along * along_m.powi(2) + (Matrix3::identity() - along) * across_m.powi(2)
}

fn measured(centre: Vector3<f64>, covariance: Matrix3<f64>, ray: Vector3<f64>) -> MeasuredCentre {
    MeasuredCentre { centre: Point3::from(centre), covariance, ray }
}

fn diameters(measured_m: &[f64], sigma_m: impl Fn(f64, f64) -> f64, hidden: &[f64]) -> Vec<MeasuredDiameter> {
    let one = |(&diameter_m, &hidden): (&f64, &f64)| MeasuredDiameter {
        diameter_m,
        sigma_m: sigma_m(diameter_m, hidden),
        hidden,
    };
    measured_m.iter().zip(hidden).map(one).collect()
}

#[test]
fn one_sighting_stays_as_it_is_and_none_is_nothing() {
    let one = measured(Vector3::new(1.0, 2.0, 3.0), long_along(&Vector3::z(), 0.01, 0.002), Vector3::z());
    assert_eq!(fuse_centres(&[one]), Some((one.centre, one.covariance)));
    assert_eq!(fuse_centres(&[]), None);
    let [diameter] = diameters(&[0.07], |_, _| 0.004, &[0.05])[..] else { panic!("one") };
    assert_eq!(fuse_diameters(&[diameter]), Some((0.07, 0.004)));
    assert_eq!(fuse_diameters(&[]), None);
    for none in [f64::NAN, 0.0, -0.07, f64::INFINITY] {
        assert_eq!(fuse_diameters(&[diameter, MeasuredDiameter { diameter_m: none, ..diameter }]), None);
    }
}

#[test]
fn crossing_rays_meet_where_both_are_sure() {
    // Each is off along its own ray by 2 cm and right across it.
    let sightings = [Vector3::z(), Vector3::x()].map(|ray| measured(ray * 0.02, long_along(&ray, 0.02, 0.001), ray));
    let (centre, covariance) = fuse_centres(&sightings).expect("valid");
    assert!(centre.coords.amax() < 1e-3, "{centre}");
    assert!(covariance.symmetric_eigenvalues().max() < 0.2 * 0.02_f64.powi(2));
}

#[test]
fn a_sighting_of_a_leaf_hardly_counts() {
    let mut random = Random(SplitMix(0));
    let covariance = Matrix3::identity() * 0.003_f64.powi(2);
    let mut sightings: Vec<_> = (0..9).map(|_| measured(random.vector() * 0.003, covariance, Vector3::z())).collect();
    sightings[4].centre.z -= 0.25;
    assert!(fuse_centres(&sightings).expect("valid").0.coords.norm() < 0.005);
}

#[test]
fn sightings_that_disagree_widen_the_covariance() {
    let mut random = Random(SplitMix(2));
    let agreeing: Vec<_> = (0..6).map(|_| random.vector() * 0.001).collect();
    let spread = |by: f64| {
        let one = |centre: &Vector3<f64>| measured(centre * by, Matrix3::identity() * 1e-6, Vector3::z());
        fuse_centres(&agreeing.iter().map(one).collect::<Vec<_>>()).expect("valid").1.trace()
    };
    assert!(spread(4.0) > 2.0 * spread(1.0));
}

#[test]
fn many_sightings_are_no_surer_than_they_are_independent() {
    let one = measured(Vector3::zeros(), Matrix3::identity() * 0.002_f64.powi(2), Vector3::z());
    let (_, covariance) = fuse_centres(&vec![one; 1000]).expect("valid");
    assert!(covariance[(0, 0)].sqrt() > 0.0005);
    let same = diameters(&[0.07; 1000], |_, _| 0.003, &[0.01; 1000]);
    assert!(fuse_diameters(&same).expect("valid").1 > 0.0005);
}

#[test]
fn diameters_that_leaves_made_smaller_give_the_true_one() {
    let mut random = Random(SplitMix(4));
    let (mut sum, mut sum2) = (0.0, 0.0);
    for _ in 0..100 {
        let hidden = [0.09; 12];
        let measured_m: [f64; 12] =
            std::array::from_fn(|_| 0.07 * (1.0 + 0.09 * random.uniform().ln()) + 0.002 * random.normal());
        let found = fuse_diameters(&diameters(&measured_m, |d, h| f64::hypot(0.002, h * d), &hidden));
        let (diameter_m, sigma_m) = found.expect("valid");
        assert!(diameter_m > measured_m.iter().sum::<f64>() / 12.0);
        let error = (diameter_m - 0.07) / sigma_m;
        (sum, sum2) = (sum + error, sum2 + error * error);
    }
    let mean = sum / 100.0;
    let deviation = (sum2 / 100.0 - mean * mean).sqrt();
    assert!(mean.abs() < 0.5, "{mean}");
    assert!((0.3..1.2).contains(&deviation), "{deviation}");
}

#[test]
fn clear_sightings_outweigh_hidden_ones() {
    let hidden = [0.01, 0.01, 0.01, 0.12, 0.12, 0.12];
    let sightings = diameters(&[0.070, 0.0702, 0.0698, 0.05, 0.045, 0.04], |d, h| f64::hypot(0.001, h * d), &hidden);
    let (diameter_m, _) = fuse_diameters(&sightings).expect("valid");
    assert!((diameter_m - 0.0705).abs() < 0.001, "{diameter_m}");
}

/// Nine cameras along x that look at the origin; `off_m` metres along its ray each takes the fruit to be.
fn fan(off_m: impl Fn(usize) -> f64, beside: impl Fn(usize) -> Vector3<f64>) -> Vec<MeasuredCentre> {
    let sighting = |k: usize| {
        let ray = Vector3::new(0.8 - 0.2 * k as f64, 0.0, 1.5).normalize();
        measured(ray * off_m(k) + beside(k), long_along(&ray, 0.03, 0.002), ray)
    };
    (0..9).map(sighting).collect()
}

#[test]
fn a_wrong_depth_leaves_its_ray() {
    // Some depths, or even most, are of the row behind; all directions are right.
    for wrong in [&[4][..], &[1, 5, 7], &[0, 1, 3, 4, 5, 7, 8]] {
        let sightings = fan(|k| if wrong.contains(&k) { 0.9 } else { 0.0 }, |_| Vector3::zeros());
        let (centre, covariance) = fuse_centres(&sightings).expect("valid");
        assert!(centre.coords.norm() < 0.005, "{wrong:?}: {centre}");
        // Directions that cross at right angles make it sure; depths that contradict each other add nothing.
        assert!((0.001..0.01).contains(&covariance.trace().sqrt()), "{wrong:?}: {covariance}");
    }
}

#[test]
fn directions_that_contradict_each_other_widen_the_covariance() {
    let mut random = Random(SplitMix(3));
    let off: Vec<f64> = (0..9).map(|_| 0.01 * random.normal()).collect();
    let height = |sightings: &[MeasuredCentre]| fuse_centres(sightings).expect("valid").1[(1, 1)].sqrt();
    let sure = height(&fan(|_| 0.0, |_| Vector3::zeros()));
    assert!(height(&fan(|_| 0.0, |k| Vector3::y() * off[k])) > 3.0 * sure);
}

proptest! {
    #[test]
    fn order_changes_nothing(seed in any::<u64>()) {
        let mut random = Random(SplitMix(seed));
        let mut sightings: Vec<_> = (0..5)
            .map(|_| {
                let spread = Matrix3::from_fn(|_, _| random.normal());
                measured(random.vector(), spread * spread.transpose() + Matrix3::identity(), random.vector())
            })
            .collect();
        let (first, _) = fuse_centres(&sightings).expect("valid");
        sightings.rotate_left(2);
        sightings.swap(0, 1);
        let (again, _) = fuse_centres(&sightings).expect("valid");
        // Of starts in one valley either may end lower by rounding, and steps that end after ten leave some micrometres.
        prop_assert!((first - again).norm() < 1e-5, "{first} and {again}");
    }
}

#[test]
fn what_leaves_hide_they_hide_in_the_next_frame_too() {
    let sigma_m = |n: usize| fuse_diameters(&diameters(&vec![0.07; n], |_, _| 0.004, &vec![0.0; n])).expect("valid").1;
    // Half of the variance of one sighting, of ever so many.
    assert!((sigma_m(64) / 0.004 - 0.71).abs() < 0.03, "{}", sigma_m(64));
    assert!(sigma_m(8) > sigma_m(64) && sigma_m(8) < 0.004);
}
