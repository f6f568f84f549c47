//! Which colours are fruit in this picture: the boxes themselves say it.
//!
//! The histogram of the colours in the middle of the boxes is held against that of everything outside boxes, both over
//! two opponent colours, red-green and yellow-blue. A pixel then is fruit with the probability `p_in / (p_in + p_out)`.
//! Where fruits have the colour of leaves it is a half everywhere, and all pixels of a box count alike.

use crate::camera::PixelBox;
use crate::stereo::Picture;

/// Bins along each opponent colour; 16 levels each.
const BINS: usize = 32;

/// Pixels added to each histogram, spread evenly: the colours of a single small box prove little.
const PRIOR_PIXELS: f64 = 200.0;

/// Part of a box on every side that is left out of its middle: corners show leaves.
const MARGIN: usize = 5;

/// Columns of the picture that are looked at outside boxes, and rows as far apart.
const COLUMNS: usize = 320;

/// A pixel of a greater probability is rather fruit than not.
pub(crate) const FRUIT: f32 = 0.5;

/// Probability of being fruit by colour.
pub(crate) struct FruitColour {
    probability: Vec<f32>,
}

impl FruitColour {
    /// Learns the colours of one picture.
    pub(crate) fn new(picture: Picture, boxes: &[PixelBox]) -> Self {
        let (width, height) = (picture.width(), picture.height());
        let mut boxed = vec![false; width * height];
        let mut inside = vec![PRIOR_PIXELS / (BINS * BINS) as f64; BINS * BINS];
        let mut outside = inside.clone();
        for one in boxes {
            for row in one.top..one.bottom {
                boxed[row * width + one.left..row * width + one.right].fill(true);
            }
            for (column, row) in middle(one).pixels() {
                inside[bin(picture.at(column, row))] += 1.0;
            }
        }
        // Of the rest every second pixel of every second row is enough, fewer of a large picture.
        let step = (width / COLUMNS).max(2);
        for row in (0..height).step_by(step) {
            for column in (0..width).step_by(step).filter(|&column| !boxed[row * width + column]) {
                outside[bin(picture.at(column, row))] += 1.0;
            }
        }
        let (total_inside, total_outside): (f64, f64) = (inside.iter().sum(), outside.iter().sum());
        let probability = inside
            .iter()
            .zip(&outside)
            .map(|(one, other)| {
                let (one, other) = (one / total_inside, other / total_outside);
                (one / (one + other)) as f32
            })
            .collect();
        Self { probability }
    }

    /// Probability that a colour is fruit and not what is around fruits.
    pub(crate) fn of(&self, colour: [u8; 3]) -> f32 {
        self.probability[bin(colour)]
    }
}

fn middle(whole: &PixelBox) -> PixelBox {
    let (x, y) = (whole.width() / MARGIN, whole.height() / MARGIN);
    PixelBox { left: whole.left + x, top: whole.top + y, right: whole.right - x, bottom: whole.bottom - y }
}

/// Red minus green and yellow minus blue, each from -255 to 255.
fn bin([blue, green, red]: [u8; 3]) -> usize {
    let (blue, green, red) = (i32::from(blue), i32::from(green), i32::from(red));
    let place = |opponent: i32| (opponent + 256) as usize * BINS / 512;
    place(red - green) * BINS + place(i32::midpoint(red, green) - blue)
}
