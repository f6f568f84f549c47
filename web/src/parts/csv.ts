/** The fruits that pass the filter as CSV, for a spreadsheet. */
import { element } from "../elements";
import { factsOf } from "../facts";
import { passing } from "../filter";
import type { Page } from "../page";
import type { Season } from "../told/season";

const COLUMNS = [
  ...["fruit_id", "row", "tree", "state", "state_probability", "n_visits", "x", "y", "z", "diameter_mm", "low_mm", "high_mm"],
  ...["rate_mm_per_day", "forecast_mm", "forecast_low_mm", "forecast_high_mm", "drop_probability", "action"],
] as const;

export function saveCsv(page: Page): void {
  const address = URL.createObjectURL(new Blob([csvOf(page)], { type: "text/csv" }));
  const name = page.season.name.replace(/\.gpkg$/, "").replace(/[^\w.-]+/g, "_");
  element("a", { href: address, download: `${name || "orchard"}-fruits.csv` }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

export function csvOf(page: Page): string {
  const lines = passing(page).map((fruit) => {
    const one = factsOf(page, fruit);
    const about = [one.id, one.row, one.tree, one.state, one.stateProbability, one.sights, ...placeInMap(page.season, fruit)];
    const sizes = [one.sizeMm, one.lowMm, one.highMm, one.rate, one.forecastMm, one.forecastLowMm, one.forecastHighMm];
    return [...about, ...sizes, one.dropProbability, one.action].map(cell).join(",");
  });
  return `${[COLUMNS.join(","), ...lines].join("\n")}\n`;
}

function cell(value: number | string): string {
  // Steps of tenths and thousandths, without what binary fractions add to them.
  if (typeof value === "number") return Number.isNaN(value) ? "" : String(Math.round(1e4 * value) / 1e4);
  // A spreadsheet would run what begins like a formula, and names come from strangers.
  const text = /^[=+\-@\t\r]/.test(value) ? `'${value}` : value;
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

/** Where it was last seen, in the map's own frame, to the millimetre: places are told in those. */
function placeInMap({ sights, mapFromPage }: Season, fruit: number): number[] {
  const row = sights.starts[fruit + 1] - 1;
  const place = [sights.x[row], sights.y[row], sights.z[row], 1];
  return mapFromPage.slice(0, 3).map((axis) => Math.round(1e3 * axis.reduce((sum, value, i) => sum + value * place[i], 0)) / 1e3);
}
