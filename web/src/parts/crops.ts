/** Small pictures of a fruit: in a report of its best date, from the server of every date. */
import { element } from "../elements";
import type { Page } from "../page";
import type { Season } from "../told/season";

export function portrait({ season }: Page, fruit: number): HTMLElement | null {
  const source = season.crops?.best(fruit) ?? null;
  return source === null ? null : element("img", { src: source, alt: `Fruit ${season.ids[fruit]}`, width: 72, height: 72 });
}

export function sightPicture({ crops, visits }: Season, fruit: number, visit: number): HTMLElement | null {
  const source = crops?.of(fruit, visit) ?? null;
  if (source === null) return null;
  return element("img", { src: source, alt: `As ${visits[visit].name} saw it`, width: 32, height: 32, loading: "lazy" });
}
