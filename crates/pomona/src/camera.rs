//! A rectified pinhole camera.

/// Size and intrinsics, pixels. The origin of picture coordinates is the top left corner of the top left pixel.
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
}

impl Camera {
    /// Direction (x, y, 1) of a picture point.
    pub fn ray(&self, x_px: f64, y_px: f64) -> [f64; 3] {
        [(x_px - self.cx) / self.fx, (y_px - self.cy) / self.fy, 1.0]
    }

    /// Direction through the centre of a pixel.
    pub fn pixel_ray(&self, column: usize, row: usize) -> [f64; 3] {
        self.ray(column as f64 + 0.5, row as f64 + 0.5)
    }
}

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

    /// Column and row of each pixel, row by row.
    pub fn pixels(self) -> impl Iterator<Item = (usize, usize)> {
        (self.top..self.bottom).flat_map(move |row| (self.left..self.right).map(move |column| (column, row)))
    }
}
