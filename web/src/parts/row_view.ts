/** The row in 3D, at the time of the slider, in the chosen colours; what the filter leaves out is faded. */
import { element } from "../elements";
import { factsOf } from "../facts";
import type { Page } from "../page";
import { watchAll } from "../signal";
import { steer } from "../scene/gestures";
import { ground, withGround } from "../scene/ground";
import { Orbit } from "../scene/orbit";
import { fruitAt } from "../scene/picking";
import { extentOf } from "../scene/extent";
import { LOOKS } from "../scene/moment";
import { Stage } from "../scene/stage";
import { inkRgb, repaint } from "../theme";
import { mm, number } from "../words";
import { rowPainter } from "./row_painter";
import { treeLabels } from "./tree_labels";

export interface RowView {
  readonly root: HTMLElement;
  readonly orbit: Orbit;
}

export function rowView(page: Page): RowView {
  const { season, selected } = page;
  const extent = extentOf(season);
  const orbit = new Orbit(withGround(extent), "free");
  const tip = element("div", { class: "tip", role: "status", hidden: true });
  const root = element("div", { class: "row-view" }, tip);
  const stage = new Stage(root, orbit, season.n);
  stage.canvas.tabIndex = 0;
  stage.canvas.setAttribute("role", "application");
  stage.canvas.setAttribute("aria-label", "The row in 3D. The table of fruits has the same facts. Arrows move, A D W S turn, plus and minus zoom, 1 side, 2 above, 3 aslant.");
  root.append(treeLabels(page, stage, extent.low[2]));

  const paint = rowPainter(page, stage);
  watchAll([selected, page.time], () => mark(page, stage));
  repaint.watch(() => {
    stage.setBackground(inkRgb("sky"));
    stage.ground.set(ground(season, extent));
    paint();
  });
  steer(stage.canvas, orbit, {
    hover: (x, y) => showTip(page, tip, fruitAt(stage, x, y), x, y),
    leave: () => (tip.hidden = true),
    press: (x, y) => selected.set(fruitAt(stage, x, y)),
  });
  return { root, orbit };
}

function mark({ selected, time, history }: Page, { marks, redraw }: Stage): void {
  const fruit = selected.value;
  marks.from.colours.set([...inkRgb("accent"), fruit === null ? LOOKS.hidden : LOOKS.ring]);
  if (fruit !== null) {
    history.placeAt(time.value)(fruit, marks.from.positions, 0);
    marks.from.diameters[0] = (1.7 * history.sizeAt(time.value)(fruit)) / 1000;
  }
  marks.rest();
  redraw();
}

function showTip(page: Page, tip: HTMLElement, fruit: number | null, x: number, y: number): void {
  tip.hidden = fruit === null;
  if (fruit === null) return;
  const facts = factsOf(page, fruit);
  const size = mm(page.history.sizeAt(page.time.value)(fruit));
  const rate = Number.isNaN(facts.rate) ? "" : ` · ${number(facts.rate, 2)} mm a day`;
  tip.textContent = `Fruit ${facts.id} · ${size}${rate}`;
  tip.style.transform = `translate(${Math.round(x)}px, ${Math.round(y)}px)`;
}
