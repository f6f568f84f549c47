/** What the row is coloured by, from where it is looked at, and what the colours mean. */
import { schemeOf, UNKNOWN, VIRIDIS, type ColourBy, type Ramp, type Swatches } from "../colours";
import { choice, element, replaceAll } from "../elements";
import { ANY, isAny, passing } from "../filter";
import type { Page } from "../page";
import type { Orbit, View } from "../scene/orbit";
import { fruits, whole } from "../words";
import { fruitSwatch } from "./swatch";

const VIEWS: readonly (readonly [View, string])[] = [
  ["side", "Side"],
  ["above", "Above"],
  ["free", "3D"],
];

export function rowTools(page: Page, orbit: Orbit): HTMLElement {
  const colours = choice("Colour", colourNames(page), (by) => page.colour.set(by));
  const views = choice("View", VIEWS, (view) => orbit.see(view));
  orbit.view.watch(views.show);
  page.colour.watch(colours.show);
  return element("div", { class: "row-tools" }, element("span", { class: "label" }, "Colour"), colours.root, views.root);
}

function colourNames({ season }: Page): (readonly [ColourBy, string])[] {
  const always: (readonly [ColourBy, string])[] = [
    ["size", "Size"],
    ["state", "State"],
    ["date", "Date"],
  ];
  const grown: (readonly [ColourBy, string])[] = season.growth ? [["growth", "Growth"]] : [];
  const planned: (readonly [ColourBy, string])[] = season.thinning ? [["plan", "Thinning"]] : [];
  return [...grown, ...always, ...planned];
}

export function legend(page: Page): HTMLElement {
  const root = element("div", { class: "legend" });
  page.colour.watch(() => {
    const { legend } = schemeOf(page);
    const title = element("span", { class: "label" }, legend.title);
    replaceAll(root, title, legend.kind === "ramp" ? ramp(legend) : swatches(legend), ...(legend.kind === "ramp" ? besides(legend) : []));
  });
  return root;
}

function besides({ hasUnknown }: Ramp): HTMLElement[] {
  const unseen = fruitSwatch("not seen then", "currentcolor", true);
  return hasUnknown ? [fruitSwatch("not known", UNKNOWN, false, "dot"), unseen] : [unseen];
}

/** Says that not all fruits are looked at, and ends it. */
export function filtered(page: Page): HTMLElement {
  const button = element("button", { type: "button", class: "filtered", click: () => page.filter.set(ANY) });
  page.filter.watch((now) => {
    button.hidden = isAny(now);
    button.textContent = `Only ${whole(passing(page).length)} of ${fruits(page.season.n)} ✕`;
  });
  return button;
}

function ramp({ low, high }: Ramp): HTMLElement {
  const bar = element("span", { class: "ramp", "aria-hidden": "true" });
  bar.style.background = `linear-gradient(to right, ${VIRIDIS.map((rgb) => `rgb(${rgb.join(",")})`).join(",")})`;
  return element("span", { class: "ends" }, low, bar, high);
}

function swatches({ swatches }: Swatches): HTMLElement {
  const items = swatches.map(({ name, rgb, isRing, mark }) => fruitSwatch(name, rgb, isRing, mark));
  return element("span", { class: "swatches" }, ...items);
}
