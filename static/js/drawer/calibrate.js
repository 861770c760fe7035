// Calibration from measurements: what they show, how well, drawn, and what of the setup they change.

import { etagOf, upload } from "../api.js";
import { button, fill, h } from "../dom.js";
import { at, withValue } from "../form.js";
import { bytes, fixed } from "../format.js";
import { issueList, tag, toneOf } from "../status.js";

const KINDS = {
  tilt: ["Tilt loss of the probe", "A flat target, the tool turned about B and about C. CSV: b_deg, c_deg, amplitude_pct"],
  couplant: ["Speed of sound and delay", "Known gaps or steps, repeat echoes if there are any. CSV: tof_us, gap_mm or step_mm, echo"],
  tcp: ["TCP", "A fixed plane or sphere, seen from many directions. A scan in any format, with poses"],
};
const NAMES = {
  k_b: "Tilt loss about B", k_c: "Tilt loss about C", zero_b: "B of the largest echo", zero_c: "C of the largest echo", sound_speed: "Speed of sound", delay: "Delay",
  c: "Turn about x (C)", b: "Turn about y (B)", a: "Turn about z (A)", x: "Shift along x", y: "Shift along y", z: "Shift along z", radius: "Radius of the sphere",
};
const UNITS = { us: "µs", "dB/deg^2": "dB/deg²" };

/** A calibration that nobody has sent files for yet. */
export const newCalibration = (kind) => ({ kind, target: "plane", radius: "", progress: null, answer: null, issues: [], madeFor: null, saving: false });

/** Fields of a patch: [{path, value}], nested names as a path. */
const leaves = (patch, path = []) => Object.entries(patch).flatMap(([key, value]) => (value !== null && typeof value === "object" ? leaves(value, [...path, key]) : [{ path: [...path, key], value }]));
const merged = (setup, patch) => leaves(patch).reduce((s, { path, value }) => withValue(s, path, value), setup);

/** Draw the tab. `cal` is what is chosen and found; `local.draft` the form's unsaved changes. */
export function calibrate(body, shell, local) {
  const cal = local.calibration;
  const again = () => { if (shell.step === "cell" && local.calibration === cal) shell.drawer.draw(); };
  const choose = (change) => { Object.assign(cal, change, { answer: null, issues: [] }); again(); };
  const files = (chosen) => send(shell, cal, chosen, again);
  const close = button("Close", () => { cal.progress?.cancel(); local.calibration = null; shell.draw(); }, { class: "ghost tiny", key: "calibration-close" });
  fill(body, h("div", { class: "calibrate" },
    h("div", { class: "stack" }, h("div", { class: "row" }, choices(cal, choose), cal.answer && drop(cal, files), close), cal.answer ? picture(cal.answer) : cal.progress ? waiting(cal) : drop(cal, files),
      local.draft && h("p", { class: "small soft" }, "The saved cell counts; its unsaved changes do not.")),
    h("div", { class: "stack" }, cal.answer ? [table(cal.answer), change(shell, local, cal, again), issueList(cal.answer.issues)] : issueList(cal.issues))));
}

function choices(cal, choose) {
  const off = Boolean(cal.progress);
  const select = (name, label, value, options) => h("label", {}, label, h("select", { name, disabled: off, onchange: (e) => choose({ [name.split("-")[1]]: e.target.value }) }, options.map(([v, text]) => h("option", { value: v, selected: v === value }, text))));
  return [select("calibration-kind", "Calibrate", cal.kind, Object.entries(KINDS).map(([k, [text]]) => [k, text])),
    cal.kind === "tcp" && select("calibration-target", "Target", cal.target, [["plane", "plane"], ["sphere", "sphere"]]),
    cal.kind === "tcp" && cal.target === "sphere" && h("label", {}, "Radius (mm)", h("input", { type: "number", name: "calibration-radius", step: "any", min: 0.001, max: 10000, placeholder: "to be found", disabled: off, value: cal.radius, oninput: (e) => { cal.radius = e.target.value; } }))];
}

function drop(cal, send) {
  const input = h("input", { type: "file", name: "calibration-files", class: "hidden", multiple: true, onchange: () => send([...input.files]) });
  const box = h("div", { class: cal.answer ? "drop low" : "drop" }, cal.answer ? h("span", { class: "small" }, "Other readings") : ["Drop the readings here", h("span", { class: "faint small" }, KINDS[cal.kind][1])], button("Choose files", () => input.click(), { key: "calibration-choose" }), input);
  box.addEventListener("dragover", (e) => { e.preventDefault(); box.classList.add("over"); });
  box.addEventListener("dragleave", () => box.classList.remove("over"));
  box.addEventListener("drop", (e) => { e.preventDefault(); send([...e.dataTransfer.files]); });
  return box;
}

const waiting = (cal) => h("div", { class: "stack", role: "status" }, h("span", {}, cal.progress.text), cal.progress.share < 1 ? h("progress", { value: cal.progress.share, max: 1 }) : h("div", { class: "seeking" }), button("Cancel", cal.progress.cancel, { class: "tiny", key: "calibration-cancel" }));

async function send(shell, cal, files, again) {
  if (!files.length || cal.progress) return;
  const { project } = shell;
  const fields = cal.kind === "tcp" ? { target: cal.target, radius_mm: cal.target === "sphere" ? cal.radius : "" } : {};
  const show = (share, text) => { cal.progress = { share, text, cancel: () => job.cancel() }; again(); };
  Object.assign(cal, { answer: null, issues: [] });
  const job = upload("POST", `${project.path}/calibrations/${cal.kind}`, files.map((f) => ["file", f]), fields, (share, sent, total) => show(share, share < 1 ? `${bytes(sent)} of ${bytes(total)}` : "Calibrating"));
  show(0, "Sending");
  try {
    const answer = await job.promise;
    // The patch belongs to the setup it was computed with: the one shown here, or one that somebody saved meanwhile.
    const path = `${project.path}/setup`;
    const same = () => etagOf(path) === `"${answer.setup_version}"`;
    if (!same()) await project.load(["setup"]);
    Object.assign(cal, { answer, madeFor: same() ? JSON.stringify(project.data.setup) : null });
  } catch (error) {
    cal.issues = error.issues ?? [{ severity: "error", code: "fault", message: error.message, remedy: "", where: "" }];
  } finally {
    cal.progress = null;
    again();
  }
}

function table(answer) {
  const row = ([name, e]) => {
    // Two digits of the half width say how well it is known.
    const places = e.half_95 > 0 ? Math.min(Math.max(1 - Math.floor(Math.log10(e.half_95)), 0), 6) : 4;
    return h("tr", {}, h("td", {}, NAMES[name] ?? name), h("td", { class: "num" }, fixed(e.value, places)), h("td", { class: "num" }, fixed(e.half_95, places)), h("td", { class: "unit l" }, UNITS[e.unit] ?? e.unit), h("td", { class: "l" }, tag(toneOf(e.status), e.status)));
  };
  return h("table", {}, h("thead", {}, h("tr", {}, [`${answer.readings} readings`, "Value", "± 95 %", "", "Status"].map((t, i) => h("th", { scope: "col", class: i > 2 ? "l" : null }, t)))), h("tbody", {}, Object.entries(answer.estimates).map(row)));
}

/** The patch, field by field, and the button that puts it in force. */
function change(shell, local, cal, again) {
  const { project } = shell;
  const { setup } = project.data;
  const fields = leaves(cal.answer.patch);
  if (!fields.length) return h("p", { class: "small" }, "Nothing to change in the cell.");
  const text = (v) => (v === null || v === undefined ? "auto" : typeof v === "number" ? String(Number(v.toPrecision(9))).replace("-", "−") : String(v));
  const done = fields.every(({ path, value }) => at(setup, path) === value);
  const stale = !done && JSON.stringify(setup) !== cal.madeFor;
  const old = cal.madeFor ? JSON.parse(cal.madeFor) : setup;
  const use = async () => {
    if (cal.saving) return;
    cal.saving = true;
    again();
    await shell.do(async () => {
      try {
        await project.saveSetup(merged(setup, cal.answer.patch));
        if (local.draft) local.draft = merged(local.draft, cal.answer.patch);
      } catch (error) {
        if (error.status === 412) await project.load(["setup"]);
        throw error;
      } finally { cal.saving = false; }
    });
    again();
  };
  return [h("table", { class: "patch" }, h("thead", {}, h("tr", {}, ["Of the cell", "Before", "", "After"].map((t) => h("th", { scope: "col" }, t)))), h("tbody", {}, fields.map(({ path, value }) => h("tr", {}, h("td", {}, path.join(".")), h("td", { class: "num" }, text(at(old, path))), h("td", {}, "→"), h("td", { class: "num" }, text(value)))))),
    stale && h("p", { class: "small" }, tag("warn", "The cell was changed since. Send the files again.")),
    h("div", { class: "row" }, button("Use in the setup", use, { class: "primary", disabled: done || stale || cal.saving, key: "calibration-use" }), done && tag("good", "in force"), report(cal.answer))];
}

function report(answer) {
  return h("a", { href: "#", download: `calibration-${answer.kind}.html`, "aria-label": "Report of the calibration", onclick: (e) => {
    const source = URL.createObjectURL(new Blob([answer.report_html], { type: "text/html" }));
    e.currentTarget.href = source;
    setTimeout(() => URL.revokeObjectURL(source), 10000);
  } }, "Report");
}

function picture(answer) {
  const source = URL.createObjectURL(new Blob([answer.figure_svg], { type: "image/svg+xml" }));
  return h("div", { class: "figure" }, h("img", { src: source, alt: `${KINDS[answer.kind][0]}: readings and fit`, onload: () => URL.revokeObjectURL(source) }));
}
