/** Counts of what hangs, of all and by tree. */
import { actionOf, hangChance, hangs, lastMeasured, orOne } from "./facts";
import type { Page } from "./page";
import type { Block } from "./told/document";
import { STATES, type Season } from "./told/season";
import { wholeFruits } from "./words";

const GONE = STATES.indexOf("gone");

/** How many of some fruits hang, as is expected. */
export function expected(season: Season, rows: readonly number[]): number {
  return rows.reduce((sum, fruit) => sum + hangChance(season, fruit), 0);
}

/** How many of all hang, and how many no longer do, as is expected. */
export function expectedOfAll({ trees, fruitProbability }: Season): { hang: number; gone: number } {
  const hang = trees.reduce((sum, tree) => sum + tree.hang, 0);
  return { hang, gone: fruitProbability.reduce((sum, one) => sum + orOne(one), 0) - hang };
}

export function hangingRows(season: Season): number[] {
  return Array.from({ length: season.n }, (_, i) => i).filter((fruit) => hangs(season, fruit));
}

/** Diameters of what hangs, by the curves where there are some, else as the last visits measured them. */
export function sizesNow(season: Season): number[] {
  const { growth } = season;
  const of = (fruit: number): number =>
    growth ? growth.medianMm[fruit * growth.times.length + growth.nVisits - 1] : lastMeasured(season, fruit);
  return hangingRows(season)
    .map(of)
    .filter((mm) => !Number.isNaN(mm));
}

/** Whether thinning is worth a word: fruits are small enough, or somebody has named a target. */
export function isTimeToThin({ season, target }: Page): boolean {
  return season.thinning !== null && (target.value !== null || season.thinning.areFruitlets);
}

export interface TreeSummary {
  readonly tree: number;
  readonly label: string;
  /** How many hang, as is expected. */
  readonly fruits: number;
  readonly gone: number;
  readonly drops: number;
  readonly thin: number;
  readonly clustersToThin: number;
  /** What is known of its growth; null where no fruit of it has any. */
  readonly block: Block | null;
  /** Diameters as they were measured last, of what hangs: their number and sum. */
  readonly measured: number;
  readonly measuredMm: number;
}

/** Mean size now of some trees: by the curves of their block, as measured where the map has no growth. */
export function meanMm({ growth }: Season, block: Block | null | undefined, trees: readonly TreeSummary[]): number {
  if (growth) return block?.mean_mm[growth.nVisits - 1] ?? NaN;
  const sum = (of: (tree: TreeSummary) => number): number => trees.reduce((total, tree) => total + of(tree), 0);
  return sum((tree) => tree.measuredMm) / sum((tree) => tree.measured);
}

export function treeSummaries({ season, target }: Page): TreeSummary[] {
  const counts = season.trees.map(() => ({ gone: 0, drops: 0, thin: 0, measured: 0, measuredMm: 0, clusters: new Set<number>() }));
  for (let fruit = 0; fruit < season.n; fruit++) {
    const count = counts[season.tree[fruit]];
    if (season.state[fruit] === GONE) count.gone++;
    if (hangs(season, fruit)) {
      const mm = lastMeasured(season, fruit);
      if (!Number.isNaN(mm)) [count.measured, count.measuredMm] = [count.measured + 1, count.measuredMm + mm];
    }
    const action = actionOf(season, fruit, target.value);
    if (action === "drops") count.drops += hangChance(season, fruit);
    if (action === "thin") {
      count.thin++;
      count.clusters.add(season.thinning?.cluster[fruit] ?? 0);
    }
  }
  const blocks = season.growth?.blocks ?? [];
  return season.trees.map(({ name, label, hang }, tree) => {
    const { clusters, ...count } = counts[tree];
    const drops = wholeFruits(count.drops);
    // Where no tree is known, the fruits of none are all.
    const kind = season.trees.length > 1 || name ? "tree" : "all";
    const block = blocks.find((one) => one.kind === kind && one.name === name) ?? null;
    return { tree, label, ...count, fruits: hang, drops, clustersToThin: clusters.size, block };
  });
}
