// Requests of all clouds: few at a time, the most urgent first, several units in one.

/** At the same time. */
const MOST_REQUESTS = 3;

export class Loader {
  constructor(onChange, onError) {
    Object.assign(this, { onChange, onError, running: 0, requests: 0 });
  }

  get isFull() {
    return this.running >= MOST_REQUESTS;
  }

  /**
   * Runs a request if there is room. Its units are "loading" until it ends; those of one that fails are "failed", and are not
   * requested again.
   */
  run(units, request) {
    if (this.isFull) return false;
    this.running++;
    this.requests++;
    for (const unit of units) unit.state = "loading";
    request()
      .then(
        () => units.forEach((unit) => unit.state === "loading" && (unit.state = "ready")),
        (error) => {
          for (const unit of units) unit.state = "failed";
          this.onError(error);
        },
      )
      .finally(() => {
        this.running--;
        this.onChange();
      });
    return true;
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
