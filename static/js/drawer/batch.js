// Serial parts on one fixture: what their alignments have in common, and what is each part's own.

import { API, etagOf, get } from "../api.js";
import { fill, h } from "../dom.js";
import { fixed } from "../format.js";
import { issueList, tag } from "../status.js";
import { patchOf } from "./patch.js";

const WORDS = { nothing: "Nothing to change in the cell.", stale: "The cell was changed since the plan. Plan, then align again.", key: "batch" };
const PLACES = { mm: 3, deg: 4, sigma: 2 };
const SVG = "http://www.w3.org/2000/svg";
const signed = (v, places) => (Number.isFinite(v) && Number(v.toFixed(places)) > 0 ? "+" : "") + fixed(v, places);

/** Alignments that may be parts of a batch: not failed, of the plan in force, by all readings; of one scan the newest. */
export function candidates(all) {
  const newest = new Map();
  for (const a of all ?? []) if (a.verdict !== "fail" && !a.stale && a.method === "map") newest.set(JSON.stringify(a.options?.scans), a);
  return [...newest.values()].sort((a, b) => a.number - b.number);
}

/** Draw the table of a batch of the alignments in `list`; `local.chosen` is a Set of their numbers that the check boxes change. */
export async function batch(body, alive, shell, list, local) {
  const { path, data } = shell.project;
  const numbers = list.map((a) => a.number).filter((n) => local.chosen.has(n));
  let refusal = "";
  // Once its patch is in force, the alignments are of the cell before: what was shown then stays, to be taken back.
  const used = inForce(shell, local);
  // While it is being put in force or taken back, a question asked now could be answered of either cell.
  const kept = used || Boolean(local.use?.saving);
  let found = kept ? local.found : null;
  if (!kept && numbers.length > 1) {
    try { found = await get(`${path}/batch?${numbers.map((n) => `alignments=${n}`).join("&")}`); } catch (error) { refusal = error.message; }
  }
  if (!alive()) return;
  if (found && !kept) remember(local, found, etagOf(`${path}/setup`) === `"${found.setup_version}"` ? JSON.stringify(data.setup) : null);
  const again = () => { if (shell.step === "alignment") shell.drawer.draw(); };
  const toggle = (n) => { if (!local.chosen.delete(n)) local.chosen.add(n); again(); };
  const boxes = h("div", { class: "row tight" }, h("span", { class: "soft small" }, "Parts:"), list.map((a) => h("label", { class: "row tight" },
    h("input", { type: "checkbox", name: `part-${a.number}`, checked: local.chosen.has(a.number), onchange: () => toggle(a.number) }), `Alignment ${a.number}`)));
  const query = (found?.alignments ?? []).map((n) => `alignments=${n}`).join("&");
  const link = (format, word) => h("a", { href: `${API}${path}/batch/report?${query}&format=${format}${format === "html" ? "" : "&download=true"}`, target: "_blank", rel: "noopener", "aria-label": `Report of the batch: ${word}` }, word);
  const links = h("div", { class: "row" }, h("span", { class: "soft small" }, "Report:"), link("html", "open"), link("pdf", "PDF"), link("csv", "CSV"), link("json", "JSON"));
  fill(body, h("div", { class: "batch stack" }, used ? h("p", { class: "small" }, tag("warn", "Its suggestion is in force now: plan again. The alignments are of the cell before.")) : boxes,
    found ? [notes(found, true).map((i) => h("p", { class: "small" }, tag("warn", i.message))), table(found), links, h("div", { class: "advice stack" }, h("h3", {}, "Suggested for the cell"), patchOf(shell, local.use, WORDS, again)), issueList(notes(found, false), 6)]
      : h("p", { class: "nothing" }, refusal || "Choose two parts or more.")));
}

/** Keep what a batch suggests, and whether it was used, for as long as it suggests the same. */
function remember(local, found, madeFor) {
  const key = JSON.stringify([found.alignments, found.patch]);
  if (local.key !== key) Object.assign(local, { key, use: { patch: found.patch, madeFor: null, saving: false } });
  local.found = found;
  local.use.madeFor = madeFor;
}

/** True as long as the setup is the one that the button of this tab made. */
export const inForce = (shell, local) => Boolean(local?.use?.mine) && local.use.mine === JSON.stringify(shell.project.data.setup);

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
