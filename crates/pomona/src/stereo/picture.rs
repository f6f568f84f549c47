//! Colour pictures of a rectified pair, and the right one as matching reads it.

use crate::camera::PixelBox;

/// Colours of a picture; `TRUNCATION` and the sums below are for three.
pub const CHANNELS: usize = 3;

/// A picture with three interleaved channels, row by row.
#[derive(Debug, Clone, Copy)]
pub struct Picture<'a> {
    values: &'a [u8],
    width: usize,
}

impl<'a> Picture<'a> {
    /// A picture of rows `width` pixels long.
    ///
    /// # Panics
    /// When the last row is not whole.
    pub fn new(values: &'a [u8], width: usize) -> Self {
        assert!(values.len().is_multiple_of((width * CHANNELS).max(1)), "a picture has whole rows");
        Self { values, width }
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.values.len() / (self.width * CHANNELS).max(1)
    }

    /// All channels, row by row.
    pub(crate) fn values(&self) -> &'a [u8] {
        self.values
    }

    /// The colours of a row.
    pub(crate) fn row(&self, row: usize) -> &'a [[u8; CHANNELS]] {
        self.values[row * self.width * CHANNELS..][..self.width * CHANNELS].as_chunks().0
    }

    /// The colour of a pixel.
    pub fn at(&self, column: usize, row: usize) -> [u8; CHANNELS] {
        let first = (row * self.width + column) * CHANNELS;
        [self.values[first], self.values[first + 1], self.values[first + 2]]
    }

    /// The colour at a place between two pixels of a row; none outside the picture.
    ///
    /// `x` counts from the centre of the first pixel.
    pub(crate) fn between(&self, x: f64, row: usize) -> Option<[f64; CHANNELS]> {
        if !(x >= 0.0 && x < (self.width - 1) as f64) {
            return None;
        }
        let column = x as usize;
        let part = x - column as f64;
        let both = &self.values[(row * self.width + column) * CHANNELS..][..2 * CHANNELS];
        let (low, high) = both.split_at(CHANNELS);
        Some(std::array::from_fn(|c| f64::from(low[c]) + part * (f64::from(high[c]) - f64::from(low[c]))))
    }
}

/// Per channel, the least and the greatest value within half a pixel, laid out so that a step of disparity is a step
/// forwards in memory.
///
/// A cost between the bounds does not depend on where between two pixels the truth lies (Birchfield and Tomasi 1998).
pub(crate) struct Bounds {
    width: usize,
    matches: Side,
    /// Planes of each channel: lower bounds, then upper bounds, only of the rows that were asked for.
    planes: [[Vec<u8>; 2]; CHANNELS],
}

/// On which side of a pixel's column its match lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    /// In the right picture.
    Left,
    /// In the left picture.
    Right,
}

impl Bounds {
    /// Only the rows of `boxes` are filled.
    pub(crate) fn new(picture: Picture, matches: Side, boxes: &[PixelBox]) -> Self {
        let (width, height) = (picture.width(), picture.height());
        let plane = || vec![0; width * height];
        let mut bounds = Self { width, matches, planes: std::array::from_fn(|_| [plane(), plane()]) };
        let mut wanted = vec![false; height];
        for one in boxes {
            wanted[one.top..one.bottom].fill(true);
        }
        let mut lines: [Vec<u8>; CHANNELS] = std::array::from_fn(|_| vec![0; width]);
        for row in (0..height).filter(|&row| wanted[row]) {
            for (column, colour) in picture.row(row).iter().enumerate() {
                let along = bounds.along(column);
                for (line, &value) in lines.iter_mut().zip(colour) {
                    line[along] = value;
                }
            }
            for (channel, line) in lines.iter().enumerate() {
                bounds.fill(line, row, channel);
            }
        }
        bounds
    }

    /// Fills a row from its values in the order of memory.
    fn fill(&mut self, line: &[u8], row: usize, channel: usize) {
        let here = row * self.width..(row + 1) * self.width;
        let [lower, upper] = &mut self.planes[channel];
        let (lower, upper) = (&mut lower[here.clone()], &mut upper[here]);
        lower.copy_from_slice(line);
        upper.copy_from_slice(line);
        let neighbours = || line.iter().zip(&line[1.min(line.len())..]).map(|(&one, &next)| one.midpoint(next));
        for from in 0..2.min(line.len()) {
            let bounds = lower[from..].iter_mut().zip(&mut upper[from..]);
            for ((low, high), between) in bounds.zip(neighbours()) {
                *low = between.min(*low);
                *high = between.max(*high);
            }
        }
    }

    fn along(&self, column: usize) -> usize {
        match self.matches {
            Side::Left => self.width - 1 - column,
            Side::Right => column,
        }
    }

    /// Costs of a pixel of the other picture at the disparities `from`, `from + 1`, ...: differences of colour, summed
    /// over the channels and cut at `TRUNCATION`. Where this picture ends, a cost is `TRUNCATION`.
    pub(crate) fn costs(&self, colour: [u8; CHANNELS], column: usize, row: usize, from: usize, costs: &mut [u8]) {
        let end = (row + 1) * self.width;
        let first = (row * self.width + self.along(column) + from).min(end);
        let seen = costs.len().min(end - first);
        let (inside, outside) = costs.split_at_mut(seen);
        outside.fill(TRUNCATION);
        let [blue, green, red] = self.planes.each_ref().map(|[lower, upper]| {
            let (lower, upper) = (&lower[first..first + seen], &upper[first..first + seen]);
            lower.iter().zip(upper)
        });
        // At most one of the two differences is not 0.
        let difference = |value: u8, (&low, &high): (&u8, &u8)| value.saturating_sub(high) | low.saturating_sub(value);
        for (((cost, blue), green), red) in inside.iter_mut().zip(blue).zip(green).zip(red) {
            let [blue, green, red] =
                [difference(colour[0], blue), difference(colour[1], green), difference(colour[2], red)];
            *cost = blue.saturating_add(green).saturating_add(red).min(TRUNCATION);
        }
    }
}

/// Differences of colour above this say no more than that it is another thing: 30 of 255 grey levels per channel.
pub(crate) const TRUNCATION: u8 = 90;
