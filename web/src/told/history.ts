/** Every fruit on every visit: where it was, whether it was seen, how big it was, then and between visits. */
import type { Season } from "./season";
import { STATES, type State } from "./season";
import { DAY_MS } from "../words";

const GONE = STATES.indexOf("gone");
const USUAL_MM = 60;

export interface History {
  readonly times: readonly number[];
  /** The last moment that can be shown: of the last visit, or of the harvest. */
  readonly end: number;
  /** First and last visit that saw each fruit. */
  readonly first: Int32Array;
  readonly last: Int32Array;
  readonly wasSeen: (fruit: number, visit: number) => boolean;
  /** By that visit or another one of its day: each goes along a row of its own. */
  readonly wasSeenThatDay: (fruit: number, visit: number) => boolean;
  /** The visit that was the last at a time. */
  readonly visitAt: (time: number) => number;
  /** Whether a fruit is known of by then, and not gone yet. */
  readonly isThere: (fruit: number, time: number) => boolean;
  readonly stateAt: (fruit: number, time: number) => State;
  /** Diameter by the curve; where there is none, the last one that was measured. */
  readonly sizeAt: (time: number) => (fruit: number) => number;
  readonly placeAt: (time: number) => (fruit: number, into: Float32Array, at: number) => void;
  /** The stretch around a time in which states stay and places and sizes change evenly. */
  readonly spanAt: (time: number) => Span;
}

export interface Span {
  readonly start: number;
  readonly end: number;
}

export function historyOf(season: Season): History {
  const times = season.visits.map((visit) => visit.time);
  const [n, nVisits] = [season.n, times.length];
  const { starts, visit, x, y, z, diameterMm } = season.sights;
  const [first, last] = [new Int32Array(n), new Int32Array(n)];
  const seen = new Uint8Array(n * nVisits);
  const places = new Float32Array(3 * n * nVisits);
  const sizes = new Float32Array(n * nVisits);
  for (let fruit = 0; fruit < n; fruit++) {
    first[fruit] = visit[starts[fruit]];
    last[fruit] = visit[starts[fruit + 1] - 1];
    let sight = starts[fruit];
    let size = NaN;
    for (let v = 0; v < nVisits; v++) {
      if (sight + 1 < starts[fruit + 1] && visit[sight + 1] <= v) sight++;
      if (visit[sight] === v) seen[fruit * nVisits + v] = 1;
      places.set([x[sight], y[sight], z[sight]], 3 * (fruit * nVisits + v));
      if (!Number.isNaN(diameterMm[sight])) size = diameterMm[sight];
      sizes[fruit * nVisits + v] = size;
    }
  }
  const dayOf = times.map((time) => Math.floor(time / DAY_MS));
  const ofDay = dayOf.map((day) => [...dayOf.keys()].filter((v) => dayOf[v] === day));
  const wasSeenThatDay = (fruit: number, v: number): boolean => ofDay[v].some((other) => seen[fruit * nVisits + other] === 1);
  const visitAt = (time: number): number => Math.max(0, times.findLastIndex((one) => one <= time));
  const growth = season.growth;

  const stateAt = (fruit: number, time: number): State => {
    const v = visitAt(time);
    if (season.state[fruit] === GONE && v > last[fruit]) return "gone";
    if (!wasSeenThatDay(fruit, v)) return "missed";
    return dayOf[v] > dayOf[0] && dayOf[first[fruit]] === dayOf[v] ? "new" : "seen";
  };
  const sizeAt = (time: number) => {
    const v = visitAt(time);
    const curve = growth ? between(growth.times, growth.medianMm, time) : () => NaN;
    return (fruit: number): number => curve(fruit) || sizes[fruit * nVisits + v] || USUAL_MM;
  };
  const placeAt = (time: number) => {
    const v = visitAt(time);
    const next = Math.min(v + 1, nVisits - 1);
    const share = next === v ? 0 : Math.max(0, (time - times[v]) / (times[next] - times[v] || 1));
    return (fruit: number, into: Float32Array, at: number): void => {
      const [from, to] = [3 * (fruit * nVisits + v), 3 * (fruit * nVisits + next)];
      for (let axis = 0; axis < 3; axis++) {
        into[at + axis] = places[from + axis] + share * (places[to + axis] - places[from + axis]);
      }
    };
  };
  return {
    times,
    end: growth?.harvest ?? times[nVisits - 1],
    first,
    last,
    wasSeen: (fruit, v) => seen[fruit * nVisits + v] === 1,
    wasSeenThatDay,
    visitAt,
    isThere: (fruit, time) => {
      const v = visitAt(time);
      return first[fruit] <= v && !(season.state[fruit] === GONE && v > last[fruit]);
    },
    stateAt,
    sizeAt,
    placeAt,
    spanAt: spansOf([...times, ...(growth?.times ?? [])]),
  };
}

/** From each visit, or day of the curves, to the next. */
function spansOf(times: readonly number[]): (time: number) => Span {
  const days = [...new Set(times)].sort((a, b) => a - b);
  const spans = days.slice(1).map((end, i) => ({ start: days[i], end }));
  return (time) => spans.findLast(({ start }) => start <= time) ?? spans[0];
}

/** Curves at a time, on lines between their days; NaN where there is none. */
function between(times: readonly number[], rows: Float64Array, time: number): (fruit: number) => number {
  const q = times.length;
  const after = times.findIndex((one) => one >= time);
  const right = after < 0 ? q - 1 : Math.max(1, after);
  const left = right - 1;
  const share = Math.min(1, Math.max(0, (time - times[left]) / (times[right] - times[left] || 1)));
  return (fruit) => {
    const [low, high] = [rows[fruit * q + left], rows[fruit * q + right]];
    return Number.isNaN(high) ? low : low + share * (high - low);
  };
}
