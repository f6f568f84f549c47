/** Balls around the fruits of each cell: which of them are in the picture, and how much of them to draw. */
import { N_LEVELS, type DrawingOrder, type Run } from "./drawing_order";
import type { Moment } from "./moment";

/** CSS pixels: fruits of this size are seen one by one, none of them is ever left out. */
const SEEN_ALONE_PX = 8;
/** Fruits: to draw still fewer saves a millisecond, without a graphics card. */
const FEWEST = 4000;
/** Metres: a picture shows the least fruit as a few pixels, so a ball reaches a bit farther than its fruits. */
const MARGIN_M = 0.2;

/** The camera as numbers: the matrix to the picture in columns, and the CSS pixels of a metre at one metre. */
export interface Sight {
  readonly matrix: readonly number[];
  readonly pixels: number;
}

export class Cells {
  /** Middle and radius, and the largest fruit. */
  private readonly balls: Float64Array;
  private readonly largest: Float64Array;
  private readonly levels: Uint8Array;
  private readonly counts: Uint32Array;

  constructor(private readonly order: DrawingOrder) {
    this.counts = new Uint32Array(order.nCells);
    for (const cell of order.cellOf) this.counts[cell]++;
    this.balls = new Float64Array(4 * order.nCells);
    this.largest = new Float64Array(order.nCells);
    this.levels = new Uint8Array(order.nCells);
  }

  /** Takes where the fruits are; at several moments where they are on their way. */
  enclose(moments: readonly Moment[]): void {
    const { cellOf, nCells } = this.order;
    const boxes = new Float64Array(6 * nCells).fill(-Infinity);
    this.largest.fill(0);
    for (const { positions, diameters } of moments) {
      for (let i = 0; i < cellOf.length; i++) {
        const cell = cellOf[i];
        this.largest[cell] = Math.max(this.largest[cell], diameters[i]);
        for (let axis = 0; axis < 3; axis++) {
          const at = positions[3 * i + axis];
          boxes[6 * cell + axis] = Math.max(boxes[6 * cell + axis], -at);
          boxes[6 * cell + 3 + axis] = Math.max(boxes[6 * cell + 3 + axis], at);
        }
      }
    }
    for (let cell = 0; cell < nCells; cell++) this.setBall(cell, boxes.subarray(6 * cell, 6 * cell + 6));
  }

  /** A box is its negative low ends, then its high ends. */
  private setBall(cell: number, box: Float64Array): void {
    const spans = [0, 1, 2].map((axis) => (box[3 + axis] + box[axis]) / 2);
    for (let axis = 0; axis < 3; axis++) this.balls[4 * cell + axis] = (box[3 + axis] - box[axis]) / 2;
    this.balls[4 * cell + 3] = Math.hypot(...spans) + this.largest[cell] / 2 + MARGIN_M;
  }

  /** What to draw: of many small fruits fewer by so many halvings, of what is out of the picture nothing. */
  runs(sight: Sight, halvings: number): Run[] {
    const small = this.look(sight);
    const nSmall = small.reduce((sum, cell) => sum + this.counts[cell], 0);
    const useful = Math.max(0, Math.floor(Math.log2(nSmall / FEWEST)));
    for (const cell of small) this.levels[cell] = N_LEVELS - Math.min(halvings, useful);
    return this.order.runs(this.levels);
  }

  /** Shows all levels of what is in the picture; gives the cells there of which the fruits are small. */
  private look({ matrix, pixels }: Sight): number[] {
    const [across, upwards, depth] = [rowOf(matrix, 0), rowOf(matrix, 1), rowOf(matrix, 3)];
    const sides = [across, upwards].flatMap((row) => [plane(depth, row, 1), plane(depth, row, -1)]);
    const small: number[] = [];
    for (let cell = 0; cell < this.order.nCells; cell++) {
      const [x, y, z, radius] = this.balls.subarray(4 * cell, 4 * cell + 4);
      const away = (row: readonly number[]): number => row[0] * x + row[1] * y + row[2] * z + row[3];
      const nearest = away(depth) - radius;
      const isSeen = nearest > -2 * radius && sides.every((side) => away(side) > -radius);
      this.levels[cell] = isSeen ? N_LEVELS : 0;
      if (isSeen && nearest > 0 && (pixels * this.largest[cell]) / nearest < SEEN_ALONE_PX) small.push(cell);
    }
    return small;
  }
}

const rowOf = (matrix: readonly number[], row: number): number[] => [0, 4, 8, 12].map((column) => matrix[column + row]);

/** Where a side of the picture is, as metres inwards. */
function plane(depth: readonly number[], row: readonly number[], sign: number): number[] {
  const sum = depth.map((value, i) => value + sign * row[i]);
  const length = Math.hypot(sum[0], sum[1], sum[2]);
  return sum.map((value) => value / length);
}
