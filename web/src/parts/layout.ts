/** Where the parts of the page are. */
import { element, replaceAll } from "../elements";
import type { Page } from "../page";
import { fullDay } from "../words";
import { answers } from "./answers";
import { legend, rowTools } from "./row_tools";
import { rowView } from "./row_view";
import { timeSlider } from "./time_slider";
import { treeTable } from "./tree_table";

export function layOut(root: HTMLElement, page: Page): void {
  const row = rowView(page);
  row.orbit.see("free");
  const foot = element("div", { class: "row-foot" }, legend(page), timeSlider(page));
  const seen = element("section", { class: "card row-card", "aria-label": "The row" }, rowTools(page, row.orbit), row.root, foot);
  replaceAll(root, top(page), element("main", {}, answers(page), seen, treeTable(page)));
}

function top({ season, history }: Page): HTMLElement {
  const { times } = history;
  const visits = times.length === 1 ? "1 visit" : `${times.length} visits`;
  const span = `${visits}, ${fullDay(times[0])} to ${fullDay(times[times.length - 1])}`;
  return element("header", {}, element("h1", {}, season.name), element("span", { class: "soft" }, span));
}
