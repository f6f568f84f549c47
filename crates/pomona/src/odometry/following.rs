//! Points followed from one picture to another: the method of Lucas and Kanade on pyramids (Bouguet, 2000), forth and back.
//!
//! A window T around a point of the first picture and the second picture J at x + d differ by what the gradients of T and a
//! step explain, and by the light: a gain and an offset of each window's own, for lamps flicker, shutters roll and leaves
//! shade. With g the gradients without the part that T itself and a constant explain as well, the light falls out of
//!
//! ```text
//! (sum g g^T) step = sum g (T - J(x + d)),    d <- d + step,
//! ```
//!
//! from the coarsest pictures to the finest. Steps are as much too long as the gain is above 1: gains of whole pictures
//! are better taken out before. Only windows are looked at, so a call costs what its points cost, whatever the size of the
//! pictures.

use super::config::PicturesConfig;
use crate::row_search::Grey;
use nalgebra::{Matrix2, Vector2};

/// Values of a row of a window that are computed at once; those beyond its side weigh nothing.
const LANES: usize = 16;

/// Sides of windows go up to this: with a pixel beside, a row fits.
pub(super) const MAX_WINDOW_PX: usize = LANES - 1;

/// Least eigenvalue of the mean of g g^T, squared grey steps a pixel: below, a window shows nothing that has a place.
const MIN_EIGENVALUE: f32 = 0.1;

/// Two steps that undo each other to this many pixels go on for ever; the place between is taken.
const SWINGING_PX: f32 = 0.01;

type Row = [f32; LANES];

/// Where the second picture shows points (x, y) of the first, given where they are expected; none for a point that is not
/// found, does not come home, or whose window the edge cuts.
///
/// Pictures come with their halvings, finest first; as many are used as both have.
pub fn follow(
    first: &[Grey<'_>],
    second: &[Grey<'_>],
    points: &[Vector2<f64>],
    expected: &[Vector2<f64>],
    config: &PicturesConfig,
) -> Vec<Option<Vector2<f64>>> {
    let levels = first.len().min(second.len());
    let edge = (config.window_px / 2) as f64;
    let one = |(point, expected): (&Vector2<f64>, &Vector2<f64>)| {
        let start = point.cast::<f32>();
        let there = descended(&first[..levels], &second[..levels], start, expected.cast(), config)?;
        let back = settled(second[0], first[0], there, start, config)?;
        let there: Vector2<f64> = there.cast();
        let (width, height) = (second[0].width as f64, second[0].height() as f64);
        let inside = there.x >= edge && there.x < width - edge && there.y >= edge && there.y < height - edge;
        (inside && f64::from((back - start).norm()) < config.forth_and_back_px).then_some(there)
    };
    if levels == 0 { vec![None; points.len()] } else { points.iter().zip(expected).map(one).collect() }
}

/// From the coarsest pictures to the finest.
fn descended(
    first: &[Grey<'_>],
    second: &[Grey<'_>],
    point: Vector2<f32>,
    expected: Vector2<f32>,
    config: &PicturesConfig,
) -> Option<Vector2<f32>> {
    let mut guess = expected;
    for level in (0..first.len()).rev() {
        let scale = 1.0 / (1 << level) as f32;
        let found = settled(first[level], second[level], point * scale, guess * scale, config);
        // What a coarse picture does not show, a finer one may.
        match found {
            Some(place) => guess = place / scale,
            None if level == 0 => return None,
            None => {}
        }
    }
    Some(guess)
}

/// Steps at one level until they are small; none where the window shows nothing or leaves the picture.
fn settled(
    first: Grey<'_>,
    second: Grey<'_>,
    point: Vector2<f32>,
    guess: Vector2<f32>,
    config: &PicturesConfig,
) -> Option<Vector2<f32>> {
    let side = config.window_px;
    let half = Vector2::repeat((side - 1) as f32 / 2.0);
    let template = Template::new(first, point - half, side)?;
    let (mut corner, mut before) = (guess - half, Vector2::zeros());
    for step_number in 0..config.max_steps {
        let step = template.step(second, corner)?;
        corner += step;
        if f64::from(step.norm()) <= config.settled_px {
            break;
        }
        if step_number > 0 && (step + before).abs().max() < SWINGING_PX {
            corner -= step * 0.5;
            break;
        }
        before = step;
    }
    is_near(second, corner, side).then_some(corner + half)
}

/// Whether a window touches the picture.
fn is_near(picture: Grey<'_>, corner: Vector2<f32>, side: usize) -> bool {
    let reach = |at: f32, size: usize| size > 0 && at >= -(side as f32) && at < size as f32;
    reach(corner.x, picture.width) && reach(corner.y, picture.height())
}

/// A window of the first picture, its gradients as far as no light explains them, and the inverse of their sum of squares.
struct Template {
    side: usize,
    values: [Row; LANES],
    across: [Row; LANES],
    down: [Row; LANES],
    inverse: Matrix2<f32>,
}

impl Template {
    /// The window with its first value at `corner`; none where it shows nothing.
    fn new(picture: Grey<'_>, corner: Vector2<f32>, side: usize) -> Option<Self> {
        if !is_near(picture, corner, side) {
            return None;
        }
        let mut room = NO_ROOM;
        let window = Window::new(picture, corner - Vector2::repeat(1.0), side + 2, &mut room);
        let mut wide = [[0.0; AROUND]; LANES + 1];
        for (row, values) in wide.iter_mut().enumerate().take(side + 2) {
            window.fill(row, values);
        }
        let mut all = Self {
            side,
            values: [[0.0; LANES]; LANES],
            across: [[0.0; LANES]; LANES],
            down: [[0.0; LANES]; LANES],
            inverse: Matrix2::zeros(),
        };
        let counts: Row = std::array::from_fn(|lane| f32::from(u8::from(lane < side)));
        for row in 0..side {
            let [above, here, below] = [&wide[row], &wide[row + 1], &wide[row + 2]];
            // Scharr's weights: the gradient of a plane, and nearly the same in all directions.
            let slopes: [f32; AROUND] = std::array::from_fn(|k| (below[k] - above[k]) / 32.0);
            let smooth: [f32; AROUND] = std::array::from_fn(|k| (3.0 * (above[k] + below[k]) + 10.0 * here[k]) / 32.0);
            for lane in 0..LANES {
                all.values[row][lane] = counts[lane] * here[lane + 1];
                all.across[row][lane] = counts[lane] * (smooth[lane + 2] - smooth[lane]);
                all.down[row][lane] =
                    counts[lane] * (3.0 * (slopes[lane] + slopes[lane + 2]) + 10.0 * slopes[lane + 1]);
            }
        }
        let shades = all.shades(&counts);
        for slopes in [&mut all.across, &mut all.down] {
            without_light(&mut slopes[..side], &shades[..side], &counts);
        }
        let (across, down) = (&all.across[..side], &all.down[..side]);
        let [xx, xy, yy] = [product(across, across), product(across, down), product(down, down)];
        let least = (xx + yy - ((xx - yy).powi(2) + 4.0 * xy * xy).sqrt()) / 2.0;
        all.inverse = Matrix2::new(xx, xy, xy, yy).try_inverse()?;
        (least >= MIN_EIGENVALUE * (side * side) as f32).then_some(all)
    }

    /// The values over their mean; 0 beyond the side.
    fn shades(&self, counts: &Row) -> [Row; LANES] {
        let mean = sum(&self.values[..self.side]) / (self.side * self.side) as f32;
        self.values.map(|row| std::array::from_fn(|lane| row[lane] - counts[lane] * mean))
    }

    /// The step that explains best what differs with the window at `corner`; none where that leaves the picture.
    fn step(&self, picture: Grey<'_>, corner: Vector2<f32>) -> Option<Vector2<f32>> {
        if !is_near(picture, corner, self.side) {
            return None;
        }
        let mut room = NO_ROOM;
        let window = Window::new(picture, corner, self.side, &mut room);
        let (mut across, mut down) = ([0.0; LANES], [0.0; LANES]);
        for first in (0..LANES).step_by(QUAD) {
            let here = first..first + QUAD;
            let [by_x, by_y] = self.sums(&window, first);
            across[here.clone()].copy_from_slice(&by_x);
            down[here].copy_from_slice(&by_y);
        }
        Some(self.inverse * Vector2::new(across.iter().sum(), down.iter().sum()))
    }

    /// Sums over the rows, in a few columns: all that is needed stays in registers.
    fn sums(&self, window: &Window<'_>, first: usize) -> [[f32; QUAD]; 2] {
        let [a, b, c, d] = window.weights;
        let (mut across, mut down) = ([0.0; QUAD], [0.0; QUAD]);
        let [mut left, mut right] = window.pixels(0, first);
        let templates = self.values.iter().zip(&self.across).zip(&self.down).take(self.side);
        for (row, ((values, by_x), by_y)) in templates.enumerate() {
            let [left_below, right_below] = window.pixels(row + 1, first);
            let [values, by_x, by_y] = [values, by_x, by_y].map(|all| &all[first..first + QUAD]);
            for k in 0..QUAD {
                let off = values[k] - (a * left[k] + b * right[k] + c * left_below[k] + d * right_below[k]);
                across[k] += off * by_x[k];
                down[k] += off * by_y[k];
            }
            [left, right] = [left_below, right_below];
        }
        [across, down]
    }
}

/// Takes out of gradients what another offset, and another gain of the values over their mean, explain as well.
fn without_light(slopes: &mut [Row], shades: &[Row], counts: &Row) {
    let offset = sum(slopes) / (slopes.len() * slopes.len()) as f32;
    let gain = product(slopes, shades) / product(shades, shades).max(f32::MIN_POSITIVE);
    for (slope, shade) in slopes.iter_mut().zip(shades) {
        for lane in 0..LANES {
            slope[lane] -= counts[lane] * offset + gain * shade[lane];
        }
    }
}

fn sum(rows: &[Row]) -> f32 {
    let mut sums = [0.0; LANES];
    for row in rows {
        for lane in 0..LANES {
            sums[lane] += row[lane];
        }
    }
    sums.iter().sum()
}

fn product(first: &[Row], second: &[Row]) -> f32 {
    let mut sums = [0.0; LANES];
    for (one, other) in first.iter().zip(second) {
        for lane in 0..LANES {
            sums[lane] += one[lane] * other[lane];
        }
    }
    sums.iter().sum()
}

/// Values of a register that every processor has.
const QUAD: usize = 4;

/// Pixels around a window: one more than it has values, and two more for its gradients.
const AROUND: usize = LANES + 2;

/// Room for the pixels around a window that the edge of the picture cuts.
type Room = [u8; AROUND * AROUND];
const NO_ROOM: Room = [0; AROUND * AROUND];

/// A window between the pixels of a picture.
struct Window<'a> {
    /// From its first pixel on.
    pixels: &'a [u8],
    /// Pixels from one row to the next.
    stride: usize,
    /// How much each of four neighbours counts.
    weights: [f32; 4],
}

impl<'a> Window<'a> {
    fn new(picture: Grey<'a>, corner: Vector2<f32>, side: usize, room: &'a mut Room) -> Self {
        let whole = corner.map(f32::floor);
        let part = corner - whole;
        let (left, top) = (whole.x as isize, whole.y as isize);
        let weights =
            [(1.0 - part.x) * (1.0 - part.y), part.x * (1.0 - part.y), (1.0 - part.x) * part.y, part.x * part.y];
        let (width, height) = (picture.width as isize, picture.height() as isize);
        if left >= 0 && top >= 0 && left + AROUND as isize <= width && top + (side as isize) < height {
            let first = top as usize * picture.width + left as usize;
            return Self { pixels: &picture.pixels[first..], stride: picture.width, weights };
        }
        for (row, pixels) in room.chunks_exact_mut(AROUND).enumerate().take(side + 1) {
            let first = reflected(top + row as isize, height) * picture.width;
            for (column, pixel) in pixels.iter_mut().enumerate() {
                *pixel = picture.pixels[first + reflected(left + column as isize, width)];
            }
        }
        Self { pixels: room, stride: AROUND, weights }
    }

    /// Whole pixels of a row from a column on, and their neighbours to the right.
    fn pixels(&self, row: usize, first: usize) -> [[f32; QUAD]; 2] {
        let seen = &self.pixels[row * self.stride + first..][..=QUAD];
        [0, 1].map(|shift| std::array::from_fn(|k| f32::from(seen[shift + k])))
    }

    /// Fills in the values of a row with two more; the last of them does not count.
    fn fill(&self, row: usize, values: &mut [f32; AROUND]) {
        let [a, b, c, d] = self.weights;
        let [here, below] = [row, row + 1].map(|row| &self.pixels[row * self.stride..][..AROUND]);
        for k in 0..AROUND - 1 {
            let [left, right, left_below, right_below] = [here[k], here[k + 1], below[k], below[k + 1]].map(f32::from);
            values[k] = a * left + b * right + c * left_below + d * right_below;
        }
    }
}

/// The pixel that stands for one beyond the edge: as far inside, the edge itself once.
fn reflected(at: isize, size: isize) -> usize {
    let period = (2 * (size - 1)).max(1);
    let within = at.rem_euclid(period);
    within.min(period - within).min(size - 1) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix;

    const SIZE: [usize; 2] = [160, 120];

    /// Smooth waves of all directions, moved by (x, y).
    fn waves(x: f64, y: f64) -> Vec<u8> {
        let mut random = SplitMix(6);
        let mut unit = || random.below(1 << 20) as f64 / f64::from(1 << 20);
        let waves: Vec<[f64; 3]> =
            (0..40).map(|_| [0.9 * (unit() - 0.5), 0.9 * (unit() - 0.5), std::f64::consts::TAU * unit()]).collect();
        let value = |column: f64, row: f64| {
            let sum: f64 = waves.iter().map(|[a, b, phase]| (a * column + b * row + phase).sin()).sum();
            (128.0 + 12.0 * sum).clamp(0.0, 255.0).round() as u8
        };
        let places = (0..SIZE[1]).flat_map(|row| (0..SIZE[0]).map(move |column| (column, row)));
        places.map(|(column, row)| value(column as f64 - x, row as f64 - y)).collect()
    }

    fn grey(pixels: &[u8]) -> Grey<'_> {
        Grey { pixels, width: SIZE[0] }
    }

    fn followed(shift: [f64; 2], expected_off: [f64; 2], point: [f64; 2]) -> Option<Vector2<f64>> {
        let (first, second) = (waves(0.0, 0.0), waves(shift[0], shift[1]));
        let point = Vector2::from(point);
        let expected = point + Vector2::from(shift) + Vector2::from(expected_off);
        follow(&[grey(&first)], &[grey(&second)], &[point], &[expected], &PicturesConfig::default())[0]
    }

    #[test]
    fn a_shift_is_found_to_a_part_of_a_pixel() {
        for shift in [[0.0, 0.0], [3.3, -1.7], [-20.25, 8.5]] {
            let found = followed(shift, [0.8, -0.6], [80.0, 60.0]).expect("plenty to see");
            let off = found - Vector2::new(80.0, 60.0) - Vector2::from(shift);
            assert!(off.norm() < 0.1, "{shift:?}: {off}");
        }
    }

    #[test]
    fn windows_may_be_lit_otherwise() {
        let (first, second) = (waves(0.0, 0.0), waves(3.3, -1.7));
        let second: Vec<u8> = second.iter().map(|&value| (0.7 * f64::from(value) + 50.0).round() as u8).collect();
        let points: Vec<_> = (0..30).map(|k| Vector2::new(f64::from(30 + 3 * k), f64::from(20 + 2 * k))).collect();
        let found = follow(&[grey(&first)], &[grey(&second)], &points, &points, &PicturesConfig::default());
        let is_near = |(place, point): (&Option<Vector2<f64>>, &Vector2<f64>)| {
            place.is_some_and(|place| (place - point - Vector2::new(3.3, -1.7)).norm() < 0.1)
        };
        assert!(found.iter().zip(&points).filter(|&one| is_near(one)).count() > 25, "{found:?}");
    }

    #[test]
    fn what_is_nowhere_near_or_shows_nothing_is_not_found() {
        assert_eq!(followed([0.0, 0.0], [0.0, 500.0], [80.0, 60.0]), None);
        let flat = vec![90; SIZE[0] * SIZE[1]];
        let point = [Vector2::new(80.0, 60.0)];
        assert_eq!(follow(&[grey(&flat)], &[grey(&flat)], &point, &point, &PicturesConfig::default()), [None]);
        let nowhere = [Vector2::new(f64::NAN, 60.0)];
        let waves = waves(0.0, 0.0);
        assert_eq!(follow(&[grey(&waves)], &[grey(&waves)], &point, &nowhere, &PicturesConfig::default()), [None]);
    }

    #[test]
    fn another_scene_does_not_lead_home() {
        let (first, second) = (waves(0.0, 0.0), waves(900.0, 700.0));
        let config = PicturesConfig::default();
        let points: Vec<_> = (0..60).map(|k| Vector2::new(f64::from(20 + 2 * k), f64::from(20 + k))).collect();
        let found = follow(&[grey(&first)], &[grey(&second)], &points, &points, &config);
        assert!(found.iter().flatten().count() < 30, "{found:?}");
    }

    #[test]
    fn windows_at_the_edge_are_followed_until_it_cuts_them() {
        assert!(followed([0.0, 0.0], [0.5, 0.5], [7.0, 8.0]).is_some());
        assert_eq!(followed([-4.0, 0.0], [0.0, 0.0], [8.0, 60.0]), None);
        assert_eq!([reflected(-3, 10), reflected(11, 10), reflected(0, 1), reflected(25, 10)], [3, 7, 0, 7]);
    }
}
