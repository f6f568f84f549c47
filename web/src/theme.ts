/** Light or dark, as the machine is set until somebody turns it; and the colours that canvases take from the style sheet. */
import { Signal } from "./signal";
import type { Rgb } from "./colours";

export type Theme = "light" | "dark";

/** Rises whenever colours have changed. */
export const repaint = new Signal(0);

export function setTheme(theme: Theme): void {
  document.documentElement.dataset["theme"] = theme;
  repaint.set(repaint.value + 1);
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => repaint.set(repaint.value + 1));

/** A colour of the style sheet as text. */
export function ink(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** The same as numbers; the style sheet writes #rrggbb. */
export function inkRgb(name: string): Rgb {
  const value = Number.parseInt(ink(name).slice(1), 16);
  return [value >> 16, (value >> 8) & 255, value & 255];
}
