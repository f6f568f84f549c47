//! The seeds of a large map by their shape, a byte for each number of a code.

use super::{CompactMap, Facts};
use crate::verified::codes::{Code, Run};
use crate::verified::seeds::{Quad, STARS};

/// Codes that are measured at once.
pub(super) const LANES: usize = 16;

/// Numbers of a code.
pub(super) const NUMBERS: usize = 6;

/// A code in steps, a byte each.
pub(super) type Shape = [u8; NUMBERS];

/// Steps of a spacing: 7 mm in an orchard, which adds a hundredth to the variance of the noise.
pub(super) const STEPS: f64 = 40.0;

/// Zero of the last two numbers of a code, which have a sign.
const ZERO: f32 = 128.0;

/// A code in metres as one in steps.
pub(super) fn in_steps(code: &Code, step: f64) -> Code {
    let mut steps = code.map(|number| number / step as f32);
    steps[4..].iter_mut().for_each(|number| *number += ZERO);
    steps
}

/// As it is stored; `None` where a byte does not hold it.
pub(super) fn rounded(steps: &Code) -> Option<Shape> {
    let fits = steps.iter().all(|number| (-0.5..255.5).contains(number));
    fits.then(|| steps.map(|number| number.round() as u8))
}

/// What a search asks of the shapes. Numbers from a file may be wrong: none is trusted as a row.
pub(super) struct Shapes<'a> {
    facts: &'a Facts,
    starts: &'a [u32],
    common: &'a [u32],
    codes: &'a [u8],
    anchors: &'a [u32],
    labels: &'a [u16],
    companions: &'a [u32],
}

impl<'a> Shapes<'a> {
    pub(super) fn new(map: &'a CompactMap) -> Self {
        Self {
            facts: &map.facts,
            starts: map.starts.get(),
            common: map.common.get(),
            codes: map.codes.get(),
            anchors: map.anchors.get(),
            labels: map.labels.get(),
            companions: map.companions.get(),
        }
    }

    /// How many seeds of the map are in the cell of a code, on average over it and those beside it; `None` where the map
    /// keeps none because there are too many.
    pub(super) fn crowd(&self, steps: &Code) -> Option<f32> {
        let cells = &self.facts.cells;
        let own = cells.of(steps) as usize;
        if self.common[own / 32] >> (own % 32) & 1 == 1 {
            return None;
        }
        let count = |cell: usize| self.starts[cell + 1].saturating_sub(self.starts[cell]) as f32;
        let mut sum = count(own);
        for number in 0..NUMBERS {
            for aside in [-cells.edge, cells.edge] {
                let mut beside = *steps;
                beside[number] += aside;
                sum += count(cells.of(&beside) as usize);
            }
        }
        Some(sum / (1 + 2 * NUMBERS) as f32)
    }

    /// Calls `visit` with every seed whose code is within `radius` of `shape`, both in steps.
    pub(super) fn within(&self, shape: Shape, radius: f32, runs: &mut Vec<Run>, mut visit: impl FnMut(Quad)) {
        let limit = (radius * radius).min(f32::from(u16::MAX - 1)) as u16;
        self.facts.cells.near(&shape.map(f32::from), radius, runs, |cells| {
            let (first, end) = (self.starts[cells.start] as usize, self.starts[cells.end] as usize);
            for block in first / LANES..end.div_ceil(LANES) {
                let Some(codes) = self.codes.get(block * LANES * NUMBERS..(block + 1) * LANES * NUMBERS) else { break };
                let distances = squared_distances(codes, shape);
                if distances.iter().all(|&distance| distance > limit) {
                    continue;
                }
                for (lane, _) in distances.iter().enumerate().filter(|(_, distance)| **distance <= limit) {
                    let seed = block * LANES + lane;
                    if let Some(quad) = self.quad(seed).filter(|_| (first..end).contains(&seed)) {
                        visit(quad);
                    }
                }
            }
        });
    }

    /// The fruits of a seed.
    #[inline]
    fn quad(&self, seed: usize) -> Option<Quad> {
        let (anchor, label) = (*self.anchors.get(seed)?, *self.labels.get(seed)?);
        let first = anchor as usize * self.facts.each;
        let near = self.companions.get(first..first + self.facts.each)?;
        let mut quad = [anchor; STARS];
        for (place, row) in quad.iter_mut().enumerate() {
            let which = usize::from(label >> (4 * place) & 15);
            if which > 0 {
                *row = *near.get(which - 1)?;
            }
        }
        Some(quad)
    }
}

/// Up to the largest number of 16 bits.
#[inline]
fn squared_distances(codes: &[u8], shape: Shape) -> [u16; LANES] {
    let mut sums = [0u16; LANES];
    for (numbers, own) in codes.chunks_exact(LANES).zip(shape) {
        for (sum, &number) in sums.iter_mut().zip(numbers) {
            let apart = u16::from(number.abs_diff(own));
            *sum = sum.saturating_add(apart * apart);
        }
    }
    sums
}
