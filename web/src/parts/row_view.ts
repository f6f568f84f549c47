/** The row in 3D, at the time of the slider, in the chosen colours; what the filter leaves out is faded. */
import { schemeOf } from "../colours";
import { element } from "../elements";
import { factsOf } from "../facts";
import { passesOf } from "../filter";
import type { Page } from "../page";
import { onceAFrame, watchAll } from "../signal";
import { steer } from "../scene/gestures";
import { ground } from "../scene/ground";
import { Orbit } from "../scene/orbit";
import { fruitAt } from "../scene/picking";
import { extentOf } from "../scene/extent";
import { LOOKS } from "../scene/spheres";
import { Stage } from "../scene/stage";
import { inkRgb, repaint } from "../theme";
import { mm, number } from "../words";
import { treeLabels } from "./tree_labels";

export interface RowView {
  readonly root: HTMLElement;
  readonly orbit: Orbit;
}

export function rowView(page: Page): RowView {
  const { season, selected } = page;
  const extent = extentOf(season);
  const orbit = new Orbit(extent);
  const tip = element("div", { class: "tip", role: "status", hidden: true });
  const root = element("div", { class: "row-view" }, tip);
  const stage = new Stage(root, orbit, season.n);
  stage.canvas.tabIndex = 0;
  stage.canvas.setAttribute("role", "application");
  stage.canvas.setAttribute("aria-label", "The row in 3D. The table of fruits has the same facts. Arrows move, A D W S turn, plus and minus zoom, 1 side, 2 above, 3 aslant.");
  root.append(treeLabels(page, stage));

  const paint = onceAFrame(() => paintFruits(page, stage));
  watchAll([page.time, page.colour, page.filter, page.target], paint);
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

function paintFruits(page: Page, stage: Stage): void {
  const { history, season } = page;
  const time = page.time.value;
  const [scheme, passes] = [schemeOf(page), passesOf(page)];
  const [place, size, colour] = [history.placeAt(time), history.sizeAt(time), scheme.at(time)];
  const visit = history.visitAt(time);
  const isOfStates = page.colour.value === "state";
  const { positions, diameters, colours } = stage.fruits;
  for (let fruit = 0; fruit < season.n; fruit++) {
    const isKnown = history.first[fruit] <= visit;
    const isShown = history.isThere(fruit, time) || (isKnown && isOfStates);
    const look = !isShown ? "hidden" : !passes(fruit) ? "faded" : history.wasSeen(fruit, visit) ? "solid" : "ring";
    colours.set(colour(fruit), 4 * fruit);
    colours[4 * fruit + 3] = LOOKS[look];
    diameters[fruit] = size(fruit) / 1000;
    place(fruit, positions, 3 * fruit);
  }
  stage.fruits.changed();
  stage.redraw();
}

function mark({ selected, time, history }: Page, stage: Stage): void {
  const { marks } = stage;
  const fruit = selected.value;
  marks.colours.set([...inkRgb("accent"), fruit === null ? LOOKS.hidden : LOOKS.ring]);
  if (fruit !== null) {
    history.placeAt(time.value)(fruit, marks.positions, 0);
    marks.diameters[0] = (1.7 * history.sizeAt(time.value)(fruit)) / 1000;
  }
  marks.changed();
  stage.redraw();
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
