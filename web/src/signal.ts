/** A value that parts of the page share: who watches is told when it changes, and once at the beginning. */
export class Signal<T> {
  private readonly watchers: ((value: T) => void)[] = [];

  constructor(private held: T) {}

  get value(): T {
    return this.held;
  }

  set(value: T): void {
    if (value === this.held) return;
    this.held = value;
    for (const watcher of this.watchers) watcher(value);
  }

  watch(watcher: (value: T) => void): void {
    this.watchers.push(watcher);
    watcher(this.held);
  }
}

/** Calls at the beginning, and whenever one of several values changes. */
export function watchAll(signals: readonly { watch(watcher: () => void): void }[], watcher: () => void): void {
  for (const signal of signals) signal.watch(watcher);
}
