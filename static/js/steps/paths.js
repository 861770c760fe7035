// Step 5: the alignment path and the inspection raster, walked pose by pose.

import { button, fill, h } from "../dom.js";
import { table } from "../drawer/tables.js";
import { AXES, deg, facts, fixed, isAngle, mm, num, pct, poseKey, whole } from "../format.js";
import { share } from "../journey.js";
import { issueList, verdict, working } from "../status.js";

export const watchesView = true;
export const watchesJobs = true;
const ROLES = { approach: "approaching", "lead in": "leading in", data: "taking data", "lead out": "leading out", retract: "retracting", link: "moving to the next pass" };

export function content(shell) {
  const { plan, part } = shell.project.data;
  if (!part) return verdict("none", "No part yet", "Load one in step Part.");
  if (shell.busy("plan")) return working(shell, "Planning", "plan");
  if (!plan) return verdict("none", "No paths yet", "Planning lays both paths, checks tilt, standoff, reach and collision, and writes the programs.");
  const errors = plan.issues.filter((i) => i.severity === "error").length;
  const local = (place(shell));
  const chosen = plan[local.path];
  return [
    plan.stale ? verdict("warn", "Out of date", `Changed since: ${plan.stale_because.join(", ")}. Plan again.`)
      : errors ? verdict("bad", `${errors} ${errors === 1 ? "problem" : "problems"} to solve`, "A program with a problem is not written.") : verdict("good", "Planned", "Both paths keep to the tolerances of the cell."),
    h("div", { class: "row tight", role: "group", "aria-label": "Path" }, [["alignment", "Alignment scan"], ["inspection", "Inspection raster"]].map(([key, text]) => button(text, () => show(shell, local, key), { class: local.path === key ? "on" : "", "aria-pressed": String(local.path === key) }))),
    chosen && facts([["Passes", whole(chosen.passes)], ["Poses", whole(chosen.poses)], ["Length, taking data", fixed(chosen.data_length_mm / 1000, 3), "m"], ["Surface swept", pct(share(chosen))], ...(chosen.coverage?.missed_mm2 !== undefined ? [["Not covered", whole(chosen.coverage.missed_mm2), "mm²"]] : []),
      ["Largest tilt", fixed(chosen.checks?.tilt_max_deg, 3), "deg"], ["Least clearance", fixed(chosen.checks?.clearance_min_mm, 1), "mm"], ["Poses in reach", pct(chosen.checks?.reachable_share)]]),
    walker(shell, local),
    issueList(plan.issues),
  ];
}

/** A number of the plan under a readable name with its unit. */
export function worded(key, value) {
  const units = { _mm_s: "mm/s", _mm2: "mm²", _db: "dB", _mm: "mm", _deg: "deg", _s: "s", _pct: "%" };
  const end = Object.keys(units).find((u) => key.endsWith(u)) ?? "";
  const text = key.slice(0, key.length - end.length).replaceAll("_", " ");
  return [text.charAt(0).toUpperCase() + text.slice(1), Number.isInteger(value) ? whole(value) : fixed(value, 3), units[end] ?? ""];
}

const place = (shell) => (shell.local.paths ??= { path: "inspection", at: 0.25 });

/** Show the path chosen last, and the probe where it was left. */
export function enter(shell) {
  const local = place(shell);
  if (shell.project.data.plan) show(shell, local, local.path);
}

export function drawer(shell) {
  const { plan } = shell.project.data;
  if (!plan) return { tabs: [], stamp: "" };
  return { stamp: `${plan.number}`, tabs: [{ key: "checks", title: "Checks", draw: (body) => fill(body, checks(plan)) }] };
}

function checks(plan) {
  const of = (kind) => Object.entries(plan[kind]?.checks ?? {}).filter(([, v]) => typeof v === "number");
  const keys = [...new Set([...of("alignment"), ...of("inspection")].map(([k]) => k))];
  const cell = (kind, key) => { const v = plan[kind]?.checks?.[key]; return typeof v === "number" ? worded(key, v)[1] : "–"; };
  const name = (key) => { const [text, , unit] = worded(key, 0); return [text, " ", h("span", { class: "unit" }, unit)]; };
  return table([{ title: "Check of the poses sent to the robot", text: true, cell: name }, { title: "Alignment scan", cell: (k) => cell("alignment", k) }, { title: "Inspection raster", cell: (k) => cell("inspection", k) }], keys);
}

function show(shell, local, path) {
  local.path = path;
  shell.view.send({ layers: { alignment: path === "alignment", inspection: path === "inspection" }, probe: { path, at: local.at } });
}

function walker(shell, local) {
  const probe = shell.view.state?.probe;
  const slide = h("input", { type: "range", min: 0, max: 1000, step: 1, value: Math.round(local.at * 1000), name: "walk", "aria-label": "Place of the probe on the path", oninput: (e) => { local.at = Number(e.target.value) / 1000; shell.view.send({ probe: { path: local.path, at: local.at } }); } });
  return h("div", { class: "stack" }, h("h3", {}, "Probe"), slide,
    probe && probe.path === local.path && [facts([["Pose", `${whole(probe.pose)} / ${whole(probe.poses)}`], ["Pass", `${whole(probe.pass)} / ${whole(probe.passes)}`], ["Doing", h("span", {}, ROLES[probe.role] ?? probe.role)], ["Standoff", mm(probe.standoff_mm), "mm"]]),
      h("dl", { class: "facts" }, AXES.map((a) => [h("dt", {}, `${a.toUpperCase()} in BASE`), h("dd", {}, num(isAngle(a) ? deg(probe[poseKey(a)]) : mm(probe[poseKey(a)]), isAngle(a) ? "deg" : "mm"))]))]);
}

export function footer(shell) {
  const { plan, part } = shell.project.data;
  const busy = shell.busy("plan");
  const run = () => shell.do(async () => { await shell.project.run("/plan"); if (shell.step === "paths" && shell.project.data.plan) show(shell, place(shell), place(shell).path); });
  if (!plan || plan.stale || busy) return button(busy ? "Planning…" : plan ? "Plan again" : "Plan both paths", run, { class: "primary", disabled: !part || busy, key: "plan" });
  return [button("Plan again", run, { class: "tiny", key: "again" }), button("Continue: programs", () => { location.hash = `#/p/${shell.project.id}/programs`; }, { class: "primary" })];
}
