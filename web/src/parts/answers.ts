/** The four questions of a grower, answered before any click: how many, how big, how fast, what to do. */
import { element, replaceAll, type Child } from "../elements";
import { oldDay } from "../facts";
import type { Page } from "../page";
import { advice } from "./advice";
import { expectedOfAll, hangingRows, sizesNow } from "../summary";
import { STATES, type Season } from "../told/season";
import { day, fruits, mm, number, whole, wholeFruits } from "../words";

export function answers(page: Page): HTMLElement {
  const root = element("section", { class: "answers", "aria-label": "At a glance" });
  const show = (): void => replaceAll(root, howMany(page), howBig(page), howFast(page), whatToDo(page));
  page.target.watch(show);
  return root;
}

function answer(question: string, said: string, unit: string, ...more: Child[]): HTMLElement {
  const big = element("p", { class: "said" }, element("strong", {}, said), unit ? ` ${unit}` : null);
  return element("div", { class: "card answer" }, element("h2", { class: "label" }, question), big, ...more);
}

const line = (text: string): HTMLElement => element("p", { class: "soft" }, text);

function howMany({ season }: Page): HTMLElement {
  const { hang, gone } = expectedOfAll(season);
  const named = season.trees.filter((tree) => tree.name).length;
  const where = named > 0 ? `on ${named} trees, ${whole(hang / named)} a tree` : "no single trees known";
  return answer("How many", whole(wholeFruits(hang)), "fruits hang", line(where), ...others(season, wholeFruits(gone)).map(line));
}

/** What was seen and is not counted. */
function others(season: Season, gone: number): string[] {
  const doubted = season.n - hangingRows(season).length - season.state.filter((one) => STATES[one] === "gone").length;
  const lost = gone > 0 ? gone === 1 ? "1 more was seen and has probably gone" : `${whole(gone)} more were seen and have probably gone` : "none is gone so far";
  return doubted > 0 ? [lost, `${whole(doubted)} seen once ${doubted === 1 ? "is" : "are"} likelier no fruit`] : [lost];
}

function howBig({ season }: Page): HTMLElement {
  const all = season.growth?.blocks[0];
  const sizes = sizesNow(season);
  if (sizes.length === 0) return answer("How big", "–", "", line("no diameters in this map"));
  const middle = `eight of ten: ${number(quantile(sizes, 0.1), 0)} to ${number(quantile(sizes, 0.9), 0)} mm`;
  const unit = `mm on average${onOldDay(season)}`;
  if (!season.growth || !all) return answer("How big", number(mean(sizes), 1), unit, line(middle));
  const now = season.growth.nVisits - 1;
  const sure = `${number(all.low_mm[now], 1)} to ${number(all.high_mm[now], 1)} mm (90\u00a0%)`;
  const { unmeasured } = season.growth;
  const more = unmeasured > 0 ? [`${fruits(unmeasured)} that no visit measured`] : [];
  return answer("How big", number(all.mean_mm[now], 1), unit, ...[sure, middle, ...more].map(line));
}

function howFast({ season }: Page): HTMLElement {
  const growth = season.growth;
  if (!growth) return answer("How fast", "–", "", line(season.noGrowth ?? ""));
  const [low, rate, high] = growth.blocks[0].rate_mm_per_day;
  const sure = line(`${number(low, 2)} to ${number(high, 2)} mm (90\u00a0%)`);
  const last = growth.times.length - 1;
  const then = growth.harvest === null ? line("--harvest DATE foretells a day") : line(
    `${day(growth.harvest)}: ${mm(growth.blocks[0].mean_mm[last])}, ${number(growth.blocks[0].low_mm[last], 1)} to ${number(growth.blocks[0].high_mm[last], 1)}`,
  );
  return answer("How fast", number(rate, 2), `mm a day${onOldDay(season)}`, sure, then);
}

/** The day of sizes and rates, where the last visits have none. */
function onOldDay(season: Season): string {
  const old = oldDay(season);
  return old === null ? "" : ` on ${old.replace(" ", "\u00a0")}`;
}

function whatToDo(page: Page): HTMLElement {
  const [first, ...others] = advice(page);
  const said = element("p", { class: "said" }, element("strong", {}, first));
  const more = others.slice(0, 3).map((one) => line(one));
  return element("div", { class: "card answer" }, element("h2", { class: "label" }, "What to do"), said, ...more);
}

const mean = (values: readonly number[]): number => values.reduce((sum, value) => sum + value, 0) / values.length;

function quantile(values: readonly number[], share: number): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.round(share * (sorted.length - 1))];
}

