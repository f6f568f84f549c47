/** What fruits and lines look like, for keys: as `scene/spheres.ts` and `scene/strokes.ts` draw them. */
import type { Rgb } from "../colours";
import { drawing, element } from "../elements";
import type { Mark } from "../scene/moment";

/** In a circle of radius 1, as paths. */
const PATHS: Record<Exclude<Mark, "none">, string> = {
  dot: "M-.32 0a.32.32 0 1 0 .64 0a.32.32 0 1 0 -.64 0z",
  cross: "M0 .2L.4 .6L.6 .4L.2 0L.6 -.4L.4 -.6L0 -.2L-.4 -.6L-.6 -.4L-.2 0L-.6 .4L-.4 .6z",
  bar: "M-.64 -.18H.64V.18H-.64z",
  up: "M0 -.6L.56 .36H-.56z",
  down: "M0 .6L.56 -.36H-.56z",
};

/** Takes a colour, or the name of one of the style sheet. */
export function fruitSwatch(name: string, colour: Rgb | string, isRing: boolean, mark: Mark = "none"): HTMLElement {
  const fill = typeof colour === "string" ? colour : `rgb(${colour.join(",")})`;
  const ball = isRing ? drawing("circle", { r: 0.8, fill: "none", stroke: fill, "stroke-width": 0.4 }) : drawing("circle", { r: 1, fill });
  const path = mark === "none" ? null : drawing("path", { d: PATHS[mark], fill: isRing ? fill : "#141414" });
  return element("span", { class: "swatch" }, drawing("svg", { viewBox: "-1 -1 2 2", class: "dot", "aria-hidden": "true" }, ball, path), name);
}

export function lineSwatch(name: string, colour: Rgb): HTMLElement {
  const line = drawing("line", { x1: 0, x2: 22, y1: 5, y2: 5, stroke: `rgb(${colour.join(",")})`, "stroke-width": 2, "stroke-dasharray": "4 2" });
  return element("span", { class: "swatch" }, drawing("svg", { viewBox: "0 0 22 10", class: "stroke", "aria-hidden": "true" }, line), name);
}
