// Step 8: where the part is: the correction, how well it is known, and what it changes.

import { API, get, post } from "../api.js";
import { askAcceptance } from "../dialog.js";
import { button, h } from "../dom.js";
import { batch, candidates, inForce } from "../drawer/batch.js";
import { drawing } from "../drawer/figure.js";
import { histograms } from "../drawer/plots.js";
import { directions, matches, runs } from "../drawer/tables.js";
import { AXES, facts, fixed, isAngle, mm, ofAxis, pct, poseKey, whole } from "../format.js";
import { signed } from "../journey.js";
import { issueList, tag, toneOf, verdict, working } from "../status.js";
import { compare } from "./compare.js";
import { chosenOf, companions, surfaces } from "./together.js";

export const watchesView = true;
export const watchesJobs = true;
const SHAPED = new Set(["sprung-back", "not-rigid"]);
const WORDS = { pass: ["Pass", "The part is found; the corrected program may run after a dry run."], partial: ["Partial", "Usable only if you accept what is said below."], fail: ["Fail", "No corrected program is written."] };

export function content(shell) {
  const { alignment: a, scans, setup } = shell.project.data;
  const local = (shell.local.alignment ??= { method: "map", edges: "", non_rigid: false, layer: "after" });
  if (shell.busy("alignment")) return working(shell, "Aligning", "alignment");
  if (!a) return [verdict("none", "Not aligned yet", scans?.length ? "The alignment finds the part from the readings." : "Upload a scan, or rehearse one, first."), companions(shell, local), options(shell, local)];
  const { layers: on, legend } = shell.view.state ?? {};
  shell.view.say(a.verdict !== "fail" && !a.stale && on?.after && !legend ? "Drawing the deviation map…" : null);
  const [word, text] = WORDS[a.verdict] ?? [a.verdict, ""];
  return [
    a.stale ? verdict("warn", "Out of date", `Changed since: ${a.stale_because.join(", ")}.`) : a.accepted ? verdict("good", "Accepted", `By ${a.accepted.name}: ${a.accepted.reason}`) : verdict(toneOf(a.verdict), word, text),
    a.verdict !== "fail" && compare(shell, a, (chosen) => { Object.assign(local, chosen); run(shell, local); }),
    a.verdict !== "pass" && issueList(a.issues, 8),
    follow(shell, a, local),
    correction(a, setup, hidden(shell, a)),
    paper(a, hidden(shell, a)),
    a.verdict !== "fail" && !a.stale && layers(shell, local),
    before(a),
    surfaces(a),
    sprang(a.non_rigid),
    facts([["Residual, rms", mm(a.residual?.rms_mm), "mm"], ["Residual, 95 %", mm(a.residual?.p95_mm), "mm"], ["Readings used", whole(a.residual?.readings)], ["Method", h("span", {}, a.method === "map" ? "all readings (MAP)" : "key points (paper)")]]),
    a.verdict === "pass" && issueList(a.issues, 8),
    companions(shell, local),
    options(shell, local),
  ];
}

/** The offset that the scans of this alignment were rehearsed with, if all of them were, and with the same. */
function hidden(shell, a) {
  const scans = (a.options?.scans ?? []).map((n) => shell.project.data.scans?.find((s) => s.number === n));
  const offsets = scans.map((s) => (s?.origin === "simulated" ? s.detail?.options?.offset : null));
  return offsets.length && offsets[0] && offsets.every((o) => JSON.stringify(o) === JSON.stringify(offsets[0])) ? offsets[0] : null;
}

function correction(a, setup, truth) {
  const rows = AXES.map((axis) => {
    const key = poseKey(axis);
    const d = a.dof?.[axis] ?? {};
    const unit = isAngle(axis) ? "deg" : "mm";
    return h("tr", {}, h("td", {}, `${axis.toUpperCase()} `, h("span", { class: "unit" }, unit)),
      h("td", { class: "num" }, h("b", {}, signed(a.correction[key], isAngle(axis) ? 4 : 3))), h("td", { class: "num soft" }, `± ${ofAxis(axis, d.sigma)}`), h("td", { class: "l" }, d.status && tag(toneOf(d.status), d.status)),
      truth && h("td", { class: "num soft", title: "The hidden offset of the rehearsal" }, signed(truth[key], isAngle(axis) ? 4 : 3)));
  });
  const bases = AXES.map((axis) => h("tr", {}, h("td", {}, axis.toUpperCase()), h("td", { class: "num soft" }, ofAxis(axis, setup.base[poseKey(axis)])), h("td", { class: "num" }, ofAxis(axis, a.base[poseKey(axis)]))));
  return [
    h("div", {}, h("h3", {}, "Correction of BASE, one sigma"), h("table", { class: "correction" }, truth && h("thead", {}, h("tr", {}, ["", "found", "", "", "hidden"].map((t) => h("th", {}, t)))), h("tbody", {}, rows))),
    h("div", {}, h("h3", {}, `BASE_DATA[${a.base.number}]`), h("table", {}, h("thead", {}, h("tr", {}, ["", "nominal", "corrected"].map((t) => h("th", {}, t)))), h("tbody", {}, bases))),
  ];
}

/** The paper's key-point method on the same readings; with a rehearsal's truth, how far each is off. */
function paper(a, truth) {
  const b = a.baseline;
  if (a.method !== "map") return null;
  if (!b) return h("p", { class: "soft small" }, "The key-point method of the paper finds no answer in these readings.");
  const cells = (axis) => {
    const key = poseKey(axis);
    const places = isAngle(axis) ? 4 : 3;
    const rest = truth ? [b[key] - truth[key], a.correction[key] - truth[key]] : [b[key] - a.correction[key]];
    return [b[key], ...rest].map((v, i) => h("td", { class: `num ${i ? "" : "soft"}` }, signed(v, places)));
  };
  const titles = ["", "its answer", ...(truth ? ["its error", "ours"] : ["less ours"])];
  return h("div", {}, h("h3", {}, "Beside it: the paper's key-point method"), h("table", {}, h("thead", {}, h("tr", {}, titles.map((t) => h("th", {}, t)))), h("tbody", {}, AXES.map((axis) => h("tr", {}, h("td", {}, `${axis.toUpperCase()} `, h("span", { class: "unit" }, isAngle(axis) ? "deg" : "mm")), cells(axis))))));
}

/** Offer to follow the shape of a part that is not as its CAD. */
function follow(shell, a, local) {
  if (a.stale || a.options?.non_rigid || !a.issues?.some((i) => SHAPED.has(i.code))) return null;
  return h("div", { class: "row" }, button("Run as non-rigid, following its shape", () => { local.method = "map"; local.non_rigid = true; local.open = true; local.together?.clear(); run(shell, local); }, { key: "follow" }));
}

/** What was found of a part that sprang back. */
function sprang(n) {
  if (!n) return null;
  return h("div", { class: "stack" }, h("h3", {}, "Shape of the part"), h("p", { class: "small" }, n.applied ? "The poses follow the measured shape." : n.reason ?? "Rigid."),
    facts([["Field, rms", mm(n.field_rms_mm), "mm"], ["Field, largest", mm(n.field_max_mm), "mm"], ["Largest slope", fixed(n.slope_max_deg, 3), "deg"], ["Known over", pct(n.support_share)]]));
}

function layers(shell, local) {
  const set = (layer) => { local.layer = layer; shell.view.send({ layers: { before: layer === "before", cad: layer === "before", after: layer === "after", found: layer === "after" } }); };
  return h("div", { class: "stack" }, h("h3", {}, "Deviation map"), h("div", { class: "row tight", role: "group" }, [["before", "Before"], ["after", "After"]].map(([k, text]) => button(text, () => set(k), { class: local.layer === k ? "on" : "", "aria-pressed": String(local.layer === k) }))));
}

function before(a) {
  const { before: b, after: c } = a.prediction ?? {};
  if (!b || !c || b.tof_std_mm === undefined) return null;
  const row = (name, key, show) => h("tr", {}, h("td", {}, name), h("td", { class: "num soft" }, show(b[key])), h("td", { class: "num" }, show(c[key])));
  return h("div", {}, h("h3", {}, "Predicted for the inspection scan"), h("table", {}, h("thead", {}, h("tr", {}, ["", "before", "after"].map((t) => h("th", {}, t)))), h("tbody", {},
    row("Distance, std (mm)", "tof_std_mm", mm), row("Distance, range (mm)", "tof_range_mm", mm), row("Largest tilt (deg)", "tilt_max_deg", (v) => fixed(v, 3)), row("Within 2 dB", "within_2db", (v) => pct(v)))));
}

function options(shell, local) {
  const radio = (name, value, text) => h("label", { class: "row tight" }, h("input", { type: "radio", name, value, checked: local[name] === value, onchange: () => { local[name] = value; shell.draw(); } }), text);
  return h("details", { class: "group", open: local.open, ontoggle: (e) => { local.open = e.target.open; } }, h("summary", {}, h("span", {}, "Options"), h("span", { class: "glance" }, local.method === "map" ? "all readings" : "key points only")),
    h("div", { class: "fields stack" }, radio("method", "map", "All readings (MAP)"), radio("method", "keypoints", "Key points only (the paper's method)"),
      h("label", { class: "row tight" }, h("input", { type: "checkbox", name: "non_rigid", checked: local.non_rigid, onchange: (e) => { local.non_rigid = e.target.checked; } }), "The part may have sprung back: adapt the poses"),
      h("label", { class: "field wide" }, "Edges", h("select", { name: "edges", onchange: (e) => { local.edges = e.target.value; } }, [["", "wherever the scan crosses them"], ["true", "always"], ["false", "never"]].map(([v, text]) => h("option", { value: v, selected: v === local.edges }, text))))));
}

function run(shell, local) {
  return shell.do(async () => {
    const { method, non_rigid } = local;
    await shell.project.run("/alignments", { method, non_rigid: method === "map" && non_rigid, ...(local.edges ? { edges: local.edges === "true" } : {}), ...chosenOf(local) });
    local.layer = "after";
    if (shell.step === "alignment") await shell.view.send({ step: "alignment" });
  });
}

export function footer(shell) {
  const { alignment: a, scans } = shell.project.data;
  const local = shell.local.alignment ?? {};
  const busy = shell.busy("alignment");
  const again = button(busy ? "Aligning…" : a ? "Align again" : "Align", () => run(shell, local), { class: a && !a.stale && !busy ? "tiny" : "primary", disabled: !scans?.length || busy, key: "align" });
  if (!a || a.stale || busy) return again;
  if (a.verdict === "partial" && !a.accepted) return [again, button("Accept…", () => accept(shell, a), { class: "primary" })];
  return [again, button("Continue: report", () => { location.hash = `#/p/${shell.project.id}/report`; }, { class: "primary", disabled: a.verdict === "fail" })];
}

/** Take a partial result over. */
export async function accept(shell, a) {
  const answer = await askAcceptance(issueList(a.issues, 5));
  if (answer) await shell.do(async () => { await post(`${shell.project.path}/alignments/${a.number}/accept`, answer); await shell.project.load(["alignment"]); });
}

/** Which alignments are compared as serial parts: all, until somebody unticks one; new ones come ticked. */
function batchOf(shell, parts) {
  const local = (shell.local.batch ??= { known: new Set(), chosen: new Set() });
  for (const { number } of parts) if (!local.known.has(number)) { local.known.add(number); local.chosen.add(number); }
  return local;
}

/** Take back what the tab Batch put in force. */
export function undo(shell) {
  if (inForce(shell, shell.local.batch)) shell.do(() => shell.project.undoSetup());
}

export function drawer(shell) {
  const { alignment: a, alignments: all = [] } = shell.project.data;
  if (!a) return { tabs: [], stamp: "" };
  const parts = candidates(all);
  const serial = batchOf(shell, parts);
  const path = (n, name) => `${shell.project.path}/alignments/${n}/figures/${name}`;
  return { stamp: `${a.number} ${a.stale} ${all.length} ${inForce(shell, serial)}`, tabs: [
    { key: "histogram", title: "Before and after", draw: async (body, alive) => histograms(body, alive, await get(`${shell.project.path}/charts/deviation`)) },
    ...(a.prediction?.after ? [{ key: "inspection", title: "Predicted inspection", draw: (body, alive) => drawing(body, alive, path(a.number, "inspection")) }] : []),
    ...(a.non_rigid?.field_rms_mm != null ? [{ key: "shape", title: "Shape of the part", draw: (body, alive) => drawing(body, alive, path(a.number, "shape")) }] : []),
    { key: "points", title: "Key points", draw: (body) => matches(body, a.keypoints, (id) => shell.view.send({ focus: id })) },
    { key: "directions", title: "Directions", draw: (body) => directions(body, a.directions) },
    ...(all.length > 1 ? [{ key: "runs", title: "All alignments", draw: (body) => runs(body, all, (n) => `${API}${shell.project.path}/alignments/${n}/report`) }] : []),
    ...(parts.length > 1 || inForce(shell, serial) ? [{ key: "batch", title: "Batch", draw: (body, alive) => batch(body, alive, shell, parts, serial) }] : []),
  ] };
}
