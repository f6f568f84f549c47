//! A rectified pinhole camera, and what lies on its pictures.

use nalgebra::{Matrix3, Vector3};
use std::ops::Range;

/// Size, intrinsics and, where there is a camera to its right, the distance to it.
///
/// Pixels; the origin of picture coordinates is the top left corner of the top left pixel. A point (x, y, z) of the
/// camera is seen at u = fx x / z + cx, v = fy y / z + cy, and the right picture shows it fx baseline / z farther left.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Columns of a picture.
    pub width: usize,
    /// Rows of a picture.
    pub height: usize,
    /// Focal lengths.
    pub fx: f64,
    /// Vertical focal length.
    pub fy: f64,
    /// Principal point.
    pub cx: f64,
    /// Vertical principal point.
    pub cy: f64,
    /// Distance of the right camera, metres; none of a camera alone.
    pub baseline_m: Option<f64>,
}

impl Camera {
    /// Focal length 1: where places are measured and no pictures.
    pub const UNIT: Self = Self { width: 0, height: 0, fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, baseline_m: None };

    /// Focal lengths along x and y.
    #[inline]
    pub fn focal_px(&self) -> [f64; 2] {
        [self.fx, self.fy]
    }

    /// Principal point.
    #[inline]
    pub fn principal_px(&self) -> [f64; 2] {
        [self.cx, self.cy]
    }

    /// Width and height of a picture.
    #[inline]
    pub fn size_px(&self) -> [f64; 2] {
        [self.width as f64, self.height as f64]
    }

    /// Focal length times baseline, the disparity at one metre; 0 of a camera alone.
    #[inline]
    pub fn focal_baseline_px_m(&self) -> f64 {
        self.fx * self.baseline_m.unwrap_or(0.0)
    }

    /// Direction (x, y, 1) of a picture point.
    pub fn ray(&self, x_px: f64, y_px: f64) -> [f64; 3] {
        [(x_px - self.cx) / self.fx, (y_px - self.cy) / self.fy, 1.0]
    }

    /// Direction through the centre of a pixel.
    pub fn pixel_ray(&self, column: usize, row: usize) -> [f64; 3] {
        self.ray(column as f64 + 0.5, row as f64 + 0.5)
    }

    /// Column, row and depth of a point in the frame of the camera.
    pub fn project(&self, point: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(self.fx * point.x / point.z + self.cx, self.fy * point.y / point.z + self.cy, point.z)
    }

    /// The point at a column, row and depth.
    pub fn unproject(&self, seen: &Vector3<f64>) -> Vector3<f64> {
        let [x, y, _] = self.ray(seen.x, seen.y);
        Vector3::new(x * seen.z, y * seen.z, seen.z)
    }

    /// Derivative of [`Self::project`].
    pub(crate) fn projection_jacobian(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        let ([fx, fy], z) = (self.focal_px(), point.z);
        Matrix3::new(fx / z, 0.0, -fx * point.x / (z * z), 0.0, fy / z, -fy * point.y / (z * z), 0.0, 0.0, 1.0)
    }

    /// Derivative of [`Self::unproject`].
    pub(crate) fn ray_jacobian(&self, seen: &Vector3<f64>) -> Matrix3<f64> {
        let (&Self { fx, fy, cx, cy, .. }, z) = (self, seen.z);
        Matrix3::new(z / fx, 0.0, (seen.x - cx) / fx, 0.0, z / fy, (seen.y - cy) / fy, 0.0, 0.0, 1.0)
    }

    /// Column, row and disparity of a point in front of the camera, with their derivative.
    #[inline]
    pub(crate) fn project_pair(&self, point: &Vector3<f64>) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        if point.z <= NEAREST_M {
            return None;
        }
        let (&Self { fx, fy, cx, cy, .. }, inverse) = (self, 1.0 / point.z);
        let (x, y) = (point.x * inverse, point.y * inverse);
        let reach = self.focal_baseline_px_m();
        let seen = Vector3::new(fx * x + cx, fy * y + cy, reach * inverse);
        let slope = Matrix3::new(fx, 0.0, -fx * x, 0.0, fy, -fy * y, 0.0, 0.0, -reach * inverse) * inverse;
        Some((seen, slope))
    }

    /// Whether a point in the picture's pyramid lies in front of the camera and within `margin_px` of the picture.
    pub(crate) fn sees(&self, seen: &Vector3<f64>, margin_px: f64) -> bool {
        let size_px = self.size_px();
        seen.z > 0.0 && (0..2).all(|axis| seen[axis] > -margin_px && seen[axis] < size_px[axis] + margin_px)
    }
}

/// Nearer than a centimetre nothing is in focus, and the projection has no use.
const NEAREST_M: f64 = 0.01;

/// Depth along the optical axis of a camera, metres, row by row; 0 where nothing was measured.
#[derive(Debug, Clone, Copy)]
pub struct DepthPicture<'a> {
    depth_m: &'a [f32],
    width: usize,
}

impl<'a> DepthPicture<'a> {
    /// A picture of rows `width` long.
    ///
    /// # Panics
    /// When the last row is not whole.
    pub fn new(depth_m: &'a [f32], width: usize) -> Self {
        assert!(depth_m.len().is_multiple_of(width.max(1)), "a depth picture has whole rows");
        Self { depth_m, width }
    }

    /// Rows of the picture.
    pub fn height(&self) -> usize {
        self.depth_m.len() / self.width.max(1)
    }

    /// Columns of the picture.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Depth of a pixel.
    pub fn at(&self, column: usize, row: usize) -> f64 {
        f64::from(self.depth_m[row * self.width + column])
    }
}

/// Pixels that a box touches, inside the picture: columns and rows, the ends not included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelBox {
    /// First column.
    pub left: usize,
    /// First row.
    pub top: usize,
    /// One after the last column.
    pub right: usize,
    /// One after the last row.
    pub bottom: usize,
}

impl PixelBox {
    /// The pixels of a box (xmin, ymin, xmax, ymax), and `beside` more on every side where the picture has them.
    pub fn new(box_px: [f64; 4], beside: usize, width: usize, height: usize) -> Self {
        let low = |edge: f64, size: usize| (edge.max(0.0).floor() as usize).min(size).saturating_sub(beside);
        let high = |edge: f64, size: usize| (edge.max(0.0).ceil() as usize).saturating_add(beside).min(size);
        let (left, top) = (low(box_px[0], width), low(box_px[1], height));
        Self { left, top, right: high(box_px[2], width).max(left), bottom: high(box_px[3], height).max(top) }
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.right - self.left
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.bottom - self.top
    }

    /// Whether both have a pixel in common.
    pub fn touches(&self, other: &Self) -> bool {
        self.left < other.right && other.left < self.right && self.top < other.bottom && other.top < self.bottom
    }

    /// Whether a pixel is one of them.
    pub fn contains(&self, column: usize, row: usize) -> bool {
        (self.left..self.right).contains(&column) && (self.top..self.bottom).contains(&row)
    }

    /// Each row, with its columns in a shape that has no gap in any row.
    pub fn rows_in(self, is_in: impl Fn(usize, usize) -> bool) -> impl Iterator<Item = (usize, Range<usize>)> {
        (self.top..self.bottom).filter_map(move |row| {
            let first = (self.left..self.right).find(|&column| is_in(column, row))?;
            let last = (first..self.right).rfind(|&column| is_in(column, row))?;
            Some((row, first..last + 1))
        })
    }

    /// Column and row of each pixel, row by row.
    pub fn pixels(self) -> impl Iterator<Item = (usize, usize)> {
        (self.top..self.bottom).flat_map(move |row| (self.left..self.right).map(move |column| (column, row)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera =
        Camera { width: 640, height: 360, fx: 417.0, fy: 420.0, cx: 320.0, cy: 180.0, baseline_m: Some(0.12) };

    #[test]
    fn a_point_comes_back_from_where_it_is_seen() {
        let point = Vector3::new(0.6, -0.3, 1.4);
        assert!((CAMERA.unproject(&CAMERA.project(&point)) - point).norm() < 1e-12);
    }

    #[test]
    fn the_two_derivatives_are_inverse() {
        let point = Vector3::new(0.6, -0.3, 1.4);
        let there_and_back = CAMERA.projection_jacobian(&point) * CAMERA.ray_jacobian(&CAMERA.project(&point));
        assert!((there_and_back - Matrix3::identity()).abs().max() < 1e-12);
    }

    #[test]
    fn a_pair_shows_what_each_picture_shows_and_the_depth_as_disparity() {
        let point = Vector3::new(0.6, -0.3, 1.4);
        let (seen, _) = CAMERA.project_pair(&point).expect("in front");
        assert!((seen.xy() - CAMERA.project(&point).xy()).norm() < 1e-12);
        assert!((seen.z - 417.0 * 0.12 / 1.4).abs() < 1e-12);
        let alone = Camera { baseline_m: None, ..CAMERA };
        assert!(alone.project_pair(&point).expect("in front").0.z.abs() < 1e-12);
    }

    #[test]
    fn a_pair_shows_nothing_behind_the_camera() {
        assert!(CAMERA.project_pair(&Vector3::new(0.1, 0.1, -1.0)).is_none());
    }
}
