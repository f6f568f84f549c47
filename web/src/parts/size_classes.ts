/** How many fruits of each size there are, on the last visit and at the harvest. */
import { element } from "../elements";
import { oldDay } from "../facts";
import type { Page } from "../page";
import type { SizeClass } from "../told/document";
import { fullDay, number, timeOf, whole } from "../words";
import { between } from "./advice";

interface Day {
  readonly date: string;
  readonly classes: readonly SizeClass[];
}

export function sizeClasses(page: Page, isLong: boolean): HTMLElement {
  const days = daysOf(page);
  const title = element("h2", {}, "Sizes");
  if (days.length === 0) {
    return element("section", { class: "card" }, title, element("p", { class: "soft" }, page.season.noGrowth ?? ""));
  }
  const brackets = page.season.growth ? "Numbers in brackets are 90 % intervals." : "As measured.";
  const hint = isLong ? `Minimum belongs to a class, maximum to the next. ${brackets}` : "Click a fruit for its own curve.";
  return element(
    "section",
    { class: "card sizes" },
    title,
    isLong ? null : key(days),
    isLong ? element("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Sizes" }, longTable(days)) : bars(days, oldDay(page.season)),
    isLong || page.season.growth ? element("p", { class: "soft" }, hint) : null,
  );
}

function daysOf({ season }: Page): Day[] {
  return [...new Set(season.classes.map((one) => one.date))].map((date) => ({
    date,
    classes: season.classes.filter((one) => one.date === date),
  }));
}

function key(days: readonly Day[]): HTMLElement {
  const names = days.map(({ date }, i) =>
    element("span", { class: "swatch" }, element("span", { class: `block ${i ? "later" : ""}`, "aria-hidden": "true" }), fullDay(timeOf(date))),
  );
  return element("p", { class: "key soft" }, ...names);
}

function bars(days: readonly Day[], old: string | null): HTMLElement {
  const most = Math.max(...days.flatMap(({ classes }) => classes.map((one) => one.n_fruits)));
  const rows = days[0].classes.map((first, i) => {
    const both = days.map(({ classes }, d) => {
      const bar = element("span", { class: `bar ${d ? "later" : ""}`, "aria-hidden": "true" });
      bar.style.width = `${(100 * classes[i].n_fruits) / most}%`;
      return bar;
    });
    const counts = days.map(({ classes }) => element("td", {}, whole(classes[i].n_fruits)));
    return element("tr", {}, element("th", { scope: "row" }, between(first)), element("td", { class: "wide" }, ...both), ...counts);
  });
  const heads = ["mm", "", old ?? "now", ...(days.length > 1 ? ["then"] : [])];
  const head = element("tr", {}, ...heads.map((name) => element("th", { scope: "col" }, name)));
  return element("table", { class: "plain bars" }, element("thead", {}, head), element("tbody", {}, ...rows));
}

function longTable(days: readonly Day[]): HTMLElement {
  const names = ["fruits", "kg", "packs"];
  const head = element(
    "tr",
    {},
    element("th", { scope: "col" }, "Size"),
    ...days.flatMap(({ date }) => names.map((name) => element("th", { scope: "col" }, `${name}, ${fullDay(timeOf(date))}`))),
  );
  const rows = days[0].classes.map((first, i) =>
    element("tr", {}, element("th", { scope: "row" }, between(first)), ...days.flatMap(({ classes }) => amounts(classes[i]))),
  );
  return element("table", { class: "plain" }, element("thead", {}, head), element("tbody", {}, ...rows));
}

function amounts(one: SizeClass): HTMLElement[] {
  const range = (low: number | null, high: number | null, digits: number): string =>
    low === null || high === null ? "" : ` (${number(low, digits)} to ${number(high, digits)})`;
  return [
    element("td", {}, whole(one.n_fruits) + range(one.n_fruits_low, one.n_fruits_high, 0)),
    element("td", {}, number(one.kg, 1)),
    element("td", {}, number(one.packs, 1) + range(one.packs_low, one.packs_high, 1)),
  ];
}
