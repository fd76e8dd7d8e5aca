// The settings at the right.

import { VIEWS } from "pm/camera.js";
import { GRADIENTS, classColour, classTitle, css } from "pm/gl/palettes.js";
import { colouringBy } from "pm/gl/renderer.js";
import { button, check, choice, element, place, range, section, slider } from "pm/ui/elements.js";
import { savePicture } from "pm/ui/picture.js";

const millions = (n) => `${(n / 1e6).toFixed(1)} M`;

export class Panel {
  constructor(parent, app) {
    this.app = app;
    const wasOpen = [...parent.querySelectorAll("details")].map((each) => each.open);
    if (wasOpen.length === 0 && window.innerWidth < 600) parent.classList.add("closed");
    parent.replaceChildren(this.#title(parent), this.#view(), this.#points(), this.#colours(), this.#clip(), this.#tools(), this.#datasets());
    // made anew for another link: what was unfolded stays so
    [...parent.querySelectorAll("details")].forEach((each, i) => (each.open = wasOpen[i] ?? each.open));
  }

  #title(parent) {
    const title = button("pointmill", "Show or hide the settings", () => {
      parent.classList.toggle("closed");
      tell();
    });
    const tell = () => title.setAttribute("aria-expanded", String(!parent.classList.contains("closed")));
    tell();
    return element("h1", {}, title);
  }

  #view() {
    const { app } = this;
    const names = Object.keys(VIEWS).map((name) => button(name, `Look from there at everything`, () => app.look(name)));
    this.fly = button("fly", "Fly with W A S D, Q and E; the wheel changes the pace", () => app.setFlying(!app.controls.isFlying));
    this.fly.setAttribute("aria-pressed", String(app.controls.isFlying));
    const field = slider("Field of view", { min: 10, max: 120, step: 1, value: app.camera.fov, show: (v) => `${v}°` }, (v) => app.setFov(v));
    return section("View", true, element("div", { className: "row" }, ...names, this.fly), field);
  }

  #points() {
    const { app } = this;
    const { settings } = app.renderer;
    const change = (name) => (value) => app.change({ [name]: value });
    // a slider of powers: ten thousand to twenty millions
    const budget = slider("Points", { min: 4, max: 7.3, step: 0.05, value: Math.log10(app.budget), show: (v) => millions(10 ** v) }, (v) =>
      app.setBudget(Math.round(10 ** v)),
    );
    const parts = [
      budget,
      slider("Size", { min: 0.5, max: 10, step: 0.1, value: settings.size }, change("size")),
      check("Adaptive", settings.isAdaptive, change("isAdaptive")),
      choice("Shape", ["square", "circle", "paraboloid"], settings.shape, change("shape")),
      slider("Eye-dome", { min: 0, max: 2, step: 0.05, value: settings.edl }, change("edl")),
      check("Boxes", settings.boxes, change("boxes")),
    ];
    const first = (kind) => app.clouds.find((cloud) => cloud.scene.kind === kind);
    const [batches, bintree] = [first("batches"), first("bintree")];
    if (batches) {
      parts.push(
        slider("Detail (CLOD)", { min: 0, max: 10, step: 0.1, value: batches.clod, show: (v) => (v === 0 ? "all" : v) }, (v) => app.each("batches", { clod: v })),
        choice("Bits", [["0", "by size"], "10", "20", "30"], String(batches.bits), (v) => app.each("batches", { bits: Number(v) })),
      );
    }
    if (bintree) {
      parts.push(slider("Disc radius", { min: 0, max: 1, step: 0.01, value: bintree.radius, show: (v) => (v === 0 ? "off" : v) }, (v) => app.each("bintree", { radius: v })));
    }
    return section("Points", true, ...parts);
  }

  #colours() {
    const { app } = this;
    const { settings } = app.renderer;
    const names = new Set(app.clouds.flatMap((cloud) => cloud.scene.attributes.map((attribute) => attribute.name)));
    const options = [];
    if (app.clouds.some((cloud) => cloud.scene.colour)) options.push(["rgb", "colour"]);
    if (names.has("intensity")) options.push("intensity");
    if (names.has("classification")) options.push(["class", "classification"]);
    options.push("height", "level", ["one", "one colour"]);
    const known = ["rgb", "rgba", "intensity", "classification", "position", "x", "y", "z"];
    options.push(...[...names].filter((name) => !known.includes(name)).map((name) => [colouringBy(name), name]));
    this.colour = choice("Colour", options, settings.colour, (value) => app.setColour(value));
    this.range = range("Range", settings.range, (value) => app.chooseRange(value));
    this.gradient = element("div", { className: "gradient" });
    this.gradient.style.background = css(settings.gradient);
    const palette = choice("Gradient", GRADIENTS, settings.gradient, (value) => {
      this.gradient.style.background = css(value);
      app.change({ gradient: value });
    });
    this.classes = element("fieldset", {});
    this.ramp = element("div", {}, this.range, palette, this.gradient);
    return section("Colours", true, this.colour, this.ramp, this.classes);
  }

  /** Whether classes can be hidden while these colours are shown. */
  setFilter(isKnown) {
    this.classes.disabled = !isKnown;
    this.classes.classList.toggle("off", !isKnown);
    this.classes.title = isKnown ? "" : "Batches have either colours or classes: choose the colour classification to hide some";
  }

  /** The legend of the classes that were met. */
  setClasses(numbers) {
    const { app } = this;
    const { hidden } = app.renderer.settings;
    this.classes.replaceChildren(
      ...[...numbers].sort((a, b) => a - b).map((number) => {
        const swatch = element("span");
        swatch.style.background = `rgb(${classColour(number).join(",")})`;
        const box = check("", !hidden.has(number), (isShown) => app.showClass(number, isShown));
        box.className = "class";
        box.firstChild.replaceWith(swatch);
        box.append(element("span", { textContent: `${number} ${classTitle(number)}` }));
        return box;
      }),
    );
    this.classes.hidden = numbers.size === 0 || (numbers.size === 1 && numbers.has(0));
  }

  #clip() {
    const { app } = this;
    const { box, clipBox } = app;
    const parts = ["x", "y", "z"].flatMap((name, a) =>
      ["min", "max"].map((end) =>
        place(`${name} ${end}`, { min: box.min[a], max: box.max[a], value: (clipBox ?? box)[end][a] }, (value) => app.setClip(end, a, value)),
      ),
    );
    const isOn = app.renderer.settings.clip !== null;
    this.clip = check("Clip", isOn, (next) => app.setClipping(next));
    return section("Clip box", isOn, this.clip, ...parts);
  }

  #tools() {
    const { app } = this;
    this.measuring = button("measure", "Distances between points that are clicked", () => app.measure.toggle());
    this.measuring.setAttribute("aria-pressed", String(app.measure.isOn));
    const clear = button("clear", "Forget the measured points", () => app.measure.clear());
    const picture = button("picture", "Save the picture as PNG", () => savePicture(app));
    const link = button("link", "Copy a link to this view", () => app.address.copy());
    return section("Tools", true, element("div", { className: "row" }, this.measuring, clear, picture, link));
  }

  #datasets() {
    const { app } = this;
    const rows = app.clouds.map((cloud) => {
      const { scene } = cloud;
      const box = check("", cloud.isShown, (isShown) => app.show(cloud, isShown));
      box.firstChild.remove();
      const points = scene.points === null ? "" : ` · ${scene.points.toLocaleString("en")} points`;
      const text = `${scene.name} · ${scene.format}${points}`;
      box.append(element("span", { textContent: text }), button("fit", "Look at this dataset alone", () => app.fit(cloud.box)));
      return box;
    });
    return section("Datasets", app.clouds.length > 1, ...rows, element("p", { className: "dim", textContent: app.systems() }));
  }
}
