/** Points of which some stretches are drawn. */
import { Geometry, type OGLRenderingContext } from "ogl";
import type { DrawingOrder, Run } from "./drawing_order";
import type { Moment } from "./moment";

export class Runs extends Geometry {
  drawn: readonly Run[] = [];

  constructor(gl: OGLRenderingContext, { fruits }: DrawingOrder, from: Moment, to: Moment) {
    const usage = gl.DYNAMIC_DRAW;
    const colours = { size: 4, type: gl.UNSIGNED_BYTE, normalized: true, usage };
    super(gl, {
      index: { data: fruits },
      placeFrom: { size: 3, data: from.positions, usage },
      placeTo: { size: 3, data: to.positions, usage },
      diameterFrom: { size: 1, data: from.diameters, usage },
      diameterTo: { size: 1, data: to.diameters, usage },
      colourFrom: { ...colours, data: from.colours },
      colourTo: { ...colours, data: to.colours },
    });
  }

  /** Says that a moment has changed: its arrays go to the graphics card when they are drawn next. */
  changed(moment: "From" | "To"): void {
    for (const name of ["place", "diameter", "colour"]) this.attributes[name + moment].needsUpdate = true;
  }

  draw(how: Parameters<Geometry["draw"]>[0]): void {
    for (const { start, count } of this.drawn) {
      this.setDrawRange(start, count);
      super.draw(how);
    }
  }
}
