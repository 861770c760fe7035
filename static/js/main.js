// Where to go: #/ is the list of projects, #/p/<id>/<step> one project.

import { fill, h } from "./dom.js";
import { Shell } from "./shell.js";
import { drawStart } from "./start.js";

const root = document.getElementById("app");
let shell = null;

function route() {
  const found = /^#\/p\/([A-Za-z0-9_-]+)(?:\/([a-z]+))?/.exec(location.hash);
  if (!found) {
    shell?.close();
    shell = null;
    drawStart(root);
    return;
  }
  const [, id, step = "part"] = found;
  if (shell?.project.id === id) { shell.go(step); return; }
  shell?.close();
  shell = new Shell(root, id, step);
}

window.addEventListener("hashchange", route);
window.addEventListener("unhandledrejection", (e) => {
  document.querySelector(".fault")?.remove();
  document.body.append(h("div", { class: "fault sr", role: "alert" }, `The page has a fault: ${e.reason?.message ?? e.reason}`));
});
fill(root);
route();
