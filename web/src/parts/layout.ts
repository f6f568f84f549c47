/** Where the parts of the page are. */
import { element, replaceAll } from "../elements";
import type { Page } from "../page";
import { Signal } from "../signal";
import { setTheme } from "../theme";
import { fullDay } from "../words";
import { answers } from "./answers";
import { calipers } from "./calipers";
import { filterBar } from "./filter_bar";
import { fruitCard } from "./fruit_card";
import { fruitTable } from "./fruit_table";
import { filtered, legend, rowTools } from "./row_tools";
import { rowView } from "./row_view";
import { sizeClasses } from "./size_classes";
import { tabs } from "./tabs";
import { thinning } from "./thinning";
import { timeSlider } from "./time_slider";
import { treeTable } from "./tree_table";
import { twoDates } from "./two_dates";

const GUESS = "Which way is up is guessed from the shape of the row; --up X,Y,Z tells it.";

type Name = "row" | "fruits" | "dates" | "sizes" | "thinning" | "calipers";

export function layOut(root: HTMLElement, page: Page): void {
  const chosen = new Signal<Name>("row");
  const { list, panels } = tabs<Name>(
    [
      { name: "row", title: "Row", build: () => [answers(page), beside(page, rowCard(page), atAGlance(page))] },
      { name: "fruits", title: "Fruits", build: () => [beside(page, fruitsCard(page), hint("Choose a fruit: its growth is shown here."))] },
      { name: "dates", title: "Two dates", build: () => [beside(page, twoDates(page), hint("Choose a fruit: the same one is marked on both dates."))] },
      { name: "sizes", title: "Sizes", build: () => [sizeClasses(page, true)] },
      { name: "thinning", title: "Thinning", build: () => [thinning(page, (tab) => chosen.set(tab))] },
      { name: "calipers", title: "Calipers", build: () => [page.season.calipers ? beside(page, calipers(page), hint("Click a dot for its fruit.")) : calipers(page)] },
    ],
    chosen,
  );
  replaceAll(root, top(page, list), element("main", {}, ...panels), foot(page));
}

function top({ season, history }: Page, list: HTMLElement): HTMLElement {
  const { times } = history;
  const visits = times.length === 1 ? "1 visit" : `${times.length} visits`;
  const span = times.length === 1 ? fullDay(times[0]) : `${fullDay(times[0])} to ${fullDay(times[times.length - 1])}`;
  return element("header", {}, element("h1", {}, season.name), element("span", { class: "soft" }, `${visits}, ${span}`), list, themes());
}

function themes(): HTMLElement {
  const isDark = (): boolean => getComputedStyle(document.documentElement).colorScheme === "dark";
  const turn = (): void => setTheme(isDark() ? "light" : "dark");
  return element("button", { type: "button", class: "theme", "aria-label": "Light or dark", title: "Light or dark", click: turn }, "◐");
}

function foot({ season }: Page): HTMLElement {
  return element("footer", { class: "soft" }, `${season.program}. Intervals are of 90 %.`);
}

/** Something large with the card of the chosen fruit at its side. */
function beside(page: Page, large: HTMLElement, otherwise: HTMLElement): HTMLElement {
  return element("div", { class: "beside" }, large, fruitCard(page, otherwise));
}

function rowCard(page: Page): HTMLElement {
  const row = rowView(page);
  const below = element("div", { class: "row-foot" }, legend(page), filtered(page), timeSlider(page));
  const guess = page.season.isVerticalGuessed ? element("p", { class: "soft below" }, GUESS) : null;
  return element("section", { class: "card row-card", "aria-label": "The row" }, rowTools(page, row.orbit), row.root, guess, below);
}

function fruitsCard(page: Page): HTMLElement {
  return element("section", { class: "card fruits-card", "aria-label": "Fruits" }, filterBar(page), fruitTable(page));
}

function atAGlance(page: Page): HTMLElement {
  return element("div", { class: "glance" }, treeTable(page), sizeClasses(page, false));
}

const hint = (text: string): HTMLElement => element("p", { class: "card soft hint" }, text);
