// Step 3, below the choice: box, paint, keep-out regions and the direction of the passes.

import { button, h } from "../dom.js";
import { fixed } from "../format.js";
import { edit, toolButton } from "./surface.js";

const AXES = ["X", "Y", "Z"];
const DIRECTIONS = [["extent", "the longest extent"], ["lowest_curvature", "the lowest curvature"], ["drawn", "a line drawn"]];

function group(local, key, name, glance, ...inside) {
  return h("details", { class: "group", open: local.open.has(key), ontoggle: (e) => local.open[e.target.open ? "add" : "delete"](key) },
    h("summary", { data: { key: `group-${key}` } }, h("span", {}, name), h("span", { class: "glance num" }, glance)),
    h("div", { class: "fields stack" }, inside));
}

function number(name, label, value, unit, change, min = null) {
  return h("div", { class: "field" }, h("label", { for: `s-${name}` }, label),
    h("input", { id: `s-${name}`, name, type: "number", step: "any", min, required: true, value, onchange: (e) => (e.target.checkValidity() ? change(Number(e.target.value)) : e.target.reportValidity()) }),
    h("span", { class: "unit" }, unit));
}

/** Only what lies in the box is inspected. */
export function boxGroup(shell, local) {
  const { box } = shell.project.data.setup.inspection;
  const draft = local.box ?? box;
  const size = box ? `${AXES.map((_, i) => fixed(box.max_mm[i] - box.min_mm[i], 0)).join(" × ")} mm` : "none";
  const cell = (end, i) => h("label", {}, `${AXES[i]} ${end === "min_mm" ? "from" : "to"}`,
    h("input", { type: "number", step: "any", required: true, name: `box-${end}-${i}`, value: draft[end][i], onchange: (e) => {
      if (!e.target.checkValidity()) { e.target.reportValidity(); return; }
      const next = { min_mm: [...draft.min_mm], max_mm: [...draft.max_mm] };
      next[end][i] = Number(e.target.value);
      local.box = next;
      shell.draw();
    } }));
  const good = draft && draft.min_mm.every((low, i) => low < draft.max_mm[i]);
  return group(local, "box", "Box", size, draft
    ? [h("div", { class: "six" }, ["min_mm", "max_mm"].map((end) => [0, 1, 2].map((i) => cell(end, i)))),
      !good && h("p", { class: "small soft" }, "From must be smaller than to."),
      h("div", { class: "row" },
        button("Use the box", () => edit(shell, { box: draft }).then(() => { local.box = null; shell.draw(); }), { disabled: !good || !local.box, key: "box-use" }),
        button("No box", () => { local.box = null; if (box) edit(shell, { box: null }); else shell.draw(); }, { key: "box-none" }))]
    : [h("p", { class: "soft small" }, "Cuts the surface along the axes of the CAD, in mm."),
      button("Set a box", () => { local.box = around(shell); shell.draw(); }, { key: "box-set" })]);
}

function around(shell) {
  const { part } = shell.project.data;
  const half = part.extents_mm.map((v) => Math.ceil(v / 2));
  const middle = part.centre_mm ?? [0, 0, 0];
  return { min_mm: middle.map((c, i) => Math.round(c - half[i])), max_mm: middle.map((c, i) => Math.round(c + half[i])) };
}

/** Only what is painted is inspected. */
export function paintGroup(shell, local) {
  const { paint } = shell.project.data.setup.inspection;
  const n = paint?.length ?? 0;
  return group(local, "paint", "Paint", n ? `${n} ${n === 1 ? "dab" : "dabs"}` : "none",
    number("brush", "Radius of the brush", local.brush, "mm", (v) => { local.brush = v; shell.view.send({ brush_mm: v }); }, 0.1),
    h("div", { class: "row" },
      toolButton(shell, "paint", "Paint", "Stop painting", { brush_mm: local.brush }),
      toolButton(shell, "erase", "Erase", "Stop erasing", { brush_mm: local.brush }),
      button("Clear", () => edit(shell, { paint: [] }), { disabled: !n, key: "paint-clear" })));
}

/** Fasteners, brackets, clamps. */
export function keepOutGroup(shell, local) {
  const list = shell.project.data.setup.inspection.keep_outs ?? [];
  const change = (i, more) => edit(shell, { keep_outs: list.map((k, j) => (j === i ? { ...k, ...more } : k)) });
  const row = (k, i) => h("li", {},
    h("input", { type: "text", name: `keep-name-${i}`, maxlength: 40, "aria-label": `Name of ${called(k, i)}`, value: k.name, placeholder: called({}, i), onchange: (e) => change(i, { name: e.target.value }) }),
    h("span", { class: "num small soft" }, sizeOf(k)),
    button("✕", () => edit(shell, { keep_outs: list.filter((_, j) => j !== i) }), { class: "ghost tiny", key: `keep-del-${i}`, title: "Delete", "aria-label": `Delete ${called(k, i)}` }),
    h("div", { class: "row small" },
      h("label", { title: "What the passes keep from it" }, "margin", length(`keep-margin-${i}`, `Margin of ${called(k, i)}, mm`, k.margin_mm, (v) => change(i, { margin_mm: v }), { min: 0, required: true }), "mm"),
      h("label", { title: "How high it stands above the surface: nozzle and wrist keep clear of that. Blank: not known." }, "height", length(`keep-height-${i}`, `Height of ${called(k, i)} above the surface, mm`, k.height_mm, (v) => change(i, { height_mm: v }), { placeholder: "unknown" }, above), "mm"),
      h("label", {}, h("input", { type: "checkbox", name: `keep-cross-${i}`, checked: k.may_cross, "aria-label": `The tool may pass over ${called(k, i)}`, onchange: (e) => change(i, { may_cross: e.target.checked }) }), "the tool may pass over it")));
  const send = () => shell.view.send({ brush_mm: local.region, may_cross: local.cross });
  return group(local, "keep", "Keep-out regions", list.length ? String(list.length) : "none",
    list.length > 0 && h("ul", { class: "keep-outs" }, list.map(row)),
    number("region", "Radius of the next", local.region, "mm", (v) => { local.region = v; send(); }, 0.1),
    h("label", { class: "row tight" }, h("input", { type: "checkbox", name: "region-cross", checked: local.cross, onchange: (e) => { local.cross = e.target.checked; send(); } }), "The tool may pass over it"),
    h("div", { class: "row" }, toolButton(shell, "keepout", "Add by a click", "Stop adding", { brush_mm: local.region, may_cross: local.cross })));
}

/** A length in a list; blank is null where it may be. `refuse(v)` says what is wrong with a number beyond its bounds. */
function length(name, label, value, change, props, refuse = () => "") {
  return h("input", { type: "number", name, step: "any", "aria-label": label, value: value ?? "", ...props, onchange: (e) => {
    const v = e.target.value === "" ? null : Number(e.target.value);
    e.target.setCustomValidity(v === null ? "" : refuse(v));
    if (e.target.checkValidity()) change(v); else e.target.reportValidity();
  } });
}

const above = (v) => (v > 0 ? "" : "A height is above 0; leave it blank if it is not known.");

/** What a keep-out is called where it has no name. */
const called = (k, i) => k.name || `keep-out ${i + 1}`;

function sizeOf(k) {
  if (k.type === "sphere" || k.type === "disc") return `R ${fixed(k.radius_mm, 1)}`;
  if (k.type === "box") return [0, 1, 2].map((i) => fixed(k.max_mm[i] - k.min_mm[i], 0)).join("×");
  return k.type === "polygon" ? `${k.points_mm.length} corners` : `${k.faces.length} triangles`;
}

/** What the passes run along. */
export function directionGroup(shell, local) {
  const { direction, direction_deg: turn, guide } = shell.project.data.setup.inspection;
  const drawn = guide?.length ?? 0;
  return group(local, "direction", "Passes", DIRECTIONS.find(([k]) => k === direction)?.[1] ?? direction,
    h("div", { class: "field text" }, h("label", { for: "s-direction" }, "Along"),
      h("select", { id: "s-direction", name: "direction", onchange: (e) => edit(shell, { direction: e.target.value }) },
        DIRECTIONS.map(([k, text]) => h("option", { value: k, selected: k === direction, disabled: k === "drawn" && drawn < 2 }, text)))),
    number("turn", "Turned by", turn, "deg", (v) => edit(shell, { direction_deg: v })),
    h("div", { class: "row" },
      toolButton(shell, "guide", "Draw a line", "Stop drawing"),
      button("Clear the line", () => edit(shell, { guide: [], direction: direction === "drawn" ? "extent" : direction }), { disabled: !drawn, key: "guide-clear" }),
      drawn > 0 && h("span", { class: "small soft" }, `${drawn} ${drawn === 1 ? "point" : "points"}`)));
}
