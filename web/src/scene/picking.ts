/** Which fruit is under the pointer: the nearest to the eye of those whose disc is there. */
import type { Stage } from "./stage";

const LEAST_RADIUS_PX = 6;

export function fruitAt(stage: Stage, x: number, y: number): number | null {
  const { fruits } = stage;
  const { colours } = fruits.from;
  let found: number | null = null;
  let least = Infinity;
  for (let i = 0; i < fruits.n; i++) {
    if (colours[4 * i + 3] < 100) continue; // hidden or faded
    const at = stage.project(fruits.coordinate(i, 0), fruits.coordinate(i, 1), fruits.coordinate(i, 2));
    if (at === null) continue;
    const radius = Math.max(LEAST_RADIUS_PX, (fruits.diameter(i) / 2) * stage.pixelsPerMetre(at.depth));
    const away = Math.hypot(at.x - x, at.y - y) / radius;
    // Near the middle of a disc beats near the eye only between small ones that overlap.
    const cost = at.depth * (1 + 0.05 * away);
    if (away <= 1 && cost < least) [found, least] = [i, cost];
  }
  return found;
}
