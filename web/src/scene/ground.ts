/** A ground with a mark every metre under the lowest fruits, and a trunk for each tree that is known. */
import { inkRgb } from "../theme";
import type { Season } from "../told/season";
import type { Extent } from "./orbit";
import type { Ink, Point, Stroke } from "./strokes";

const BELOW_M = 0.35;
const BESIDE_M = 0.5;
const MOST_MARKS = 200;

/** The box around the fruits and their ground. */
export const withGround = ({ low, high }: Extent): Extent => ({ low: [low[0], low[1], low[2] - BELOW_M], high });

export function ground({ trees }: Season, { low, high }: Extent): Stroke[] {
  const z = low[2] - BELOW_M;
  const [y0, y1] = [low[1] - BESIDE_M, high[1] + BESIDE_M];
  const line: Ink = [...inkRgb("ground"), 1];
  const step = Math.max(1, Math.ceil((high[0] - low[0]) / MOST_MARKS));
  const strokes: Stroke[] = [
    { from: [low[0], y0, z], to: [high[0], y0, z], ink: line },
    { from: [low[0], y1, z], to: [high[0], y1, z], ink: line },
  ];
  for (let x = Math.ceil(low[0]); x <= high[0]; x += step) {
    strokes.push({ from: [x, y0, z], to: [x, y1, z], ink: line });
  }
  const trunk: Ink = [...inkRgb("trunk"), 1];
  for (const { name, middle } of trees) {
    const foot: Point = [middle[0], middle[1], z];
    if (name) strokes.push({ from: foot, to: [middle[0], middle[1], high[2]], ink: trunk });
  }
  return strokes;
}
