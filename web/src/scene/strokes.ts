/** Straight lines in space, each end with its own colour: the ground, trunks, identities. */
import { Geometry, Mesh, Program, type OGLRenderingContext } from "ogl";

const VERTEX = `#version 300 es
in vec3 position;
in vec4 colour;
uniform mat4 modelViewMatrix, projectionMatrix;
out vec4 tint;
void main() {
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  tint = colour;
}`;

const FRAGMENT = `#version 300 es
precision mediump float;
in vec4 tint;
out vec4 shown;
void main() {
  shown = vec4(tint.rgb * tint.a, tint.a);
}`;

export type Point = readonly [number, number, number];

/** Red, green and blue from 0 to 255, opacity from 0 to 1. */
export type Ink = readonly [number, number, number, number];

export interface Stroke {
  readonly from: Point;
  readonly to: Point;
  readonly ink: Ink;
}

const DASHES = 21;

/** The same line in pieces, half of its length drawn. */
export function dashed({ from, to, ink }: Stroke): Stroke[] {
  const at = (share: number): Point => [0, 1, 2].map((axis) => from[axis] + share * (to[axis] - from[axis])) as unknown as Point;
  return Array.from({ length: DASHES }, (_, i) => ({ from: at(i / (DASHES - 0.5)), to: at((i + 0.5) / (DASHES - 0.5)), ink }));
}

export interface Strokes {
  readonly mesh: Mesh;
  readonly set: (strokes: readonly Stroke[]) => void;
}

export function strokes(gl: OGLRenderingContext): Strokes {
  const program = new Program(gl, { vertex: VERTEX, fragment: FRAGMENT, transparent: true, depthWrite: false });
  program.setBlendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  const mesh = new Mesh(gl, { mode: gl.LINES, geometry: drawn(gl, []), program, frustumCulled: false });
  const set = (all: readonly Stroke[]): void => {
    mesh.geometry.remove();
    mesh.geometry = drawn(gl, all);
    mesh.visible = all.length > 0;
  };
  return { mesh, set };
}

function drawn(gl: OGLRenderingContext, all: readonly Stroke[]): Geometry {
  const positions = new Float32Array(6 * Math.max(1, all.length));
  const colours = new Uint8Array(8 * Math.max(1, all.length));
  all.forEach(({ from, to, ink }, i) => {
    positions.set([...from, ...to], 6 * i);
    const bytes = [ink[0], ink[1], ink[2], 255 * ink[3]];
    colours.set([...bytes, ...bytes], 8 * i);
  });
  return new Geometry(gl, {
    position: { size: 3, data: positions },
    colour: { size: 4, data: colours, type: gl.UNSIGNED_BYTE, normalized: true },
  });
}
