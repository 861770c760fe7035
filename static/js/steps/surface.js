// Step 3: the inspection surface: clicks flooded to the creases, a box, paint; keep-out regions; what the passes run along.

import { put } from "../api.js";
import { button, h } from "../dom.js";
import { facts, fixed, whole } from "../format.js";
import { verdict } from "../status.js";
import { boxGroup, directionGroup, keepOutGroup, paintGroup } from "./regions.js";

export const pick = "none";
export const watchesView = true;

const SAYS = {
  surface: "Click on the face to inspect. Shift-click adds a place.",
  paint: "Click to paint what is to be inspected",
  erase: "Click to erase paint",
  keepout: "Click where no data shall be taken",
  guide: "Click the line that the passes follow, from one side to the other",
};
// What of the settings this step edits, and can bring back.
const OWN = ["box", "paint", "keep_outs", "guide", "direction", "direction_deg"];

export function content(shell) {
  const { part, surface, plan, setup } = shell.project.data;
  if (!part || !setup) return verdict("none", "No part yet", "Load one in step Part.");
  const local = (shell.local.surface ??= { brush: Math.max(Math.round(Math.max(...part.extents_mm) / 20), 1), region: 8, cross: true, open: new Set(), undo: [], seen: null });
  note(local, setup.inspection);
  const tool = shell.view.state?.pick ?? "none";
  shell.view.say(SAYS[tool] ?? null);
  const chosen = surface?.seeds?.length;
  const painted = setup.inspection.paint?.length;
  const how = chosen ? (chosen > 1 ? `by ${chosen} clicks` : "by a click") : painted ? "by paint" : "the largest face";
  const fresh = plan && !plan.stale;
  const kept = fresh ? plan.inspection?.coverage?.kept_out_mm2 : 0;
  return [
    h("p", { class: "soft" }, "The tinted face is inspected. It spreads from the places you click up to the next crease (30°)."),
    facts([
      ["Chosen", h("span", {}, how)],
      fresh && ["Area", whole(plan.surface.area_mm2 / 100), "cm²"], kept > 0 && ["Kept out", fixed(kept / 100, 1), "cm²"], fresh && ["Triangles", whole(plan.surface.triangles)],
      ...(surface?.seeds ?? []).map((s, i) => [`Seed ${i + 1}`, `${fixed(s.x_mm, 2)}  ${fixed(s.y_mm, 2)}  ${fixed(s.z_mm, 2)}`, "mm"]),
    ]),
    h("div", { class: "row" },
      toolButton(shell, "surface", "Choose on the part", "Stop choosing"),
      button("Take the largest face", () => shell.do(() => put(`${shell.project.path}/surface`, { seeds: [] })), { disabled: !chosen })),
    boxGroup(shell, local), paintGroup(shell, local), keepOutGroup(shell, local), directionGroup(shell, local),
  ];
}

/** A button that switches a click tool of the view on and off. */
export function toolButton(shell, tool, off, on, more = {}) {
  const active = shell.view.state?.pick === tool;
  return button(active ? on : off, () => shell.view.send({ pick: active ? "none" : tool, ...more }), { class: active ? "on" : "", "aria-pressed": String(active), key: `tool-${tool}` });
}

/** Save a change of the inspection settings. */
export function edit(shell, change) {
  const { setup } = shell.project.data;
  return shell.do(async () => {
    try {
      await shell.project.saveSetup({ ...setup, inspection: { ...setup.inspection, ...change } });
    } catch (error) {
      if (error.status === 412) await shell.project.load(["setup"]);
      throw error;
    }
  });
}

/** Remember what was in force before every change, whoever made it: clicks in the view are made by the server. */
function note(local, inspection) {
  const now = JSON.stringify(Object.fromEntries(OWN.map((k) => [k, inspection[k]])));
  if (local.seen === now) return;
  if (local.seen !== null && local.back !== now) local.undo.push(local.seen);
  local.back = null;
  local.seen = now;
}

export function undo(shell) {
  const local = shell.local.surface;
  const before = local?.undo.pop();
  if (!before) return;
  local.back = before;
  edit(shell, JSON.parse(before));
}

export function leave(shell) { shell.view.say(null); }

export function footer(shell) {
  return [
    h("div", { class: "row" }, button("Undo", () => undo(shell), { class: "tiny", disabled: !shell.local.surface?.undo.length, title: "Ctrl+Z" })),
    button("Continue: key points", () => { location.hash = `#/p/${shell.project.id}/keypoints`; }, { class: "primary", disabled: !shell.project.data.part }),
  ];
}
