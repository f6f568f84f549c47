/** What is known of each fruit now: the same facts for the row, the table, the card and the export. */
import type { Page } from "./page";
import { STATES, type Season, type State } from "./told/season";
import { day, fullDay, timeOf } from "./words";

const MISSED = STATES.indexOf("missed");
const GONE = STATES.indexOf("gone");

export type Action = "keep" | "thin" | "drops" | "";

export interface Facts {
  readonly id: string;
  readonly row: string;
  readonly tree: string;
  readonly state: State;
  readonly stateProbability: number;
  readonly sights: number;
  readonly sizeMm: number;
  readonly lowMm: number;
  readonly highMm: number;
  readonly rate: number;
  readonly forecastMm: number;
  readonly forecastLowMm: number;
  readonly forecastHighMm: number;
  readonly dropProbability: number;
  readonly action: Action;
}

/** Neither gone nor, once missed, likelier no fruit at all: what `pomona growth` foretells. */
export function hangs({ state, fruitProbability }: Season, fruit: number): boolean {
  return state[fruit] !== GONE && !(state[fruit] === MISSED && fruitProbability[fruit] <= 0.5);
}

/** What an older map does not say is taken for sure. */
export const orOne = (probability: number): number => (Number.isNaN(probability) ? 1 : probability);

/** Probability that a fruit is one and hangs: as `pomona growth` counts. Of what was missed or is gone the map's own is one of fruits. */
export function hangChance({ state, stateProbability, fruitProbability }: Season, fruit: number): number {
  const [sure, real] = [orOne(stateProbability[fruit]), orOne(fruitProbability[fruit])];
  return state[fruit] === MISSED ? real * sure : state[fruit] === GONE ? real * (1 - sure) : Math.min(real, sure);
}

export function factsOf({ season, target }: Page, fruit: number): Facts {
  const { growth, thinning, sights } = season;
  const [now, then] = [growth ? growth.nVisits - 1 : 0, growth ? growth.times.length - 1 : 0];
  const curve = (rows: Float64Array | undefined, at: number): number =>
    growth && rows ? rows[fruit * growth.times.length + at] : NaN;
  const later = (rows: Float64Array | undefined): number => (growth?.harvest ? curve(rows, then) : NaN);
  return {
    id: season.ids[fruit],
    row: season.trees[season.tree[fruit]].row,
    tree: season.trees[season.tree[fruit]].name,
    state: STATES[season.state[fruit]],
    stateProbability: season.stateProbability[fruit],
    sights: sights.starts[fruit + 1] - sights.starts[fruit],
    // The curve of what no longer hangs ends when it was seen last.
    sizeMm: growth ? curve(growth.medianMm, now) : hangs(season, fruit) ? lastMeasured(season, fruit) : NaN,
    lowMm: curve(growth?.lowMm, now),
    highMm: curve(growth?.highMm, now),
    rate: growth ? growth.rate[fruit] : NaN,
    forecastMm: later(growth?.medianMm),
    forecastLowMm: later(growth?.lowMm),
    forecastHighMm: later(growth?.highMm),
    dropProbability: thinning ? thinning.dropProbability[fruit] : NaN,
    action: actionOf(season, fruit, target.value),
  };
}

/** What to do with a fruit when each tree shall keep so many: `pomona thinning` says in which order they go. */
export function actionOf(season: Season, fruit: number, target: number | null): Action {
  const { thinning } = season;
  if (thinning === null || !hangs(season, fruit)) return "";
  const place = thinning.place[fruit];
  if (Number.isNaN(place)) return Number.isNaN(thinning.clusterSize[fruit]) ? "" : "drops";
  return target !== null && place > target ? "thin" : "keep";
}

/** The last diameter that a visit measured. */
export function lastMeasured({ sights }: Season, fruit: number): number {
  return sights.diameterMm[lastSized({ sights }, fruit)] ?? NaN;
}

/** The sight that measured a fruit last, -1 for none. */
function lastSized({ sights }: Pick<Season, "sights">, fruit: number): number {
  let row = sights.starts[fruit + 1] - 1;
  while (row >= sights.starts[fruit] && Number.isNaN(sights.diameterMm[row])) row--;
  return row >= sights.starts[fruit] ? row : -1;
}

/** The day of which the size of a fruit is told, where that is not the last visit's; else null. */
export function oldDayOf(season: Season, fruit: number): string | null {
  const sight = lastSized(season, fruit);
  if (season.growth || sight < 0) return oldDay(season);
  return unlessLast(season, season.visits[season.sights.visit[sight]].time);
}

/** The day of which sizes and rates are told, where the last visits have none; else null. */
export function oldDay(season: Season): string | null {
  const { growth, classes } = season;
  if (growth) return unlessLast(season, growth.times[growth.nVisits - 1]);
  return classes.length === 0 ? null : unlessLast(season, timeOf(classes[0].date));
}

function unlessLast({ visits }: Season, time: number): string | null {
  return fullDay(time) === fullDay(visits[visits.length - 1].time) ? null : day(time);
}
