// What is known of the point under the cursor.

import { element } from "pm/ui/elements.js";
import { classTitle } from "pm/gl/palettes.js";

export class PointBox {
  constructor(parent) {
    this.parent = parent;
  }

  hide() {
    this.parent.hidden = true;
  }

  show(scene, point) {
    // 15 digits are what doubles hold of any decimal number
    const place = point.position.map((v) => String(Number(v.toPrecision(15))));
    const rows = [["dataset", scene.name], ...["x", "y", "z"].map((axis, a) => [axis, place[a]])];
    for (const { name, values, text } of point.attributes) {
      const shown = text ?? values.join(", ");
      rows.push([name, name === "classification" ? `${shown} ${classTitle(values[0])}` : shown]);
    }
    const table = element("table", {}, ...rows.map(([name, value]) => element("tr", {}, element("td", { textContent: name }), element("td", { textContent: value }))));
    this.parent.replaceChildren(table);
    this.parent.hidden = false;
  }
}
