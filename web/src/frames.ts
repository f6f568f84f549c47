/** Work that is done once in the next frame, however often it is asked for until then: first what paints, then what draws it. */
/** Takes when the frame began, as `requestAnimationFrame` tells it. */
type Work = (start: number) => void;

const paints = new Set<Work>();
const draws = new Set<Work>();
let waits = false;

export const paintOnceAFrame = (work: Work): (() => void) => () => ask(paints, work);
/** Draws after all that paints in the same frame, also when a painter asks for it. */
export const drawOnceAFrame = (work: Work): (() => void) => () => ask(draws, work);

function ask(works: Set<Work>, work: Work): void {
  works.add(work);
  if (waits) return;
  waits = true;
  requestAnimationFrame((start) => {
    doAll(paints, start);
    waits = false; // what the drawing asks for belongs to the next frame
    doAll(draws, start);
  });
}

function doAll(works: Set<Work>, start: number): void {
  const asked = [...works];
  works.clear();
  for (const work of asked) work(start);
}
