// Step 1: the CAD of the part, its unit, its size.

import { post, upload } from "../api.js";
import { button, h } from "../dom.js";
import { bytes, facts, num, size, whole } from "../format.js";
import { verdict } from "../status.js";

const UNITS = ["mm", "cm", "m", "inch"];
const SIZE_IF = /([\d.e+-]+) x ([\d.e+-]+) x ([\d.e+-]+) mm if in (\w+)/g;

export function content(shell) {
  const { part } = shell.project.data;
  const local = (shell.local.part ??= { unit: null, file: null, progress: null });
  return [part && overview(part), local.sizes && !local.progress && unitQuestion(shell, local), local.progress ? progressOf(local) : drop(shell, local, part), !part && samples(shell)];
}

function overview(part) {
  const [x, y, z] = part.extents_mm;
  return [
    h("div", { class: "stack" }, h("h3", {}, "Size"), h("div", { class: "big" }, `${size(x)} × ${size(y)} × ${size(z)}`, h("span", { class: "unit" }, "mm"))),
    part.size_if && h("div", { class: "stack" }, h("p", { class: "soft small" }, `The file was read in ${part.unit}. If that is not its real size:`),
      h("dl", { class: "facts" }, Object.entries(part.size_if).filter(([unit]) => unit !== part.unit).map(([unit, s]) => [h("dt", {}, `in ${unit}`), h("dd", {}, num(s.map(size).join(" × "), "mm"))]))),
    facts([
      ["File", h("span", {}, part.name)], ["Triangles", whole(part.triangles)], ["Chord error", part.chord_error_mm === null ? null : part.chord_error_mm.toFixed(4), "mm"],
      ["On disk", bytes(part.bytes)], ["SHA-256", h("span", { class: "num", title: part.sha256 }, `${part.sha256.slice(0, 12)}…`)],
    ]),
    part.notes?.length > 0 && h("ul", { class: "small soft stack" }, part.notes.map((n) => h("li", {}, n))),
  ];
}

function drop(shell, local, part) {
  const input = h("input", { type: "file", class: "hidden", accept: ".step,.stp,.stl,.obj,.ply,.glb", onchange: () => choose(shell, local, input.files[0]) });
  const box = h("div", { class: "drop" },
    part ? "Replace the part: drop a file here" : "Drop the CAD of the part here", h("span", { class: "faint small" }, "STEP, STL, OBJ, PLY or GLB"),
    button("Choose a file", () => input.click()), input);
  box.addEventListener("dragover", (e) => { e.preventDefault(); box.classList.add("over"); });
  box.addEventListener("dragleave", () => box.classList.remove("over"));
  box.addEventListener("drop", (e) => { e.preventDefault(); box.classList.remove("over"); choose(shell, local, e.dataTransfer.files[0]); });
  return box;
}

function choose(shell, local, file) {
  if (!file) return;
  local.file = file;
  local.unit = null;
  local.sizes = null;
  send(shell, local);
}

/** The file was read and says nothing of its unit: the sizes it would have help to tell. */
function unitQuestion(shell, local) {
  const choice = (u) => h("tr", {}, h("td", {}, h("label", { class: "row tight" }, h("input", { type: "radio", name: "unit", value: u, checked: local.unit === u, onchange: () => { local.unit = u; shell.draw(); } }), u)), h("td", { class: "num" }, local.sizes[u] ? `${local.sizes[u].map(size).join(" × ")} mm` : ""));
  return h("section", { class: "stack" }, h("h3", {}, "Unit"), h("p", {}, `${local.file.name} does not say in which unit its numbers are. How large is the part?`),
    h("table", {}, h("tbody", {}, UNITS.map(choice))), button(`Take ${local.file.name}${local.unit ? ` in ${local.unit}` : ""}`, () => send(shell, local), { disabled: !local.unit, key: "upload", class: "primary" }));
}

function send(shell, local) {
  return shell.do(async () => {
    const job = upload("PUT", `${shell.project.path}/part`, [["file", local.file]], { unit: local.unit }, (share, sent, total) => {
      local.progress = { share, text: share < 1 ? `${bytes(sent)} of ${bytes(total)}` : "Reading the part", cancel: job.cancel };
      shell.draw();
    });
    local.progress = { share: 0, text: "Uploading", cancel: job.cancel };
    shell.draw();
    try {
      await job.promise;
      local.file = local.sizes = null;
    } catch (error) {
      const missing = error.issues?.find((i) => i.code === "unit-missing");
      if (!missing) { local.file = local.sizes = null; throw error; }
      local.sizes = Object.fromEntries([...missing.message.matchAll(SIZE_IF)].map(([, x, y, z, unit]) => [unit, [x, y, z].map(Number)]));
      return;
    } finally { local.progress = null; }
    await shell.project.load(["part"]);
    await shell.view.send({ step: "part", camera: "iso" });
  });
}

function progressOf(local) {
  return h("div", { class: "stack" }, h("span", {}, `${local.file?.name ?? ""}: ${local.progress.text}`), h("progress", { value: local.progress.share, max: 1 }), button("Cancel", local.progress.cancel, { class: "tiny" }));
}

function samples(shell) {
  const use = (part) => shell.do(() => post(`${shell.project.path}/sample`, { part }));
  return [verdict("none", "No part yet", "Load one, or take a sample to look around."), h("div", { class: "row" }, button("Aerofoil sample", () => use("aerofoil")), button("Flat plate sample", () => use("flat-plate")))];
}

export function footer(shell) {
  const { part } = shell.project.data;
  return button("Continue: the cell", () => { location.hash = `#/p/${shell.project.id}/cell`; }, { class: "primary", disabled: !part });
}
