/** Whether what is drawn moves, and how much of it is drawn then. */
import { Pace } from "./pace";

/** Milliseconds without a change after which the picture is at rest: longer than between two steps of a wheel or of a held key. */
const SETTLE_MS = 150;

export class Motion {
  private readonly pace: Pace;
  private settling = 0;
  private moves = false;

  constructor(
    mostHalvings: number,
    private readonly rested: () => void,
  ) {
    this.pace = new Pace(mostHalvings);
  }

  get isMoving(): boolean {
    return this.moves;
  }

  /** Halvings of what is drawn now: none at rest. */
  get halvings(): number {
    return this.moves ? this.pace.halvings : 0;
  }

  stir(): void {
    this.moves = true;
    clearTimeout(this.settling);
    this.settling = setTimeout(() => {
      this.moves = false;
      this.rested();
    }, SETTLE_MS);
  }

  /** Call in a frame that draws: how long it takes is known when the next one begins. */
  timeFrame(start: number): void {
    if (this.moves) requestAnimationFrame((next) => this.pace.took(next - start));
  }
}
