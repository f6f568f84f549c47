/** Where the small pictures of fruits are: inside the report, or on the server. */
import { unpacked } from "./columns";
import type { ToldCrops } from "./document";

export interface Crops {
  /** Address of the picture of a fruit's best date. */
  readonly best: (fruit: number) => string | null;
  /** Address of the picture of one visit. */
  readonly of: (fruit: number, visit: number) => string | null;
}

export async function cropsOf(told: ToldCrops | null, ids: readonly string[]): Promise<Crops | null> {
  if (told === null) return null;
  const rows = await unpacked(told.best);
  const { pictures, sights } = told;
  const best = new Map<number, string>();
  rows.forEach((fruit, i) => best.set(fruit, pictures ? inside(pictures[i]) : `crops/${ids[fruit]}`));
  const seen = new Set<string>();
  if (sights) {
    const [fruits, visits] = [await unpacked(sights.fruit), await unpacked(sights.visit)];
    fruits.forEach((fruit, i) => seen.add(`${fruit}/${visits[i]}`));
  }
  return {
    best: (fruit) => best.get(fruit) ?? null,
    of: (fruit, visit) => (seen.has(`${fruit}/${visit}`) ? `crops/${ids[fruit]}/${visit}` : null),
  };
}

/** A JPEG begins with these letters in base64; else it is a WebP. */
const inside = (base64: string): string => `data:image/${base64.startsWith("/9j/") ? "jpeg" : "webp"};base64,${base64}`;
