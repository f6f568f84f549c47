/** The same four answers tree by tree; a click looks at one tree. */
import { element, replaceAll } from "../elements";
import { oldDay } from "../facts";
import type { Page } from "../page";
import { meanMm, treeSummaries, type TreeSummary } from "../summary";
import { day, number, whole, wholeFruits } from "../words";

const BAR_PX = 28;

export function treeTable(page: Page): HTMLElement {
  const { season, filter, target } = page;
  const body = element("tbody");
  const growth = season.growth;
  const old = oldDay(season);
  const heads = ["Tree", "Fruits", old === null ? "mm" : `mm, ${old}`, "a day"];
  if (growth?.harvest) heads.push(day(growth.harvest));
  const isPlanned = (): boolean => season.thinning !== null && target.value !== null;
  const head = element("tr");
  const show = (): void => {
    const titles = isPlanned() ? [...heads, "thin"] : heads;
    replaceAll(head, ...titles.map((title) => element("th", { scope: "col" }, title)));
    const trees = treeSummaries(page);
    const most = Math.max(...trees.map((tree) => tree.fruits));
    const isOther = (i: number): boolean => season.trees[i].row !== (season.trees[i - 1]?.row ?? "");
    const lines = trees.map((tree, i) => {
      const line = lineOf(page, tree, most, isPlanned());
      return isOther(i) ? [rowLine(page, season.trees[i].row, trees, isPlanned()), line] : [line];
    });
    replaceAll(body, ...lines.flat());
  };
  filter.watch(show);
  target.watch(show);
  const table = element("table", { class: "plain" }, element("thead", {}, head), body);
  return element("section", { class: "card trees" }, element("h2", {}, "Tree by tree"), element("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Tree by tree" }, table));
}

/** Above the trees of a row what they come to together; a click looks at the row. */
function rowLine({ season, filter }: Page, row: string, trees: readonly TreeSummary[], isPlanned: boolean): HTMLElement {
  const { growth } = season;
  const own = trees.filter(({ tree }) => season.trees[tree].row === row);
  const sum = (of: (tree: TreeSummary) => number): string => whole(wholeFruits(own.reduce((total, tree) => total + of(tree), 0)));
  const block = growth?.blocks.find((one) => one.kind === "row" && one.name === row);
  const isChosen = filter.value.row === row && row !== "";
  const pick = (): void => filter.set({ ...filter.value, row: isChosen ? "" : row, tree: null });
  const button = element("button", { type: "button", title: row || null, "aria-pressed": String(isChosen), click: pick }, row || "no row");
  const cells = [sum(({ fruits }) => fruits), number(meanMm(season, block, own), 1), number(block?.rate_mm_per_day[1] ?? NaN, 2)];
  if (growth?.harvest) cells.push(number(block?.mean_mm[growth.times.length - 1] ?? NaN, 1));
  if (isPlanned) cells.push(sum(({ thin }) => thin));
  const about = element("th", { scope: "row" }, button);
  return element("tr", { class: isChosen ? "of-row chosen" : "of-row" }, about, ...cells.map((cell) => element("td", {}, cell)));
}

function lineOf({ season, filter }: Page, tree: TreeSummary, most: number, isPlanned: boolean): HTMLElement {
  const { growth } = season;
  const isChosen = filter.value.tree === tree.tree;
  const pick = (): void => filter.set({ ...filter.value, tree: isChosen ? null : tree.tree });
  const button = element("button", { type: "button", title: tree.label, "aria-pressed": String(isChosen), click: pick }, tree.label);
  const bar = element("span", { class: "bar", "aria-hidden": "true" });
  bar.style.width = `${(BAR_PX * tree.fruits) / Math.max(1, most)}px`;
  const cells = [
    element("td", {}, bar, whole(wholeFruits(tree.fruits))),
    element("td", {}, number(meanMm(season, tree.block, [tree]), 1)),
    element("td", {}, number(tree.block?.rate_mm_per_day[1] ?? NaN, 2)),
  ];
  if (growth?.harvest) cells.push(element("td", {}, number(tree.block?.mean_mm[growth.times.length - 1] ?? NaN, 1)));
  if (isPlanned) cells.push(element("td", {}, whole(tree.thin)));
  return element("tr", { class: isChosen ? "chosen" : "" }, element("th", { scope: "row" }, button), ...cells);
}

