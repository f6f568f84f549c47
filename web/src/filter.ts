/** Which fruits are looked at: in the table, in the row and in what is exported. */
import { actionOf, factsOf, hangs, type Action } from "./facts";
import type { Page } from "./page";
import { STATES, type State } from "./told/season";

export interface Filter {
  readonly text: string;
  readonly row: string;
  readonly tree: number | null;
  readonly state: State | "hanging" | "";
  readonly action: Action;
  readonly fromMm: number;
  readonly belowMm: number;
}

export const ANY: Filter = { text: "", row: "", tree: null, state: "", action: "", fromMm: NaN, belowMm: NaN };

export const isAny = (filter: Filter): boolean =>
  Object.entries(ANY).every(([name, value]) => Object.is(filter[name as keyof Filter], value));

/** Rows of the fruits that pass, in order. */
export function passing(page: Page): number[] {
  const passes = passesOf(page);
  const rows: number[] = [];
  for (let fruit = 0; fruit < page.season.n; fruit++) if (passes(fruit)) rows.push(fruit);
  return rows;
}

export function passesOf(page: Page): (fruit: number) => boolean {
  const { season } = page;
  const { text, row, tree, state, action, fromMm, belowMm } = page.filter.value;
  const wanted = text.trim().toLowerCase();
  const isSized = !Number.isNaN(fromMm) || !Number.isNaN(belowMm);
  return (fruit) => {
    if (row !== "" && season.trees[season.tree[fruit]].row !== row) return false;
    if (tree !== null && season.tree[fruit] !== tree) return false;
    const its = STATES[season.state[fruit]];
    if (state === "hanging" ? !hangs(season, fruit) : state !== "" && its !== state) return false;
    if (action !== "" && actionOf(season, fruit, page.target.value) !== action) return false;
    if (isSized && !isBetween(factsOf(page, fruit).sizeMm, fromMm, belowMm)) return false;
    return wanted === "" || season.ids[fruit] === wanted;
  };
}

/** The minimum belongs to it, the maximum does not: as in size classes. */
function isBetween(sizeMm: number, fromMm: number, belowMm: number): boolean {
  return !Number.isNaN(sizeMm) && !(sizeMm < fromMm) && !(sizeMm >= belowMm);
}
