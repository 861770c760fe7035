// A patch of the setup: field by field, before and after, put in force by one button and taken back by another.

import { button, h } from "../dom.js";
import { at, withValue } from "../form.js";
import { tag } from "../status.js";

/** Fields of a patch: [{path, value}], nested names as a path. */
const leaves = (patch, path = []) => Object.entries(patch).flatMap(([key, value]) => (value !== null && typeof value === "object" && !Array.isArray(value) ? leaves(value, [...path, key]) : [{ path: [...path, key], value }]));
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);
const merged = (setup, fields) => fields.reduce((s, { path, value }) => withValue(s, path, value), setup);
const shown = (v) => (v === null || v === undefined ? "auto" : typeof v === "number" ? String(Number(v.toPrecision(9))).replace("-", "−") : String(v));

/**
 * Draw a patch. `use`: {patch, madeFor, undone, saving}, of which `madeFor` is the setup it was computed with, as JSON; null if that is
 * no longer the one in force. `words`: {nothing, stale, key}. `again()` draws once more; `after(merge)` may take the patch over elsewhere.
 */
export function patchOf(shell, use, words, again, after = () => {}) {
  const { project } = shell;
  const { setup } = project.data;
  const fields = leaves(use.patch);
  if (!fields.length) return h("p", { class: "small" }, words.nothing);
  const done = fields.every(({ path, value }) => same(at(setup, path), value));
  const stale = !done && JSON.stringify(setup) !== use.madeFor;
  const old = use.madeFor ? JSON.parse(use.madeFor) : done ? null : setup;
  const guarded = (action) => async () => {
    if (use.saving) return;
    use.saving = true;
    again();
    await shell.do(async () => {
      try {
        await action();
      } catch (error) {
        if (error.status === 412) await project.load(["setup"]);
        throw error;
      } finally { use.saving = false; }
    });
    again();
  };
  const put = guarded(async () => {
    await project.saveSetup(merged(setup, fields));
    use.mine = JSON.stringify(project.data.setup);
    after((other) => merged(other, fields));
  });
  // Only what this button did is taken back here, and only while nothing else was changed since.
  const mine = done && use.mine === JSON.stringify(setup) && project.undoSetups.length > 0;
  return [h("table", { class: "patch" }, h("thead", {}, h("tr", {}, ["Of the cell", "Before", "", "After"].map((t) => h("th", { scope: "col" }, t)))),
    h("tbody", {}, fields.map(({ path, value }) => h("tr", {}, h("td", {}, path.join(".")), h("td", { class: "num" }, old ? shown(at(old, path)) : ""), h("td", {}, "→"), h("td", { class: "num" }, shown(value)))))),
  stale && h("p", { class: "small" }, tag("warn", words.stale)),
  h("div", { class: "row" }, button("Use in the setup", put, { class: "primary", disabled: done || stale || use.saving, key: `${words.key}-use` }), done && tag("good", "in force"),
    mine && button("Undo", guarded(() => project.undoSetup()), { class: "tiny", disabled: use.saving, key: `${words.key}-undo` }))];
}
