// Step 2: the cell, as a form made from the schema of the setup.

import { ApiError, get } from "../api.js";
import { button, h } from "../dom.js";
import { baseFit, newFit } from "../drawer/basefit.js";
import { calibrate, newCalibration } from "../drawer/calibrate.js";
import { field, fieldsOf, at, title, withValue } from "../form.js";
import { AXES, fixed, poseKey } from "../format.js";

let schemaPromise = null;

async function schema() {
  schemaPromise ??= (async () => {
    for (const path of ["openapi.json", "api/v1/openapi.json"]) {
      const answer = await fetch(path, { credentials: "same-origin" }).catch(() => null);
      if (!answer?.ok) continue;
      const root = await answer.json();
      const all = root.components?.schemas ?? {};
      const found = all["Setup-Input"] ?? all.Setup;
      if (found) return { root, setup: found, robots: await get("/robots") };
    }
    schemaPromise = null;
    throw new ApiError(0, [{ severity: "error", code: "schema-missing", message: "The server does not describe the setup.", remedy: "Reload the page.", where: "openapi.json" }]);
  })();
  return schemaPromise;
}

const GROUPS = ["probe", "couplant", "tool", "base", "placement", "robot_root", "signals", "fixture", "tolerances", "alignment", "inspection", "limits"];
// Groups of the form that measurements can fill in, by the kind of calibration.
const CALIBRATIONS = { probe: "tilt", couplant: "couplant", tool: "tcp" };
const WORDS = { base: "BASE (nominal)", placement: "CAD origin in BASE", robot_root: "Robot foot in world", fixture: "Fixture, one sigma", limits: "Largest correction", alignment: "Alignment scan", inspection: "Inspection raster", tool: "Tool", tcp: "TCP in flange" };

export function content(shell) {
  const { setup } = shell.project.data;
  const local = (shell.local.cell ??= { draft: null, schema: null, open: new Set(["base"]) });
  if (!local.schema) {
    schema().then((s) => { local.schema = s; if (shell.step === "cell") shell.draw(); }, (e) => { shell.problems.cell = e.issues ?? []; shell.draw(); });
    return h("p", { class: "faint" }, "Loading…");
  }
  const draft = local.draft ?? setup;
  const change = (path, value) => { local.draft = withValue(local.draft ?? setup, path, value); if (JSON.stringify(local.draft) === JSON.stringify(setup)) local.draft = null; shell.draw(); };
  const one = (f, label) => field({ ...f, label, schema: f.key === "robot" ? robotSchema(f.schema, local.schema.robots) : f.schema }, at(draft, f.path), at(setup, f.path), change);
  const tree = fieldsOf(local.schema.setup, local.schema.root);
  const named = Object.fromEntries(tree.map((f) => [f.key, f]));
  const plain = tree.filter((f) => !f.children);
  const group = (f) => h("details", { class: "group", open: local.open.has(f.key), ontoggle: (e) => local.open[e.target.open ? "add" : "delete"](f.key) },
    h("summary", { data: { key: `group-${f.key}` } }, h("span", {}, WORDS[f.key] ?? title(f.key)), h("span", { class: "glance num" }, glance(f.key, draft))),
    h("div", { class: "fields" }, f.children.map((c) => (c.children ? [h("p", { class: "soft small" }, WORDS[c.key] ?? title(c.key)), c.children.map((d) => one(d))] : one(c))),
      f.key === "base" && button("Fit to touched points…", () => { local.fit ??= newFit(); show(shell, "fit"); }, { key: "fit-open" }),
      CALIBRATIONS[f.key] && button("Calibrate…", () => { if (local.calibration?.kind !== CALIBRATIONS[f.key]) local.calibration = newCalibration(CALIBRATIONS[f.key]); show(shell, "calibrate"); }, { key: `calibrate-${f.key}` })));
  return [h("div", {}, plain.map((f) => one(f))), h("div", {}, GROUPS.filter((k) => named[k]).map((k) => group(named[k])))];
}

const robotSchema = (schema, robots) => ({ ...schema, choices: robots.map((r) => [r.name, r.title]) });

function show(shell, tab) {
  shell.drawer.chosen.cell = tab;
  shell.drawer.open = true;
  shell.draw();
  shell.drawer.draw();
}

/** The fit of BASE to touched points, and a calibration, while somebody does them. */
export function drawer(shell) {
  const local = shell.local.cell;
  const { setup } = shell.project.data;
  if (!setup || !(local?.fit || local?.calibration)) return { tabs: [], stamp: "" };
  const use = (base) => {
    const draft = local.draft ?? setup;
    const rounded = Object.fromEntries(AXES.map((a) => [poseKey(a), Number(base[poseKey(a)].toFixed(6))]));
    local.draft = { ...draft, base: { ...draft.base, ...rounded } };
    local.fit = null;
    shell.draw();
  };
  const fit = local.fit && { key: "fit", title: "BASE from touched points", draw: (body) => baseFit(body, local.fit, shell.project.id, () => (local.draft ?? shell.project.data.setup).placement, use) };
  const calibration = local.calibration && { key: "calibrate", title: "Calibrate", draw: (body) => calibrate(body, shell, local) };
  // What is in force, whether there are unsaved changes, and what is kept, is part of what a calibration shows.
  const kept = (shell.project.data.calibrations ?? []).map((c) => `${c.number} ${c.created} ${c.applied}`).join();
  const stamp = local.calibration ? `${local.calibration.kind} ${Boolean(local.draft)} ${JSON.stringify(setup)} ${kept}` : "fit";
  return { stamp, tabs: [fit, calibration].filter(Boolean) };
}

/** The numbers of a group in one line. */
function glance(key, s) {
  const pose = (p) => ["x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"].map((k) => fixed(p[k], 0)).join(" ");
  const laws = s.probe.elements === 1 ? 1 : s.probe.elements - s.probe.aperture_elements + 1;
  return {
    probe: s.probe.elements === 1 ? `single, ${s.probe.frequency_mhz} MHz` : `${laws} laws, ${fixed(laws * s.probe.pitch_mm, 1)} mm`,
    couplant: s.couplant.sound_speed_m_s ? `${s.couplant.sound_speed_m_s} m/s` : `water, ${s.couplant.temperature_c} °C`,
    tool: `TOOL ${s.tool.number}`, base: pose(s.base) === "0 0 0 0 0 0" ? "untaught" : pose(s.base), placement: pose(s.placement), robot_root: pose(s.robot_root),
    fixture: `${s.fixture.sigma_mm} mm, ${s.fixture.sigma_deg}°`, tolerances: `${s.tolerances.tilt_deg}°, ${s.tolerances.loss_db} dB`,
    alignment: `${fixed(s.alignment.coverage * 100, 0)} % coverage`, inspection: s.inspection.strategy, limits: `${s.limits.correction_mm} mm, ${s.limits.correction_deg}°`,
    signals: s.signals.data_output ? `$OUT[${s.signals.data_output}]` : "none",
  }[key] ?? "";
}

export function footer(shell) {
  const local = shell.local.cell ?? {};
  const dirty = Boolean(local.draft);
  const undo = shell.project.undoSetups.length;
  return [
    h("div", { class: "row" }, button("Undo", () => undoLast(shell), { class: "tiny", disabled: !dirty && !undo, title: "Ctrl+Z" }), dirty && h("span", { class: "small soft" }, "Changed, not saved yet")),
    dirty ? button("Save the cell", () => save(shell, local), { class: "primary" })
      : button("Continue: the surface", () => { location.hash = `#/p/${shell.project.id}/surface`; }, { class: "primary" }),
  ];
}

async function save(shell, local) {
  await shell.do(async () => {
    try {
      await shell.project.saveSetup(local.draft);
      local.draft = null;
    } catch (error) {
      if (error.status === 412) await shell.project.load(["setup"]);
      throw error;
    }
  });
}

function undoLast(shell) {
  const local = shell.local.cell;
  if (local?.draft) { local.draft = null; shell.draw(); return; }
  shell.do(() => shell.project.undoSetup());
}

export const undo = (shell) => undoLast(shell);
