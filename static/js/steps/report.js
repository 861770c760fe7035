// Step 9: hand over: the corrected program, the report, and the proof by the inspection scan itself.

import { get, href } from "../api.js";
import { button, h } from "../dom.js";
import { programs as krl } from "../drawer/krl.js";
import { overlaid, surfaceMaps } from "../drawer/plots.js";
import { fixed, mm, pct } from "../format.js";
import { issueList, verdict, working } from "../status.js";
import { accept } from "./alignment.js";
import { program } from "./programs.js";
import { record } from "./record.js";
import { drop, rehearse, sending } from "./scan.js";

export const watchesJobs = true;
const link = (path, text, props = {}) => h("a", { class: "btn", style: { textDecoration: "none", color: "inherit", lineHeight: "20px" }, href: href(path), ...props }, text);

export function content(shell) {
  const { alignment: a, assessment } = shell.project.data;
  const local = (shell.local.report ??= { base: "", path: "corrected", progress: null, roles: {} });
  if (shell.busy("assessment")) return working(shell, "Assessing", "assessment");
  if (!a) return [verdict("none", "Nothing to report yet", "Align first."), record(shell, local), archive(shell)];
  return [
    shell.busy("simulate") && working(shell, "Rehearsing", "simulate"),
    program(shell, "corrected", "Corrected inspection", a.program, a.corrected_program ?? a.export ?? null),
    report(shell, "alignments", a, "Report of the alignment"),
    record(shell, local),
    h("section", { class: "stack" }, h("h3", {}, "Inspection scan"), assessment ? judged(assessment) : h("p", { class: "soft small" }, "Upload the inspection scan (and the one from before the correction), or rehearse them, to see whether the front-wall echo stayed within 2 dB."), roles(shell, local)),
    assessment && report(shell, "assessments", assessment, "Report of the inspection scan"),
    local.progress ? sending(local) : drop(shell, local),
    archive(shell),
  ];
}

/** A result's report in every form it comes in. */
function report(shell, kind, result, text) {
  const path = `${shell.project.path}/${kind}/${result.number}`;
  const form = (name, word) => link(`${path}/report?format=${name}&download=true`, word, { download: "", "aria-label": `${text}: ${word}` });
  return h("section", { class: "stack" }, h("h3", {}, text), h("div", { class: "row" },
    link(`${path}/report`, kind === "alignments" ? "Open the report" : "Open it", { target: "_blank", rel: "noopener" }), form("pdf", "PDF"), form("html", "HTML"), form("csv", "CSV"), form("json", "JSON"), link(`${path}/files`, "Data (zip)", { download: "", "aria-label": `${text}: data (zip)` })));
}

const WORDS = [["", "not used"], ["after", "this inspection"], ["before", "from before"]];

/** Which scan is what: chosen by hand, else the newest of the corrected path against the newest of the nominal one. */
function roleOf(shell, local) {
  const list = (shell.project.data.scans ?? []).filter((s) => ["inspection", "corrected"].includes(s.path));
  const corrected = list.filter((s) => s.path === "corrected").at(-1);
  const nominal = list.filter((s) => s.path === "inspection").at(-1);
  const usual = (s) => (s === (corrected ?? nominal) ? "after" : s === nominal ? "before" : "");
  return list.map((s) => [s, local.roles[s.number] ?? usual(s)]);
}

/** Choose the scans: an inspection may come in several, its passes split over them. */
function roles(shell, local) {
  const list = roleOf(shell, local);
  if (list.length < 2) return null;
  return h("table", { class: "roles" }, h("tbody", {}, list.map(([s, role]) => h("tr", {}, h("td", {}, `#${s.number}`), h("td", { class: "l" }, s.files.map((f) => f.name).join(", ")),
    h("td", {}, h("select", { name: `role-${s.number}`, "aria-label": `What scan ${s.number} is`, onchange: (e) => { local.roles[s.number] = e.target.value; shell.draw(); } }, WORDS.map(([v, text]) => h("option", { value: v, selected: v === role }, text))))))));
}

const archive = (shell) => h("section", { class: "stack" }, h("h3", {}, "Archive"), link(`${shell.project.path}/archive`, "Save the whole project (zip)", { download: "" }));

function judged(s) {
  const rows = [["Distance, std (mm)", "tof_std_mm", mm], ["Distance, range (mm)", "tof_range_mm", mm], ["Amplitude, range (dB)", "db_range_db", (v) => fixed(v, 2)], ["Mean |dB|", "mean_abs_db", (v) => fixed(v, 2)], ["Within 2 dB", "within_2db", (v) => pct(v)], ["Over-spray", "over_spray", (v) => pct(v)]];
  return [s.stale && verdict("warn", "Out of date"), h("table", {}, h("thead", {}, h("tr", {}, ["", s.before && "before", "after"].filter((t) => typeof t === "string").map((t) => h("th", {}, t)))),
    h("tbody", {}, rows.map(([name, key, show]) => h("tr", {}, h("td", {}, name), s.before && h("td", { class: "num soft" }, show(s.before[key])), h("td", { class: "num" }, show(s.after?.[key])))))),
    Number.isFinite(s.improvement_pct) && h("p", {}, `Improvement ${fixed(s.improvement_pct, 1)} %`), issueList(s.issues, 5)];
}

export function footer(shell) {
  const { alignment: a, assessment } = shell.project.data;
  if (a?.verdict === "partial" && !a.accepted && !a.stale) return button("Accept…", () => accept(shell, a), { class: "primary" });
  const chosen = roleOf(shell, shell.local.report ?? { roles: {} });
  const numbers = (role) => chosen.filter(([, r]) => r === role).map(([s]) => s.number);
  const after = numbers("after");
  const busy = shell.busy("simulate", "assessment");
  // What was assessed already gives the same again; then the program is what there is to take.
  const known = assessment && !assessment.stale && JSON.stringify([assessment.options?.scans, assessment.options?.before]) === JSON.stringify([after, numbers("before")]);
  const assess = () => shell.do(() => shell.project.run("/assessments", { scans: after, before: numbers("before") }));
  return [
    h("div", { class: "row tight" }, button("Rehearse uncorrected", () => rehearse(shell, "inspection"), { class: "tiny", disabled: busy }), button("Rehearse corrected", () => rehearse(shell, "corrected"), { class: "tiny", disabled: busy || !a?.program?.available })),
    after.length && !known ? button(busy ? "Working…" : "Assess the inspection scan", assess, { class: "primary", disabled: busy, key: "assess" })
      : a?.program?.available && h("a", { class: "btn primary", style: { textAlign: "center", textDecoration: "none", lineHeight: "26px" }, href: href(`${shell.project.path}/programs/corrected`), download: "" }, "Download the corrected program"),
  ];
}

export function drawer(shell) {
  const { alignment: a, assessment } = shell.project.data;
  let loaded = null;
  const charts = () => (loaded ??= get(`${shell.project.path}/assessments/${assessment.number}/charts`));
  const tabs = [
    ...(assessment ? [
      { key: "standoff", title: "Front wall", draw: async (body, alive) => surfaceMaps(body, alive, await charts(), "mm") },
      { key: "amplitude", title: "Amplitude", draw: async (body, alive) => surfaceMaps(body, alive, await charts(), "dB") },
      { key: "spread", title: "Before and after", draw: async (body, alive) => overlaid(body, alive, ...(await charts()).histograms) },
    ] : []),
    ...(a?.program?.available ? [{ key: "corrected", title: "KRL, corrected", draw: (body, alive) => krl(body, alive, `${shell.project.path}/programs/corrected`) }] : []),
  ];
  return { stamp: `${a?.number} ${assessment?.number}`, tabs };
}
