// Datasets beside a page on any web server: decoded here.

export function openStatic(scene, messages) {
  const load = {
    potree2: async () => new (await import("pm/sources/potree2.js")).Potree2Source(scene, messages),
    potree1: async () => new (await import("pm/sources/potree1.js")).Potree1Source(scene),
    bintree: async () => new (await import("pm/sources/bintree.js")).BintreeSource(scene, messages),
    batches: async () => new (await import("pm/sources/batches.js")).BatchesSource(scene, messages),
  }[scene.kind];
  if (!load) throw new Error(`${scene.name}: a page without a program behind it cannot show ${scene.kind}: use \`pointmill view\``);
  return new Lazy(load);
}

/** A source whose module comes with the first request. */
class Lazy {
  mostUnits = 256;
  mostBatches = 24; // each comes whole

  constructor(load) {
    this.load = load;
  }

  async #source() {
    this.source ??= this.load();
    return this.source;
  }

  async scene() {
    return (await this.#source()).scene();
  }

  async chunk(name) {
    return (await this.#source()).chunk(name);
  }

  async boxes() {
    return (await this.#source()).boxes();
  }

  async points(units, wanted) {
    return (await this.#source()).points(units, wanted);
  }

  async batches(units, wanted) {
    return (await this.#source()).batches(units, wanted);
  }

  async point(unit, index) {
    return (await this.#source()).point(unit, index);
  }
}
