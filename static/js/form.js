// A form from a JSON schema: one line per number, its unit behind it, its bounds enforced while typing.

import { h, uid } from "./dom.js";

const UNITS = [["_mm_s", "mm/s"], ["_m_s", "m/s"], ["_db_per_deg2", "dB/deg²"], ["_mm", "mm"], ["_deg", "deg"], ["_us", "µs"], ["_mhz", "MHz"], ["_hz", "Hz"], ["_ms", "ms"], ["_pct", "%FSH"], ["_db", "dB"], ["temperature_c", "°C"], ["_c", "°C"]];

/** Unit of a field by its name, and the name without it. */
export function unitOf(key) {
  for (const [end, unit] of UNITS) if (key.endsWith(end) && !/^[abc]$/.test(key)) return [key === "temperature_c" ? "temperature" : key.slice(0, -end.length), unit];
  return [key, ""];
}

/** The words of a key. */
export function title(key) {
  const [stem] = unitOf(key);
  if (stem.length === 1) return stem.toUpperCase();
  const text = stem.replaceAll("_", " ");
  return text.charAt(0).toUpperCase() + text.slice(1);
}

function resolve(schema, root) {
  let s = schema;
  while (s?.$ref) s = s.$ref.replace(/^#\//, "").split("/").reduce((o, k) => o?.[decodeURIComponent(k)], root);
  if (s?.allOf?.length === 1) return { ...resolve(s.allOf[0], root), ...s };
  if (s?.anyOf) {
    const real = s.anyOf.map((o) => resolve(o, root)).find((o) => o.type !== "null");
    return { ...real, nullable: s.anyOf.some((o) => o.type === "null"), description: s.description ?? real?.description, default: s.default };
  }
  return s ?? {};
}

/** All leaves of an object schema: [{path, key, schema}], groups as {key, schema, children}. */
export function fieldsOf(schema, root, path = []) {
  const own = resolve(schema, root);
  // Fields with a step of their own are edited there, in the 3D view.
  return Object.entries(own.properties ?? {}).filter(([, child]) => !child["x-step"]).map(([key, child]) => {
    const s = resolve(child, root);
    const here = [...path, key];
    return s.properties ? { key, path: here, schema: s, children: fieldsOf(s, root, here) } : { key, path: here, schema: s };
  });
}

export const at = (object, path) => path.reduce((o, k) => o?.[k], object);

/** A copy of the object with one value replaced. */
export function withValue(object, path, value) {
  const [first, ...rest] = path;
  return { ...object, [first]: rest.length ? withValue(object?.[first] ?? {}, rest, value) : value };
}

/** One field. `change(path, value)` is called with a value that fits the schema, `bad(path, text)` with what is wrong. */
export function field({ key, path, schema, label, empty = "auto" }, value, saved, change) {
  const id = uid("f");
  const name = path.join(".");
  const [, unit] = unitOf(key);
  const dirty = JSON.stringify(value ?? null) !== JSON.stringify(saved ?? null);
  const bounds = boundsText(schema, unit);
  const input = inputFor(schema, value, id, name, bounds, (v) => change(path, v), empty);
  return h("div", { class: `field ${dirty ? "dirty" : ""} ${schema.type === "string" ? "text" : ""} ${schema.maxLength > LONG ? "wide" : ""}` },
    h("label", { for: id, title: [schema.description, bounds].filter(Boolean).join("  ") }, label ?? title(key)),
    input, h("span", { class: "unit" }, unit));
}

function inputFor(schema, value, id, name, bounds, change, empty) {
  const common = { id, name, title: bounds };
  if (schema.type === "boolean") return h("input", { ...common, type: "checkbox", checked: Boolean(value), onchange: (e) => change(e.target.checked) });
  const options = schema.choices ?? (schema.enum ?? (schema.const !== undefined ? [schema.const] : null))?.map((o) => [o, o]);
  if (options) {
    // What is in force stays to be seen, even if the server no longer offers it.
    const known = value === undefined || value === null || options.some(([o]) => o === value);
    return h("select", { ...common, onchange: (e) => change(e.target.value) }, [...options, ...(known ? [] : [[value, `${value} (unknown)`]])].map(([o, text]) => h("option", { value: o, selected: o === value }, text)));
  }
  if (schema.format === "date") return h("input", { ...common, type: "date", value: value ?? "", onchange: (e) => change(e.target.value || null) });
  if (schema.format === "date-time") return h("input", { ...common, type: "datetime-local", value: localTime(value), onchange: (e) => change(withZone(e.target.value)) });
  if (schema.maxLength > LONG) return h("textarea", { ...common, rows: 3, maxlength: schema.maxLength, value: value ?? "", onchange: (e) => change(e.target.value) });
  if (schema.type === "array") {
    return h("input", { ...common, type: "text", value: (value ?? []).join(" "), placeholder: "none", onchange: (e) => change(e.target.value.split(/[\s,]+/).filter(Boolean)) });
  }
  if (schema.type === "number" || schema.type === "integer") {
    const low = schema.minimum ?? schema.exclusiveMinimum;
    const high = schema.maximum ?? schema.exclusiveMaximum;
    return h("input", {
      ...common, type: "number", value: value ?? "", step: schema.type === "integer" ? 1 : "any", min: low, max: high,
      placeholder: schema.nullable ? empty : "", required: !schema.nullable,
      onchange: (e) => {
        if (e.target.value === "" && schema.nullable) return change(null);
        return e.target.checkValidity() ? change(Number(e.target.value)) : e.target.reportValidity();
      },
    });
  }
  return h("input", {
    ...common, type: "text", value: value ?? "", pattern: patternOf(schema.pattern), maxlength: schema.maxLength, placeholder: schema.nullable ? empty : "",
    onchange: (e) => e.target.reportValidity() && change(schema.nullable && e.target.value === "" ? null : e.target.value),
  });
}

// A text that may be longer than this gets an area of its own.
const LONG = 500;
const two = (n) => String(Math.abs(Math.trunc(n))).padStart(2, "0");

/** A time with its zone as this browser's clock shows it, for its own input; and back, with the zone. */
function localTime(text) {
  if (!text) return "";
  const t = new Date(text);
  return `${t.getFullYear()}-${two(t.getMonth() + 1)}-${two(t.getDate())}T${two(t.getHours())}:${two(t.getMinutes())}`;
}
function withZone(text) {
  if (!text) return null;
  const behind = new Date(text).getTimezoneOffset();
  return `${text}:00${behind > 0 ? "-" : "+"}${two(behind / 60)}:${two(behind % 60)}`;
}

// Browsers read patterns with the v flag, where a hyphen in a class must be escaped.
const patternOf = (pattern) => pattern?.replace(/^\^|\$$/g, "").replaceAll("-]", "\\-]") ?? null;

function boundsText(schema, unit) {
  const low = schema.minimum ?? schema.exclusiveMinimum;
  const high = schema.maximum ?? schema.exclusiveMaximum;
  if (low === undefined && high === undefined) return "";
  return `${low ?? "−∞"} … ${high ?? "∞"} ${unit}`.trim();
}
