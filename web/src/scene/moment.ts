/** How fruits are at one moment: N places, diameters in metres and colours. */
export interface Moment {
  readonly positions: Float32Array;
  readonly diameters: Float32Array;
  /** Red, green, blue, and one of `LOOKS`. */
  readonly colours: Uint8Array;
}

/** In the fourth byte of a colour. */
export const LOOKS = { hidden: 0, faded: 85, ring: 170, solid: 255 } as const;

export function momentOf(n: number): Moment {
  return { positions: new Float32Array(3 * n), diameters: new Float32Array(n), colours: new Uint8Array(4 * n) };
}
