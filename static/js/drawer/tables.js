// Tables: key points, directions of the alignment, issues of a plan.

import { fill, h } from "../dom.js";
import { AXES, deg, fixed, isAngle, mm, ofAxis, poseKey, whole } from "../format.js";
import { tag, toneOf } from "../status.js";

/** A table: columns [{title, cell(row), text}] over rows; rows can be picked. */
export function table(columns, rows, onpick = null) {
  return h("table", {}, h("thead", {}, h("tr", {}, columns.map((c) => h("th", { class: c.text ? "l" : null, scope: "col" }, c.title)))),
    h("tbody", {}, rows.map((row) => h("tr", { class: onpick ? "pick" : null, onclick: onpick && (() => onpick(row)) },
      columns.map((c) => h("td", { class: c.text ? "l" : "num" }, c.cell(row)))))));
}

/** Key points as the alignment judged them. */
export function matches(body, keypoints, focus) {
  if (!keypoints?.length) return fill(body, h("p", { class: "nothing" }, "No key points were evaluated."));
  return fill(body, table([
    { title: "Key point", text: true, cell: (k) => k.id },
    { title: "", text: true, cell: (k) => tag(toneOf(k.status), k.status) },
    { title: "Residual, mm", cell: (k) => mm(k.residual_mm) },
    { title: "Normal, deg", cell: (k) => deg(k.normal_angle_deg) },
    { title: "Readings", cell: (k) => whole(k.readings) },
    { title: "Amplitude, %FSH", cell: (k) => fixed(k.amplitude_pct, 1) },
    { title: "ToF, µs", cell: (k) => fixed(k.tof_us, 3) },
    { title: "X, mm", cell: (k) => mm(k.x_mm) }, { title: "Y, mm", cell: (k) => mm(k.y_mm) }, { title: "Z, mm", cell: (k) => mm(k.z_mm) },
    { title: "Reason", text: true, cell: (k) => h("span", { class: "reason" }, k.reason ?? "") },
  ], keypoints, (k) => focus(k.id)));
}

/** The six directions the alignment could or could not measure. */
export function directions(body, list) {
  if (!list?.length) return fill(body, h("p", { class: "nothing" }, "No directions were reported."));
  const names = ["rX, deg", "rY, deg", "rZ, deg", "X, mm", "Y, mm", "Z, mm"];
  // What one sigma of it is: a turn about the axes of BASE, and a shift of the middle of the face.
  const part = (d, i) => d.sigma * (Array.isArray(d.vector) ? d.vector[i] : d.vector?.[i]) * (i < 3 ? 180 / Math.PI : 1);
  return fill(body, table([
    { title: "Direction", text: true, cell: (d) => `${list.indexOf(d) + 1}` },
    { title: "", text: true, cell: (d) => tag(toneOf(d.status), d.status) },
    { title: "Sigma / prior", cell: (d) => fixed(d.sigma, 4) },
    { title: "Surface, mm rms", cell: (d) => mm(d.displacement_mm) },
    { title: "Turn, deg", cell: (d) => deg(d.turn_deg) },
    ...names.map((name, i) => ({ title: name, cell: (d) => fixed(part(d, i), i < 3 ? 4 : 3) })),
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
    { title: "X, mm", cell: (k) => mm(k.x_mm) }, { title: "Y, mm", cell: (k) => mm(k.y_mm) }, { title: "Z, mm", cell: (k) => mm(k.z_mm) },
    { title: "Why", text: true, cell: (k) => worst(k.id)?.message ?? "" },
    { title: "", cell: (k) => h("button", { type: "button", class: "btn ghost tiny", "aria-label": `Delete ${k.id}`, onclick: () => remove(k.id) }, "✕") },
  ], keypoints));
}

/** Every alignment of the project, the newest first. `report(number)` is the address of its report. */
export function runs(body, list, report) {
  return fill(body, table([
    { title: "Alignment", text: true, cell: (a) => h("a", { href: report(a.number), target: "_blank", rel: "noopener" }, `#${a.number}`) },
    { title: "", text: true, cell: (a) => (a.stale ? tag("warn", "out of date") : tag(toneOf(a.verdict), a.accepted ? `${a.verdict}, accepted` : a.verdict)) },
    { title: "Method", text: true, cell: (a) => (a.method === "map" ? (a.options?.non_rigid ? "MAP, non-rigid" : "MAP") : "key points") },
    ...AXES.map((axis) => ({ title: `${axis.toUpperCase()}, ${isAngle(axis) ? "deg" : "mm"}`, cell: (a) => ofAxis(axis, a.correction?.[poseKey(axis)]) })),
    { title: "Residual rms, mm", cell: (a) => mm(a.residual?.rms_mm) },
    { title: "Made", text: true, cell: (a) => a.created.slice(0, 16).replace("T", " ") },
  ], [...list].reverse()));
}
