// Other projects of the same part, each with a surface and scans of its own, that are aligned together with this one.

import { get } from "../api.js";
import { h } from "../dom.js";
import { mm, pct, whole } from "../format.js";

// Other projects change without this one hearing of it.
const AGAIN_MS = 10_000;

/** Tick the projects whose scans count too; nothing where no other project has this part. */
export function companions(shell, local) {
  const sha = shell.project.data.part?.sha256;
  if (!sha) return null;
  if (local.companionsOf !== sha || Date.now() - local.companionsAt > AGAIN_MS) {
    Object.assign(local, { companionsOf: sha, companionsAt: Date.now() });
    get(`${shell.project.path}/together`).then((all) => { local.companions = all; shell.draw(); }, () => { local.companionsOf = null; });
  }
  const found = local.companions ?? [];
  if (!found.length) return null;
  const chosen = (local.together ??= new Set());
  const tick = (c, on) => { chosen[on ? "add" : "delete"](c.project); shell.draw(); };
  return h("section", { class: "stack" }, h("h3", {}, "Together with"),
    h("p", { class: "soft small" }, "Scans of other surfaces of this part: all of them determine one correction, for every inspection program."),
    found.map((c) => h("label", { class: "row tight", title: c.missing }, h("input", { type: "checkbox", name: `together-${c.project}`, disabled: Boolean(c.missing), checked: chosen.has(c.project) && !c.missing, onchange: (e) => tick(c, e.target.checked) }), c.name, h("span", { class: "soft small" }, c.missing || `scan ${c.scans.at(-1)}`))));
}

/** What to send with the wish to align. */
export function chosenOf(local) {
  const picked = (local.companions ?? []).filter((c) => local.together?.has(c.project) && !c.missing);
  return picked.length ? { together: picked.map((c) => ({ project: c.project })) } : {};
}

/** How well the readings of each surface agree with the one placement. */
export function surfaces(a) {
  if (!a.surfaces?.length) return null;
  const row = (s) => h("tr", {}, h("td", {}, s.name), h("td", { class: "num" }, mm(s.rms_mm)), h("td", { class: "num soft" }, pct(s.agreeing_share)), h("td", { class: "num soft" }, whole(s.readings)));
  return h("div", {}, h("h3", {}, "Surfaces aligned together"), h("table", {}, h("thead", {}, h("tr", {}, ["", "rms (mm)", "agreeing", "readings"].map((t) => h("th", {}, t)))), h("tbody", {}, a.surfaces.map(row))));
}
