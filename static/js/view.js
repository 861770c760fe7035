// The 3D view: viser's client in a same-origin frame. Commands go to the server, which moves this browser's own view.

import { API, call } from "./api.js";
import { button, fill, h } from "./dom.js";
import { fixed } from "./format.js";

const CAMERAS = [["iso", "Iso"], ["surface", "Surface"], ["top", "Top"], ["front", "Front"], ["right", "Right"]];
const MORE = [["back", "Back"], ["left", "Left"], ["bottom", "Bottom"]];
// A colour the frame's own page can take: viser's canvas is transparent above it.
const BACKDROP = "linear-gradient(#f8f9fa, #e6eaed)";

/** The view of one project. `told(state)` is called after every command. */
export class View {
  constructor(project, told) {
    this.project = project;
    this.told = told;
    this.state = null;
    this.client = null;
    this.queue = Promise.resolve();
    this.waiting = {};
    this.frame = h("iframe", { title: "3D view", src: `view/${encodeURIComponent(project)}/` });
    this.legend = h("div", { class: "overlay legend hidden", "aria-hidden": "true" });
    this.hint = h("div", { class: "overlay hint hidden" });
    this.stage = h("div", { class: "stage" }, this.frame, this.legend, this.hint);
    this.layerList = h("div", { class: "list hidden" });
    this.tools = h("div", { class: "tools", role: "toolbar", "aria-label": "3D view" },
      [...CAMERAS, ...MORE].map(([name, text]) => button(text, () => this.send({ camera: name }), { class: "ghost tiny", title: `View ${text.toLowerCase()}` })),
      h("span", { class: "grow" }),
      this.extra = h("span", { class: "row tight" }),
      h("span", { class: "menu" }, button("Layers", () => this.layerList.classList.toggle("hidden"), { class: "ghost tiny", "aria-haspopup": "true" }), this.layerList));
    document.addEventListener("click", (e) => { if (!e.target.closest?.(".menu")) this.layerList.classList.add("hidden"); });
    this.timer = setInterval(() => this.meet(), 250);
  }

  /** Find out the number of this browser's view: viser shows it as the label of its hidden panel. */
  meet() {
    let label = "";
    try {
      const inside = this.frame.contentDocument;
      label = inside?.querySelector('[data-testid="floating-panel"]')?.textContent ?? "";
      this.dress(inside);
    } catch { return; }
    const found = /echobase-view-(\d+)/.exec(label);
    const client = found ? Number(found[1]) : null;
    if (client !== null && client !== this.client) {
      this.client = client;
      this.send(this.wanted ?? {});
    }
  }

  dress(inside) {
    // viser fades its canvas in while the light loads, and stays half faded if a second light comes meanwhile: colours would lie.
    if (inside?.head && !inside.getElementById("echobase-opaque")) {
      const style = inside.createElement("style");
      style.id = "echobase-opaque";
      style.textContent = "canvas { opacity: 1 !important; }";
      inside.head.append(style);
    }
    const canvas = inside?.querySelector("canvas");
    for (let node = canvas?.parentElement; node; node = node.parentElement) {
      if (node.style.background === BACKDROP) return;
      if (inside.defaultView.getComputedStyle(node).backgroundColor === "rgb(255, 255, 255)" && node !== inside.body) {
        node.style.background = BACKDROP;
        return;
      }
    }
  }

  /** Send a command. Commands of one kind that arrive while one is under way are merged: the last one counts. */
  send(command) {
    for (const key of ["step", "pick", "scan_by"]) if (command[key]) this.wanted = { ...this.wanted, [key]: command[key] };
    if (command.step) this.wanted = { step: command.step, pick: command.pick ?? "none" };
    if (this.client === null) return Promise.resolve(null);
    Object.assign(this.waiting, command);
    this.queue = this.queue.then(() => this.flush(), () => this.flush());
    return this.queue;
  }

  async flush() {
    if (!Object.keys(this.waiting).length) return this.state;
    const body = { ...this.waiting, client: this.client };
    this.waiting = {};
    return this.take(await call("POST", `/projects/${this.project}/view`, body));
  }

  /** Ask what the view shows. */
  async refresh() {
    if (this.client === null) return null;
    return this.take(await call("GET", `/projects/${this.project}/view?client=${this.client}`));
  }

  take(state) {
    this.state = state;
    this.drawLegend(state.legend);
    fill(this.layerList, Object.entries(state.titles).map(([name, text]) => h("label", {},
      h("input", { type: "checkbox", checked: state.layers[name], onchange: (e) => this.send({ layers: { [name]: e.target.checked } }) }), text)));
    this.told(state);
    return state;
  }

  drawLegend(legend) {
    this.legend.classList.toggle("hidden", !legend);
    if (!legend) return;
    const places = legend.high - legend.low < 5 ? 2 : 0;
    fill(this.legend, h("div", { class: "row", style: { justifyContent: "space-between" } }, h("span", { class: "small" }, legend.title), h("span", { class: "unit" }, legend.unit)),
      h("div", { class: "map" }, legend.colours.map((c) => h("i", { style: { background: c } }))),
      h("div", { class: "ends num" }, [legend.low, (legend.low + legend.high) / 2, legend.high].map((v) => h("span", {}, fixed(v, places)))),
      legend.unknown && h("div", { class: "row tight small soft" }, h("i", { class: "swatch", style: { background: legend.unknown } }), "not measured"));
  }

  /** A sentence over the view, or nothing. */
  say(text) {
    this.hint.classList.toggle("hidden", !text);
    fill(this.hint, text ?? "");
  }

  close() {
    clearInterval(this.timer);
    this.stage.remove();
  }
}

export const viewPath = (project) => `${API}/projects/${project}/view`;
