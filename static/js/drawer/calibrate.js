// Calibration from measurements: what they show, how well, drawn, and what of the setup they change.

import { API, del, get, upload } from "../api.js";
import { confirm } from "../dialog.js";
import { button, fill, h } from "../dom.js";
import { bytes, fixed } from "../format.js";
import { issueList, tag, toneOf } from "../status.js";
import { patchOf } from "./patch.js";

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

const APPLIED = { now: ["good", "in force"], earlier: ["none", "was in force"], never: ["none", "not used"], nothing: ["none", "changes nothing"] };
const WORDS = { nothing: "Nothing to change in the cell.", stale: "It was computed with an earlier cell. Send the files again.", key: "calibration" };

/** A calibration that nobody has sent files for yet. */
export const newCalibration = (kind) => ({ kind, target: "plane", radius: "", progress: null, number: null, issues: [], use: null });

/** Draw the tab. `cal` is what is chosen and found; `local.draft` the form's unsaved changes. */
export function calibrate(body, shell, local) {
  const cal = local.calibration;
  const kept = shell.project.data.calibrations ?? [];
  const answer = kept.find((c) => c.number === cal.number && c.created === cal.created) ?? null;
  const again = () => { if (shell.step === "cell" && local.calibration === cal) shell.drawer.draw(); };
  const choose = (change) => { Object.assign(cal, change, { number: null, issues: [] }); again(); };
  const files = (chosen) => send(shell, cal, chosen, again);
  const close = button("Close", () => { cal.progress?.cancel(); local.calibration = null; shell.draw(); }, { class: "ghost tiny", key: "calibration-close" });
  const path = answer && `${API}${shell.project.path}/calibrations/${answer.number}`;
  // Unsaved changes of the form get the patch too, so that saving them does not take it back.
  const draft = (merge) => { if (local.draft) local.draft = merge(local.draft); };
  fill(body, h("div", { class: "calibrate" },
    h("div", { class: "stack" }, h("div", { class: "row" }, choices(cal, choose), answer && drop(cal, files), close), answer ? picture(path, answer) : cal.progress ? waiting(cal) : drop(cal, files),
      local.draft && h("p", { class: "small soft" }, "The saved cell counts; its unsaved changes do not.")),
    h("div", { class: "stack" }, answer ? [table(answer), cal.use && patchOf(shell, cal.use, WORDS, again, draft), reports(path), issueList(answer.issues)] : issueList(cal.issues), past(shell, cal, kept, again))));
}

/** Show a calibration that is kept. */
async function pick(shell, cal, answer, again) {
  Object.assign(cal, { kind: answer.kind, target: answer.options.target, radius: answer.options.radius_mm ?? "", number: answer.number, created: answer.created, issues: [], use: null });
  again();
  // The patch belongs to the setup it was computed with, whatever is in force now.
  const madeFor = JSON.stringify(await get(`${shell.project.path}/setup?version=${answer.setup_version}`));
  if (cal.number === answer.number) { cal.use = { patch: answer.patch, madeFor, saving: false }; again(); }
}

/** All calibrations of the project, newest first. */
function past(shell, cal, kept, again) {
  if (!kept.length) return null;
  const remove = async (c) => {
    const sure = await confirm(`Delete calibration ${c.number}?`, `${KINDS[c.kind][0]} from ${c.name}, with its readings and its report. The cell stays as it is.`, "Delete");
    if (sure) await shell.do(async () => { await del(`${shell.project.path}/calibrations/${c.number}`); await shell.project.load(["calibrations"]); });
  };
  const row = (c) => h("tr", { class: c.number === cal.number ? "on" : null }, h("td", {}, button(`${c.number}`, () => pick(shell, cal, c, again), { class: "tiny", title: "Show", "aria-label": `Show calibration ${c.number}`, key: `calibration-${c.number}` })),
    h("td", { class: "l" }, KINDS[c.kind][0]), h("td", { class: "l name", title: c.name }, c.name), h("td", { class: "l soft", title: c.created }, new Date(c.created).toLocaleString([], { dateStyle: "short", timeStyle: "short" })),
    h("td", { class: "l" }, tag(...APPLIED[c.applied])),
    h("td", {}, button("✕", () => remove(c), { class: "ghost tiny", "aria-label": `Delete calibration ${c.number}`, key: `calibration-del-${c.number}` })));
  return h("div", { class: "past" }, h("h3", {}, "Calibrations of this project"), h("table", {}, h("tbody", {}, [...kept].reverse().map(row))));
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
  const box = h("div", { class: cal.number ? "drop low" : "drop" }, cal.number ? h("span", { class: "small" }, "Other readings") : ["Drop the readings here", h("span", { class: "faint small" }, KINDS[cal.kind][1])], button("Choose files", () => input.click(), { key: "calibration-choose" }), input);
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
  Object.assign(cal, { number: null, issues: [] });
  const job = upload("POST", `${project.path}/calibrations/${cal.kind}`, files.map((f) => ["file", f]), fields, (share, sent, total) => show(share, share < 1 ? `${bytes(sent)} of ${bytes(total)}` : "Calibrating"));
  show(0, "Sending");
  try {
    const answer = await job.promise;
    await project.load(["setup", "calibrations"]);
    await pick(shell, cal, answer, again);
  } catch (error) {
    // The server ends the work when the page hangs up.
    const stopped = error.issues?.[0]?.code === "upload-cancelled";
    cal.issues = stopped ? [{ severity: "info", code: "cancelled", message: "The calibration was cancelled; nothing was kept.", remedy: "", where: "" }] : error.issues ?? [{ severity: "error", code: "fault", message: error.message, remedy: "", where: "" }];
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

function reports(path) {
  const link = (format, word) => h("a", { href: `${path}/report?format=${format}${format === "html" ? "" : "&download=true"}`, target: "_blank", rel: "noopener", "aria-label": `Report of the calibration: ${word}` }, word);
  return h("div", { class: "row" }, h("span", { class: "soft small" }, "Report:"), link("html", "open"), link("pdf", "PDF"), link("csv", "CSV"), link("json", "JSON"), h("a", { href: `${path}/files`, "aria-label": "Documents of the calibration" }, "ZIP"));
}

const picture = (path, answer) => h("div", { class: "figure" }, h("img", { src: `${path}/figures/${answer.kind}`, alt: `${KINDS[answer.kind][0]}: readings and fit` }));
