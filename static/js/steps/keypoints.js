// Step 4: key points, by hand or by suggestion, with what they are worth before the robot moves.

import { post } from "../api.js";
import { button, h } from "../dom.js";
import { isOf, planned } from "../drawer/tables.js";
import { AXES, deg, isAngle, mm, num, pct } from "../format.js";
import { tag, toneOf, verdict, working } from "../status.js";

export const pick = "keypoints";
export const watchesView = true;
export const watchesJobs = true;
const ASKED = [0.1, 0.3];

export function content(shell) {
  const { part, keypoints, insight, setup } = shell.project.data;
  if (!part) return verdict("none", "No part yet", "Load one in step Part.");
  const n = keypoints?.length ?? 0;
  if (shell.busy("suggest") || shell.local.suggesting) return working(shell, "Choosing key points", "suggest");
  const view = shell.view.state;
  const picking = view?.pick === "keypoints";
  shell.view.say(picking ? (n ? null : "Click on the tinted surface to place key points. Shift-click deletes one.") : null);
  const fresh = insight && insight.version === view?.version ? insight : null;
  return [
    n === 0 ? verdict("none", "No key points yet", "Click where the alignment scan shall pass, or let EchoBase choose.") : judged(n, fresh),
    gauge(fresh?.coverage ?? null, setup),
    accuracy(fresh, n),
    h("div", { class: "row tight" },
      button(picking ? "Picking: on" : "Picking: off", () => shell.view.send({ pick: picking ? "none" : "keypoints" }), { class: picking ? "on" : "", "aria-pressed": String(picking), key: "picking" }),
      button("Undo", () => step(shell, "undo"), { disabled: !view?.undo, title: "Ctrl+Z" }), button("Redo", () => step(shell, "redo"), { disabled: !view?.redo, title: "Ctrl+Shift+Z" }),
      button("Clear", () => shell.do(() => shell.view.send({ clear: true })), { disabled: !n })),
    fresh?.issues?.some((i) => !keypoints.some((k) => isOf(i, k.id))) && h("div", { class: "stack" }, fresh.issues.filter((i) => !keypoints.some((k) => isOf(i, k.id))).map((i) => h("p", { class: "small soft" }, i.message))),
  ];
}

function judged(n, insight) {
  if (!insight) return [verdict("busy", `${n} key ${n === 1 ? "point" : "points"}`, "Computing coverage and accuracy. You can go on picking."), h("div", { class: "seeking", role: "progressbar", "aria-label": "Computing coverage and accuracy" })];
  const errors = insight.issues.filter((i) => i.severity === "error").length;
  const warnings = insight.issues.filter((i) => i.severity === "warning").length;
  if (errors) return verdict("bad", `${errors} to solve`, "Delete or move the marked points.");
  if (warnings) return verdict("warn", `${n} key points, ${warnings} doubtful`, "They may be rejected after the scan.");
  return verdict("good", `${n} key ${n === 1 ? "point" : "points"}, all usable`);
}

function gauge(coverage, setup) {
  const full = 0.5;
  const at = (share) => `${Math.min(share / full, 1) * 100}%`;
  return h("div", { class: "gauge" },
    h("div", { class: "row", style: { justifyContent: "space-between" } }, h("h3", {}, "Coverage"), num(coverage === null ? "–" : pct(coverage))),
    h("div", { class: "track", title: "Asked of a suggested scan: 10 to 30 %" }, h("div", { class: "asked", style: { left: at(ASKED[0]), width: `${((ASKED[1] - ASKED[0]) / full) * 100}%` } }),
      coverage !== null && h("div", { class: "fill", style: { width: at(coverage) } }), setup && h("div", { class: "have", style: { left: at(setup.alignment.coverage) }, title: "Asked for in the cell" })),
    h("div", { class: "scale num" }, ["0", "10", "20", "30", "40", "50 %"].map((t) => h("span", {}, t))));
}

function accuracy(insight, n) {
  if (!n) return null;
  const sigma = insight?.sigma ?? {};
  const error = insight?.normal_error_mm;
  return h("div", { class: "stack" }, h("h3", {}, "Accuracy to expect (one sigma)"),
    h("dl", { class: "facts" }, h("dt", {}, "Largest normal error"), h("dd", {}, num(mm(error ?? NaN), "mm")),
      Object.keys(sigma).length > 0 && AXES.map((a) => [h("dt", {}, a.toUpperCase(), " ", insight.status?.[a] && tag(toneOf(insight.status[a]), insight.status[a])), h("dd", {}, num(isAngle(a) ? deg(sigma[a]) : mm(sigma[a]), isAngle(a) ? "deg" : "mm"))])));
}

const step = (shell, which) => shell.do(() => shell.view.send({ [which]: true }));
export const undo = (shell, again) => step(shell, again ? "redo" : "undo");
export function leave(shell) { shell.view.say(null); }

export function footer(shell) {
  const { keypoints, part } = shell.project.data;
  const suggest = () => shell.do(async () => { shell.local.suggesting = true; shell.draw(); try { await post(`${shell.project.path}/keypoints/suggest`); } finally { shell.local.suggesting = false; } await shell.project.load(["keypoints"]); });
  const label = shell.local.suggesting ? "Choosing…" : "Suggest key points";
  if (!keypoints?.length) return button(label, suggest, { class: "primary", disabled: !part || shell.local.suggesting, key: "suggest" });
  return [button(label, suggest, { class: "tiny", disabled: shell.local.suggesting, key: "suggest" }), button("Continue: paths", () => { location.hash = `#/p/${shell.project.id}/paths`; }, { class: "primary" })];
}

export function drawer(shell) {
  const { keypoints, insight } = shell.project.data;
  if (!keypoints?.length) return { tabs: [], stamp: "" };
  return { stamp: JSON.stringify([keypoints, insight?.version]), tabs: [{ key: "points", title: "Key points", draw: (body) => planned(body, keypoints, insight, (id) => shell.view.send({ focus: id }), (id) => shell.do(() => shell.view.send({ delete: id }))) }] };
}
