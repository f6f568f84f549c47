/**
 * How much is drawn while something moves. What keeps up is always drawn in full; who is too slow, as without a graphics
 * card, sees fewer of the small fruits until it does, and all of them as soon as nothing moves.
 */

/** Milliseconds a frame on average. Longer ones are not fluid; a display of 30 pictures a second is still in time. */
const SLOW_MS = 36;
/** What the average begins with: a display of 60 pictures a second. */
const USUAL_MS = 1000 / 60;
/** Share of the newest frame in the average, and the most that it counts: one late frame may be anything, two are slow. */
const NEWEST = 0.2;
const MOST_MS = 100;
/** Frames in time after which more is tried; twice as many each time that it was too much. */
const PATIENCE_FRAMES = 60;
const MOST_PATIENCE_FRAMES = 960;

export class Pace {
  /** Halvings of what is drawn: 0 is all. */
  halvings = 0;
  private meanMs = USUAL_MS;
  private inTime = 0;
  private patience = PATIENCE_FRAMES;

  constructor(private readonly most: number) {}

  /** Tells how long a frame took that was drawn while something moved. */
  took(ms: number): void {
    this.meanMs += NEWEST * (Math.min(ms, MOST_MS) - this.meanMs);
    if (this.meanMs > SLOW_MS) this.drawLess();
    else if (this.halvings > 0 && ++this.inTime >= this.patience) this.drawMore();
  }

  private drawLess(): void {
    if (this.halvings < this.most) this.halvings++;
    this.begin();
  }

  private drawMore(): void {
    this.halvings--;
    this.patience = Math.min(MOST_PATIENCE_FRAMES, 2 * this.patience);
    this.begin();
  }

  private begin(): void {
    this.meanMs = USUAL_MS;
    this.inTime = 0;
  }
}
