/** Two dates, one over the other: the same fruits joined by lines, the others told apart. */
import type { Rgb } from "../colours";
import { element, replaceAll } from "../elements";
import { paintOnceAFrame } from "../frames";
import type { Page } from "../page";
import { extentOf } from "../scene/extent";
import { steer } from "../scene/gestures";
import { Orbit } from "../scene/orbit";
import { fruitAt } from "../scene/picking";
import { LOOKS, MARKS } from "../scene/moment";
import { Stage } from "../scene/stage";
import { dashed, type Ink, type Stroke } from "../scene/strokes";
import { Signal, watchAll } from "../signal";
import { inkRgb, repaint } from "../theme";
import type { Season } from "../told/season";
import { DAY_MS, fruits, number } from "../words";
import { fruitSwatch, lineSwatch } from "./swatch";

const GAP_M = 0.5;
/** Of the fruits of a visit: where less were seen before, that was another row. */
const FEW = 0.1;
const BOTH: Rgb = [0, 158, 115];
const FIRST_ONLY: Rgb = [230, 159, 0];
const SECOND_ONLY: Rgb = [86, 180, 233];
const UNSURE: Rgb = [213, 94, 0];
/** Triangles on what only one of the dates has point to where it hangs in the picture. */
const [ABOVE, BELOW] = ["up", "down"] as const;
const FAINT = 0.35;
/** Probability below which a line stands out. */
const SURE = 0.9;

interface Dates {
  readonly first: Signal<number>;
  readonly second: Signal<number>;
}

export function twoDates(page: Page): HTMLElement {
  const { history, season } = page;
  if (history.times.length < 2) return element("p", { class: "notice" }, "Two dates need a second visit.");
  const [first, second] = latestPair(page);
  const dates: Dates = { first: new Signal(first), second: new Signal(second) };
  const said = element("p", { class: "soft below", role: "status" });
  const head = element("div", { class: "row-tools" }, pick(page, "above", dates.first), pick(page, "below", dates.second), key());
  const holder = element("div", { class: "row-view tall" });
  const root = element("section", { class: "card row-card", "aria-label": "Two dates" }, head, holder, said);

  const extent = extentOf(season);
  const half = (extent.high[2] - extent.low[2] + GAP_M) / 2;
  const [low, high] = [[...extent.low], [...extent.high]] as [[number, number, number], [number, number, number]];
  [low[2], high[2]] = [low[2] - half, high[2] + half];
  const orbit = new Orbit({ low, high }, "side");
  const stage = new Stage(holder, orbit, 2 * season.n);
  stage.canvas.tabIndex = 0;
  stage.canvas.setAttribute("role", "application");
  stage.canvas.setAttribute("aria-label", "Two dates in 3D. The card of a fruit has the same facts. Arrows move, A D W S turn, plus and minus zoom.");
  steer(stage.canvas, orbit, {
    hover: () => undefined,
    leave: () => undefined,
    press: (x, y) => {
      const found = fruitAt(stage, x, y);
      page.selected.set(found === null ? null : found % season.n);
    },
  });
  const paint = paintOnceAFrame(() => {
    const counts = compare(page, stage, dates, half);
    replaceAll(said, summary(page, dates, counts));
  });
  watchAll([dates.first, dates.second, page.selected, page.filter], paint);
  repaint.watch(() => {
    stage.setBackground(inkRgb("sky"));
    paint();
  });
  return root;
}

/** The two latest visits that saw the same fruits, of different days where there are such: visits to other rows share few or none. */
function latestPair({ season, history }: Page): [number, number] {
  const days = history.times.map((time) => Math.floor(time / DAY_MS));
  const last = days.length - 1;
  const isEarlier = (a: number, b: number): boolean => days[a] < days[b];
  const isBefore = (a: number, b: number): boolean => a < b;
  for (const [share, isWanted] of [[FEW, isEarlier], [0, isEarlier], [0, isBefore]] as const) {
    for (let b = last; b > 0; b--) {
      const shared = sharedWith(season, b);
      const enough = shared.map((n, a) => (isWanted(a, b) && n > share * shared[b] ? n : 0));
      const latest = days[enough.findLastIndex((n) => n > 0)];
      // Of several on that day the one that saw most of them.
      const ofThatDay = enough.map((n, a) => (days[a] === latest ? n : 0));
      if (latest !== undefined) return [ofThatDay.indexOf(Math.max(...ofThatDay)), b];
    }
  }
  return [last - 1, last];
}

/** How many of the fruits of a visit each visit saw. */
function sharedWith({ sights, visits, n }: Season, visit: number): number[] {
  const counts = visits.map(() => 0);
  for (let fruit = 0; fruit < n; fruit++) {
    const seen = sights.visit.subarray(sights.starts[fruit], sights.starts[fruit + 1]);
    if (seen.includes(visit)) for (const v of seen) counts[v]++;
  }
  return counts;
}

function pick({ season }: Page, where: string, chosen: Signal<number>): HTMLElement {
  const options = season.visits.map((visit, v) => element("option", { value: v }, visit.title));
  const select = element("select", { "aria-label": `Date ${where}`, change: () => chosen.set(Number(select.value)) }, ...options);
  chosen.watch((v) => (select.value = String(v)));
  return element("span", { class: "date" }, element("span", { class: "label", "aria-hidden": "true" }, where), select);
}

function key(): HTMLElement {
  const items = [
    fruitSwatch("on both dates", BOTH, false),
    fruitSwatch("above only", FIRST_ONLY, false, ABOVE),
    fruitSwatch("below only", SECOND_ONLY, false, BELOW),
    lineSwatch("less than 90\u00a0% sure", UNSURE),
  ];
  return element("span", { class: "swatches" }, ...items);
}

interface Counts {
  both: number;
  first: number;
  second: number;
  growthMm: number;
  measured: number;
}

function compare(page: Page, stage: Stage, dates: Dates, half: number): Counts {
  const { season, history, selected } = page;
  const [a, b] = [dates.first.value, dates.second.value];
  const [placeA, placeB] = [history.placeAt(history.times[a]), history.placeAt(history.times[b])];
  const [sizeA, sizeB] = [history.sizeAt(history.times[a]), history.sizeAt(history.times[b])];
  const { positions, diameters, colours } = stage.fruits.from;
  const counts: Counts = { both: 0, first: 0, second: 0, growthMm: 0, measured: 0 };
  const strokes: Stroke[] = [];
  const tree = page.filter.value.tree;
  for (let fruit = 0; fruit < season.n; fruit++) {
    const [inA, inB] = [history.wasSeen(fruit, a), history.wasSeen(fruit, b)];
    const other = season.n + fruit;
    const isFaded = tree !== null && season.tree[fruit] !== tree;
    const look = isFaded ? LOOKS.faded : LOOKS.solid;
    placeA(fruit, positions, 3 * fruit);
    placeB(fruit, positions, 3 * other);
    positions[3 * fruit + 2] += half;
    positions[3 * other + 2] -= half;
    const rgb = inA && inB ? BOTH : inA ? FIRST_ONLY : SECOND_ONLY;
    const mark = MARKS[inA && inB ? "none" : inA ? ABOVE : BELOW];
    colours.set([...rgb, inA ? look + mark : LOOKS.hidden], 4 * fruit);
    colours.set([...rgb, inB ? look + mark : LOOKS.hidden], 4 * other);
    diameters[fruit] = sizeA(fruit) / 1000;
    diameters[other] = sizeB(fruit) / 1000;
    if (inA && inB) counts.both++;
    else if (inA) counts.first++;
    else if (inB) counts.second++;
    if (!inA || !inB || isFaded) continue;
    const isChosen = selected.value === fruit;
    const isSure = sureOf(page, fruit, Math.max(a, b)) >= SURE;
    const ink: Ink = isChosen ? [...inkRgb("accent"), 1] : isSure ? [...inkRgb("soft"), FAINT] : [...UNSURE, 0.9];
    const stroke = { from: at(positions, fruit), to: at(positions, other), ink };
    strokes.push(...(isSure ? [stroke] : dashed(stroke)));
    const grown = measured(page, fruit, b) - measured(page, fruit, a);
    if (Number.isNaN(grown)) continue;
    counts.growthMm += grown;
    counts.measured++;
  }
  stage.fruits.rest();
  stage.lines.set(strokes);
  stage.redraw();
  return counts;
}

const at = (positions: Float32Array, i: number): [number, number, number] => [positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]];

function rowOf({ season }: Page, fruit: number, visit: number): number {
  const { sights } = season;
  for (let row = sights.starts[fruit]; row < sights.starts[fruit + 1]; row++) if (sights.visit[row] === visit) return row;
  return -1;
}

const measured = (page: Page, fruit: number, visit: number): number => page.season.sights.diameterMm[rowOf(page, fruit, visit)];

/** Probability that the later sight is this fruit. */
function sureOf(page: Page, fruit: number, visit: number): number {
  const sure = page.season.sights.probability[rowOf(page, fruit, visit)];
  return Number.isNaN(sure) ? 1 : sure;
}

function summary({ season }: Page, { first, second }: Dates, counts: Counts): string {
  const [a, b] = [season.visits[first.value].title, season.visits[second.value].title];
  const grown = counts.measured > 0 ? `, where the mean of their measured diameters differs by ${number(counts.growthMm / counts.measured, 1)} mm` : "";
  return `${fruits(counts.both)} on both dates${grown}; ${fruits(counts.first)} on ${a} only, ${fruits(counts.second)} on ${b} only. Lines join the same fruit; red, dashed ones are less than 90 % sure.`;
}
