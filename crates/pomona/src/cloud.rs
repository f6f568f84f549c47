//! The fruits of one visit as a struct of arrays.

use crate::error::{Error, Result};
use nalgebra::{Matrix3, Point3};

/// Which fruits each frame of the recording saw, as pairs sorted by frame.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Views {
    /// Frame number of each sighting.
    pub frames: Vec<i64>,
    /// Row of the fruit of each sighting.
    pub fruits: Vec<usize>,
}

impl Views {
    /// The rows of the fruits seen in each frame, in order of frames; rows ascend and are unique inside a frame.
    pub fn by_frame(&self) -> Vec<(i64, Vec<usize>)> {
        let mut sightings: Vec<_> = self.frames.iter().copied().zip(self.fruits.iter().copied()).collect();
        sightings.sort_unstable();
        sightings.dedup();
        sightings.chunk_by(|a, b| a.0 == b.0).map(|frame| (frame[0].0, frame.iter().map(|s| s.1).collect())).collect()
    }
}

/// Sparse landmarks of one visit: one row per fruit, metres, in the session's frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FruitCloud {
    /// Centroids, metres.
    pub positions: Vec<Point3<f64>>,
    /// Covariance of each centroid, square metres.
    pub covariances: Option<Vec<Matrix3<f64>>>,
    /// Diameters in metres; NaN where unknown.
    pub diameters_m: Option<Vec<f64>>,
    /// Names of the fruits; row numbers where there are none.
    pub ids: Option<Vec<String>>,
    /// Which frame saw which fruit.
    pub views: Option<Views>,
}

impl FruitCloud {
    /// A cloud of bare positions.
    pub fn from_positions(positions: Vec<Point3<f64>>) -> Self {
        Self { positions, ..Self::default() }
    }

    /// Number of fruits.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there is no fruit.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The rows `rows` as a cloud of their own, in that order; sightings are dropped.
    ///
    /// # Panics
    /// A row beyond the last.
    #[must_use]
    pub fn select(&self, rows: &[usize]) -> Self {
        Self {
            positions: rows.iter().map(|&row| self.positions[row]).collect(),
            covariances: self.covariances.as_ref().map(|all| rows.iter().map(|&row| all[row]).collect()),
            diameters_m: self.diameters_m.as_ref().map(|all| rows.iter().map(|&row| all[row]).collect()),
            ids: self.ids.as_ref().map(|all| rows.iter().map(|&row| all[row].clone()).collect()),
            views: None,
        }
    }

    /// Checks lengths, finite coordinates, covariances and diameters.
    ///
    /// # Errors
    /// The first row or array that is wrong.
    pub fn validate(&self) -> Result<()> {
        let expected = self.len();
        if let Some(row) = self.positions.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(Error::NotFinite { what: "positions", row });
        }
        let check = |what, found: Option<usize>| match found {
            Some(found) if found != expected => Err(Error::Length { what, found, expected }),
            _ => Ok(()),
        };
        check("covariances", self.covariances.as_ref().map(Vec::len))?;
        check("diameters_m", self.diameters_m.as_ref().map(Vec::len))?;
        check("ids", self.ids.as_ref().map(Vec::len))?;
        if let Some(row) = self.covariances.iter().flatten().position(|c| !is_covariance(c)) {
            return Err(Error::Covariance { row });
        }
        let is_none = |diameter: &f64| *diameter <= 0.0 || diameter.is_infinite();
        let mut diameters = self.diameters_m.iter().flatten().enumerate();
        if let Some((row, &found)) = diameters.find(|(_, diameter)| is_none(diameter)) {
            return Err(Error::Diameter { row, found });
        }
        match &self.views {
            Some(views) if views.frames.len() != views.fruits.len() => {
                Err(Error::Length { what: "views", found: views.frames.len(), expected: views.fruits.len() })
            }
            Some(views) => match views.fruits.iter().find(|&&fruit| fruit >= expected) {
                Some(&found) => Err(Error::Row { what: "views.fruits", found, below: expected }),
                None => Ok(()),
            },
            None => Ok(()),
        }
    }
}

/// Symmetric to rounding and without a negative eigenvalue beyond rounding.
pub(crate) fn is_covariance(matrix: &Matrix3<f64>) -> bool {
    let size = matrix.norm();
    size.is_finite()
        && (matrix - matrix.transpose()).norm() <= 1e-9 * size.max(1e-30)
        && matrix.symmetric_eigenvalues().min() >= -1e-9 * size
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_group_by_frame_without_repeats() {
        let views = Views { frames: vec![2, 1, 2, 2], fruits: vec![0, 3, 1, 0] };
        assert_eq!(views.by_frame(), vec![(1, vec![3]), (2, vec![0, 1])]);
    }

    #[test]
    fn validate_names_the_row() {
        let cloud = FruitCloud::from_positions(vec![Point3::origin(), Point3::new(0.0, f64::NAN, 0.0)]);
        assert_eq!(cloud.validate(), Err(Error::NotFinite { what: "positions", row: 1 }));
    }

    #[test]
    fn validate_refuses_a_negative_covariance() {
        let mut cloud = FruitCloud::from_positions(vec![Point3::origin()]);
        cloud.covariances = Some(vec![Matrix3::identity() * -1.0]);
        assert_eq!(cloud.validate(), Err(Error::Covariance { row: 0 }));
    }

    #[test]
    fn validate_names_the_fruit_that_a_view_knows_and_the_cloud_does_not() {
        let mut cloud = FruitCloud::from_positions(vec![Point3::origin(); 3]);
        cloud.views = Some(Views { frames: vec![0, 0], fruits: vec![2, 7] });
        assert_eq!(cloud.validate(), Err(Error::Row { what: "views.fruits", found: 7, below: 3 }));
    }

    #[test]
    fn validate_refuses_a_diameter_that_is_no_length_and_takes_one_that_is_not_known() {
        let mut cloud = FruitCloud::from_positions(vec![Point3::origin(); 2]);
        cloud.diameters_m = Some(vec![f64::NAN, 0.07]);
        assert_eq!(cloud.validate(), Ok(()));
        for found in [0.0, -0.07, f64::INFINITY] {
            cloud.diameters_m = Some(vec![0.07, found]);
            assert_eq!(cloud.validate(), Err(Error::Diameter { row: 1, found }));
        }
    }
}
