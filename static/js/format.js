// Numbers as an instrument shows them: fixed decimals, a real minus sign, the unit beside them.

import { h } from "./dom.js";

const DASH = "–";

/** A number with fixed decimals, or a dash. */
export function fixed(value, decimals) {
  if (value === null || value === undefined || !Number.isFinite(value)) return DASH;
  const text = value.toFixed(decimals);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

export const mm = (v) => fixed(v, 3);
export const deg = (v) => fixed(v, 4);
export const pct = (share, decimals = 1) => (Number.isFinite(share) ? `${fixed(share * 100, decimals)} %` : DASH);
export const whole = (v) => (Number.isFinite(v) ? Math.round(v).toString().replace(/\B(?=(\d{3})+(?!\d))/g, "\u202f") : DASH);

/** A size in mm with as many decimals as it deserves. */
export const size = (v) => fixed(v, Math.abs(v) >= 1000 ? 1 : 2);
export const sizes = (list) => (list ? `${list.map(size).join(" × ")} mm` : DASH);

/** Bytes for people. */
export function bytes(n) {
  if (!Number.isFinite(n)) return DASH;
  const units = ["B", "kB", "MB", "GB"];
  let i = 0;
  while (n >= 1000 && i < 3) { n /= 1000; i += 1; }
  return `${fixed(n, i ? 1 : 0)} ${units[i]}`;
}

/** Seconds for people. */
export function seconds(s) {
  if (!Number.isFinite(s)) return DASH;
  if (s < 90) return `${fixed(s, 0)} s`;
  return `${fixed(Math.floor(s / 60), 0)} min ${fixed(s % 60, 0)} s`;
}

/** A number element with its unit. */
export function num(text, unit = "") {
  return h("span", {}, h("span", { class: "num" }, text), unit && h("span", { class: "unit" }, unit));
}

/** A list of facts: [name, text, unit] rows; rows without a value are left out. */
export function facts(rows) {
  const kept = rows.filter((r) => r && r[1] !== null && r[1] !== undefined && r[1] !== DASH);
  return h("dl", { class: "facts" }, kept.map(([name, text, unit]) => [h("dt", {}, name), h("dd", {}, text instanceof Node ? text : num(text, unit))]));
}

export const AXES = ["x", "y", "z", "a", "b", "c"];
export const isAngle = (axis) => "abc".includes(axis);
export const poseKey = (axis) => `${axis}_${isAngle(axis) ? "deg" : "mm"}`;
export const ofAxis = (axis, v) => (isAngle(axis) ? deg(v) : mm(v));
