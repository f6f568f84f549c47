/** What a grower can do now, the most pressing first; one line each. */
import { oldDay } from "../facts";
import type { Page } from "../page";
import { expected, hangingRows, treeSummaries, type TreeSummary } from "../summary";
import type { SizeClass } from "../told/document";
import { STATES, type Season } from "../told/season";
import { DAY_MS, day, fruits, fullDay, percent, whole, wholeFruits } from "../words";

/** A tree that grows so much slower than all is worth a look. */
const SLOW = 0.9;
/** Days to the harvest below which another visit tells nothing that could still be decided, and below which it is the last. */
const [LEAST_DAYS, FEW_DAYS] = [7, 21];
const MISSED = STATES.indexOf("missed");

export function advice(page: Page): string[] {
  const { season } = page;
  const trees = treeSummaries(page);
  return [
    ...thin(page, trees),
    ...harvest(season),
    ...tooLate(page, trees),
    ...slowTrees(season, trees),
    ...hidden(season),
    ...again(season),
  ];
}

const total = (trees: readonly TreeSummary[], of: (tree: TreeSummary) => number): number => trees.reduce((sum, tree) => sum + of(tree), 0);

function thin({ season, target }: Page, trees: readonly TreeSummary[]): string[] {
  if (!season.thinning?.areFruitlets) return [];
  const [toThin, drops] = [total(trees, (tree) => tree.thin), total(trees, (tree) => tree.drops)];
  const dropping = drops > 0 ? [`${fruits(drops)} will drop by themselves`] : [];
  if (target.value === null) return ["Choose how many fruits a tree keeps", "the thinning page tells which to take", ...dropping];
  const on = trees.filter((tree) => tree.thin > 0).length;
  const kept = `to keep ${whole(target.value)} on each tree`;
  if (toThin > 0) return [`Thin ${fruits(toThin)}`, `on ${on} of ${trees.length} trees, ${kept}`, ...dropping];
  return ["Nothing to thin", kept, ...dropping];
}

/** A target is told what it comes to, when the time to thin is over too. */
function tooLate({ season, target }: Page, trees: readonly TreeSummary[]): string[] {
  const beyond = total(trees, (tree) => tree.thin);
  if (target.value === null || season.thinning === null || season.thinning.areFruitlets || beyond === 0) return [];
  return [`Too large to thin: ${whole(beyond)} beyond ${whole(target.value)} a tree`];
}

/** When the next visit is worth it, and what for. */
function again(season: Season): string[] {
  const last = season.visits[season.visits.length - 1].time;
  const left = season.harvest === null || season.harvest <= last ? Infinity : (season.harvest - last) / DAY_MS;
  if (left < LEAST_DAYS) return season.growth ? [] : [`Harvest on ${spaced(season.harvest!)}`];
  const when = left < FEW_DAYS ? "once more before the harvest" : "again in a week or two";
  const sized = oldDay(season) === null ? "" : ", with diameters";
  return [`Record the row ${when}${sized}${season.growth ? "" : missing(season)}`];
}

/** What growth needs. */
function missing({ sights, visits }: Season): string {
  const days = new Set<string>();
  sights.visit.forEach((visit, row) => !Number.isNaN(sights.diameterMm[row]) && days.add(fullDay(visits[visit].time)));
  if (days.size === 0) return ", with diameters: those of two dates show growth";
  return days.size === 1 ? ": two dates show growth" : "";
}

/** A day that is not broken over lines. */
const spaced = (time: number): string => day(time).replace(" ", "\u00a0");

function harvest({ growth, classes }: Season): string[] {
  if (!growth?.harvest) return [];
  const then = classes.filter((one) => Date.parse(one.date) >= (growth.harvest ?? 0));
  const sum = (of: (one: SizeClass) => number): number => then.reduce((total, one) => total + of(one), 0);
  const best = then.reduce((most, one) => (one.n_fruits > most.n_fruits ? one : most), then[0]);
  const lines = [`Plan ${whole(Math.ceil(sum((one) => one.packs)))} packs for ${spaced(growth.harvest)}`];
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
  const missed = hangingRows(season).filter((fruit) => season.state[fruit] === MISSED);
  const hid = wholeFruits(expected(season, missed));
  return hid === 0 ? [] : [`${fruits(hid)} hid from the last visit`];
}
