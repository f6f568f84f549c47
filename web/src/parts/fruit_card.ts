/** All that is known of the fruit that was chosen. */
import { curveChart } from "../charts/curve";
import { element, replaceAll, type Child } from "../elements";
import { factsOf, oldDayOf, type Facts } from "../facts";
import type { Page } from "../page";
import { isTimeToThin } from "../summary";
import { day, mm, number, percent } from "../words";
import { portrait, sightPicture } from "./crops";

const SAID = {
  new: "new on the last visit",
  seen: "seen on the last visit",
  missed: "hid from the last visit",
  gone: "gone",
} as const;
/** Probability from which on a fruit is said to have stopped. */
const LIKELY = 0.5;
const PLANNED = { keep: "keep it", thin: "thin it", drops: "will drop by itself", "": "" } as const;

/** Tells of the chosen fruit; `otherwise` stands there while none is. */
export function fruitCard(page: Page, otherwise: HTMLElement): HTMLElement {
  const root = element("aside", { class: "side", "aria-label": "Fruit" });
  const show = (fruit: number | null): void => {
    root.classList.toggle("chosen", fruit !== null);
    replaceAll(root, fruit === null ? otherwise : cardOf(page, fruit));
  };
  page.selected.watch(show);
  page.target.watch(() => show(page.selected.value));
  return root;
}

function cardOf(page: Page, fruit: number): HTMLElement {
  const facts = factsOf(page, fruit);
  const close = element("button", { type: "button", "aria-label": "Close", click: () => page.selected.set(null) }, "✕");
  const tree = page.season.trees[page.season.tree[fruit]];
  const where = element("span", { class: "soft" }, [tree.row, tree.name && tree.label].filter(Boolean).join(", "));
  const title = element("h2", {}, `Fruit ${facts.id}`);
  return element(
    "div",
    { class: "card fruit-card" },
    element("div", { class: "card-head" }, title, where, steps(page, fruit), close),
    element("div", { class: "card-body" }, portrait(page, fruit), factList(page, fruit, facts)),
    curveChart(page, fruit),
    sightsTable(page, fruit),
  );
}

function steps({ selected, season }: Page, fruit: number): HTMLElement {
  const to = (by: number): void => selected.set((fruit + by + season.n) % season.n);
  return element(
    "span",
    { class: "steps" },
    element("button", { type: "button", "aria-label": "Fruit before", click: () => to(-1) }, "‹"),
    element("button", { type: "button", "aria-label": "Next fruit", click: () => to(1) }, "›"),
  );
}

function factList(page: Page, fruit: number, facts: Facts): HTMLElement {
  const { season } = page;
  const old = oldDayOf(season, fruit);
  const lines: [string, Child][] = [
    ["State", `${said(page, fruit, facts)}, ${percent(facts.stateProbability)}\u00a0sure`],
  ];
  if (!Number.isNaN(facts.sizeMm)) lines.push([old === null ? "Now" : `On ${old}`, withRange(facts.sizeMm, facts.lowMm, facts.highMm)]);
  if (!Number.isNaN(facts.rate)) {
    lines.push(["Growth", `${number(facts.rate, 2)} ± ${number(1.645 * (season.growth?.rateSigma[fruit] ?? NaN), 2)} mm a day${old === null ? "" : ` on ${old}`}`]);
  }
  const stopped = season.growth?.stopped[fruit] ?? NaN;
  if (stopped > LIKELY) lines.push(["Stopped", `it has stopped growing, ${percent(stopped)}\u00a0sure`]);
  const harvest = season.growth?.harvest;
  if (harvest && !Number.isNaN(facts.forecastMm)) {
    lines.push([day(harvest), withRange(facts.forecastMm, facts.forecastLowMm, facts.forecastHighMm)]);
  }
  if (facts.action !== "" && isTimeToThin(page)) {
    const drop = Number.isNaN(facts.dropProbability) ? "" : `, drops with ${percent(facts.dropProbability)}`;
    lines.push(["Thinning", `${PLANNED[facts.action]}${drop}`]);
  }
  if (season.growth?.odd[fruit] === 1) lines.push(["Odd", "a size that is not its own, or grows like no other"]);
  return element("dl", {}, ...lines.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]));
}

/** What was seen before and is in no picture of the last visit has not hidden: it keeps its state. */
function said({ history }: Page, fruit: number, { state }: Facts): string {
  const isUnseen = history.last[fruit] < history.times.length - 1;
  return isUnseen && (state === "seen" || state === "new") ? "out of view on the last visit" : SAID[state];
}

function withRange(middle: number, low: number, high: number): string {
  return Number.isNaN(low) ? mm(middle) : `${mm(middle)} (${number(low, 1)} to ${number(high, 1)})`;
}

/** Every date: what was measured, and how sure it is that it was this fruit. */
function sightsTable({ season, history }: Page, fruit: number): HTMLElement {
  const { sights, visits } = season;
  const rowOf = new Map<number, number>();
  for (let row = sights.starts[fruit]; row < sights.starts[fruit + 1]; row++) rowOf.set(sights.visit[row], row);
  const lines = visits.map((visit, v) => {
    const row = rowOf.get(v);
    const date = element("th", { scope: "row", title: visit.title }, day(visit.time));
    if (row === undefined) {
      const why = v < history.first[fruit] ? "not seen yet" : "not seen";
      return element("tr", { class: "soft" }, date, element("td", {}, ""), element("td", {}, "–"), element("td", {}, why));
    }
    const sure = Number.isNaN(sights.probability[row]) ? "first sight" : percent(sights.probability[row]);
    const measured = element("td", {}, number(sights.diameterMm[row], 1));
    return element("tr", {}, date, element("td", {}, sightPicture(season, fruit, v)), measured, element("td", {}, sure));
  });
  const head = ["Date", "", "mm", "the same fruit"].map((title) => element("th", { scope: "col" }, title));
  return element("table", { class: "plain sights" }, element("thead", {}, element("tr", {}, ...head)), element("tbody", {}, ...lines));
}
