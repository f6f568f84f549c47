/** How far the sizes agree with calipers. */
import { blandAltman } from "../charts/bland_altman";
import { element } from "../elements";
import type { Page } from "../page";
import type { Agreement } from "../told/document";
import { number, whole } from "../words";

const MOST_NAMES = 8;

export function calipers(page: Page): HTMLElement {
  const told = page.season.calipers;
  if (told === null) {
    const how = "Measure some fruits by hand and give the table: --calipers FILE. This page then shows how far both agree.";
    return element("p", { class: "notice" }, how);
  }
  const heads = ["Visit", "pairs", "bias, mm", "RMSE, mm", "limits of agreement, mm"];
  const head = element("tr", {}, ...heads.map((name) => element("th", { scope: "col" }, name)));
  const lines = [lineOf("All", told.all), ...told.visits.map((visit) => lineOf(visit.name, visit))];
  const table = element("table", { class: "plain" }, element("thead", {}, head), element("tbody", {}, ...lines));
  const some = told.unseen.slice(0, MOST_NAMES).join(", ") + (told.unseen.length > MOST_NAMES ? ", …" : "");
  const unseen = told.unseen.length > 0 ? element("p", { class: "soft" }, `Not measured by any visit near: ${some}`) : null;
  return element(
    "section",
    { class: "card" },
    element("h2", {}, "Against calipers"),
    element("p", { class: "soft" }, `${told.file}; bias is measured minus caliper, 95 % of differences lie within the limits.`),
    blandAltman(page, told),
    element("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Agreement" }, table),
    unseen,
  );
}

function lineOf(name: string, one: Agreement): HTMLElement {
  const limits = one.low_mm === null ? "–" : `${number(one.low_mm, 1)} to ${number(one.high_mm ?? NaN, 1)}`;
  const cells = [whole(one.n), number(one.bias_mm, 2), number(one.rmse_mm, 2), limits];
  return element("tr", {}, element("th", { scope: "row", title: name }, name), ...cells.map((cell) => element("td", {}, cell)));
}
