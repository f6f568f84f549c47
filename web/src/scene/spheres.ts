/** Fruits as points that a shader lights as spheres: 50,000 of them draw in a few calls, without a triangle. */
import { Mesh, Program, type OGLRenderingContext } from "ogl";
import { Cells, type Sight } from "./cells";
import { drawingOrder } from "./drawing_order";
import { momentOf, type Moment } from "./moment";
import { Runs } from "./runs";

const VERTEX = `#version 300 es
in vec3 placeFrom, placeTo;
in float diameterFrom, diameterTo;
in vec4 colourFrom, colourTo;
uniform mat4 modelViewMatrix, projectionMatrix;
uniform float share, pixels, least;
flat out vec3 tint;
flat out float look, rim, mark;
void main() {
  gl_Position = projectionMatrix * modelViewMatrix * vec4(mix(placeFrom, placeTo, share), 1.0);
  float code = floor(255.0 * colourFrom.a + 0.5);
  mark = mod(code, 16.0);
  look = (code - mark) / 255.0;
  // A mark is no mark in two pixels.
  float smallest = mark > 0.5 ? 2.8 * least : least;
  gl_PointSize = max(pixels * mix(diameterFrom, diameterTo, share) / gl_Position.w, smallest);
  tint = mix(colourFrom.rgb, colourTo.rgb, share);
  rim = 1.0 - 3.0 / gl_PointSize;
  if (look < 0.1) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
}`;

// The shine is a power of 24 by products: without a graphics card pow() is most of the work of a pixel.
const FRAGMENT = `#version 300 es
precision mediump float;
flat in vec3 tint;
flat in float look, rim, mark;
uniform vec3 background;
out vec4 shown;
// Dot, cross, bar, and triangles that point up and down: y is down.
bool isMarked(vec2 at, float r2) {
  if (mark < 1.5) return r2 < 0.1;
  if (mark < 2.5) return min(abs(at.x - at.y), abs(at.x + at.y)) < 0.22 && r2 < 0.5;
  if (mark < 3.5) return abs(at.y) < 0.18 && abs(at.x) < 0.64;
  float up = mark < 4.5 ? -at.y : at.y;
  return up > -0.36 && abs(at.x) < 0.58 * (0.6 - up);
}
void main() {
  vec2 at = 2.0 * gl_PointCoord - 1.0;
  float r2 = dot(at, at);
  bool isInside = mark > 0.5 && isMarked(at, r2);
  if (r2 > 1.0 || (look > 0.5 && look < 0.8 && r2 < 0.4 && !isInside)) discard;
  vec3 normal = vec3(at.x, -at.y, sqrt(1.0 - r2));
  float light = 0.62 + 0.42 * dot(normal, vec3(-0.38, 0.56, 0.73));
  float mirrored = max(dot(normal, vec3(-0.25, 0.42, 0.87)), 0.0);
  float power2 = mirrored * mirrored, power4 = power2 * power2, power8 = power4 * power4;
  vec3 lit = isInside && look > 0.8 ? vec3(0.08) : look > 0.8 ? tint * light + 0.22 * power8 * power8 * power8 : tint;
  // The rim fades where it has two pixels for it: most fruits hang before nothing.
  float solid = rim > 0.3 && look > 0.8 ? 1.0 - smoothstep(rim, 1.0, sqrt(r2)) * 0.7 : 1.0;
  shown = vec4(look < 0.5 ? mix(background, tint, 0.28) : mix(background, lit, solid), 1.0);
}`;

export class Spheres {
  readonly mesh: Mesh;
  /** What is shown, or where it sets out. */
  readonly from: Moment;
  /** Where it goes to. */
  readonly to: Moment;
  private readonly uniforms = { share: { value: 0 }, pixels: { value: 1 }, least: { value: 2 }, background: { value: [1, 1, 1] } };
  private made: { readonly runs: Runs; readonly cells: Cells } | null = null;

  constructor(
    private readonly gl: OGLRenderingContext,
    readonly n: number,
  ) {
    [this.from, this.to] = [momentOf(n), momentOf(n)];
    const program = new Program(gl, { vertex: VERTEX, fragment: FRAGMENT, uniforms: this.uniforms });
    this.mesh = new Mesh(gl, { mode: gl.POINTS, program, frustumCulled: false });
    this.mesh.visible = false;
  }

  /** How far the fruits are from `from` to `to`: 0 to 1. */
  get share(): number {
    return this.uniforms.share.value;
  }

  set share(value: number) {
    this.uniforms.share.value = value;
  }

  /** Where a fruit is now: along x, y or z. */
  coordinate(fruit: number, axis: number): number {
    return this.between(this.from.positions, this.to.positions, 3 * fruit + axis);
  }

  diameter(fruit: number): number {
    return this.between(this.from.diameters, this.to.diameters, fruit);
  }

  private between(from: Float32Array, to: Float32Array, i: number): number {
    return from[i] + this.share * (to[i] - from[i]);
  }

  /** Shows `from`, which has changed. */
  rest(): void {
    const { runs, cells } = this.make();
    runs.changed("From");
    cells.enclose([this.from]);
    this.share = 0;
  }

  /** Goes from `from` to `to`, which both have changed. */
  setOut(): void {
    const { runs, cells } = this.make();
    runs.changed("From");
    runs.changed("To");
    cells.enclose([this.from, this.to]);
  }

  /** Takes the camera, the pixels of the picture in a CSS pixel, the least diameter in CSS pixels, and how often to halve what is small. */
  look(sight: Sight, ratio: number, leastPx: number, halvings: number): void {
    this.uniforms.pixels.value = sight.pixels * ratio;
    this.uniforms.least.value = leastPx * ratio;
    if (this.made) this.made.runs.drawn = this.made.cells.runs(sight, halvings);
  }

  setBackground(rgb: readonly number[]): void {
    this.uniforms.background.value = [...rgb];
  }

  /** The order follows from where fruits are when they are shown first; later they move by their growth alone. */
  private make(): { readonly runs: Runs; readonly cells: Cells } {
    if (this.made) return this.made;
    const order = drawingOrder(this.from.positions);
    this.made = { runs: new Runs(this.gl, order, this.from, this.to), cells: new Cells(order) };
    this.mesh.geometry = this.made.runs;
    this.mesh.visible = true;
    return this.made;
  }
}
