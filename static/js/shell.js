// One window of one project: top bar, steps, view, inspector, drawer. Draws from the project and from nothing else.

import { ApiError, call } from "./api.js";
import { askText } from "./dialog.js";
import { fill, h, redraw } from "./dom.js";
import { Drawer } from "./drawer.js";
import { journey } from "./journey.js";
import { Project } from "./project.js";
import { issueList, sign } from "./status.js";
import { drawTop } from "./top.js";
import { View } from "./view.js";
import * as alignment from "./steps/alignment.js";
import * as cell from "./steps/cell.js";
import * as keypoints from "./steps/keypoints.js";
import * as part from "./steps/part.js";
import * as paths from "./steps/paths.js";
import * as programs from "./steps/programs.js";
import * as report from "./steps/report.js";
import * as scan from "./steps/scan.js";
import * as surface from "./steps/surface.js";

const INSPECTORS = { part, cell, surface, keypoints, paths, programs, scan, alignment, report };

export class Shell {
  constructor(root, id, step) {
    this.step = step;
    this.local = {};
    this.problems = {};
    this.top = h("header", { class: "top" });
    this.nav = h("nav", { class: "steps", "aria-label": "Steps" });
    this.head = h("header");
    this.content = h("div", { class: "content" });
    this.foot = h("footer");
    this.drawer = new Drawer();
    this.view = new View(id, () => this.afterView());
    this.lost = h("div", { class: "overlay lost hidden" }, h("p", {}, "The server is away. Everything acknowledged is safe; the page goes on by itself."));
    this.view.stage.append(this.lost);
    fill(root, h("div", { class: "shell" }, this.top, this.nav,
      h("main", { class: "centre" }, this.view.tools, this.view.stage, this.drawer.node),
      h("aside", { class: "inspector", "aria-label": "Inspector" }, this.head, this.content, this.foot)));
    this.project = new Project(id, (what) => this.changed(what));
    this.keys = (e) => this.key(e);
    document.addEventListener("keydown", this.keys);
    this.go(step);
  }

  close() {
    document.removeEventListener("keydown", this.keys);
    this.project.close();
    this.view.close();
  }

  /** Show a step. */
  go(step) {
    this.inspector?.leave?.(this);
    this.step = step;
    this.inspector = INSPECTORS[step] ?? part;
    this.view.say(null);
    this.view.send({ step, pick: this.inspector.pick ?? "none" }).catch(() => {});
    this.content.scrollTop = 0;
    this.inspector.enter?.(this);
    this.draw();
  }

  changed(what) {
    if (this.project.deleted) { location.hash = "#/"; return; }
    this.lost.classList.toggle("hidden", this.project.online);
    if (what === "link" && this.project.online && this.view.client !== null) this.view.client = null;
    if (what === "view") { this.view.refresh().catch(() => {}); return; }
    if (what === "jobs") { this.drawTopBar(); if (!this.inspector.watchesJobs) return; }
    if (what === "people") { this.drawTopBar(); return; }
    if (what === "data" && !this.entered) { this.entered = true; this.inspector.enter?.(this); }
    this.draw();
  }

  afterView() {
    const { insight } = this.view.state;
    if (insight && insight.version !== this.project?.data.insight?.version) {
      this.project.data.insight = insight;
      this.draw();
      return;
    }
    if (this.inspector?.watchesView) this.draw();
  }

  drawTopBar() {
    drawTop(this.top, this.project, async () => {
      const name = await askText("Rename project", "Name", this.project.data.project?.name ?? "", "Rename");
      if (name) await this.do(() => call("PATCH", this.project.path, { name }));
    });
  }

  /** Draw everything that depends on the data; focus and scroll stay where they are. */
  draw() {
    this.drawTopBar();
    const steps = journey(this.project.data);
    redraw(this.nav, () => steps.map((s, i) => h("button", { type: "button", class: "step", "aria-current": s.id === this.step ? "step" : null, data: { key: `step-${s.id}` }, title: `${i + 1}`, onclick: () => { location.hash = `#/p/${this.project.id}/${s.id}`; } },
      h("span", { class: `sign ${s.tone}`, "aria-hidden": "true" }, sign(s.tone)),
      h("span", { class: "name" }, s.name, h("span", { class: `state ${s.tone}` }, s.word)),
      h("span", { class: "fact" }, s.fact || "\u00a0"))));
    const now = steps.find((s) => s.id === this.step);
    fill(this.head, h("h2", {}, now.name), h("span", { class: `small ${now.tone === "todo" ? "faint" : ""}` }, now.word));
    const ready = this.project.data.setup !== undefined;
    redraw(this.content, () => (ready ? [this.inspector.content(this), this.problemList()] : [h("p", { class: "faint" }, "Loading…")]));
    redraw(this.foot, () => (ready ? (this.inspector.footer?.(this) ?? []) : []));
    const offer = ready ? (this.inspector.drawer?.(this) ?? { tabs: [], stamp: "" }) : { tabs: [], stamp: "" };
    this.drawer.offer(this.step, offer.tabs, offer.stamp);
    fill(this.view.extra, this.inspector.tools?.(this) ?? []);
  }

  problemList() {
    const told = this.project.data.state?.steps?.find((s) => s.name === this.step);
    const failed = told?.job?.state === "failed" ? told.job.issues : [];
    const mine = this.problems[this.step]?.length ? this.problems[this.step] : failed;
    const seen = this.project.data.viewIssues.filter((i) => Date.now() - i.at < 8000);
    if (seen.length) setTimeout(() => this.draw(), 8100);
    return issueList([...mine, ...seen]);
  }

  /** Do something that may be refused; what the server says is shown where it was asked. */
  async do(action) {
    const step = this.step;
    this.problems[step] = [];
    try {
      return await action();
    } catch (error) {
      if (!(error instanceof ApiError)) throw error;
      this.problems[step] = error.issues;
      return null;
    } finally {
      if (this.step === step) this.draw();
    }
  }

  /** True while a job of a kind runs. */
  busy(...kinds) {
    return [...this.project.data.jobs.values()].some((j) => kinds.includes(j.kind) && ["queued", "running"].includes(j.state));
  }

  key(event) {
    if (event.target.closest?.("input, textarea, select, dialog") || event.altKey) return;
    const meta = event.ctrlKey || event.metaKey;
    if (meta && event.key.toLowerCase() === "z") {
      event.preventDefault();
      this.inspector.undo?.(this, event.shiftKey);
    } else if (!meta && /^[1-9]$/.test(event.key)) {
      location.hash = `#/p/${this.project.id}/${Object.keys(INSPECTORS)[Number(event.key) - 1]}`;
    }
  }
}
