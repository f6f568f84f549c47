/** What all parts of the page share. */
import type { ColourBy } from "./colours";
import { ANY, type Filter } from "./filter";
import { Signal } from "./signal";
import { historyOf, type History } from "./told/history";
import type { Season } from "./told/season";

export interface Page {
  readonly season: Season;
  readonly history: History;
  /** Row of the fruit that was chosen. */
  readonly selected: Signal<number | null>;
  readonly time: Signal<number>;
  readonly colour: Signal<ColourBy>;
  readonly filter: Signal<Filter>;
  /** Fruits that a tree shall keep. */
  readonly target: Signal<number | null>;
}

export function pageOf(season: Season): Page {
  const history = historyOf(season);
  return {
    season,
    history,
    selected: new Signal<number | null>(null),
    time: new Signal(history.times[history.times.length - 1]),
    colour: new Signal<ColourBy>(season.growth ? "growth" : season.classes.length > 0 ? "size" : "state"),
    filter: new Signal(ANY),
    target: new Signal(season.thinning?.target ?? null),
  };
}
