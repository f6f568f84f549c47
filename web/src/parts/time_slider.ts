/** The season as a slider: a mark for each visit, a part that is foretold, and a button that plays it. */
import { drawing, element } from "../elements";
import type { Page } from "../page";
import { DAY_MS, fullDay } from "../words";

const SEASON_SECONDS = 9;

export function timeSlider({ history, time }: Page): HTMLElement {
  const [start, end] = [history.times[0], history.end];
  const input = element("input", {
    type: "range",
    min: 0,
    max: Math.max(1, Math.round((end - start) / DAY_MS)),
    step: 1,
    "aria-label": "Date",
    input: () => time.set(start + Number(input.value) * DAY_MS),
  });
  const said = element("output", { class: "when" });
  const player = element("button", { type: "button", class: "play" });
  const last = history.times[history.times.length - 1];
  const share = (moment: number): number => (100 * (moment - start)) / (end - start || 1);
  const marks = history.times.map((moment) => drawing("line", { x1: share(moment), x2: share(moment), y1: 0, y2: 6 }));
  const later = drawing("rect", { x: share(last), width: 100 - share(last), y: 2, height: 2, class: "later" });
  const ticks = drawing("svg", { viewBox: "0 0 100 6", preserveAspectRatio: "none", "aria-hidden": "true" }, later, ...marks);
  let told = "";
  time.watch((now) => {
    const days = String(Math.round((now - start) / DAY_MS));
    if (input.value !== days) input.value = days;
    const what = now > last + DAY_MS / 2 ? "foretold" : `visit ${history.visitAt(now) + 1} of ${history.times.length}`;
    const day = fullDay(now);
    if (told === day + what) return; // a text is laid out anew even where it says the same
    told = day + what;
    said.replaceChildren(element("strong", {}, day), ` ${what}`);
    input.setAttribute("aria-valuetext", `${day}, ${what}`);
  });
  if (end === start) return element("div", { class: "time-slider" }, said);
  play(player, time, start, end);
  return element("div", { class: "time-slider" }, player, element("div", { class: "track" }, input, ticks), said);
}

function play(button: HTMLButtonElement, time: Page["time"], start: number, end: number): void {
  let since: number | null = null;
  const show = (): void => {
    button.textContent = since === null ? "▶" : "❚❚";
    button.setAttribute("aria-label", since === null ? "Play the season" : "Pause");
  };
  const frame = (now: number): void => {
    if (since === null) return;
    const moment = start + ((end - start) * (now - since)) / (1000 * SEASON_SECONDS);
    time.set(Math.min(end, moment));
    if (moment >= end) since = null;
    else requestAnimationFrame(frame);
    show();
  };
  button.addEventListener("click", () => {
    const from = time.value >= end ? start : time.value;
    since = since === null ? performance.now() - (1000 * SEASON_SECONDS * (from - start)) / (end - start) : null;
    show();
    requestAnimationFrame(frame);
  });
  show();
}

