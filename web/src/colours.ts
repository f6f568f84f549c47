/** Colours of fruits that all eyes tell apart: viridis for numbers, those of Okabe and Ito for kinds. */
import { actionOf } from "./facts";
import type { Page } from "./page";
import type { Mark } from "./scene/moment";
import { STATES } from "./told/season";
import { day, number } from "./words";

export type ColourBy = "growth" | "size" | "state" | "date" | "plan";
export type Rgb = readonly [number, number, number];

export interface Ramp {
  readonly kind: "ramp";
  readonly title: string;
  readonly low: string;
  readonly high: string;
  /** Whether there are fruits of which it is not known. */
  readonly hasUnknown: boolean;
}

export interface Swatches {
  readonly kind: "swatches";
  readonly title: string;
  readonly swatches: readonly { readonly name: string; readonly rgb: Rgb; readonly isRing: boolean; readonly mark: Mark }[];
}

export interface Scheme {
  readonly legend: Ramp | Swatches;
  readonly at: (time: number) => (fruit: number) => Rgb;
  /** What is drawn on a fruit besides, for who does not see the colour. */
  readonly markAt: (time: number) => (fruit: number) => Mark;
}

export const VIRIDIS: readonly Rgb[] = [
  [72, 30, 112],
  [69, 55, 129],
  [57, 86, 140],
  [45, 112, 142],
  [33, 144, 141],
  [41, 175, 127],
  [92, 200, 99],
  [160, 218, 57],
  [253, 231, 37],
];
const STEPS: readonly Rgb[] = Array.from({ length: 257 }, (_, i) => between((i / 256) * (VIRIDIS.length - 1)));
export const UNKNOWN: Rgb = [150, 150, 150];
const GREEN: Rgb = [0, 158, 115];
const SKY: Rgb = [86, 180, 233];
const ORANGE: Rgb = [230, 159, 0];
const VERMILION: Rgb = [213, 94, 0];
const OF_STATE = { new: SKY, seen: GREEN, missed: ORANGE, gone: VERMILION } as const;
const OF_ACTION = { keep: GREEN, thin: VERMILION, drops: ORANGE, "": UNKNOWN } as const;
/** What is not seen is a ring too. */
const MARK_OF_STATE = { new: "dot", seen: "none", missed: "none", gone: "cross" } as const;
const MARK_OF_ACTION = { keep: "none", thin: "cross", drops: "bar", "": "dot" } as const;
const unmarked = () => (): Mark => "none";
/** Shares of fruits that a ramp leaves beyond its ends: one odd fruit does not bleach the others. */
const ENDS = [0.02, 0.98] as const;

export function ramp(share: number): Rgb {
  return Number.isNaN(share) ? UNKNOWN : STEPS[Math.round(Math.min(1, Math.max(0, share)) * (STEPS.length - 1))];
}

function between(at: number): Rgb {
  const [low, part] = [VIRIDIS[Math.floor(at)], at - Math.floor(at)];
  const high = VIRIDIS[Math.min(VIRIDIS.length - 1, Math.floor(at) + 1)];
  return [0, 1, 2].map((i) => Math.round(low[i] + part * (high[i] - low[i]))) as unknown as Rgb;
}

export function schemeOf(page: Page): Scheme {
  return SCHEMES[page.colour.value](page);
}

const SCHEMES: Record<ColourBy, (page: Page) => Scheme> = {
  growth: ({ season }) => {
    const rates = season.growth?.rate ?? new Float64Array();
    const [low, high] = spanOf(rates);
    return {
      legend: { kind: "ramp", title: "growth, mm a day", low: number(low, 2), high: number(high, 2), hasUnknown: rates.some(Number.isNaN) },
      at: () => (fruit) => ramp((rates[fruit] - low) / (high - low)),
      markAt: () => (fruit) => (Number.isNaN(rates[fruit]) ? "dot" : "none"),
    };
  },
  size: ({ season, history }) => {
    const [low, high] = spanOf(season.growth?.medianMm ?? season.sights.diameterMm);
    return {
      legend: { kind: "ramp", title: "diameter, mm", low: number(low, 0), high: number(high, 0), hasUnknown: false },
      markAt: unmarked,
      at: (time) => {
        const size = history.sizeAt(time);
        return (fruit) => ramp((size(fruit) - low) / (high - low));
      },
    };
  },
  state: ({ history }) => ({
    legend: {
      kind: "swatches",
      title: "on this date",
      swatches: STATES.map((name) => ({ name, rgb: OF_STATE[name], isRing: name === "missed" || name === "gone", mark: MARK_OF_STATE[name] })),
    },
    markAt: (time) => (fruit) => MARK_OF_STATE[history.stateAt(fruit, time)],
    at: (time) => (fruit) => OF_STATE[history.stateAt(fruit, time)],
  }),
  date: ({ history }) => {
    const last = Math.max(1, history.times.length - 1);
    return {
      legend: { kind: "ramp", title: "first seen", low: day(history.times[0]), high: day(history.times[last] ?? history.times[0]), hasUnknown: false },
      markAt: unmarked,
      at: () => (fruit) => ramp(history.first[fruit] / last),
    };
  },
  plan: (page) => ({
    legend: {
      kind: "swatches",
      title: "what to do",
      swatches: [
        { name: "keep", rgb: GREEN, isRing: false, mark: MARK_OF_ACTION.keep },
        { name: "thin", rgb: VERMILION, isRing: false, mark: MARK_OF_ACTION.thin },
        { name: "will drop", rgb: ORANGE, isRing: false, mark: MARK_OF_ACTION.drops },
        { name: "not known", rgb: UNKNOWN, isRing: false, mark: MARK_OF_ACTION[""] },
      ],
    },
    markAt: () => (fruit) => MARK_OF_ACTION[actionOf(page.season, fruit, page.target.value)],
    at: () => (fruit) => OF_ACTION[actionOf(page.season, fruit, page.target.value)],
  }),
};

function spanOf(values: Float64Array): [number, number] {
  const known = values.filter((value) => !Number.isNaN(value)).sort();
  if (known.length === 0) return [0, 1];
  const [low, high] = ENDS.map((share) => known[Math.floor(share * (known.length - 1))]);
  return high > low ? [low, high] : [low - 0.5, low + 0.5];
}
