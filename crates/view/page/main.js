// The page: finds out what to show, and shows it or says why it cannot.

import { App } from "pm/app.js";
import { Messages } from "pm/ui/messages.js";
import { ServerSource } from "pm/sources/server.js";

document.getElementById("start").remove(); // modules run: what it explains did not happen
const messages = new Messages(document.getElementById("messages"));
// without an exception of ours it is a remark of the browser
window.addEventListener("error", (event) => event.error && messages.fail(`The page failed: ${event.message}`));
window.addEventListener("unhandledrejection", (event) => messages.fail(`The page failed: ${event.reason?.message ?? event.reason}`));

async function sources(config) {
  if (config.mode === "server") return config.scenes.map((base) => new ServerSource(base));
  const { openStatic } = await import("pm/sources/static.js");
  return config.scenes.map((scene) => openStatic(scene, messages));
}

try {
  const config = JSON.parse(document.getElementById("config").textContent);
  const app = new App(messages, config);
  window.pointmill = app; // for tests, and for those who want to look
  await app.open(await sources(config));
} catch (error) {
  messages.fail(error.message);
}
