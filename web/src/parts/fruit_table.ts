/** Every fruit as a line: sorted by any column, only those on screen are in the page. */
import { element, replaceAll } from "../elements";
import { factsOf, oldDay, type Facts } from "../facts";
import { passing } from "../filter";
import type { Page } from "../page";
import { watchAll } from "../signal";
import { isTimeToThin } from "../summary";
import { rowsOf } from "../told/season";
import { day, number, percent } from "../words";

const ROW_PX = 32;
const SPARE_ROWS = 6;

interface Column {
  /** Of its widest cell, the title with its arrow among them, in ems. */
  readonly width: number;
  readonly title: string;
  readonly say: (facts: Facts) => string;
  readonly order: (facts: Facts) => number | string;
}

export function fruitTable(page: Page): HTMLElement {
  let columns = columnsOf(page);
  let sortedBy = 0;
  let isFalling = false;
  let rows: number[] = [];
  const body = element("div", { class: "lines", role: "rowgroup" });
  const scroller = element("div", { class: "scroller", tabindex: 0, role: "table", "aria-label": "Fruits" });
  const head = element("div", { class: "line head", role: "row" });
  scroller.append(element("div", { role: "rowgroup", class: "heads" }, head), body);

  const sort = (): void => {
    const { order } = columns[sortedBy] ?? columns[0];
    const keys = new Map(rows.map((fruit) => [fruit, order(factsOf(page, fruit))]));
    rows.sort((a, b) => (isFalling ? -1 : 1) * compared(keys.get(a), keys.get(b)) || a - b);
  };
  const draw = (): void => {
    const first = Math.max(0, Math.floor(scroller.scrollTop / ROW_PX) - SPARE_ROWS);
    const last = Math.min(rows.length, first + Math.ceil(scroller.clientHeight / ROW_PX) + 2 * SPARE_ROWS);
    body.style.height = `${rows.length * ROW_PX}px`;
    replaceAll(body, ...rows.slice(first, last).map((fruit, i) => lineOf(page, columns, fruit, first + i)));
  };
  const refresh = (): void => {
    columns = columnsOf(page);
    scroller.style.setProperty("--columns", columns.map(({ width }) => `minmax(${width}em, 1fr)`).join(" "));
    rows = passing(page);
    sort();
    scroller.setAttribute("aria-rowcount", String(rows.length + 1));
    replaceAll(head, ...columns.map((column, i) => headOf(column, i === sortedBy ? isFalling : null, () => sortBy(i))));
    draw();
  };
  const sortBy = (column: number): void => {
    isFalling = column === sortedBy && !isFalling;
    sortedBy = column;
    refresh();
    (head.children[column].firstElementChild as HTMLElement).focus();
  };
  const reveal = (fruit: number | null): void => {
    const at = fruit === null ? -1 : rows.indexOf(fruit);
    const top = (at + 1) * ROW_PX;
    if (at >= 0 && (top < scroller.scrollTop + ROW_PX || top > scroller.scrollTop + scroller.clientHeight - ROW_PX)) {
      scroller.scrollTop = top - scroller.clientHeight / 2;
    }
    draw();
  };
  watchAll([page.filter, page.target], refresh);
  page.selected.watch(reveal);
  scroller.addEventListener("scroll", draw);
  new ResizeObserver(draw).observe(scroller);
  scroller.addEventListener("keydown", (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1, PageDown: 12, PageUp: -12 }[event.key];
    if (step === undefined || event.target !== scroller || rows.length === 0) return;
    event.preventDefault();
    const at = page.selected.value === null ? -1 : rows.indexOf(page.selected.value);
    page.selected.set(rows[Math.max(0, Math.min(rows.length - 1, at + step))]);
  });
  return scroller;
}

const rowColumn: Column = { width: 5, title: "Row", say: (one) => one.row, order: (one) => one.row };

function columnsOf(page: Page): Column[] {
  const { growth } = page.season;
  const old = oldDay(page.season);
  const columns: Column[] = [
    { width: 5, title: "Fruit", say: (one) => one.id, order: (one) => Number(one.id) },
    ...(rowsOf(page.season).length > 0 ? [rowColumn] : []),
    { width: 5, title: "Tree", say: (one) => one.tree, order: (one) => one.tree },
    { width: 5, title: "State", say: (one) => one.state, order: (one) => one.state },
    { width: 4.6, title: "sure", say: (one) => percent(one.stateProbability), order: (one) => one.stateProbability },
    { width: 5, title: "Visits", say: (one) => String(one.sights), order: (one) => one.sights },
    { width: 6.6, title: old === null ? "mm now" : `mm, ${old}`, say: (one) => number(one.sizeMm, 1), order: (one) => one.sizeMm },
  ];
  if (growth) {
    columns.push(
      { width: 7.6, title: "90 %", say: (one) => range(one.lowMm, one.highMm), order: (one) => one.lowMm },
      { width: 7.2, title: "mm a day", say: (one) => number(one.rate, 2), order: (one) => one.rate },
    );
  }
  if (growth?.harvest) {
    const say = (one: Facts): string => number(one.forecastMm, 1);
    columns.push(
      { width: 8.4, title: `mm, ${day(growth.harvest)}`, say, order: (one) => one.forecastMm },
      { width: 7.6, title: "90 %", say: (one) => range(one.forecastLowMm, one.forecastHighMm), order: (one) => one.forecastLowMm },
    );
  }
  if (isTimeToThin(page)) {
    columns.push(
      { width: 4.8, title: "drops", say: (one) => percent(one.dropProbability), order: (one) => one.dropProbability },
      { width: 5, title: "To do", say: (one) => one.action, order: (one) => one.action },
    );
  }
  return columns;
}

const range = (low: number, high: number): string =>
  Number.isNaN(low) ? "–" : `${number(low, 1)}–${number(high, 1)}`;

/** What is not known comes first when rising, as the least. */
function compared(a: number | string | undefined, b: number | string | undefined): number {
  if (typeof a === "string" && typeof b === "string") return a.localeCompare(b, "en", { numeric: true });
  const [one, other] = [Number.isNaN(a) ? -Infinity : Number(a), Number.isNaN(b) ? -Infinity : Number(b)];
  return one === other ? 0 : one - other;
}

function headOf({ title }: Column, falls: boolean | null, pick: () => void): HTMLElement {
  const said = falls === null ? "none" : falls ? "descending" : "ascending";
  const arrow = falls === null ? "" : falls ? " ↓" : " ↑";
  return element("span", { role: "columnheader", "aria-sort": said }, element("button", { type: "button", click: pick }, title + arrow));
}

/** Names may be cut; numbers never are. */
const isLong = (text: string): boolean => text.length > 12;

function lineOf(page: Page, columns: readonly Column[], fruit: number, at: number): HTMLElement {
  const facts = factsOf(page, fruit);
  const isChosen = page.selected.value === fruit;
  const pick = (): void => page.selected.set(isChosen ? null : fruit);
  const cells = columns.map(({ say }) => element("span", { role: "cell", title: isLong(say(facts)) ? say(facts) : null }, say(facts)));
  const line = element("div", { class: isChosen ? "line chosen" : "line", role: "row", "aria-rowindex": at + 2, click: pick }, ...cells);
  line.style.transform = `translateY(${at * ROW_PX}px)`;
  return line;
}
