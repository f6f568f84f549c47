/** How fruits are at one moment: N places, diameters in metres and colours. */
export interface Moment {
  readonly positions: Float32Array;
  readonly diameters: Float32Array;
  /** Red, green, blue, and one of `LOOKS` plus one of `MARKS`. */
  readonly colours: Uint8Array;
}

/** In the fourth byte of a colour; multiples of 16. */
export const LOOKS = { hidden: 0, faded: 80, ring: 160, solid: 240 } as const;
/** What is drawn on a fruit, so that nothing is told by colour alone. */
export const MARKS = { none: 0, dot: 1, cross: 2, bar: 3, up: 4, down: 5 } as const;
export type Mark = keyof typeof MARKS;

export function momentOf(n: number): Moment {
  return { positions: new Float32Array(3 * n), diameters: new Float32Array(n), colours: new Uint8Array(4 * n) };
}
