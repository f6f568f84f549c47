//! How much of a box looks like fruit, and how much of what is beside boxes does.
//!
//! Leaves that a detector takes for fruits come back to one place as fruits do, so no number of boxes tells them apart.
//! Their colour does, where fruits have one of their own; and how far it can be trusted the picture says itself: places
//! without a box are what false boxes are drawn around.

mod colour;
mod middle;

pub(crate) use colour::{FRUIT, FruitColour};

use crate::camera::PixelBox;
use crate::stereo::{CHANNELS, Picture};

/// Places without a box that are looked at, along and down the picture: a hundred at most.
const PLACES: [usize; 2] = [12, 8];

/// What the boxes of one picture look like.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Look {
    /// Per box: median colour of its middle, BGR.
    pub colours: Vec<[u8; CHANNELS]>,
    /// Per box: mean probability that the colour of a pixel in its ellipse is fruit. 0 of a box without a pixel.
    pub fruitness: Vec<f64>,
    /// Per box: pixels whose colour is rather fruit.
    pub fruit_px: Vec<f64>,
    /// The same as `fruitness` of places of a common box's size that no box touches.
    pub elsewhere: Vec<f64>,
}

/// Looks at the boxes (xmin, ymin, xmax, ymax) of a picture.
pub fn look_of(picture: Picture, boxes_px: &[[f64; 4]]) -> Look {
    let (width, height) = (picture.width(), picture.height());
    let boxes: Vec<_> = boxes_px.iter().map(|&one| PixelBox::new(one, 0, width, height)).collect();
    if boxes.is_empty() || picture.values().is_empty() {
        return Look::default();
    }
    let colours = FruitColour::new(picture, &boxes);
    let seen = |one: &PixelBox| fruitness(picture, one, &colours);
    let (means, pixels) = boxes.iter().map(seen).unzip();
    let elsewhere = places_without(&boxes, width, height).iter().map(|one| seen(one).0).collect();
    let medians = boxes_px.iter().map(|&one| middle::colour(picture, one)).collect();
    Look { colours: medians, fruitness: means, fruit_px: pixels, elsewhere }
}

/// Mean probability of being fruit in the ellipse of a box, and the pixels that rather are.
fn fruitness(picture: Picture, one: &PixelBox, colours: &FruitColour) -> (f64, f64) {
    let (mut sum, mut count, mut fruit) = (0.0, 0.0, 0.0);
    for (row, columns) in one.rows_in(|column, row| in_ellipse(one, column, row)) {
        count += columns.len() as f64;
        for &colour in &picture.row(row)[columns] {
            let probability = colours.of(colour);
            sum += f64::from(probability);
            fruit += f64::from(u8::from(probability > FRUIT));
        }
    }
    (if count > 0.0 { sum / count } else { 0.0 }, fruit)
}

fn in_ellipse(one: &PixelBox, column: usize, row: usize) -> bool {
    let off = |at: usize, from: usize, size: usize| (2.0 * (at - from) as f64 + 1.0) / size as f64 - 1.0;
    off(column, one.left, one.width()).powi(2) + off(row, one.top, one.height()).powi(2) <= 1.0
}

/// Boxes of the median size over the picture, those that touch none of `boxes`.
fn places_without(boxes: &[PixelBox], width: usize, height: usize) -> Vec<PixelBox> {
    let middle = |mut sizes: Vec<usize>| *sizes.select_nth_unstable(boxes.len() / 2).1;
    let (wide, high) =
        (middle(boxes.iter().map(PixelBox::width).collect()), middle(boxes.iter().map(PixelBox::height).collect()));
    let place = |k: usize, of: usize, size: usize, whole: usize| (2 * k + 1) * whole.saturating_sub(size) / (2 * of);
    let mut places = Vec::new();
    for i in 0..PLACES[0] {
        for j in 0..PLACES[1] {
            let (left, top) = (place(i, PLACES[0], wide, width), place(j, PLACES[1], high, height));
            let one = PixelBox { left, top, right: (left + wide).min(width), bottom: (top + high).min(height) };
            if !boxes.iter().any(|other| one.touches(other)) {
                places.push(one);
            }
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Leaves of many greens, with red discs in some boxes.
    fn scene(reds: &[[usize; 4]]) -> Vec<u8> {
        let (width, height) = (320, 180);
        let mut values = Vec::with_capacity(3 * width * height);
        for row in 0..height {
            for column in 0..width {
                let green = 90 + ((column * 7 + row * 13) % 90) as u8;
                let is_red = reds
                    .iter()
                    .any(|&[left, top, right, bottom]| (left..right).contains(&column) && (top..bottom).contains(&row));
                values.extend(if is_red { [30, 40, 60 + green] } else { [40, green, green / 2] });
            }
        }
        values
    }

    #[test]
    fn a_leaf_in_a_box_looks_like_what_is_beside_boxes() {
        let fruits: Vec<[usize; 4]> = (0..8).map(|k| [20 + 36 * k, 60, 40 + 36 * k, 80]).collect();
        let values = scene(&fruits);
        let mut boxes: Vec<_> = fruits.iter().map(|one| one.map(|edge| edge as f64)).collect();
        boxes.push([100.0, 120.0, 120.0, 140.0]);
        let found = look_of(Picture::new(&values, 320), &boxes);
        let leaves = found.elsewhere.iter().copied().fold(0.0, f64::max);
        assert!(found.fruitness[..8].iter().all(|&one| one > 0.9), "{:?}", found.fruitness);
        assert!(found.fruitness[8] < leaves + 0.15 && leaves < 0.4, "{:?} {leaves}", found.fruitness[8]);
        assert!(found.fruit_px[0] > 250.0 && found.fruit_px[8] < 30.0);
    }

    #[test]
    fn a_picture_without_boxes_says_nothing() {
        assert_eq!(look_of(Picture::new(&scene(&[]), 320), &[]), Look::default());
    }
}
