//! Which codes are near a code: a grid over all six numbers.
//!
//! A k-d tree prunes badly in six dimensions and is slow to build. A grid with about as many cells as codes is built by
//! counting; a search lists the rows of cells that are near enough and measures what is in them, eight codes at once.

use rayon::prelude::*;
use std::ops::Range;

/// Numbers of a code.
const NUMBERS: usize = 6;

/// A code; what its numbers are is the caller's.
pub(crate) type Code = [f32; NUMBERS];

/// Codes in the order of a grid's cells.
#[derive(Debug, Clone)]
pub(crate) struct CodeGrid {
    cells: Cells,
    /// Place of each cell's first code, one more than there are cells.
    starts: Vec<u32>,
    blocks: Vec<Block>,
}

/// The space of codes, cut into cubes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Cells {
    /// Axes by their number of cells; along the last, cells are next to each other.
    pub(crate) axes: [Axis; NUMBERS],
    pub(crate) edge: f32,
}

/// Codes that are measured at once, number by number; the last block is filled up with codes that are near nothing.
type Block = [[f32; LANES]; NUMBERS];

/// Two registers of the smallest processors.
const LANES: usize = 8;

/// One number of the code, cut into cells.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Axis {
    /// Which number of the code.
    pub(crate) number: usize,
    pub(crate) low: f32,
    pub(crate) cells: u32,
}

impl Axis {
    /// The cell of a value; the first and the last reach to infinity.
    #[inline]
    fn cell(&self, value: f32, inverse_edge: f32) -> u32 {
        (((value - self.low) * inverse_edge).max(0.0) as u32).min(self.cells - 1)
    }

    /// Distance from a value to a cell, at most a rounding error too short.
    #[inline]
    fn gap(&self, value: f32, cell: u32, edge: f32) -> f32 {
        let low = self.low + cell as f32 * edge;
        let below = if cell == 0 { 0.0 } else { low - value };
        let above = if cell + 1 == self.cells { 0.0 } else { value - (low + edge) };
        (below.max(above) - ROUNDING * edge).max(0.0)
    }
}

/// Edges by which a value may be thought to lie in a neighbouring cell.
const ROUNDING: f32 = 1e-3;

impl Cells {
    /// Cuts the space of `count` codes into `most` cubes at the most.
    pub(crate) fn cut(count: usize, most: f64, code: &impl Fn(usize) -> Code) -> Self {
        let sample: Vec<Code> = (0..count).step_by(count.div_ceil(SAMPLE).max(1)).map(code).collect();
        let extents: [(f32, f32); NUMBERS] = std::array::from_fn(|number| {
            let mut values: Vec<f32> = sample.iter().map(|code| code[number]).collect();
            values.sort_unstable_by(f32::total_cmp);
            let beyond = (values.len() as f64 * BEYOND) as usize;
            let at = |place: usize| values.get(place).copied().unwrap_or(0.0);
            (at(beyond), at(values.len().saturating_sub(1 + beyond)))
        });
        // Of cells finer than this single precision mistakes more than their rounding.
        let finest = f32::EPSILON / ROUNDING;
        // Of codes that are all the same, or none, the finest edge is a number too.
        let least = f32::MIN_POSITIVE / finest;
        let widest = extents.iter().fold(least, |widest, (low, high)| widest.max(high - low));
        let cells = |(low, high): (f32, f32), edge: f32| ((high - low) / edge).ceil().max(1.0) as u32;
        let mut edge = widest;
        loop {
            let finer = 0.9 * edge;
            let all: f64 = extents.iter().map(|&extent| f64::from(cells(extent, finer))).product();
            if all > most || finer < finest * widest {
                break;
            }
            edge = finer;
        }
        let mut axes: [Axis; NUMBERS] =
            std::array::from_fn(|number| Axis { number, low: extents[number].0, cells: cells(extents[number], edge) });
        axes.sort_by_key(|axis| axis.cells);
        Self { axes, edge }
    }

    /// The cell of a code.
    #[inline]
    pub(crate) fn of(&self, code: &Code) -> u32 {
        let inverse_edge = 1.0 / self.edge;
        self.axes.iter().fold(0, |cell, axis| cell * axis.cells + axis.cell(code[axis.number], inverse_edge))
    }

    /// Whether the numbers, out of a file, are those of cells.
    pub(crate) fn is_sound(&self) -> bool {
        let mut numbers = self.axes.map(|axis| axis.number);
        numbers.sort_unstable();
        let cells = self.axes.iter().try_fold(1u32, |all, axis| all.checked_mul(axis.cells));
        numbers.iter().enumerate().all(|(at, &number)| at == number)
            && self.axes.iter().all(|axis| axis.low.is_finite())
            && cells.is_some_and(|cells| cells > 0)
            && self.edge.is_normal()
            && self.edge > 0.0
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.axes.iter().map(|axis| axis.cells as usize).product()
    }

    /// Calls `visit` for rows of cells next to each other that hold all codes within `radius` of `code`.
    pub(crate) fn near(&self, code: &Code, radius: f32, runs: &mut Vec<Run>, mut visit: impl FnMut(Range<usize>)) {
        let limit = radius * radius;
        let inverse_edge = 1.0 / self.edge;
        runs.clear();
        runs.push(Run { first: 0, gap: 0.0 });
        let [across @ .., along] = &self.axes;
        for axis in across {
            let value = code[axis.number];
            let whole = runs.len();
            // Every run splits into those of its cells that are near enough.
            for cell in axis.cell(value - radius, inverse_edge)..=axis.cell(value + radius, inverse_edge) {
                let own = axis.gap(value, cell, self.edge);
                for at in 0..whole {
                    let Run { first, gap } = runs[at];
                    let gap = gap + own * own;
                    if gap <= limit {
                        runs.push(Run { first: first * axis.cells + cell, gap });
                    }
                }
            }
            runs.drain(..whole);
        }
        let value = code[along.number];
        for run in runs.iter() {
            let reach = (limit - run.gap).sqrt() + ROUNDING * self.edge;
            let [first, last] =
                [value - reach, value + reach].map(|end| run.first * along.cells + along.cell(end, inverse_edge));
            visit(first as usize..last as usize + 1);
        }
    }
}

impl CodeGrid {
    /// The grid of the codes that the rows from 0 to `count` have, a cell for each code, and the rows in its order: with fewer
    /// cells a search measures more codes, with more it looks into more cells.
    pub(crate) fn new(count: usize, code: impl Fn(usize) -> Code + Sync) -> (Self, Vec<u32>) {
        let cut = Cells::cut(count, count as f64, &code);
        let cell = |row: usize| cut.of(&code(row));
        let cells: Vec<u32> = (0..count).into_par_iter().map(cell).collect();
        let mut starts = vec![0u32; cut.len() + 1];
        for &cell in &cells {
            starts[cell as usize] += 1;
        }
        let mut end = 0;
        for start in &mut starts {
            end += *start;
            *start = end;
        }
        let mut order = vec![0u32; count];
        // From the last to the first, so that a cell keeps the order of its codes.
        for (row, &cell) in cells.iter().enumerate().rev() {
            let start = &mut starts[cell as usize];
            *start -= 1;
            order[*start as usize] = row as u32;
        }
        let block = |rows: &[u32]| {
            let mut block = [[f32::INFINITY; LANES]; NUMBERS];
            for (lane, &row) in rows.iter().enumerate() {
                block.iter_mut().zip(code(row as usize)).for_each(|(numbers, number)| numbers[lane] = number);
            }
            block
        };
        let blocks = order.par_chunks(LANES).map(block).collect();
        (Self { cells: cut, starts, blocks }, order)
    }

    /// Calls `visit(place in the grid's order)` for every code within `radius` of `code`.
    pub(crate) fn within(&self, code: &Code, radius: f32, runs: &mut Vec<Run>, mut visit: impl FnMut(u32)) {
        let limit = radius * radius;
        self.cells.near(code, radius, runs, |cells| {
            let places = self.starts[cells.start]..self.starts[cells.end];
            self.scan(code, limit, places, &mut visit);
        });
    }

    /// Visits those of a row of codes that are within the limit.
    #[inline]
    fn scan(&self, code: &Code, limit: f32, places: Range<u32>, visit: &mut impl FnMut(u32)) {
        if places.is_empty() {
            return;
        }
        let first = places.start as usize / LANES;
        for (at, block) in self.blocks[first..places.end.div_ceil(LANES as u32) as usize].iter().enumerate() {
            let distances = squared_distances(block, code);
            if distances.iter().fold(0, |near, &distance| near | u32::from(distance <= limit)) == 0 {
                continue;
            }
            for (lane, &distance) in distances.iter().enumerate() {
                let place = ((first + at) * LANES + lane) as u32;
                if distance <= limit && places.contains(&place) {
                    visit(place);
                }
            }
        }
    }
}

/// Cells in a row along the last axis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run {
    /// Number of the row.
    first: u32,
    /// Squared distance to it.
    gap: f32,
}

/// Codes of which the extent of a grid is taken.
const SAMPLE: usize = 1024;

/// Share of the sample beyond either end of an axis: a few large codes shall not make the cells of all others coarse.
const BEYOND: f64 = 0.02;

/// Written number by number: a sum over the numbers in the order of memory is compiled lane by lane.
#[inline]
fn squared_distances(block: &Block, code: &Code) -> [f32; LANES] {
    let squares = |number: usize| block[number].map(|value| (value - code[number]) * (value - code[number]));
    let mut sums = squares(0);
    for number in 1..NUMBERS {
        sums.iter_mut().zip(squares(number)).for_each(|(sum, square)| *sum += square);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_search_equals_brute_force(
            codes in prop::collection::vec(prop::array::uniform6(-1.0..1.0f32), 0..400),
            flat in prop::array::uniform6(prop::bool::ANY),
            code in prop::array::uniform6(-1.2..1.2f32),
            radius in 0.01..1.5f32,
        ) {
            let level = |code: &Code| -> Code { std::array::from_fn(|i| if flat[i] { 0.0 } else { code[i] }) };
            let codes: Vec<Code> = codes.iter().map(level).collect();
            let code = level(&code);
            let (grid, order) = CodeGrid::new(codes.len(), |row| codes[row]);
            let mut found = Vec::new();
            grid.within(&code, radius, &mut Vec::new(), |place| found.push(order[place as usize]));
            found.sort_unstable();
            let brute = |a: &Code, b: &Code| a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + (a - b) * (a - b));
            let near = |row: &u32| brute(&codes[*row as usize], &code) <= radius * radius;
            prop_assert_eq!(found, (0..codes.len() as u32).filter(near).collect::<Vec<_>>());
        }
    }

    #[test]
    fn equal_codes_are_found_each_once() {
        let [here, there] = [[0.5, 0.2, -0.1, 0.3, 0.0, 0.4], [0.5, 0.2, -0.1, 0.3, 0.0, 0.6]];
        for count in [1, LANES, LANES + 1, 300] {
            for codes in [vec![here; count], [vec![here; count], vec![there; count]].concat()] {
                let (grid, order) = CodeGrid::new(codes.len(), |row| codes[row]);
                let found = |code: &Code, radius: f32| {
                    let mut found = Vec::new();
                    grid.within(code, radius, &mut Vec::new(), |place| found.push(order[place as usize]));
                    found.sort_unstable();
                    found
                };
                assert_eq!(found(&here, 0.1), (0..count as u32).collect::<Vec<_>>());
                assert_eq!(found(&here, 0.3), (0..codes.len() as u32).collect::<Vec<_>>());
                assert!(found(&[0.9; NUMBERS], 0.1).is_empty());
            }
        }
    }
}
