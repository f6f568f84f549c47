/** Mouse, touch and keys on a canvas, to turns, shifts and zooms of its camera. */
import type { Orbit, View } from "./orbit";

const TURN = 0.006;
const KEY_STEP = 0.08;
const STILL_PX = 5;

export interface Touched {
  readonly hover: (x: number, y: number) => void;
  readonly leave: () => void;
  readonly press: (x: number, y: number) => void;
}

export function steer(canvas: HTMLCanvasElement, orbit: Orbit, touched: Touched): void {
  const fingers = new Map<number, { x: number; y: number }>();
  let moved = 0;
  const at = (event: MouseEvent): [number, number] => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (fingers.size === 1) moved = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return touched.hover(...at(event));
    const [dx, dy] = [event.clientX - before.x, event.clientY - before.y];
    moved += Math.abs(dx) + Math.abs(dy);
    if (moved < STILL_PX) return;
    const height = canvas.clientHeight;
    if (fingers.size === 2) pinch(fingers, event, orbit, height);
    else if (event.shiftKey || event.buttons === 2 || event.buttons === 4) orbit.shift(-dx / height, dy / height);
    else orbit.turn(-dx * TURN, dy * TURN);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  const lift = (event: PointerEvent): void => {
    if (event.type === "pointerup" && fingers.size === 1 && moved < STILL_PX) touched.press(...at(event));
    fingers.delete(event.pointerId);
  };
  canvas.addEventListener("pointerup", lift);
  canvas.addEventListener("pointercancel", lift);
  canvas.addEventListener("pointerleave", () => touched.leave());
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      orbit.zoom(Math.exp(Math.max(-60, Math.min(60, event.deltaY)) * 0.004));
    },
    { passive: false },
  );
  canvas.addEventListener("keydown", (event) => {
    if (!event.ctrlKey && !event.metaKey && !event.altKey && keyed(event, orbit)) event.preventDefault();
  });
}

/** Two fingers: their distance zooms, their middle shifts. */
function pinch(fingers: Map<number, { x: number; y: number }>, event: PointerEvent, orbit: Orbit, height: number): void {
  const before = fingers.get(event.pointerId);
  const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
  if (!before || !other) return;
  const gap = (finger: { x: number; y: number }): number => Math.hypot(finger.x - other.x, finger.y - other.y);
  orbit.zoom(gap(before) / Math.max(1, gap({ x: event.clientX, y: event.clientY })));
  orbit.shift((before.x - event.clientX) / 2 / height, (event.clientY - before.y) / 2 / height);
}

function keyed(event: KeyboardEvent, orbit: Orbit): boolean {
  const views: Record<string, View> = { "1": "side", "2": "above", "3": "free" };
  const step = event.shiftKey ? 3 * KEY_STEP : KEY_STEP;
  const moves: Record<string, () => void> = {
    ArrowLeft: () => orbit.shift(-step, 0),
    ArrowRight: () => orbit.shift(step, 0),
    ArrowUp: () => orbit.shift(0, step),
    ArrowDown: () => orbit.shift(0, -step),
    a: () => orbit.turn(-step, 0),
    d: () => orbit.turn(step, 0),
    w: () => orbit.turn(0, step),
    s: () => orbit.turn(0, -step),
    "+": () => orbit.zoom(0.85),
    "=": () => orbit.zoom(0.85),
    "-": () => orbit.zoom(1 / 0.85),
  };
  const view = views[event.key];
  const move = view ? () => orbit.see(view) : moves[event.key];
  move?.();
  return move !== undefined;
}
