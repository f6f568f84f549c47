/** A canvas with spheres and lines under one camera; it draws when something has changed, and never else. */
import { Camera, Renderer, Transform, Vec3 } from "ogl";
import { drawOnceAFrame } from "../frames";
import { N_LEVELS } from "./drawing_order";
import { Motion } from "./motion";
import { eyeOf, FIELD_OF_VIEW_DEG, type Orbit } from "./orbit";
import { Spheres } from "./spheres";
import { strokes, type Strokes } from "./strokes";

const LEAST_PX = 2.5;
const LEAST_MARK_PX = 16;
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
  private readonly motion = new Motion(N_LEVELS - 1, () => this.settle());
  private readonly drawnWatchers: (() => void)[] = [];
  private readonly restWatchers: (() => void)[] = [];
  private halvings = 0;
  private size = { width: 0, height: 0 };

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
    this.fruits = new Spheres(gl, n);
    this.marks = new Spheres(gl, 1);
    this.marks.mesh.program.depthTest = false;
    this.ground = strokes(gl);
    this.lines = strokes(gl);
    for (const { mesh } of [this.ground, this.fruits, this.lines, this.marks]) mesh.setParent(this.scene);
    this.redraw = drawOnceAFrame((start) => this.draw(start));
    new ResizeObserver(() => this.resize()).observe(holder);
    orbit.looking.watch(() => (orbit.isSteered ? this.stir() : this.redraw()));
  }

  /** Draws what moves, and all of it as soon as it rests. */
  stir(): void {
    this.motion.stir();
    this.redraw();
  }

  get isMoving(): boolean {
    return this.motion.isMoving;
  }

  /** Calls whenever nothing moves any more. */
  onRest(watcher: () => void): void {
    this.restWatchers.push(watcher);
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

  /** CSS pixels of the canvas, kept: asking the document for them between changes to it lays it out anew. */
  get width(): number {
    return this.size.width;
  }

  get height(): number {
    return this.size.height;
  }

  /** Pixels that a metre takes at a depth. */
  pixelsPerMetre(depth: number): number {
    return this.height / (2 * Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360)) / depth;
  }

  private resize(): void {
    this.size = { width: this.holder.clientWidth, height: this.holder.clientHeight };
    if (this.isHidden) return;
    this.renderer.setSize(this.width, this.height);
    this.orbit.setAspect(this.width / this.height);
    this.redraw();
  }

  private get isHidden(): boolean {
    return this.width === 0 || this.height === 0;
  }

  private settle(): void {
    for (const watcher of this.restWatchers) watcher();
    if (this.halvings > 0) this.redraw();
  }

  private draw(start: number): void {
    if (this.isHidden) return;
    this.motion.timeFrame(start);
    this.aim();
    const { renderer, camera } = this;
    this.halvings = this.motion.halvings;
    const sight = { matrix: camera.projectionViewMatrix, pixels: this.pixelsPerMetre(1) };
    this.fruits.look(sight, renderer.dpr, LEAST_PX, this.halvings);
    this.marks.look(sight, renderer.dpr, LEAST_MARK_PX, 0);
    renderer.render({ scene: this.scene, camera, frustumCull: false, sort: false });
    for (const watcher of this.drawnWatchers) watcher();
  }

  private aim(): void {
    const looking = this.orbit.looking.value;
    const { distance, target } = looking;
    this.camera.perspective({ aspect: this.width / this.height, near: distance / 100, far: distance * 20 + 1000 });
    this.camera.position.set(...eyeOf(looking));
    this.camera.lookAt(new Vec3(...target));
    this.camera.updateMatrixWorld();
  }
}
