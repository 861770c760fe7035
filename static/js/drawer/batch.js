// Serial parts on one fixture: what their alignments have in common, and what is each part's own.

import { API, get } from "../api.js";
import { fill, h } from "../dom.js";
import { fixed } from "../format.js";
import { issueList, tag } from "../status.js";

const PLACES = { mm: 3, deg: 4, sigma: 2 };
const SVG = "http://www.w3.org/2000/svg";
const signed = (v, places) => (Number.isFinite(v) && Number(v.toFixed(places)) > 0 ? "+" : "") + fixed(v, places);

/** Alignments that may be parts of a batch: not failed, of the plan in force, by all readings; of one scan the newest. */
export function candidates(all) {
  const newest = new Map();
  for (const a of all ?? []) if (a.verdict !== "fail" && !a.stale && a.method === "map") newest.set(JSON.stringify(a.options?.scans), a);
  return [...newest.values()].sort((a, b) => a.number - b.number);
}

/** Draw the table of a batch; `chosen` is a Set of alignment numbers that the check boxes change, `path` the project's. */
export async function batch(body, alive, path, list, chosen) {
  const numbers = list.map((a) => a.number).filter((n) => chosen.has(n));
  const query = numbers.map((n) => `alignments=${n}`).join("&");
  let found = null;
  let refusal = "";
  if (numbers.length > 1) {
    try { found = await get(`${path}/batch?${query}`); } catch (error) { refusal = error.message; }
  }
  if (!alive()) return;
  const again = () => batch(body, alive, path, list, chosen);
  const toggle = (n) => { if (!chosen.delete(n)) chosen.add(n); again(); };
  const boxes = h("div", { class: "row tight" }, h("span", { class: "soft small" }, "Parts:"), list.map((a) => h("label", { class: "row tight" },
    h("input", { type: "checkbox", name: `part-${a.number}`, checked: chosen.has(a.number), onchange: () => toggle(a.number) }), `Alignment ${a.number}`)));
  const link = (format, word) => h("a", { href: `${API}${path}/batch/report?${query}&format=${format}${format === "html" ? "" : "&download=true"}`, target: "_blank", rel: "noopener", "aria-label": `Report of the batch: ${word}` }, word);
  fill(body, h("div", { class: "batch stack" }, boxes,
    found ? [notes(found, true).map((i) => h("p", { class: "small" }, tag("warn", i.message))), table(found), h("div", { class: "row" }, h("span", { class: "soft small" }, "Report:"), link("html", "open"), link("pdf", "PDF"), link("csv", "CSV"), link("json", "JSON")), advice(found.patch), issueList(notes(found, false), 6)]
      : h("p", { class: "nothing" }, refusal || "Choose two parts or more.")));
}

/** What to know before reading the table, and what else there is to say. */
const notes = (found, pressing) => found.issues.filter((i) => (i.severity !== "info") === pressing);

function table(found) {
  const columns = found.directions;
  const scales = columns.map((d) => scale(d, found.parts.map((p) => p.directions[d.name])));
  const cell = (d, i, part) => {
    const v = part.directions[d.name];
    if (v.value === null) return h("td", { class: "num soft", title: "Its scan does not show this direction" }, fixed(null));
    const title = `${d.text}: ${signed(v.value, PLACES[d.unit])} ± ${fixed(1.96 * v.sigma, PLACES[d.unit])} ${d.unit} (95 %), ${signed(v.z, 1)} standard deviations from the common place`;
    return h("td", { class: "num", title }, strip(scales[i], d, v), h("span", { class: v.odd ? "odd" : null }, signed(v.departure, PLACES[d.unit])));
  };
  const row = (name, of, look = null) => h("tr", { class: look }, h("td", { class: "soft" }, name), columns.map((d) => h("td", { class: "num" }, of(d))));
  const spread = (d) => (d.scatter === null ? "not told" : fixed(d.scatter, PLACES[d.unit]));
  const between = (d) => (d.scatter_95 === null ? fixed(null) : d.scatter_95.map((v) => fixed(v, 3)).join("\u2009–\u2009"));
  const odd = (part) => Object.values(part.directions).some((v) => v.odd);
  return h("table", {}, h("thead", {}, h("tr", {}, h("th", { scope: "col" }, `${found.parts.length} parts, ${found.frame === "base" ? "BASE" : "face"}`), columns.map((d) => h("th", { scope: "col", title: d.text }, `${d.name}, ${d.unit}`)))),
    h("tbody", {}, row("common", (d) => h("b", {}, signed(d.mean, PLACES[d.unit]))), row("± 95 %", (d) => fixed(d.half_95, PLACES[d.unit])), row("scatter", spread), row("its 95 %", between, "small"),
      found.parts.map((part) => h("tr", {}, h("td", { class: "part", title: part.name }, odd(part) && [tag("warn", "odd"), " "], part.name), columns.map((d, i) => cell(d, i, part))))));
}

/** From the leftmost to the rightmost end of all whiskers and of two scatters about the mean. */
function scale(d, values) {
  const ends = values.filter((v) => v.value !== null).flatMap((v) => [v.value - 1.96 * v.sigma, v.value + 1.96 * v.sigma]);
  const reach = 2 * (d.scatter ?? 0);
  return [Math.min(...ends, d.mean - reach), Math.max(...ends, d.mean + reach)];
}

const WIDE = 34;
const HIGH = 14;
function strip([low, high], d, v) {
  const x = (value) => 3 + ((WIDE - 6) * (value - low)) / (high - low || 1);
  const make = (name, attributes) => { const node = document.createElementNS(SVG, name); for (const [k, value] of Object.entries(attributes)) node.setAttribute(k, value); return node; };
  const picture = make("svg", { width: WIDE, height: HIGH, viewBox: `0 0 ${WIDE} ${HIGH}`, "aria-hidden": "true", class: "strip" });
  if (d.scatter !== null) picture.append(make("rect", { class: "band", x: x(d.mean - 2 * d.scatter), width: Math.max(x(d.mean + 2 * d.scatter) - x(d.mean - 2 * d.scatter), 1), y: 0, height: HIGH }));
  picture.append(make("line", { class: "mean", x1: x(d.mean), x2: x(d.mean), y1: 0, y2: HIGH }),
    make("line", { class: "whisker", x1: x(v.value - 1.96 * v.sigma), x2: x(v.value + 1.96 * v.sigma), y1: HIGH / 2, y2: HIGH / 2 }),
    make("circle", { class: v.odd ? "dot odd" : "dot", cx: x(v.value), cy: HIGH / 2, r: 2.6 }));
  return picture;
}

/** What to write into the cell's settings, in words. */
function advice(patch) {
  const said = [];
  if (patch.base) said.push(`BASE ${["x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"].map((k) => `${k[0].toUpperCase()} ${fixed(patch.base[k], k.endsWith("mm") ? 3 : 4)}`).join(" ")}`);
  if (patch.fixture?.sigma_mm !== undefined) said.push(`fixture sigma ${fixed(patch.fixture.sigma_mm, 3)} mm`);
  if (patch.fixture?.sigma_deg !== undefined) said.push(`fixture sigma ${fixed(patch.fixture.sigma_deg, 4)} deg`);
  return h("p", { class: "small" }, said.length ? `Suggested for the cell: ${said.join("; ")}.` : "Nothing to change in the cell.");
}
