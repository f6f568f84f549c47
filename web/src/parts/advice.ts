/** What a grower can do now, the most pressing first; one line each. */
import type { Page } from "../page";
import { areFruitlets, hangingRows, treeSummaries, type TreeSummary } from "../summary";
import type { SizeClass } from "../told/document";
import { STATES, type Season } from "../told/season";
import { day, fruits, percent, whole } from "../words";

/** A tree that grows so much slower than all is worth a look. */
const SLOW = 0.9;
const MISSED = STATES.indexOf("missed");

export function advice(page: Page): string[] {
  const { season } = page;
  const trees = treeSummaries(page);
  return [
    ...thin(page, trees),
    ...harvest(season),
    ...slowTrees(season, trees),
    ...hidden(season),
    ...(season.growth ? [] : ["Record the row again in a week or two: two dates show growth"]),
    "Record the row again in a week or two",
  ];
}

function thin({ season, target }: Page, trees: readonly TreeSummary[]): string[] {
  if (!season.thinning) return [];
  const sum = (of: (tree: TreeSummary) => number): number => trees.reduce((total, tree) => total + of(tree), 0);
  const [toThin, drops] = [sum((tree) => tree.thin), sum((tree) => tree.drops)];
  const dropping = drops > 0 ? [`${fruits(drops)} will drop by themselves`] : [];
  if (target.value !== null) {
    const on = trees.filter((tree) => tree.thin > 0).length;
    const kept = `to keep ${whole(target.value)} on each tree`;
    if (toThin > 0) return [`Thin ${fruits(toThin)}`, `on ${on} of ${trees.length} trees, ${kept}`, ...dropping];
    return ["Nothing to thin", kept, ...dropping];
  }
  return areFruitlets(season) ? ["Choose how many fruits a tree keeps", "the thinning page tells which to take", ...dropping] : [];
}

function harvest({ growth, classes }: Season): string[] {
  if (!growth?.harvest) return [];
  const then = classes.filter((one) => Date.parse(one.date) >= (growth.harvest ?? 0));
  const sum = (of: (one: SizeClass) => number): number => then.reduce((total, one) => total + of(one), 0);
  const best = then.reduce((most, one) => (one.n_fruits > most.n_fruits ? one : most), then[0]);
  const lines = [`Plan ${whole(Math.ceil(sum((one) => one.packs)))} packs for ${day(growth.harvest).replace(" ", "\u00a0")}`];
  const share = best ? best.n_fruits / sum((one) => one.n_fruits) : 0;
  if (best) lines.push(`${percent(share)} of fruits will measure ${between(best)}`);
  return lines;
}

export function between({ from_mm, below_mm }: SizeClass): string {
  if (from_mm === null) return `below ${below_mm} mm`;
  return below_mm === null ? `${from_mm} mm and more` : `${from_mm} to ${below_mm} mm`;
}

function slowTrees({ growth }: Season, trees: readonly TreeSummary[]): string[] {
  const usual = growth?.blocks[0].rate_mm_per_day[1] ?? NaN;
  const slow = trees.filter(({ block }) => block?.kind === "tree" && block.rate_mm_per_day[1] < SLOW * usual);
  if (slow.length === 0) return [];
  const names = slow.slice(0, 3).map(({ label }) => label);
  return [`Look at ${names.join(", ")}${slow.length > 3 ? " and others" : ""}: slower by a tenth or more`];
}

function hidden(season: Season): string[] {
  const n = hangingRows(season).filter((fruit) => season.state[fruit] === MISSED).length;
  return n === 0 ? [] : [`${fruits(n)} hid from the last visit`];
}

