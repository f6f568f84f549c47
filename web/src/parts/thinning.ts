/** How many fruits to take from each tree, for a number that it shall keep. */
import { element, replaceAll } from "../elements";
import { ANY } from "../filter";
import type { Page } from "../page";
import { treeSummaries, type TreeSummary } from "../summary";
import { fruits as fruitsOf, fullDay, number, whole, wholeFruits } from "../words";

const LATE = "These fruits are past the size at which one thins, and the rule below is one of fruitlets.";
const UNTOLD = "Cannot tell which fruits will drop: rates are too unsure between these two visits. Wait, or measure from nearer.";

export function thinning(page: Page, goTo: (tab: "row" | "fruits") => void): HTMLElement {
  const plan = page.season.thinning;
  if (plan === null) {
    const why = page.season.noGrowth ?? "no fruit was measured on both of the last two days";
    return element("p", { class: "notice" }, `Thinning needs the growth between two days: ${why}.`);
  }
  const unmeasured = page.season.growth?.unmeasured ?? 0;
  const most = Math.max(...treeSummaries(page).map((tree) => wholeFruits(tree.fruits)));
  const input = element("input", { type: "number", min: 0, max: most, id: "target", input: () => set(input.value) });
  const slider = element("input", { type: "range", min: 0, max: most, "aria-label": "Fruits that a tree shall keep", input: () => set(slider.value) });
  const set = (value: string): void => page.target.set(value === "" ? null : Math.max(0, Math.round(Number(value))));
  const body = element("tbody");
  const show = element("button", { type: "button", click: () => (page.colour.set("plan"), goTo("row")) }, "Show in the row");
  const list = element("button", { type: "button", click: () => (page.filter.set({ ...ANY, action: "thin" }), goTo("fruits")) }, "List them");
  page.target.watch((target) => {
    slider.value = String(target ?? most);
    if (document.activeElement !== input) input.value = target === null ? "" : String(target);
    const trees = treeSummaries(page);
    replaceAll(body, ...trees.map(lineOf), totalOf(trees));
  });
  const doubt = plan.areFruitlets ? (plan.isTold ? null : UNTOLD) : LATE;
  const late = doubt === null ? null : element("p", { class: "late" }, doubt);
  const heads = ["Tree", "Fruits", "will drop", "stay", "to thin", "clusters to visit"];
  const head = element("tr", {}, ...heads.map((name) => element("th", { scope: "col" }, name)));
  const table = element("table", { class: "plain" }, element("thead", {}, head), body);
  return element(
    "section",
    { class: "card" },
    element("h2", {}, "Thinning"),
    late,
    element("p", { class: "target" }, element("label", { for: "target" }, "Each tree shall keep "), input, slider, show, list),
    element("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Thinning by tree" }, table),
    unmeasured > 0 ? element("p", { class: "soft" }, `${fruitsOf(unmeasured)} that no visit measured: none of them is thinned.`) : null,
    element("p", { class: "soft" }, plan.isTold ? rule(plan.fast, plan.from, plan.to) : `With a target ${ORDER}`),
  );
}

const ORDER = "a tree gives those of its fullest clusters first, the smallest of each.";

function rule(fast: number, from: number, to: number): string {
  const fastest = `From ${fullDay(from)} to ${fullDay(to)} the fastest fruits grew ${number(fast, 2)} mm a day`;
  return `${fastest}; what grows less than half as fast will drop. Of the others ${ORDER}`;
}

function lineOf({ label, fruits, drops, thin, clustersToThin }: TreeSummary): HTMLElement {
  const hang = wholeFruits(fruits);
  const numbers = [hang, drops, hang - drops, thin, clustersToThin];
  return element("tr", {}, element("th", { scope: "row", title: label }, label), ...numbers.map((n) => element("td", {}, whole(n))));
}

function totalOf(trees: readonly TreeSummary[]): HTMLElement {
  const sum = (of: (tree: TreeSummary) => number): number => trees.reduce((total, tree) => total + of(tree), 0);
  const all = { fruits: sum((tree) => tree.fruits), drops: sum((tree) => tree.drops), thin: sum((tree) => tree.thin) };
  const line = lineOf({ tree: -1, label: "All", gone: 0, block: null, measured: 0, measuredMm: NaN, ...all, clustersToThin: sum((tree) => tree.clustersToThin) });
  line.className = "total";
  return line;
}
