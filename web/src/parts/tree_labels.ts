/** The trees' names under the row: buttons that choose a tree. */
import { element } from "../elements";
import type { Page } from "../page";
import type { OnCanvas, Stage } from "../scene/stage";

const BELOW_M = 0.45;
/** CSS pixels of a label: its edges and each letter, at most as in the style sheet; its height; and between two of them. */
const EDGES_PX = 18;
const LETTER_PX = 7.5;
const MOST_PX = 160;
const HEIGHT_PX = 24;
const GAP_PX = 4;

/** Below the lowest fruits. */
export function treeLabels({ season, filter }: Page, stage: Stage, lowest: number): HTMLElement {
  const z = lowest - BELOW_M;
  const named = season.trees.map((tree, i) => ({ tree, i })).filter(({ tree }) => tree.name);
  const labels = named.map(({ tree, i }) => {
    const pick = (): void => filter.set({ ...filter.value, tree: filter.value.tree === i ? null : i });
    const widthPx = Math.min(MOST_PX, EDGES_PX + LETTER_PX * tree.label.length);
    return { at: tree.middle, i, widthPx, button: element("button", { type: "button", hidden: true, click: pick }, tree.label) };
  });
  filter.watch(({ tree }) => {
    for (const { button, i } of labels) button.setAttribute("aria-pressed", String(tree === i));
  });
  stage.onDrawn(() => {
    const shown: Place[] = [];
    for (const { at, widthPx, button } of labels) {
      const place = placed(stage, stage.project(at[0], at[1], z), widthPx);
      const isShown = place !== null && shown.every((other) => areApart(place, other));
      if (button.hidden === isShown) button.hidden = !isShown;
      if (!isShown) continue;
      shown.push(place);
      button.style.transform = `translate(-50%, 0) translate(${Math.round(place.x)}px, ${Math.round(place.y)}px)`;
    }
  });
  return element("div", { class: "tree-labels", role: "group", "aria-label": "Trees" }, ...labels.map((one) => one.button));
}

/** Where the middle of a label's upper edge is. */
interface Place {
  readonly x: number;
  readonly y: number;
  readonly widthPx: number;
}

/** Below its tree, as far as it would reach out of the picture pushed into it; null where the tree is not in the picture. */
function placed({ width, height }: Stage, at: OnCanvas | null, widthPx: number): Place | null {
  if (at === null || at.x < 0 || at.x > width || at.y < 0 || at.y > height) return null;
  return { x: Math.max(widthPx / 2, Math.min(width - widthPx / 2, at.x)), y: Math.min(height - HEIGHT_PX, at.y), widthPx };
}

function areApart(one: Place, other: Place): boolean {
  return Math.abs(one.x - other.x) >= (one.widthPx + other.widthPx) / 2 + GAP_PX || Math.abs(one.y - other.y) >= HEIGHT_PX + GAP_PX;
}
