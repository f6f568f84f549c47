//! Pictures of one scene that were exposed differently: the gain between them.
//!
//! Windows of pictures are compared by their values, so a picture that is brighter by a third matches nowhere. Both eyes,
//! and neighbouring frames, see nearly the same scene: the gain is what the quantiles of their values differ by. What the
//! scene itself changes from frame to frame stays below the least gain that is taken out, so pictures that were exposed
//! alike stay as they are.

use crate::statistics::median;

/// Quantiles that are compared: dark parts are noise, and the brightest are cut off.
const QUANTILES: [f64; 2] = [0.2, 0.9];
const N_QUANTILES: usize = 15;

/// Values that are neither cut off nor a few steps of rounding.
const USABLE: [f64; 2] = [4.0, 250.0];

/// Pictures that were exposed alike differ by less: from frame to frame of the rendered row by up to 1.035, between its
/// eyes by up to 1.02.
const LEAST_GAIN: f64 = 1.05;

/// So many columns, and rows as far apart, are enough: 14,400 pixels of 16 : 9.
const COLUMNS: usize = 160;

/// What becomes of each value of one channel.
pub type Table = [u8; 256];

/// A picture with interleaved channels, row by row.
#[derive(Debug, Clone, Copy)]
pub struct Channels<'a> {
    /// All values.
    pub values: &'a [u8],
    /// Pixels of a row.
    pub width: usize,
    /// Values of a pixel.
    pub count: usize,
}

/// For each channel the factor that brings a picture to the exposure of another one of the same scene; 1 where nothing
/// says.
pub fn gains(picture: Channels<'_>, reference: Channels<'_>) -> Vec<f64> {
    (0..picture.count).map(|channel| gain(&picture.quantiles(channel), &reference.quantiles(channel))).collect()
}

/// For each channel what its values become in the exposure of the other picture; none where gains stay below the least.
pub fn tables(picture: Channels<'_>, reference: Channels<'_>) -> Option<Vec<Table>> {
    let gains = gains(picture, reference);
    let is_alike = gains.iter().all(|gain| gain.max(1.0 / gain) < LEAST_GAIN);
    let table =
        |gain: &f64| std::array::from_fn(|value| (value as f64 * gain).round_ties_even().clamp(0.0, 255.0) as u8);
    (!is_alike).then(|| gains.iter().map(table).collect())
}

fn gain(mine: &[f64], theirs: &[f64]) -> f64 {
    let usable = |(mine, theirs): &(&f64, &f64)| mine.min(**theirs) > USABLE[0] && mine.max(**theirs) < USABLE[1];
    let mut logs: Vec<f64> =
        mine.iter().zip(theirs).filter(usable).map(|(mine, theirs)| (theirs / mine).ln()).collect();
    if logs.is_empty() { 1.0 } else { median(&mut logs).exp() }
}

impl Channels<'_> {
    /// Quantiles by the histogram, between whole values as if each filled its step.
    fn quantiles(&self, channel: usize) -> Vec<f64> {
        let step = (self.width / COLUMNS).max(1);
        let mut below = [0.0; 256];
        for row in self.values.chunks_exact((self.width * self.count).max(1)).step_by(step) {
            for &value in row.iter().skip(channel).step_by(step * self.count) {
                below[usize::from(value)] += 1.0;
            }
        }
        for value in 1..below.len() {
            below[value] += below[value - 1];
        }
        let part = |k: usize| QUANTILES[0] + (QUANTILES[1] - QUANTILES[0]) * k as f64 / (N_QUANTILES - 1) as f64;
        (0..N_QUANTILES).map(|k| value_at(&below, part(k) * below[255])).collect()
    }
}

/// The value below which so many lie.
fn value_at(below: &[f64; 256], wanted: f64) -> f64 {
    let after = below.partition_point(|&count| count <= wanted);
    match after {
        0 => 0.5,
        256 => 255.5,
        _ => {
            let (low, high) = (below[after - 1], below[after]);
            after as f64 - 0.5 + (wanted - low) / (high - low)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix;

    fn scene(factor: f64) -> Vec<u8> {
        let mut random = SplitMix(5);
        (0..160 * 90).map(|_| ((20 + random.below(120)) as f64 * factor).round() as u8).collect()
    }

    fn grey(values: &[u8]) -> Channels<'_> {
        Channels { values, width: 160, count: 1 }
    }

    #[test]
    fn a_darker_picture_is_brought_back() {
        let (dark, reference) = (scene(0.7), scene(1.0));
        let gain = gains(grey(&dark), grey(&reference))[0];
        assert!((gain * 0.7 - 1.0).abs() < 0.02, "{gain}");
        let table = &tables(grey(&dark), grey(&reference)).expect("30 % are no noise")[0];
        assert_eq!((table[0], table[255]), (0, 255));
        assert!((f64::from(table[70]) - 100.0).abs() < 3.0);
    }

    #[test]
    fn gains_below_five_percent_are_the_scene() {
        let reference = scene(1.0);
        assert!(tables(grey(&scene(1.04)), grey(&reference)).is_none());
        assert!(tables(grey(&scene(1.06)), grey(&reference)).is_some());
        assert!(tables(grey(&scene(0.0)), grey(&reference)).is_none(), "black says nothing");
    }

    #[test]
    fn each_channel_has_its_own_gain() {
        let (one, other) = (scene(0.8), scene(1.0));
        let both: Vec<u8> = one.iter().zip(&other).flat_map(|(&a, &b)| [a, b]).collect();
        let like: Vec<u8> = other.iter().flat_map(|&b| [b, b]).collect();
        let channels = |values| Channels { values, width: 160, count: 2 };
        let found = gains(channels(&both), channels(&like));
        assert!((found[0] - 1.25).abs() < 0.03 && (found[1] - 1.0).abs() < 1e-12, "{found:?}");
    }
}
