/** What is looked at, and a button that takes it along as a table. */
import { element } from "../elements";
import { ANY, isAny, passing, type Filter } from "../filter";
import type { Page } from "../page";
import { watchAll } from "../signal";
import { rowsOf, STATES } from "../told/season";
import { fruits, whole } from "../words";
import { saveCsv } from "./csv";

export function filterBar(page: Page): HTMLElement {
  const { season, filter } = page;
  const change = (part: Partial<Filter>): void => filter.set({ ...filter.value, ...part });
  const text = element("input", { type: "search", placeholder: "Number", size: 8, "aria-label": "Fruit number", input: () => change({ text: text.value }) });
  const trees = season.trees.map((tree, i) => element("option", { value: i }, tree.label));
  const tree = element("select", { "aria-label": "Tree", change: () => change({ tree: tree.value === "" ? null : Number(tree.value) }) }, element("option", { value: "" }, "All trees"), ...trees);
  const rows = rowsOf(season).map((name) => element("option", { value: name }, name));
  const row = element("select", { "aria-label": "Row", change: () => change({ row: row.value }) }, element("option", { value: "" }, "All rows"), ...rows);
  row.hidden = rows.length === 0;
  const states = ["hanging", ...STATES].map((name) => element("option", { value: name }, name));
  const state = element("select", { "aria-label": "State", change: () => change({ state: state.value as Filter["state"] }) }, element("option", { value: "" }, "All states"), ...states);
  const actions = ["keep", "thin", "drops"].map((name) => element("option", { value: name }, name));
  const action = element("select", { "aria-label": "To do", change: () => change({ action: action.value as Filter["action"] }) }, element("option", { value: "" }, "All to do"), ...actions);
  const from = sizeInput("From mm", (fromMm) => change({ fromMm }));
  const below = sizeInput("Below mm", (belowMm) => change({ belowMm }));
  const between = element("span", { class: "sizes" }, from, element("span", { "aria-hidden": "true" }, "–"), below);
  const count = element("output", { class: "soft" });
  const clear = element("button", { type: "button", click: () => filter.set(ANY) }, "Clear");
  const save = element("button", { type: "button", class: "save", click: () => saveCsv(page) }, "Save CSV");
  action.hidden = season.thinning === null;
  watchAll([filter, page.target], () => {
    const now = filter.value;
    [row.value, tree.value] = [now.row, now.tree === null ? "" : String(now.tree)];
    [state.value, action.value] = [now.state, now.action];
    if (isAny(now)) text.value = from.value = below.value = "";
    clear.hidden = isAny(now);
    count.textContent = `${whole(passing(page).length)} of ${fruits(season.n)}`;
  });
  const bar = [text, row, tree, state, action, between, clear, count, save];
  return element("form", { class: "filter-bar", role: "search", submit: (event: Event) => event.preventDefault() }, ...bar);
}

function sizeInput(label: string, change: (mm: number) => void): HTMLInputElement {
  const input = element("input", {
    type: "number",
    step: "any",
    min: 0,
    placeholder: label,
    "aria-label": label,
    class: "size",
    input: () => change(input.value === "" ? NaN : Number(input.value)),
  });
  return input;
}
