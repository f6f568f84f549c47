/** The trees' names under the row: buttons that choose a tree. */
import { element } from "../elements";
import type { Page } from "../page";
import type { Stage } from "../scene/stage";
import { extentOf } from "../scene/extent";

const APART_PX = 54;
const BELOW_M = 0.45;

export function treeLabels({ season, filter }: Page, stage: Stage): HTMLElement {
  const z = extentOf(season).low[2] - BELOW_M;
  const named = season.trees.map((tree, i) => ({ tree, i })).filter(({ tree }) => tree.name);
  const labels = named.map(({ tree, i }) => {
    const pick = (): void => filter.set({ ...filter.value, tree: filter.value.tree === i ? null : i });
    return { at: tree.middle, i, button: element("button", { type: "button", click: pick }, tree.label) };
  });
  filter.watch(({ tree }) => {
    for (const { button, i } of labels) button.setAttribute("aria-pressed", String(tree === i));
  });
  stage.onDrawn(() => {
    let free = -Infinity;
    for (const { at, button } of labels) {
      const place = stage.project(at[0], at[1], z);
      const isShown = place !== null && place.x - free >= APART_PX && isInside(place, stage.holder);
      button.hidden = !isShown;
      if (!isShown) continue;
      free = place.x;
      button.style.transform = `translate(-50%, 0) translate(${Math.round(place.x)}px, ${Math.round(place.y)}px)`;
    }
  });
  return element("div", { class: "tree-labels", role: "group", "aria-label": "Trees" }, ...labels.map((one) => one.button));
}

function isInside({ x, y }: { x: number; y: number }, holder: HTMLElement): boolean {
  return x > 10 && x < holder.clientWidth - 10 && y > 0 && y < holder.clientHeight - 24;
}
