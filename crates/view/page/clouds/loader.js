// Requests of all clouds: few at a time, the most urgent first, several units in one.

/** At the same time. */
const MOST_REQUESTS = 3;
/** Milliseconds until a connection that is gone is tried again: the first and the longest pause. */
const PAUSES = [1000, 30_000];

/** Work of a cloud that waits for an answer; errors name its dataset. */
export async function pending(cloud, work) {
  cloud.pending++;
  try {
    await work();
  } catch (error) {
    throw Object.assign(new Error(`${cloud.scene.name}: ${error.message}`), { isTransient: error.isTransient });
  } finally {
    cloud.pending--;
  }
}

export class Loader {
  /** `onBack` gets the error that `onError` got, once there is an answer again. */
  constructor(onChange, onError, onBack) {
    Object.assign(this, { onChange, onError, onBack, running: 0, requests: 0, isPaused: false, pause: 0 });
  }

  get isFull() {
    return this.isPaused || this.running >= MOST_REQUESTS;
  }

  /**
   * Runs a request if there is room. Its units are "loading" until it ends. Of one that fails fewer are requested at once, until the
   * one is found that is "failed", and is not requested again; if there is no answer at all, they are requested again after a
   * pause.
   */
  run(units, request) {
    if (this.isFull) return false;
    this.running++;
    this.requests++;
    for (const unit of units) unit.state = "loading";
    request()
      .then(
        () => {
          units.forEach((unit) => unit.state === "loading" && (unit.state = "ready"));
          this.#back();
        },
        (error) => {
          const isFinal = !error.isTransient && units.length === 1;
          for (const unit of units) unit.state = isFinal ? "failed" : "new";
          if (error.isTransient) this.#wait(error);
          else if (isFinal) this.onError(error);
          else for (const unit of units) unit.most = Math.ceil(units.length / 2);
        },
      )
      .finally(() => {
        this.running--;
        this.onChange();
      });
    return true;
  }

  #wait(error) {
    if (this.isPaused) return;
    this.gone ??= error;
    this.onError(this.gone);
    this.pause = Math.min(Math.max(2 * this.pause, PAUSES[0]), PAUSES[1]);
    this.isPaused = true;
    setTimeout(() => {
      this.isPaused = false;
      this.onChange();
    }, this.pause);
  }

  #back() {
    this.pause = 0;
    if (!this.gone) return;
    this.onBack(this.gone);
    this.gone = undefined;
  }
}

/** The first units, as many as have `most` points together, and one at least. `most` of a unit: how many may be with it. */
export function together(units, most, mostUnits) {
  const taken = [];
  let points = 0;
  let room = mostUnits;
  for (const unit of units) {
    room = Math.min(room, unit.most ?? mostUnits);
    if (taken.length >= room || (taken.length > 0 && points + unit.size > most)) break;
    taken.push(unit);
    points += unit.size;
  }
  return taken;
}
