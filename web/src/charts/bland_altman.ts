/** Differences against means, with the bias and the limits of agreement (Bland and Altman 1986). */
import { drawing, element } from "../elements";
import type { Page } from "../page";
import type { Calipers } from "../told/document";
import { number } from "../words";

const [WIDTH, HEIGHT] = [720, 300];
const EDGE = { left: 46, right: 92, top: 12, bottom: 34 };
/** Of Okabe and Ito, in turn for the dates. */
const COLOURS = ["#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#56b4e9"];

export function blandAltman(page: Page, { pairs, all }: Calipers): HTMLElement {
  const dots = pairs.map((pair) => ({
    ...pair,
    mean: (pair.measured_mm + pair.caliper_mm) / 2,
    difference: pair.measured_mm - pair.caliper_mm,
  }));
  const [low, high] = [all.low_mm ?? all.bias_mm, all.high_mm ?? all.bias_mm];
  const x = scaleOf(dots.map((dot) => dot.mean), EDGE.left, WIDTH - EDGE.right);
  const y = scaleOf([0, low, high, ...dots.map((dot) => dot.difference)], HEIGHT - EDGE.bottom, EDGE.top);
  const dates = [...new Set(dots.map((dot) => dot.date))];
  const circles = dots.map((dot) => {
    const colour = COLOURS[dates.indexOf(dot.date) % COLOURS.length];
    const title = drawing("title", {}, `${dot.name}, ${dot.date}: ${number(dot.measured_mm, 1)} against ${number(dot.caliper_mm, 1)} mm`);
    const pick = (): void => page.selected.set(dot.fruit);
    return drawing("circle", { cx: x.at(dot.mean), cy: y.at(dot.difference), r: 4, fill: colour, click: pick }, title);
  });
  const label = `${pairs.length} diameters against calipers: bias ${number(all.bias_mm, 2)} mm, RMSE ${number(all.rmse_mm, 2)} mm`;
  const lines = [level(y.at(0), "", "zero"), level(y.at(all.bias_mm), `bias ${number(all.bias_mm, 1)}`, "bias")];
  if (all.low_mm !== null) lines.push(level(y.at(low), `limit ${number(low, 1)}`, "limit"), level(y.at(high), `limit ${number(high, 1)}`, "limit"));
  const ticks = [
    ...x.ticks.map((value) => text(x.at(value), HEIGHT - 16, number(value, 0), "middle")),
    ...y.ticks.map((value) => text(EDGE.left - 8, y.at(value) + 4, number(value, 0), "end")),
    text((EDGE.left + WIDTH - EDGE.right) / 2, HEIGHT - 1, "mean of both, mm", "middle"),
  ];
  const svg = drawing("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": label, class: "scatter" }, ...lines.flat(), ...ticks, ...circles);
  return element("div", { class: "scroll" }, svg);
}

function level(y: number, said: string, kind: string): SVGElement[] {
  const line = drawing("line", { x1: EDGE.left, x2: WIDTH - EDGE.right, y1: y, y2: y, class: kind });
  return [line, text(WIDTH - EDGE.right + 8, y + 4, said, "start")];
}

const text = (x: number, y: number, said: string, anchor: string): SVGElement =>
  drawing("text", { x, y, "text-anchor": anchor }, said);

interface Scale {
  readonly at: (value: number) => number;
  readonly ticks: readonly number[];
}

function scaleOf(values: readonly number[], from: number, to: number): Scale {
  const [least, most] = [Math.min(...values), Math.max(...values)];
  const margin = Math.max(1, 0.06 * (most - least));
  const [low, high] = [least - margin, most + margin];
  const step = [1, 2, 5, 10, 20, 50, 100].find((one) => (high - low) / one <= 8) ?? 200;
  const ticks: number[] = [];
  for (let value = Math.ceil(low / step) * step; value <= high; value += step) ticks.push(value);
  return { at: (value) => from + ((value - low) / (high - low)) * (to - from), ticks };
}
