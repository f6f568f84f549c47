//! What the odometry asks of pictures; it sees none itself.

use nalgebra::{Vector2, Vector3};

/// A point of the newest keyframe, u, v, disparity, and where a picture shows it.
pub type FoundAgain = (Vector3<f64>, Vector2<f64>);

/// The picture of one frame, beside that of the newest keyframe.
///
/// Coordinates are those of the camera that the odometry was given.
pub trait Eyes {
    /// What goes wrong where pictures are looked at.
    type Error: From<crate::Error>;

    /// Where the picture shows points of the newest keyframe, given where that shows them and where they are expected;
    /// none for a point that is not found.
    ///
    /// # Errors
    /// What the pictures say.
    fn follow(
        &mut self,
        from_px: &[Vector2<f64>],
        expected_px: &[Vector2<f64>],
    ) -> Result<Vec<Option<Vector2<f64>>>, Self::Error>;

    /// Points of the newest keyframe and where the picture shows them, with no idea where.
    ///
    /// # Errors
    /// What the pictures say.
    fn find_again(&mut self) -> Result<Vec<FoundAgain>, Self::Error>;

    /// u, v, disparity of points at known places with expected disparities, then of new corners, so many in each cell with
    /// those that are known; NaN for a disparity that is not found.
    ///
    /// # Errors
    /// What the pictures say.
    fn measure(
        &mut self,
        known_px: &[Vector2<f64>],
        expected_disparities_px: &[f64],
        per_cell: usize,
    ) -> Result<Vec<Vector3<f64>>, Self::Error>;
}
