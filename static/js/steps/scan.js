// Step 7: the readings: uploaded from the robot, or rehearsed on the simulated scanner.

import { del, get, upload } from "../api.js";
import { askRehearsal, confirm } from "../dialog.js";
import { button, h } from "../dom.js";
import { histograms, maps, profile } from "../drawer/plots.js";
import { AXES, bytes, isAngle, poseKey } from "../format.js";
import { verdict, working } from "../status.js";

export const watchesView = true;
export const watchesJobs = true;

export function content(shell) {
  const { scans, plan } = shell.project.data;
  const local = (shell.local.scan ??= { base: "", path: "alignment", progress: null });
  return [
    shell.busy("simulate") && working(shell, "Rehearsing", "simulate"),
    scans?.length ? list(shell, scans) : shell.busy("simulate") ? null : verdict("none", "No scan yet", plan ? "Run the alignment program on the robot and upload its readings. No robot at hand: rehearse." : "Plan the paths first."),
    local.progress ? sending(local) : drop(shell, local),
    colours(shell, scans),
  ];
}

/** An upload under way. */
export const sending = (local) => h("div", { class: "stack" }, h("span", {}, local.progress.text), h("progress", { value: local.progress.share, max: 1 }), button("Cancel", local.progress.cancel, { class: "tiny" }));

/** Readings cannot be brought back: ask before they go. */
async function remove(shell, scan) {
  const names = scan.files.map((f) => f.name).join(", ");
  const sure = await confirm(`Delete scan ${scan.number}?`, `${names}. What was computed from it stays, but is out of date.`, "Delete");
  if (sure) await shell.do(async () => { await del(`${shell.project.path}/scans/${scan.number}`); await shell.project.load(["scans", "alignment"]); });
}

function list(shell, scans) {
  return h("div", { class: "stack" }, h("h3", {}, "Scans"), h("table", {}, h("tbody", {}, scans.map((s) => h("tr", {},
    h("td", {}, `#${s.number}`), h("td", { class: "l" }, s.files.map((f) => f.name).join(", "), h("br"), h("span", { class: "faint small" }, [s.origin, s.path, s.base && `BASE ${s.base}`].filter(Boolean).join(", "))),
    h("td", { class: "num" }, bytes(s.files.reduce((n, f) => n + f.bytes, 0))),
    h("td", {}, button("✕", () => remove(shell, s), { class: "ghost tiny", "aria-label": `Delete scan ${s.number}`, key: `del-${s.number}` })))))));
}

/** Where scans are dropped; also used for inspection scans. */
export function drop(shell, local, fixedPath = null) {
  const input = h("input", { type: "file", class: "hidden", multiple: true, onchange: () => send(shell, local, [...input.files], fixedPath) });
  const choice = (name, value, options) => h("select", { name, "aria-label": name, style: { width: "auto" }, onchange: (e) => { local[name] = e.target.value; } }, options.map(([v, text]) => h("option", { value: v, selected: v === value }, text)));
  const box = h("div", { class: "drop" }, "Drop the readings here", h("span", { class: "faint small" }, "CSV, Parquet, HDF5, PLY, PCD, XYZ; or poses and readings as two files"),
    h("div", { class: "row tight" }, !fixedPath && choice("path", local.path, [["alignment", "alignment scan"], ["inspection", "inspection scan"], ["corrected", "corrected inspection"]]), choice("base", local.base, [["", "BASE: the file says"], ["nominal", "BASE: nominal"], ["corrected", "BASE: corrected"]])),
    button("Choose files", () => input.click()), input);
  box.addEventListener("dragover", (e) => { e.preventDefault(); box.classList.add("over"); });
  box.addEventListener("dragleave", () => box.classList.remove("over"));
  box.addEventListener("drop", (e) => { e.preventDefault(); send(shell, local, [...e.dataTransfer.files], fixedPath); });
  return box;
}

function send(shell, local, files, fixedPath) {
  if (!files.length) return null;
  return shell.do(async () => {
    const job = upload("POST", `${shell.project.path}/scans`, files.map((f) => ["file", f]), { base: local.base, path: fixedPath ?? local.path }, (share, sent, total) => { local.progress = { share, text: `${bytes(sent)} of ${bytes(total)}`, cancel: job.cancel }; shell.draw(); });
    try { await job.promise; } finally { local.progress = null; }
    await shell.project.load(["scans", "alignment"]);
  });
}

function colours(shell, scans) {
  if (!scans?.length) return null;
  const by = shell.local.colour ?? "standoff";
  const set = (value) => { shell.local.colour = value; shell.view.send({ scan_by: value }); };
  return h("div", { class: "stack" }, h("h3", {}, "Colour of the points"), h("div", { class: "row tight", role: "group" }, [["standoff", "Standoff"], ["amplitude", "Amplitude"]].map(([k, text]) => button(text, () => set(k), { class: by === k ? "on" : "", "aria-pressed": String(by === k) }))));
}

/** An offset as a fixture leaves it: normal, with the sigmas of the cell, rounded. */
export function draw(setup) {
  const normal = () => Math.sqrt(-2 * Math.log(1 - Math.random())) * Math.cos(2 * Math.PI * Math.random());
  return () => Object.fromEntries(AXES.map((a) => [a, Number((normal() * (isAngle(a) ? setup.fixture.sigma_deg : setup.fixture.sigma_mm)).toFixed(isAngle(a) ? 2 : 1))]));
}

/** Ask for the hidden truth and run the simulated scanner. */
export async function rehearse(shell, path) {
  // The part stays where it is between the scans of one rehearsal.
  const known = shell.project.data.scans?.filter((s) => s.path === "alignment" && s.origin === "simulated").at(-1)?.detail?.options ?? null;
  // A sample brings an offset of its own; any other part hides where its fixture may leave it.
  const sample = (await get("/samples").catch(() => [])).find((s) => s.sha256 === shell.project.data.part?.sha256);
  const own = sample && Object.fromEntries(AXES.map((a) => [a, sample.hidden_offset[poseKey(a)]]));
  const last = known?.offset && Object.fromEntries(AXES.map((a) => [a, known.offset[poseKey(a)]]));
  const body = await askRehearsal(path, draw(shell.project.data.setup), { own, last: path === "alignment" ? null : last, springBack: path === "alignment" ? 0 : (known?.spring_back_mm ?? 0) });
  if (body) { await shell.do(async () => { await shell.project.run("/simulate", body); await shell.view.refresh(); }); }
}

export function footer(shell) {
  const { scans, plan } = shell.project.data;
  const busy = shell.busy("simulate");
  const able = plan?.programs?.alignment?.available;
  const go = button(busy ? "Rehearsing…" : "Rehearse the alignment scan", () => rehearse(shell, "alignment"), { class: scans?.length ? "tiny" : "primary", disabled: !able || busy, key: "rehearse" });
  return scans?.length ? [go, button("Continue: align", () => { location.hash = `#/p/${shell.project.id}/alignment`; }, { class: "primary" })] : go;
}

export function drawer(shell) {
  const { scans } = shell.project.data;
  if (!scans?.length) return { tabs: [], stamp: "" };
  const chart = (name) => get(`${shell.project.path}/charts/${name}`);
  return { stamp: String(scans.at(-1).number), tabs: [
    { key: "cscan", title: "C-scan", draw: async (body, alive) => maps(body, alive, await Promise.all([chart("cscan?of=amplitude"), chart("cscan?of=distance")])) },
    { key: "bscan", title: "B-scan", draw: async (body, alive) => { const first = await chart("bscan?law=1"); return profile(body, alive, first.laws > 2 ? await chart(`bscan?law=${Math.round(first.laws / 2)}`) : first); } },
    { key: "histograms", title: "Histograms", draw: async (body, alive) => histograms(body, alive, await chart("deviation"), await chart("amplitude")) },
  ] };
}
