/**
 * The order in which fruits are drawn: first every eighth, then as many again, then a fourth, then the other half; within
 * each of these levels place by place. So what is out of the picture is left out, and fewer fruits are drawn everywhere
 * alike and always the same ones: nothing flickers.
 */

/** Parts of all fruits at which the levels begin. */
const BEGINS = [0, 1 / 8, 1 / 4, 1 / 2];
export const N_LEVELS = BEGINS.length;
/** Metres: about a tree. */
const CELL_M = 2;
/** The golden ratio of 2^32: its multiples are spread evenly over the levels, so the fruits of each tree are too. */
const GOLDEN = 0x9e3779b1;

export interface Run {
  readonly start: number;
  readonly count: number;
}

export interface DrawingOrder {
  /** Rows of the fruits, as they are drawn. */
  readonly fruits: Uint32Array;
  /** The cell of each fruit, by its row. */
  readonly cellOf: Uint32Array;
  readonly nCells: number;
  /** What to draw where each cell shows so many of its levels: 0 hides it. */
  readonly runs: (levels: Uint8Array) => Run[];
}

/** A cell's part of a level; it ends where the next one begins. */
interface Piece {
  readonly start: number;
  readonly level: number;
  readonly cell: number;
}

export function drawingOrder(positions: Float32Array): DrawingOrder {
  const n = positions.length / 3;
  const { cellOf, nCells } = cellsOf(positions);
  const keys = Float64Array.from({ length: n }, (_, i) => (levelOf(i) * nCells + cellOf[i]) * n + i).sort();
  const fruits = Uint32Array.from(keys, (key) => key % n);
  const pieces: Piece[] = [];
  fruits.forEach((fruit, start) => {
    const [level, cell] = [levelOf(fruit), cellOf[fruit]];
    const before = pieces[pieces.length - 1];
    if (before?.level !== level || before.cell !== cell) pieces.push({ start, level, cell });
  });
  return { fruits, cellOf, nCells, runs: (levels) => runsOf(pieces, n, levels) };
}

function runsOf(pieces: readonly Piece[], n: number, levels: Uint8Array): Run[] {
  const runs: Run[] = [];
  let begun = -1;
  const end = (at: number): void => {
    if (begun >= 0) runs.push({ start: begun, count: at - begun });
    begun = -1;
  };
  for (const { start, level, cell } of pieces) {
    if (level >= levels[cell]) end(start);
    else if (begun < 0) begun = start;
  }
  end(n);
  return runs;
}

/** Squares of the ground that hold fruits, numbered along x, as rows go: what is seen of a row are numbers in one stretch. */
function cellsOf(positions: Float32Array): { cellOf: Uint32Array; nCells: number } {
  const n = positions.length / 3;
  const squares = (axis: number): Float64Array => Float64Array.from({ length: n }, (_, i) => Math.floor(positions[3 * i + axis] / CELL_M));
  const [xs, ys] = [squares(0), squares(1)];
  const [low, high] = [xs.reduce((a, b) => Math.min(a, b), Infinity), xs.reduce((a, b) => Math.max(a, b), -Infinity)];
  const names = xs.map((x, i) => ys[i] * (high - low + 1) + x - low);
  const numbers = new Map([...new Set(names.slice().sort())].map((name, number) => [name, number]));
  return { cellOf: Uint32Array.from(names, (name) => numbers.get(name)!), nCells: numbers.size };
}

function levelOf(fruit: number): number {
  const part = (Math.imul(fruit + 1, GOLDEN) >>> 0) / 2 ** 32;
  return BEGINS.findLastIndex((begin) => begin <= part);
}
