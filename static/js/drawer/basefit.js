// BASE from touched points: pairs of a CAD point and the place where the robot touched it, and how well they agree.

import { post } from "../api.js";
import { button, fill, h } from "../dom.js";
import { AXES, fixed, isAngle, mm, ofAxis, poseKey } from "../format.js";
import { issueList } from "../status.js";

const XYZ = ["x", "y", "z"];
const EMPTY = () => ["", "", "", "", "", ""];
const LEAST = 3;

/** Pairs as the person types them: six texts each. */
export const newFit = () => ({ pairs: [EMPTY(), EMPTY(), EMPTY()], answer: null, issues: [] });
const filled = (pair) => pair.every((t) => t.trim() !== "" && Number.isFinite(Number(t)));

/** Draw the table. `placement()` is the CAD origin in BASE as it stands in the form; `use(base)` takes the fitted frame over. */
export function baseFit(body, fit, project, placement, use) {
  const again = () => baseFit(body, fit, project, placement, use);
  const change = (row, column, text) => { fit.pairs[row][column] = text; fit.answer = null; };
  const ready = fit.pairs.filter(filled).length;

  const run = async () => {
    const kept = fit.pairs.filter(filled);
    const point = (texts) => Object.fromEntries(XYZ.map((axis, i) => [`${axis}_mm`, Number(texts[i])]));
    try {
      fit.answer = await post(`/projects/${project}/base-fit`, { pairs: kept.map((p) => ({ cad: point(p.slice(0, 3)), touched: point(p.slice(3)) })), placement: placement() });
      fit.pairs = kept;
      fit.issues = fit.answer.issues;
    } catch (error) {
      fit.answer = null;
      fit.issues = error.issues ?? [{ severity: "error", code: "fault", message: error.message, remedy: "", where: "" }];
    }
    again();
  };
  // A block of numbers pasted from the pendant's log or a spreadsheet fills the table from the cell it is pasted into.
  const paste = (event, row, column) => {
    const lines = (event.clipboardData?.getData("text") ?? "").trim().split(/\r?\n/).map((line) => line.match(/[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?/g) ?? []);
    if (lines.length < 2 && lines[0].length < 2) return;
    event.preventDefault();
    lines.forEach((numbers, i) => {
      fit.pairs[row + i] ??= EMPTY();
      numbers.slice(0, 6 - column).forEach((text, j) => change(row + i, column + j, text));
    });
    again();
  };
  const input = (row, column) => h("input", { type: "number", step: "any", name: `pair-${row}-${column}`, "aria-label": `Pair ${row + 1}, ${column < 3 ? "CAD" : "touched"} ${XYZ[column % 3].toUpperCase()} (mm)`, value: fit.pairs[row][column], oninput: (e) => { change(row, column, e.target.value); go.disabled = fit.pairs.filter(filled).length < LEAST; }, onpaste: (e) => paste(e, row, column) });
  const pairs = fit.pairs.map((pair, row) => h("tr", {}, h("td", { class: "l" }, String(row + 1)), pair.map((_, column) => h("td", {}, input(row, column))),
    fit.answer && [h("td", { class: "num" }, mm(fit.answer.pairs[row]?.residual_mm)), h("td", { class: "num" }, mm(fit.answer.pairs[row]?.left_out_mm))],
    h("td", {}, button("✕", () => { fit.pairs.splice(row, 1); fit.answer = null; again(); }, { class: "ghost tiny", "aria-label": `Delete pair ${row + 1}`, disabled: fit.pairs.length <= 1, key: `pair-del-${row}` }))));
  const go = button("Fit BASE", run, { class: "primary", disabled: ready < LEAST, key: "fit-base" });
  const found = [["Residual", "Distance to the place that all pairs give, mm"], ["Left out", "Distance to the place that the other pairs give, mm"]];
  const titles = [["", "Pair"], ...["CAD", "Touched"].flatMap((of) => XYZ.map((axis) => [`${of} ${axis.toUpperCase()}`, "mm"])), ...(fit.answer ? found : []), [""]];
  fill(body, h("div", { class: "fit" },
    h("div", { class: "stack" }, h("p", { class: "soft small" }, "Touch three or more points with a calibrated spike. Type where they are on the CAD, and where the pendant says they are in WORLD (BASE 0), in mm. Blocks of numbers can be pasted."),
      h("table", { class: "pairs" }, h("thead", {}, h("tr", {}, titles.map(([text, why], i) => h("th", { class: i === 0 ? "l" : i > 6 && text ? "found" : null, scope: "col", title: why }, text)))), h("tbody", {}, pairs)),
      h("div", { class: "row" }, button("Add a pair", () => { fit.pairs.push(EMPTY()); again(); }), go)),
    h("div", { class: "stack" }, issueList(fit.issues), fit.answer && fitted(fit.answer, use))));
}

function fitted(answer, use) {
  const value = (axis) => [h("td", {}, axis.toUpperCase()), h("td", { class: "num" }, ofAxis(axis, answer.base[poseKey(axis)])), h("td", { class: "unit l" }, isAngle(axis) ? "deg" : "mm")];
  return [h("table", {}, h("tbody", {}, [0, 1, 2].map((i) => h("tr", {}, value(AXES[i]), value(AXES[i + 3]))))),
    h("p", { class: "soft small" }, `Residuals ${fixed(answer.rms_mm, 3)} mm rms; one touch is good to ${fixed(answer.sigma_mm, 3)} mm per axis.`),
    button("Use this BASE", () => use(answer.base), { class: "primary", key: "use-base" })];
}
