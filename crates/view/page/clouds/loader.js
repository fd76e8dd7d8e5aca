// Requests of all clouds: few at a time, the most urgent first, several units in one.

/** At the same time. */
const MOST_REQUESTS = 3;
/** Seconds until the next attempt after the connection failed: doubled each time. */
const FIRST_PAUSE = 1;
const LONGEST_PAUSE = 30;

export class Loader {
  /** `onError(error)`, of a failed connection once; `onBack(error)` when it works again. */
  constructor(onChange, onError, onBack) {
    Object.assign(this, { onChange, onError, onBack, running: 0, requests: 0, pause: FIRST_PAUSE });
    // a browser that finds its network again need not wait
    globalThis.addEventListener?.("online", () => this.#resume());
  }

  get isFull() {
    return this.running >= MOST_REQUESTS || this.timer !== undefined;
  }

  /**
   * Runs `request(units)` if there is room. Its units are "loading" until it ends, then "ready". Those of which the connection
   * failed are "new" again; those that cannot be read are "failed" and are not requested again: if there are several units, it is
   * found out which.
   */
  run(units, request) {
    if (this.isFull) return false;
    this.running++;
    for (const unit of units) unit.state = "loading";
    this.#attempt(units, request).then((failures) => {
      if (failures.length > 1) failures[0].message += ` (and ${failures.length - 1} more)`;
      if (failures.length > 0) this.onError(failures[0]);
      this.running--;
      this.onChange();
    });
    return true;
  }

  /** Errors of units that cannot be read, after halves of the units were tried alone. */
  async #attempt(units, request) {
    this.requests++;
    try {
      await request(units);
      this.#works();
      for (const unit of units) if (unit.state === "loading") unit.state = "ready";
      return [];
    } catch (error) {
      if (error.isTransient) {
        for (const unit of units) unit.state = "new";
        this.#interrupted(error);
        return [];
      }
      if (units.length === 1) {
        units[0].state = "failed";
        return [error];
      }
    }
    const half = units.length >> 1;
    const first = await this.#attempt(units.slice(0, half), request);
    return first.concat(await this.#attempt(units.slice(half), request));
  }

  #interrupted(error) {
    if (this.timer !== undefined) return; // others that were under way
    if (!this.interrupted) this.onError(error);
    this.interrupted ??= error;
    this.timer = setTimeout(() => this.#resume(), 1000 * this.pause);
    this.pause = Math.min(2 * this.pause, LONGEST_PAUSE);
  }

  #resume() {
    clearTimeout(this.timer);
    this.timer = undefined;
    this.onChange();
  }

  #works() {
    if (!this.interrupted) return;
    this.onBack(this.interrupted);
    Object.assign(this, { interrupted: undefined, pause: FIRST_PAUSE });
    this.#resume();
  }
}

/** The first units, as many as have `most` points together, and one at least. */
export function together(units, most, mostUnits) {
  const taken = [];
  let points = 0;
  for (const unit of units) {
    if (taken.length >= mostUnits || (taken.length > 0 && points + unit.size > most)) break;
    taken.push(unit);
    points += unit.size;
  }
  return taken;
}
