// Step 8, beside each other: the same scans aligned as a rigid part, as one that sprang back, and by the paper's method.

import { post } from "../api.js";
import { button, h } from "../dom.js";
import { AXES, fixed, isAngle, mm, pct, poseKey } from "../format.js";
import { signed } from "../journey.js";
import { tag, toneOf } from "../status.js";

const KINDS = [["keypoints", "Key points", { method: "keypoints", non_rigid: false }], ["rigid", "Rigid", { method: "map", non_rigid: false }], ["shape", "Non-rigid", { method: "map", non_rigid: true }]];

/** Which kind of alignment one is. */
export const kindOf = (a) => (a.method === "keypoints" ? "keypoints" : a.options?.non_rigid ? "shape" : "rigid");

/** The newest alignment of each kind from the scans of the one in force, itself included. */
function rivals(a, all) {
  const scans = JSON.stringify(a.options?.scans);
  const found = {};
  for (const other of all) if (!other.stale && JSON.stringify(other.options?.scans) === scans) found[kindOf(other)] = other;
  found[kindOf(a)] = a;
  return found;
}

/** The table of what each kind makes of the inspection, and the buttons to run one and to take one. `run(options)` aligns. */
export function compare(shell, a, run) {
  const all = shell.project.data.alignments ?? [];
  if (a.stale) return null;
  const found = rivals(a, all);
  const shown = KINDS.filter(([kind]) => found[kind]);
  const missing = KINDS.filter(([kind]) => !found[kind]);
  const row = (name, of) => h("tr", {}, h("td", {}, name), shown.map(([kind]) => h("td", { class: "num" }, of(found[kind]))));
  const after = (key, show) => (r) => show(r.prediction?.after?.[key]);
  const take = (r) => (r.number === a.number ? h("span", { class: "soft small" }, "in force") : r.verdict === "fail" ? "" : button("Use", () => use(shell, r), { class: "tiny", key: `use-${r.number}`, title: `Put alignment ${r.number} in force`, "aria-label": `Use alignment ${r.number}` }));
  return h("div", { class: "stack" }, h("h3", {}, shown.length > 1 ? "Methods compared, each by its own account" : "Compare with another method"),
    shown.length > 1 && h("table", { class: "compare" }, h("thead", {}, h("tr", {}, [h("th", {}, ""), ...shown.map(([, text]) => h("th", {}, text))])), h("tbody", {},
      row("", (r) => tag(toneOf(r.verdict), r.verdict)),
      AXES.map((axis) => row(`${axis.toUpperCase()} (${isAngle(axis) ? "deg" : "mm"})`, (r) => signed(r.correction?.[poseKey(axis)], isAngle(axis) ? 4 : 3))),
      row("Distance, std (mm)", after("tof_std_mm", mm)), row("Distance, range (mm)", after("tof_range_mm", mm)),
      row("Largest tilt (deg)", after("tilt_max_deg", (v) => fixed(v, 3))), row("Within 2 dB", after("within_2db", (v) => pct(v))),
      row("Residual, rms (mm)", (r) => mm(r.residual?.rms_mm)), row("Field, largest (mm)", (r) => mm(r.non_rigid?.applied ? r.non_rigid.field_max_mm : null)),
      row("", take))),
    missing.length > 0 && h("div", { class: "row tight" }, missing.map(([kind, text, options]) => button(`Run ${text.toLowerCase()} too`, () => run(options), { class: "tiny", key: `beside-${kind}`, disabled: shell.busy("alignment") }))));
}

/** Put an earlier alignment in force; nothing is computed again. */
function use(shell, r) {
  return shell.do(async () => {
    await post(`${shell.project.path}/alignments/${r.number}/use`);
    await shell.project.load(["alignment", "assessment"]);
    await shell.view.refresh();
  });
}
