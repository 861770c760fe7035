// The record: what only people know of an inspection. Each result has its own; its report shows it from the moment it is saved.

import { ApiError, get, put } from "../api.js";
import { button, h } from "../dom.js";
import { at, field, fieldsOf, title, withValue } from "../form.js";

const WORDS = { part: "Part", procedure: "Procedure", equipment: "Equipment", settings: "Settings of the set", couplant: "Couplant", calibration: "Calibration", people: "People" };
let schemaPromise = null;

function schema() {
  schemaPromise ??= fetch("openapi.json", { credentials: "same-origin" }).then((answer) => answer.json()).then((root) => ({ root, record: root.components.schemas.Record }));
  schemaPromise.catch(() => { schemaPromise = null; });
  return schemaPromise;
}

const leaves = (record) => Object.values(record ?? {}).flatMap((group) => Object.values(group));
const given = (v) => v !== null && v !== undefined && v !== "";

/** Whose record may be edited: that of each result shown, and the one that results to come take over. */
function places(shell) {
  const { alignment: a, assessment: s } = shell.project.data;
  return [...(a ? [[`/alignments/${a.number}`, `Alignment ${a.number}`]] : []), ...(s ? [[`/assessments/${s.number}`, `Inspection scan, assessment ${s.number}`]] : []), ["", "Results to come"]];
}

/** The record saved at a place; null until it is there. Asked for again whenever a record was changed anywhere. */
function savedAt(shell, local, place) {
  const { record } = shell.project.data;
  if (local.recordsOf !== record) Object.assign(local, { recordsOf: record, records: {} });
  if (!place) return record;
  if (local.records[place] === undefined) {
    const known = local.records;
    known[place] = null;
    get(`${shell.project.path}${place}/record`).then((found) => { known[place] = found; shell.draw(); }, () => { delete known[place]; });
  }
  return local.records[place];
}

/** The form of the record, closed at first. `local` keeps the draft and whose it is. */
export function record(shell, local) {
  const all = places(shell);
  if (local.record && !all.some(([p]) => p === local.recordAt)) local.record = null;
  const place = all.some(([p]) => p === local.recordAt) ? local.recordAt : all[0][0];
  const saved = savedAt(shell, local, place);
  if (!saved) return null;
  const draft = local.record ?? saved;
  const filled = leaves(draft);
  const dirty = Boolean(local.record);
  const open = (e) => {
    local.recordOpen = e.target.open;
    if (local.recordOpen && !local.schema) schema().then((s) => { local.schema = s; shell.draw(); }, () => {});
  };
  const turn = (e) => { local.recordAt = e.target.value; shell.draw(); };
  const both = local.recordNext ?? true;
  return h("details", { class: "group", open: local.recordOpen, ontoggle: open },
    h("summary", { data: { key: "record" } }, h("span", {}, "Record"), h("span", { class: "glance num" }, `${filled.filter(given).length} of ${filled.length} filled in`)),
    local.recordOpen && local.schema && h("div", { class: "fields" },
      h("p", { class: "soft small" }, "Who, by which procedure, with what. What stays empty prints as a blank to fill in by hand. Every result keeps its own record: the next piece's serial number does not reach this one's report."),
      h("label", { class: "field wide" }, "Record of", h("select", { name: "record-of", disabled: dirty, title: dirty ? "Save or discard first" : "", onchange: turn }, all.map(([p, text]) => h("option", { value: p, selected: p === place }, text)))),
      groups(shell, { ...local, put: (next) => { local.record = next; local.recordAt = place; } }, draft, saved),
      place && h("label", { class: "row tight" }, h("input", { type: "checkbox", name: "record-next", checked: both, onchange: (e) => { local.recordNext = e.target.checked; } }), "Results to come start with it"),
      h("div", { class: "row" }, button("Save the record", () => save(shell, local, place), { disabled: !dirty, class: dirty ? "primary" : "" }), dirty && button("Discard", () => { local.record = null; shell.draw(); }, { class: "tiny" }))));
}

function groups(shell, local, draft, saved) {
  const change = (path, value) => {
    const next = withValue(draft, path, value);
    local.put(JSON.stringify(next) === JSON.stringify(saved) ? null : next);
    shell.draw();
  };
  return fieldsOf(local.schema.record, local.schema.root).map((group) => [
    h("h3", {}, WORDS[group.key] ?? title(group.key)),
    group.children.map((f) => field({ ...f, empty: "" }, at(draft, f.path), at(saved, f.path), change)),
  ]);
}

function save(shell, local, place) {
  return shell.do(async () => {
    const written = local.record;
    try {
      await put(`${shell.project.path}${place}/record`, written);
      if (place && (local.recordNext ?? true)) await put(`${shell.project.path}/record`, written);
      local.record = null;
    } catch (error) {
      // Somebody else saved meanwhile: what he wrote is shown beside what was typed here.
      if (!(error instanceof ApiError && error.status === 412)) throw error;
      await shell.project.load(["record"]);
      throw error;
    }
    await shell.project.load(["record"]);
  });
}
