/** Places, sizes and colours of the fruits of the row: at the time of the slider, or on their way while it moves. */
import { schemeOf, type Scheme } from "../colours";
import { passesOf } from "../filter";
import { paintOnceAFrame } from "../frames";
import type { Page } from "../page";
import { LOOKS, MARKS, type Moment } from "../scene/moment";
import type { Stage } from "../scene/stage";
import { watchAll } from "../signal";
import type { Span } from "../told/history";

/** Milliseconds inside the ends of a span: there nothing jumps. */
const INSIDE_MS = 1;

/** Gives what paints them anew. While time moves the shader goes from one end of a span to the other, so nothing is told anew in between. */
export function rowPainter(page: Page, stage: Stage): () => void {
  const { time, history } = page;
  const { fruits } = stage;
  let travels = false;
  let span: Span | null = null;
  const paint = paintOnceAFrame(() => {
    if (travels) {
      const now = history.spanAt(time.value);
      if (now !== span) setOut(page, stage, now);
      fruits.share = (time.value - now.start) / (now.end - now.start);
      span = now;
    } else {
      fill(page, fruits.from, schemeOf(page), time.value);
      fruits.rest();
      span = null;
    }
    stage.redraw();
  });
  let shown = time.value;
  time.watch((now) => {
    if (now === shown) return;
    [shown, travels] = [now, true];
    stage.stir();
    paint();
  });
  stage.onRest(() => {
    if (travels) paint();
    travels = false;
  });
  const repaint = (): void => {
    span = null;
    paint();
  };
  watchAll([page.colour, page.filter, page.target], repaint);
  return repaint;
}

function setOut(page: Page, { fruits }: Stage, { start, end }: Span): void {
  const scheme = schemeOf(page);
  fill(page, fruits.from, scheme, start + INSIDE_MS);
  fill(page, fruits.to, scheme, end - INSIDE_MS);
  fruits.setOut();
}

function fill(page: Page, { positions, diameters, colours }: Moment, scheme: Scheme, time: number): void {
  const { history, season } = page;
  const passes = passesOf(page);
  const [place, size, colour, mark] = [history.placeAt(time), history.sizeAt(time), scheme.at(time), scheme.markAt(time)];
  const visit = history.visitAt(time);
  const isOfStates = page.colour.value === "state";
  for (let fruit = 0; fruit < season.n; fruit++) {
    const isKnown = history.first[fruit] <= visit;
    const isShown = history.isThere(fruit, time) || (isKnown && isOfStates);
    const look = !isShown ? "hidden" : !passes(fruit) ? "faded" : history.wasSeenThatDay(fruit, visit) ? "solid" : "ring";
    colours.set(colour(fruit), 4 * fruit);
    colours[4 * fruit + 3] = LOOKS[look] + MARKS[mark(fruit)];
    diameters[fruit] = size(fruit) / 1000;
    place(fruit, positions, 3 * fruit);
  }
}
