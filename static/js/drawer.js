// The drawer at the bottom: charts and tables of the chosen step, each in a tab.

import { fill, h } from "./dom.js";

/** Tabs are [{key, title, draw(body) -> void|Promise}]. A tab is drawn when looked at, and again when its data change. */
export class Drawer {
  constructor() {
    this.strip = h("div", { class: "tabs", role: "tablist" });
    this.body = h("div", { class: "body", role: "tabpanel" });
    this.node = h("section", { class: "drawer closed", "aria-label": "Charts and tables" }, this.strip, this.body);
    this.tabs = [];
    this.chosen = {};
    this.open = true;
    this.drawn = null;
  }

  /** Offer the tabs of a step; `stamp` changes when their data did. */
  offer(step, tabs, stamp) {
    const fresh = `${step} ${stamp} ${tabs.map((t) => t.key).join()}`;
    this.step = step;
    this.tabs = tabs;
    const same = fresh === this.drawn;
    this.drawn = fresh;
    if (!same) this.draw();
  }

  draw() {
    const key = this.chosen[this.step];
    const tab = this.tabs.find((t) => t.key === key) ?? this.tabs[0];
    const shown = Boolean(tab) && this.open;
    this.node.classList.toggle("hidden", !tab);
    this.node.classList.toggle("closed", !shown);
    fill(this.strip, this.tabs.map((t) => h("button", { type: "button", class: "tab", role: "tab", "aria-selected": String(t === tab && this.open), onclick: () => this.choose(t) }, t.title)),
      tab && h("button", { type: "button", class: "tab end", onclick: () => { this.open = !this.open; this.draw(); } }, this.open ? "Hide" : "Show"));
    if (!shown) return;
    const token = (this.token = {});
    const place = `${this.step} ${tab.key}`;
    // Another step's chart under this tab's name would be a lie, however short.
    if (place !== this.place) { fill(this.body, h("p", { class: "nothing" }, "Loading…")); this.body.scrollTop = 0; }
    this.place = place;
    Promise.resolve(tab.draw(this.body, () => this.token === token)).catch((error) => {
      if (this.token === token) fill(this.body, h("p", { class: "nothing" }, error.message || "This cannot be shown."));
    });
  }

  choose(tab) {
    this.chosen[this.step] = tab.key;
    this.open = true;
    this.draw();
  }
}
