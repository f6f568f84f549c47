/** The box around all fruits, without the few that lie far from the others. */
import type { Season } from "../told/season";
import type { Extent } from "./orbit";

const STRAY = 0.002;
const MARGIN_M = 0.15;

export function extentOf({ sights }: Season): Extent {
  const spans = [sights.x, sights.y, sights.z].map((values) => {
    const sorted = values.slice().sort();
    const skipped = Math.floor(STRAY * (sorted.length - 1));
    return [sorted[skipped] - MARGIN_M, sorted[sorted.length - 1 - skipped] + MARGIN_M];
  });
  return {
    low: [spans[0][0], spans[1][0], spans[2][0]],
    high: [spans[0][1], spans[1][1], spans[2][1]],
  };
}
