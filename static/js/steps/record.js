// The record: what only people know of the inspection. Reports show it from the moment it is saved.

import { ApiError, put } from "../api.js";
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

/** The form of the record, closed at first. `local` keeps the draft. */
export function record(shell, local) {
  const saved = shell.project.data.record;
  if (!saved) return null;
  const draft = local.record ?? saved;
  const all = leaves(draft);
  const dirty = Boolean(local.record);
  const open = (e) => {
    local.recordOpen = e.target.open;
    if (local.recordOpen && !local.schema) schema().then((s) => { local.schema = s; shell.draw(); }, () => {});
  };
  return h("details", { class: "group", open: local.recordOpen, ontoggle: open },
    h("summary", { data: { key: "record" } }, h("span", {}, "Record"), h("span", { class: "glance num" }, `${all.filter(given).length} of ${all.length} filled in`)),
    local.recordOpen && local.schema && h("div", { class: "fields" },
      h("p", { class: "soft small" }, "Who, by which procedure, with what. What stays empty prints as a blank to fill in by hand."),
      groups(shell, local, draft, saved),
      h("div", { class: "row" }, button("Save the record", () => save(shell, local), { disabled: !dirty, class: dirty ? "primary" : "" }), dirty && button("Discard", () => { local.record = null; shell.draw(); }, { class: "tiny" }))));
}

function groups(shell, local, draft, saved) {
  const change = (path, value) => {
    local.record = withValue(local.record ?? saved, path, value);
    if (JSON.stringify(local.record) === JSON.stringify(saved)) local.record = null;
    shell.draw();
  };
  return fieldsOf(local.schema.record, local.schema.root).map((group) => [
    h("h3", {}, WORDS[group.key] ?? title(group.key)),
    group.children.map((f) => field({ ...f, empty: "" }, at(draft, f.path), at(saved, f.path), change)),
  ]);
}

function save(shell, local) {
  return shell.do(async () => {
    try {
      shell.project.data.record = await put(`${shell.project.path}/record`, local.record);
      local.record = null;
    } catch (error) {
      // Somebody else saved meanwhile: what he wrote is shown beside what was typed here.
      if (error instanceof ApiError && error.status === 412) await shell.project.load(["record"]);
      throw error;
    }
  });
}
