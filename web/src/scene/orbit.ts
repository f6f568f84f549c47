/** A camera that looks at a point of the row from around it; z is up. */
import { Signal } from "../signal";

export type View = "side" | "above" | "free";

export interface Extent {
  readonly low: readonly [number, number, number];
  readonly high: readonly [number, number, number];
}

export interface Looking {
  readonly target: readonly [number, number, number];
  /** Radians: 0 looks along y, from the side; elevation is the height of the camera over the target. */
  readonly azimuth: number;
  readonly elevation: number;
  readonly distance: number;
}

export const FIELD_OF_VIEW_DEG = 28;
const STRAIGHT_DOWN = Math.PI / 2 - 1e-3;
const MARGIN = 1.04;
/** Times that the box is fitted: each puts its middle nearer to the middle of the picture. */
const CENTRINGS = 6;
const ANGLES: Record<View, readonly [number, number]> = {
  side: [0, 0.1],
  above: [0, STRAIGHT_DOWN],
  free: [-0.4, 0.22],
};

export class Orbit {
  readonly looking = new Signal<Looking>({ target: [0, 0, 0], azimuth: 0, elevation: 0, distance: 1 });

  /** From where it is looked at; whoever turns the camera looks aslant. */
  readonly view: Signal<View>;

  private whole: View | null = null;
  private aspect = 2;

  constructor(
    private readonly extent: Extent,
    view: View,
  ) {
    this.view = new Signal(view);
    this.see(view);
  }

  /** Whether somebody has moved the camera since it last showed the whole row. */
  get isSteered(): boolean {
    return this.whole === null;
  }

  /** The whole row stays in the picture until somebody moves the camera. */
  setAspect(aspect: number): void {
    this.aspect = aspect;
    if (this.whole !== null) this.see(this.whole);
  }

  /** Shows the whole row: from as near as its box fits into the picture. */
  see(view: View): void {
    const [azimuth, elevation] = ANGLES[view];
    let looking: Looking = { target: middleOf(this.extent), azimuth, elevation, distance: 0 };
    for (let i = 0; i < CENTRINGS; i++) looking = this.fitted(looking);
    this.whole = view;
    this.view.set(view);
    this.looking.set(looking);
  }

  /** As near as the corners of the box fit, with their middle in the middle of the picture: what is nearer looks larger. */
  private fitted({ target, azimuth, elevation }: Looking): Looking {
    const [sinA, cosA, sinE, cosE] = [Math.sin(azimuth), Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation)];
    const slope = Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360);
    const corners = cornersOf(this.extent).map(([x, y, z]) => {
      const [dx, dy, dz] = [x - target[0], y - target[1], z - target[2]];
      const [right, inwards] = [dx * cosA + dy * sinA, dy * cosA - dx * sinA];
      const [up, nearer] = [inwards * sinE + dz * cosE, dz * sinE - inwards * cosE];
      return { right, up, nearer };
    });
    const needed = corners.map(({ right, up, nearer }) => nearer + MARGIN * Math.max(Math.abs(right) / this.aspect, Math.abs(up)) / slope);
    const distance = Math.max(...needed);
    const across = middleOfSpan(corners.map(({ right, nearer }) => right / (distance - nearer)));
    const upwards = middleOfSpan(corners.map(({ up, nearer }) => up / (distance - nearer)));
    const looking = { target, azimuth, elevation, distance };
    return { ...looking, target: besides(looking, across * distance, upwards * distance) };
  }

  turn(byAzimuth: number, byElevation: number): void {
    const { azimuth, elevation, ...rest } = this.looking.value;
    this.whole = null;
    this.view.set("free");
    const raised = Math.min(STRAIGHT_DOWN, Math.max(-0.3, elevation + byElevation));
    this.looking.set({ ...rest, azimuth: azimuth + byAzimuth, elevation: raised });
  }

  /** Moves the target to the right and upwards in the picture, in shares of its height. */
  shift(right: number, up: number): void {
    const looking = this.looking.value;
    this.whole = null;
    const seen = 2 * looking.distance * Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360);
    this.looking.set({ ...looking, target: besides(looking, right * seen, up * seen) });
  }

  zoom(factor: number): void {
    this.whole = null;
    const now = this.looking.value;
    this.looking.set({ ...now, distance: Math.min(1e4, Math.max(0.2, now.distance * factor)) });
  }
}

/** Where the camera is. */
export function eyeOf({ target, azimuth, elevation, distance }: Looking): [number, number, number] {
  const flat = distance * Math.cos(elevation);
  return [
    target[0] + flat * Math.sin(azimuth),
    target[1] - flat * Math.cos(azimuth),
    target[2] + distance * Math.sin(elevation),
  ];
}

/** The point so many metres to the right of the target and above it in the picture. */
function besides({ target, azimuth, elevation }: Looking, right: number, up: number): [number, number, number] {
  const flat = up * Math.sin(elevation);
  return [
    target[0] + right * Math.cos(azimuth) - flat * Math.sin(azimuth),
    target[1] + right * Math.sin(azimuth) + flat * Math.cos(azimuth),
    target[2] + up * Math.cos(elevation),
  ];
}

const middleOfSpan = (values: readonly number[]): number => (Math.min(...values) + Math.max(...values)) / 2;

function cornersOf({ low, high }: Extent): [number, number, number][] {
  const ends = [low, high];
  return ends.flatMap(([x]) => ends.flatMap(([, y]) => ends.map(([, , z]) => [x, y, z] as [number, number, number])));
}

function middleOf({ low, high }: Extent): [number, number, number] {
  return [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2];
}
