// Tables: key points, directions of the alignment, issues of a plan.

import { fill, h } from "../dom.js";
import { AXES, deg, fixed, isAngle, mm, ofAxis, poseKey, whole } from "../format.js";
import { tag, toneOf } from "../status.js";

/** A table: columns [{title, unit, cell(row), text}] over rows. `note(row)` is a line of its own below a row that has one. */
export function table(columns, rows, { onpick = null, note = () => null } = {}) {
  const head = (c) => h("th", { class: c.text ? "l" : null, scope: "col", title: c.why }, c.title, c.unit && [", ", h("span", { class: "of" }, c.unit)]);
  const body = rows.flatMap((row) => {
    const props = { onclick: onpick && (() => onpick(row)) };
    const said = note(row);
    return [h("tr", { class: `${onpick ? "pick" : ""} ${said ? "noted" : ""}`, ...props }, columns.map((c) => h("td", { class: c.text ? "l" : "num" }, c.cell(row)))),
      said && h("tr", { class: `note ${onpick ? "pick" : ""}`, ...props }, h("td", { class: "l", colspan: columns.length }, said))];
  });
  return h("table", { class: "wide" }, h("thead", {}, h("tr", {}, columns.map(head))), h("tbody", {}, body));
}

const place = (decimals) => ["x", "y", "z"].map((axis) => ({ title: axis.toUpperCase(), unit: "mm", cell: (row) => fixed(row[`${axis}_mm`], decimals) }));

/** Key points as the alignment judged them. */
export function matches(body, keypoints, focus) {
  if (!keypoints?.length) return fill(body, h("p", { class: "nothing" }, "No key points were evaluated."));
  return fill(body, table([
    { title: "Key point", text: true, cell: (k) => k.id },
    { title: "", text: true, cell: (k) => tag(toneOf(k.status), k.status) },
    { title: "Residual", unit: "mm", why: "Along the normal", cell: (k) => mm(k.residual_mm) },
    { title: "Normal", unit: "deg", why: "Between the measured normal and that of the CAD", cell: (k) => deg(k.normal_angle_deg) },
    { title: "Readings", cell: (k) => whole(k.readings) },
    { title: "Amplitude", unit: "%FSH", cell: (k) => fixed(k.amplitude_pct, 1) },
    { title: "ToF", unit: "µs", why: "Time of flight", cell: (k) => fixed(k.tof_us, 3) },
    ...place(1),
  ], keypoints, { onpick: (k) => focus(k.id), note: (k) => k.reason }));
}

/** The six directions the alignment could or could not measure. */
export function directions(body, list) {
  if (!list?.length) return fill(body, h("p", { class: "nothing" }, "No directions were reported."));
  const names = ["rX", "rY", "rZ", "X", "Y", "Z"];
  // What one sigma of it is: a turn about the axes of BASE, and a shift of the middle of the face.
  const part = (d, i) => d.sigma * (Array.isArray(d.vector) ? d.vector[i] : d.vector?.[i]) * (i < 3 ? 180 / Math.PI : 1);
  return fill(body, table([
    { title: "No.", text: true, cell: (d) => `${list.indexOf(d) + 1}` },
    { title: "", text: true, cell: (d) => tag(toneOf(d.status), d.status) },
    { title: "Sigma / prior", why: "One sigma after the scan, in those of the fixture before it", cell: (d) => fixed(d.sigma, 4) },
    { title: "Surface", unit: "mm rms", why: "What one sigma of it moves the surface by", cell: (d) => mm(d.displacement_mm) },
    { title: "Turn", unit: "deg", cell: (d) => deg(d.turn_deg) },
    ...names.map((name, i) => ({ title: name, unit: i < 3 ? "deg" : "mm", cell: (d) => fixed(part(d, i), i < 3 ? 4 : 3) })),
  ], list));
}

/** True if an issue is about a key point: its place ends with the name. */
export const isOf = (issue, id) => issue.where === id || issue.where?.endsWith(` ${id}`);

/** Key points as they are planned: a click looks at one, a cross deletes it. */
export function planned(body, keypoints, insight, focus, remove) {
  if (!keypoints?.length) return fill(body, h("p", { class: "nothing" }, "No key points yet. Click on the tinted surface, or let EchoBase suggest some."));
  const worst = (id) => {
    const mine = (insight?.issues ?? []).filter((i) => isOf(i, id));
    return mine.find((i) => i.severity === "error") ?? mine.find((i) => i.severity === "warning");
  };
  const verdict = (k) => {
    const w = worst(k.id);
    if (w) return tag(w.severity === "error" ? "bad" : "warn", w.severity === "error" ? "unusable" : "doubtful");
    return insight ? tag("good", "usable") : "";
  };
  return fill(body, table([
    { title: "Key point", text: true, cell: (k) => h("button", { type: "button", class: "btn ghost tiny", title: "Look at it", onclick: () => focus(k.id) }, k.id) },
    { title: "", text: true, cell: verdict },
    ...place(3),
    { title: "", cell: (k) => h("button", { type: "button", class: "btn ghost tiny", "aria-label": `Delete ${k.id}`, onclick: () => remove(k.id) }, "✕") },
  ], keypoints, { note: (k) => worst(k.id)?.message }));
}

/** Every alignment of the project, the newest first. `report(number)` is the address of its report. */
export function runs(body, list, report) {
  return fill(body, table([
    { title: "No.", text: true, cell: (a) => h("a", { href: report(a.number), target: "_blank", rel: "noopener" }, `#${a.number}`) },
    { title: "", text: true, cell: (a) => (a.stale ? tag("warn", "out of date") : tag(toneOf(a.verdict), a.accepted ? `${a.verdict}, accepted` : a.verdict)) },
    { title: "Method", text: true, cell: (a) => (a.method === "map" ? (a.options?.non_rigid ? "MAP, non-rigid" : "MAP") : "key points") },
    ...AXES.map((axis) => ({ title: axis.toUpperCase(), unit: isAngle(axis) ? "deg" : "mm", cell: (a) => ofAxis(axis, a.correction?.[poseKey(axis)]) })),
    { title: "Residual", unit: "mm rms", cell: (a) => mm(a.residual?.rms_mm) },
    { title: "Made", text: true, cell: (a) => a.created.slice(0, 16).split("T").map((t) => [h("span", { class: "whole" }, t), " "]) },
  ], [...list].reverse()));
}
