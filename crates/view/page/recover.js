// After the graphics card gave up: everything that was on it is made anew.

import { openCloud } from "pm/clouds/open.js";
import { Renderer } from "pm/gl/renderer.js";

const LOST = "The graphics card gave up the picture; it is drawn again as soon as the browser gives it back. If it does not, load the page again, with fewer points.";
/** What was chosen for a cloud. */
const CHOSEN = ["isShown", "hasClasses", "clod", "bits", "radius"];

/** `app.isLost` while nothing can be drawn. */
export function recoverWhenLost(app) {
  const { canvas, messages } = app;
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault(); // or it never comes back
    app.isLost = true;
    messages.fail(LOST);
  });
  canvas.addEventListener("webglcontextrestored", async () => {
    try {
      await rebuild(app);
      messages.remove(LOST);
    } catch (error) {
      messages.fail(error.message);
    }
  });
}

async function rebuild(app) {
  const { gl, renderer: { settings, heightBase } } = app;
  const clouds = await Promise.all(app.clouds.map(async (cloud) => {
    const made = await openCloud(gl, cloud.source);
    for (const name of CHOSEN) if (name in cloud) made[name] = cloud[name];
    return made;
  }));
  app.clouds = clouds;
  app.renderer = Object.assign(new Renderer(gl), { settings, heightBase });
  app.renderer.setTables();
  app.isLost = false;
  app.showPanel(app.isRangeChosen ? settings.range : undefined);
}
