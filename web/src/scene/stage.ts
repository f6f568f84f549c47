/** A canvas with spheres and lines under one camera; it draws when something has changed, and never else. */
import { Camera, Renderer, Transform, Vec3 } from "ogl";
import { onceAFrame } from "../signal";
import { eyeOf, FIELD_OF_VIEW_DEG, type Orbit } from "./orbit";
import { spheres, type Spheres } from "./spheres";
import { strokes, type Strokes } from "./strokes";

const LEAST_PX = 2.5;
const MOST_RATIO = 2;
/** Without a graphics card four samples a pixel take three times as long, and more fruits leave fewer pixels to each. */
const FEW = 2000;

export interface OnCanvas {
  readonly x: number;
  readonly y: number;
  readonly depth: number;
}

export class Stage {
  readonly canvas: HTMLCanvasElement;
  readonly fruits: Spheres;
  readonly marks: Spheres;
  readonly ground: Strokes;
  readonly lines: Strokes;
  readonly redraw: () => void;
  private readonly renderer: Renderer;
  private readonly camera: Camera;
  private readonly scene = new Transform();
  private readonly drawnWatchers: (() => void)[] = [];

  constructor(
    readonly holder: HTMLElement,
    private readonly orbit: Orbit,
    n: number,
  ) {
    const dpr = Math.min(devicePixelRatio, MOST_RATIO);
    this.renderer = new Renderer({ dpr, antialias: n <= FEW, alpha: false });
    const gl = this.renderer.gl;
    this.canvas = gl.canvas;
    holder.append(this.canvas);
    this.camera = new Camera(gl, { fov: FIELD_OF_VIEW_DEG });
    this.camera.up = new Vec3(0, 0, 1);
    this.fruits = spheres(gl, n);
    this.marks = spheres(gl, 1);
    this.marks.mesh.program.depthTest = false;
    this.ground = strokes(gl);
    this.lines = strokes(gl);
    for (const { mesh } of [this.ground, this.fruits, this.lines, this.marks]) mesh.setParent(this.scene);
    this.redraw = onceAFrame(() => this.draw());
    new ResizeObserver(() => this.resize()).observe(holder);
    orbit.looking.watch(() => this.redraw());
  }

  /** Calls after every frame, for what lies over the canvas. */
  onDrawn(watcher: () => void): void {
    this.drawnWatchers.push(watcher);
  }

  setBackground(rgb: readonly number[]): void {
    const [r, g, b] = rgb.map((value) => value / 255);
    this.renderer.gl.clearColor(r, g, b, 1);
    for (const each of [this.fruits, this.marks]) each.setBackground([r, g, b]);
    this.redraw();
  }

  /** Where a point of the row is on the canvas, in CSS pixels; null behind the camera. */
  project(x: number, y: number, z: number): OnCanvas | null {
    const m = this.camera.projectionViewMatrix;
    const w = m[3] * x + m[7] * y + m[11] * z + m[15];
    if (w <= 0) return null;
    const across = (m[0] * x + m[4] * y + m[8] * z + m[12]) / w;
    const upwards = (m[1] * x + m[5] * y + m[9] * z + m[13]) / w;
    return { x: ((1 + across) / 2) * this.width, y: ((1 - upwards) / 2) * this.height, depth: w };
  }

  /** Pixels that a metre takes at a depth. */
  pixelsPerMetre(depth: number): number {
    return this.height / (2 * Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360)) / depth;
  }

  private get width(): number {
    return this.holder.clientWidth;
  }

  private get height(): number {
    return this.holder.clientHeight;
  }

  private resize(): void {
    if (this.width === 0 || this.height === 0) return;
    this.renderer.setSize(this.width, this.height);
    this.orbit.setAspect(this.width / this.height);
    this.redraw();
  }

  private draw(): void {
    if (this.width === 0 || this.height === 0) return;
    const { looking } = this.orbit;
    const { distance, target } = looking.value;
    this.camera.perspective({ aspect: this.width / this.height, near: distance / 100, far: distance * 20 + 1000 });
    this.camera.position.set(...eyeOf(looking.value));
    this.camera.lookAt(new Vec3(...target));
    this.camera.updateMatrixWorld();
    const dpr = this.renderer.dpr;
    this.fruits.setPixels(this.pixelsPerMetre(1) * dpr, LEAST_PX * dpr);
    this.marks.setPixels(this.pixelsPerMetre(1) * dpr, 16 * dpr);
    this.renderer.render({ scene: this.scene, camera: this.camera, frustumCull: false, sort: false });
    for (const watcher of this.drawnWatchers) watcher();
  }
}
