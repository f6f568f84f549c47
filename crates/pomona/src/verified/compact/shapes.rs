//! The seeds of a large map by their shape, a byte for each number of a code.

use super::seed_blocks::{Anchored, Block, LANES, anchored, squared_distances};
use super::surroundings::{Surroundings, step_of};
use super::{CompactMap, Facts};
use crate::neighbours::code_grid::{Code, Run};
use crate::verified::seeds::{Quad, STARS};
use std::ops::Range;

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
    seeds: &'a [Block],
    companions: &'a [u32],
    surroundings: &'a [Surroundings],
}

impl<'a> Shapes<'a> {
    pub(super) fn new(map: &'a CompactMap) -> Self {
        Self {
            facts: &map.facts,
            starts: map.starts.get(),
            common: map.common.get(),
            seeds: map.seeds.get(),
            companions: map.companions.get(),
            surroundings: map.surroundings.get(),
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

    /// How many times the seeds of a cell are within `radius` steps of a shape: the ball of six dimensions over the cube.
    pub(super) fn reach(&self, radius: f32) -> f32 {
        const UNIT_BALL: f32 = 5.167_713; // pi^3 / 6
        UNIT_BALL * (radius / self.facts.cells.edge).powi(NUMBERS as i32)
    }

    /// Finds the seeds whose shape is within `radius` of `shape`, both in steps, with what hangs next to them.
    ///
    /// In turns, each over all that the one before found: so that many waits for memory run at once.
    pub(super) fn near(&self, shape: Shape, radius: f32, scratch: &mut Scratch) {
        let limit = (radius * radius).min(f32::from(u16::MAX - 1)) as u16;
        let Scratch { runs, cells, met, around } = scratch;
        cells.clear();
        self.facts.cells.near(&shape.map(f32::from), radius, runs, |row| cells.push(row));
        for row in cells.iter_mut() {
            *row = self.starts[row.start] as usize..self.starts[row.end] as usize;
        }
        met.clear();
        for seeds in cells.iter() {
            self.scan(shape, limit, seeds, met);
        }
        around.clear();
        around.extend(met.iter().map(|seed| *self.surroundings.get(seed.anchor as usize).unwrap_or(&NOWHERE)));
    }

    /// Those of a row of seeds that are within the limit.
    #[inline]
    fn scan(&self, shape: Shape, limit: u16, seeds: &Range<usize>, met: &mut Vec<Anchored>) {
        if seeds.is_empty() {
            return;
        }
        let first = seeds.start / LANES;
        let blocks = self.seeds.get(first..seeds.end.div_ceil(LANES)).unwrap_or_default();
        for (at, block) in (first..).zip(blocks) {
            let distances = squared_distances(block, shape);
            if distances.iter().all(|&distance| distance > limit) {
                continue;
            }
            let lanes = (0..LANES).filter(|&lane| distances[lane] <= limit && seeds.contains(&(at * LANES + lane)));
            met.extend(lanes.map(|lane| anchored(block, lane)));
        }
    }

    /// Metres of a step of a shape.
    pub(super) fn step(&self) -> f64 {
        self.facts.step
    }

    /// Metres of a step of what hangs next to fruits.
    pub(super) fn near_step(&self) -> f64 {
        step_of(self.facts.spacing)
    }

    /// The fruits of a seed.
    #[inline]
    pub(super) fn quad(&self, seed: Anchored) -> Option<Quad> {
        let first = seed.anchor as usize * self.facts.each;
        let near = self.companions.get(first..first + self.facts.each)?;
        let mut quad = [seed.anchor; STARS];
        for (row, which) in quad.iter_mut().zip(seed.which()) {
            if which > 0 {
                *row = *near.get(which - 1)?;
            }
        }
        Some(quad)
    }
}

/// What a search has found, and buffers of it that are used again.
#[derive(Default)]
pub(super) struct Scratch {
    runs: Vec<Run>,
    /// Rows of cells, then of the seeds in them.
    cells: Vec<Range<usize>>,
    pub(super) met: Vec<Anchored>,
    pub(super) around: Vec<Surroundings>,
}

/// What hangs next to a fruit that is not there.
const NOWHERE: Surroundings = [0; size_of::<Surroundings>()];
